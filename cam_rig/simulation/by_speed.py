"""What a run says of each cam at each speed: level, forces, lift-offs, landings, torque.

All but the level is of the samples, be they computed or read from a bag: both give the same row.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from cam_rig.laws import Law
from cam_rig.show.tables import Cell, DataTable, Head, tabulate
from cam_rig.simulation.simulate import Settling, TickSamples
from cam_rig.units import TURN, FloatArray, to_rpm

# Flights of the follower as its samples show them: lift-offs, and the longest time off the cam.

#: A force of zero is a flight where the follower is off the cam by more than this part of the
#: lift; else a follower without preload rests on the cam's dwell.
OFF_THE_CAM = 1e-9


@dataclass
class FlightCount:
    """Counts flights, block after block: times are known to one sample.

    Parameters
    ----------
    least_gap : m; a follower that comes no farther from the cam has not left it

    Examples
    --------
    Two flights, of which the second bounces once:

    >>> import numpy as np
    >>> force = np.array([5.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 3.0])
    >>> gap = np.array([0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0])
    >>> impulse = np.array([0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0, 0.5])
    >>> count = FlightCount(1e-9)
    >>> count.take(force, gap, impulse, settled=True)
    >>> count.lift_offs, count.longest
    (2, 3)
    """

    least_gap: float
    lift_offs: int = field(default=0, init=False)
    #: Samples of the longest flight, from lift-off or bounce to the next landing.
    longest: int = field(default=0, init=False)
    _length: int = field(default=0, init=False)
    _gap: float = field(default=0.0, init=False)
    _counts: bool = field(default=False, init=False)

    def take(self, force: FloatArray, gap: FloatArray, impulse: FloatArray, settled: bool) -> None:
        """Go on with the next samples ``(n,)``: force (N), follower less cam (m), impulse (N·s).

        A flight is of the step's settled part where it ends there, a lift-off where it is there.
        """
        flying = force == 0.0
        bounced = flying & (impulse > 0.0)
        changes = np.flatnonzero((flying[1:] != flying[:-1]) | bounced[1:]) + 1
        edges = [0, *changes.tolist(), force.size]
        for begin, end in pairwise(edges):
            if not flying[begin]:
                self.end(settled)
                continue
            if bounced[begin]:
                self.end(settled)
            elif not self._length:
                self._counts = settled
            self._length += end - begin
            self._gap = max(self._gap, float(gap[begin:end].max()))

    def end(self, settled: bool) -> None:
        """The follower is on the cam, or the step is over."""
        if self._length and self._gap > self.least_gap:
            self.lift_offs += self._counts
            self.longest = max(self.longest, self._length * settled)
        self._length, self._gap, self._counts = 0, 0.0, False


@dataclass(frozen=True)
class SpeedRow:
    """The settled turns of one cam at one speed.

    Parameters
    ----------
    rpm : cam speed
    turns : how many settled turns there are samples of
    level_db : sound level, dB re 20 µPa; None where the microphone's messages are missing
    force_peak, force_least : N, contact force at the samples, 0 in flight; below 0 in a model
        that holds the follower on the cam
    lift_offs : a turn
    flight : s, longest time off the cam, to one sample
    landing : N·s, hardest landing (two landings within one sample count as one)
    torque_peak, torque_least, torque_mean : N·m, F s' (eq. 8 of the paper); below 0 it is the
        follower that turns the cam
    """

    cam: str
    rpm: float
    turns: float
    level_db: float | None
    force_peak: float
    force_least: float
    lift_offs: float
    flight: float
    landing: float
    torque_peak: float
    torque_least: float
    torque_mean: float

    def plain(self) -> dict[str, str | float | None]:
        """The row with units in its names, for JSON and for tables of other programs."""
        return {name + UNITS.get(name, ""): value for name, value in vars(self).items()}


#: What follows a field's name in plain data, where the name has no unit yet.
UNITS = {
    "force_peak": "_N",
    "force_least": "_N",
    "lift_offs": "_per_turn",
    "flight": "_s",
    "landing": "_N_s",
    "torque_peak": "_N_m",
    "torque_least": "_N_m",
    "torque_mean": "_N_m",
}


@dataclass
class _Step:
    """One cam at one speed, as its samples come."""

    law: Law
    flights: FlightCount = field(init=False)
    samples: int = 0
    turned: float = 0.0
    force: tuple[float, float] = (-math.inf, math.inf)
    torque: tuple[float, float] = (-math.inf, math.inf)
    torque_sum: float = 0.0
    landing: float = 0.0

    def __post_init__(self) -> None:
        self.flights = FlightCount(OFF_THE_CAM * self.law.lift)

    def take(self, tick: TickSamples, rate: int, settled: bool) -> None:
        """Go on with the samples of the next tick, at ``rate`` Hz."""
        lift, slope, _ = self.law.motion_at(tick.angle_in_turn)
        self.flights.take(tick.force, tick.lift - lift, tick.impulse, settled)
        if not settled:
            return
        torque = tick.force * slope
        self.samples += torque.size
        self.turned += tick.turned(rate)
        self.force = _widened(self.force, tick.force.max(), tick.force.min())
        self.torque = _widened(self.torque, torque.max(), torque.min())
        self.torque_sum += float(torque.sum())
        self.landing = max(self.landing, float(tick.impulse.max()))

    def row(self, cam: str, speed: float, rate: int, level: float | None) -> SpeedRow:
        """The row of a cam at a speed (rad/s) with samples at ``rate`` Hz."""
        turns = self.turned / TURN
        return SpeedRow(
            cam=cam,
            rpm=round(to_rpm(speed), 9),
            turns=turns,
            level_db=level,
            force_peak=self.force[0],
            force_least=self.force[1],
            lift_offs=self.flights.lift_offs / turns,
            flight=self.flights.longest / rate,
            landing=self.landing,
            torque_peak=self.torque[0],
            torque_least=self.torque[1],
            torque_mean=self.torque_sum / self.samples,
        )


def _widened(span: tuple[float, float], most: float, least: float) -> tuple[float, float]:
    return max(span[0], float(most)), min(span[1], float(least))


class SpeedRows:
    """A run's samples (at ``rate`` Hz), tick by tick as they come: a row each cam and speed."""

    def __init__(self, laws: dict[str, Law], rate: int, settle_turns: float) -> None:
        self._laws, self._rate = laws, rate
        self._steps: dict[tuple[str, float], _Step] = {}
        self._settling = Settling(settle_turns)
        self._before: tuple[str, float] | None = None

    def take(self, tick: TickSamples) -> None:
        """Go on with the samples of the next tick."""
        key, before = (tick.cam, tick.start.speed), self._before
        if before is not None and (before != key or not tick.steady):
            self._steps[before].flights.end(settled=True)
        self._before = key if tick.steady else None
        if tick.steady:
            settled = self._settling.is_over(tick.start, tick.steady)
            step = self._steps.setdefault(key, _Step(self._laws[tick.cam]))
            step.take(tick, self._rate, settled)

    def rows(self, levels: dict[str, dict[float, float]]) -> tuple[SpeedRow, ...]:
        """The rows by cam and speed, at the end; ``levels`` in dB as of `step_levels`."""
        order = {cam: i for i, cam in enumerate(dict.fromkeys(cam for cam, _ in self._steps))}
        found = []
        for (cam, speed), step in sorted(
            self._steps.items(), key=lambda x: (order[x[0][0]], x[0][1])
        ):
            step.flights.end(settled=True)
            if step.samples:
                level = levels.get(cam, {}).get(speed)
                found.append(step.row(cam, speed, self._rate, level))
        return tuple(found)


def rows_by_speed(
    ticks: Iterable[TickSamples],
    laws: dict[str, Law],
    rate: int,
    settle_turns: float,
    levels: dict[str, dict[float, float]],
) -> tuple[SpeedRow, ...]:
    """The `SpeedRows` of a run's ticks, in order; no more than one is held at a time."""
    taken = SpeedRows(laws, rate, settle_turns)
    for tick in ticks:
        taken.take(tick)
    return taken.rows(levels)


def speed_table(
    rows: Iterable[SpeedRow], title: str, rate: int, titles: Mapping[str, str] | None = None
) -> DataTable:
    """A row for each cam and speed of a run called ``title``, sampled at ``rate`` Hz.

    ``titles`` are what cams are called, where not by name.
    """
    called = titles or {}

    def of(name: str, factor: float = 1.0) -> Callable[[SpeedRow], Cell]:
        def take(row: SpeedRow) -> Cell:
            value: Cell = getattr(row, name)
            return value * factor if isinstance(value, float) else value

        return take

    rows = tuple(rows)
    note = f"Settled turns, of samples at {rate} Hz: a flight is known to one sample."
    if bouncing := [row for row in rows if row.force_peak == 0.0]:
        where = ", ".join(
            f"{called.get(row.cam, row.cam)} at {row.rpm:.6g} rpm" for row in bouncing
        )
        note += (
            f" {where}: the follower bounces without end and is never at rest on the cam, so no "
            "sample holds a force, only its blows."
        )
    return tabulate(
        f"{title}: by speed",
        rows,
        (
            (Head("cam"), lambda row: called.get(row.cam, row.cam)),
            (Head("speed", "rpm", ".6g"), of("rpm")),
            (Head("level", "dB", ".1f"), of("level_db")),
            (Head("peak force", "N", ".1f"), of("force_peak")),
            (Head("least force", "N", ".1f"), of("force_least")),
            (Head("lift-off rate", "1/turn", ".3g"), of("lift_offs")),
            (Head("longest flight", "ms", ".2f"), of("flight", 1e3)),
            (Head("hardest landing", "N·s", ".3f"), of("landing")),
            (Head("peak torque", "N·m", ".2f"), of("torque_peak")),
            (Head("least torque", "N·m", ".2f"), of("torque_least")),
            (Head("mean torque", "N·m", ".3f"), of("torque_mean")),
        ),
        note,
    )

"""What a run says of each cam at each speed: level, forces, lift-offs, landings, torque.

All but the level is of the samples, be they computed or read from a bag: both give the same row.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from cam_rig.laws import Law
from cam_rig.laws.sampling import sample
from cam_rig.show.result import Column, Footnote
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.simulate import Settling, TickSamples
from cam_rig.units import TURN, FloatArray, to_rpm

#: A force of zero is a flight where the follower is off the cam by more than this part of the
#: lift; else a follower without preload rests on the cam's dwell.
OFF_THE_CAM = 1e-9


@dataclass
class FlightCount:
    """Counts flights, block after block: times are known to one sample."""

    least_gap: float  #: m; a follower that comes no farther from the cam has not left it
    lift_offs: int = field(default=0, init=False)
    #: Samples of the longest flight, from lift-off or bounce to the next landing.
    longest: int = field(default=0, init=False)
    _length: int = field(default=0, init=False)
    _gap: float = field(default=0.0, init=False)
    _counts: bool = field(default=False, init=False)

    def take(self, force: FloatArray, gap: FloatArray, impulse: FloatArray, settled: bool) -> None:
        """Go on with samples ``(n,)``: force (N), follower less cam (m), impulse (N·s)."""
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
    """The settled turns of one cam at one speed."""

    cam: str
    rpm: float  #: cam speed
    turns: float  #: how many settled turns there are samples of
    #: sound level, dB re 20 µPa; None where the microphone's messages are missing
    level_db: float | None
    force_peak: float  #: N, contact force at the samples, 0 in flight
    force_least: float  #: N; below 0 in a model that holds the follower on the cam
    lift_offs: float  #: a turn
    flight: float  #: s, longest time off the cam, to one sample
    landing: float  #: N·s, hardest landing (two landings within one sample count as one)
    torque_peak: float  #: N·m, F s' (eq. 8 of the paper)
    torque_least: float  #: N·m; below 0 it is the follower that turns the cam
    torque_mean: float  #: N·m


SPEEDS = (
    Column("cam"),
    Column("rpm", "rpm", ".6g", "speed"),
    Column("turns", about="settled turns with samples", hidden=True),
    Column("level", "dB", ".1f", of="level_db", about="re 20 µPa, unweighted"),
    Column("force_peak", "N", ".1f", "peak force"),
    Column("force_least", "N", ".1f", "least force"),
    Column("lift_offs", "1/turn", ".3g", "lift-off rate"),
    Column("flight", "ms", ".2f", "longest flight"),
    Column("landing", "N·s", ".3f", "hardest landing"),
    Column("torque_peak", "N·m", ".2f", "peak torque"),
    Column("torque_least", "N·m", ".2f", "least torque"),
    Column("torque_mean", "N·m", ".3f", "mean torque"),
)

BOUNCING = Footnote(
    "The follower bounces without end and is never at rest on the cam, so no sample holds a force, "
    "only its blows.",
    lambda row: bool(row.force_peak == 0.0),
    "*",
)


#: Of s, s' and s'' the one that makes a torque of a force.
SLOPE = np.array([[0.0, 1.0, 0.0]])


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
        angle, flying = tick.angle_in_turn, tick.force == 0.0
        gap = np.zeros(flying.size)  # on the cam
        if flying.any():
            gap[flying] = tick.lift[flying] - self.law(angle[flying])
        self.flights.take(tick.force, gap, tick.impulse, settled)
        if not settled:
            return
        step = tick.start.speed / rate
        torque = tick.force * sample(self.law, angle[0], step, angle.size, SLOPE, np.zeros(1))[0]
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

    @classmethod
    def of(cls, loaded: LoadedScene) -> SpeedRows:
        """The rows of a scene's run."""
        scene = loaded.scene
        return cls(loaded.laws, int(scene.sample_rate.si), scene.program.settle_turns.si)

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

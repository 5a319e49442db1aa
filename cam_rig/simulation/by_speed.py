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
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.simulate import Settling, TickSamples, WholeTurns
from cam_rig.units import TURN, FloatArray, to_rpm

#: A force of zero is a flight where the follower is off the cam by more than this part of the
#: lift; else a follower without preload rests on the cam's dwell.
OFF_THE_CAM = 1e-9


@dataclass
class FlightCount:
    """Counts flights, block after block: times are known to one sample."""

    least_gap: float  #: m; a follower that comes no farther from the cam has not left it
    _length: int = field(default=0, init=False)  #: samples of the flight so far
    _left: bool = field(default=False, init=False)  #: whether it has come so far
    _bounced: bool = field(default=False, init=False)  #: whether it began with a bounce

    def take(self, force: FloatArray, gap: FloatArray, impulse: FloatArray) -> tuple[int, int]:
        """How many lift-offs there are, and how many samples the longest flight has so far.

        A flight begins with a lift-off or a bounce. Samples ``(n,)`` that go on from those before:
        force (N), follower less cam (m), impulse (N·s).
        """
        flying = force == 0.0
        bounced = flying & (impulse > 0.0)
        changes = np.flatnonzero((flying[1:] != flying[:-1]) | bounced[1:]) + 1
        lift_offs, longest = 0, 0
        for begin, end in pairwise([0, *changes.tolist(), force.size]):
            if bounced[begin] or not flying[begin]:
                self._length, self._left, self._bounced = 0, False, bool(bounced[begin])
            if flying[begin]:
                self._length += end - begin
                if not self._left and float(gap[begin:end].max()) > self.least_gap:
                    self._left, lift_offs = True, lift_offs + (not self._bounced)
                longest = max(longest, self._length * self._left)
        return lift_offs, longest


@dataclass(frozen=True)
class SpeedRow:
    """The whole settled turns of one cam at one speed."""

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


#: Of s, s' and s'' the one that makes a torque of a force.
SLOPE = np.array([[0.0, 1.0, 0.0]])


@dataclass(frozen=True)
class _Part:
    """What the samples of a tick say, or those of a step's ticks so far."""

    samples: int = 0
    turned: float = 0.0
    force: tuple[float, float] = (-math.inf, math.inf)
    torque: tuple[float, float] = (-math.inf, math.inf)
    torque_sum: float = 0.0
    landing: float = 0.0
    lift_offs: int = 0
    longest: int = 0  #: samples

    def __add__(self, more: _Part) -> _Part:
        return _Part(
            self.samples + more.samples,
            self.turned + more.turned,
            (max(self.force[0], more.force[0]), min(self.force[1], more.force[1])),
            (max(self.torque[0], more.torque[0]), min(self.torque[1], more.torque[1])),
            self.torque_sum + more.torque_sum,
            max(self.landing, more.landing),
            self.lift_offs + more.lift_offs,
            max(self.longest, more.longest),
        )

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
            lift_offs=self.lift_offs / turns,
            flight=self.longest / rate,
            landing=self.landing,
            torque_peak=self.torque[0],
            torque_least=self.torque[1],
            torque_mean=self.torque_sum / self.samples,
        )


class SpeedRows:
    """A run's samples (at ``rate`` Hz), tick by tick as they come: a row each cam and speed."""

    def __init__(self, laws: dict[str, Law], rate: int, settle_turns: float) -> None:
        self._laws, self._rate = laws, rate
        self._turns = WholeTurns[_Part](Settling(settle_turns))
        self._flights = FlightCount(0.0)
        self._steps: dict[tuple[str, float], _Part] = {}
        self._before: tuple[str, float] | None = None

    @classmethod
    def of(cls, loaded: LoadedScene) -> SpeedRows:
        """The rows of a scene's run."""
        scene = loaded.scene
        return cls(loaded.laws, int(scene.sample_rate.si), scene.program.settle_turns.si)

    def take(self, tick: TickSamples) -> None:
        """Go on with the samples of the next tick."""
        key = tick.cam, tick.start.speed
        here = key if tick.steady else None
        if here != self._before:
            self._flights = FlightCount(OFF_THE_CAM * self._laws[tick.cam].lift)
        self._before = here
        first = round(float(tick.time[0]) * self._rate)
        span, turned = (first, first + tick.time.size), tick.turned(self._rate)
        part = self._part(tick, turned) if tick.steady else _Part()
        for whole in self._turns.take(tick.start, tick.steady, turned, span, part):
            self._steps[key] = self._steps.get(key, _Part()) + whole

    def _part(self, tick: TickSamples, turned: float) -> _Part:
        law = self._laws[tick.cam]
        angle, force, flying = tick.angle_in_turn, tick.force, tick.force == 0.0
        gap = np.zeros(flying.size)  # on the cam
        if flying.any():
            gap[flying] = tick.lift[flying] - law(angle[flying])
        lift_offs, longest = self._flights.take(force, gap, tick.impulse)
        step = tick.start.speed / self._rate
        torque = force * sample(law, angle[0], step, angle.size, SLOPE, np.zeros(1))[0]
        return _Part(
            torque.size,
            turned,
            (float(force.max()), float(force.min())),
            (float(torque.max()), float(torque.min())),
            float(torque.sum()),
            float(tick.impulse.max()),
            lift_offs,
            longest,
        )

    def rows(self, levels: dict[str, dict[float, float]]) -> tuple[SpeedRow, ...]:
        """The rows by cam and speed, at the end; ``levels`` in dB as of `step_levels`."""
        order = {cam: i for i, cam in enumerate(dict.fromkeys(cam for cam, _ in self._steps))}
        return tuple(
            step.row(cam, speed, self._rate, levels.get(cam, {}).get(speed))
            for (cam, speed), step in sorted(
                self._steps.items(), key=lambda x: (order[x[0][0]], x[0][1])
            )
        )

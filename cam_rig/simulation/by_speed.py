"""Table of a run with one row per cam and speed.

A row contains the sound level, forces, lift-offs, landings and torque.
Everything except the level is computed from the samples. Samples that are simulated and samples
that are read from a bag give the same row.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from cam_rig.laws import Law
from cam_rig.laws.sampling import sample
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.simulate import TickSamples, TransientFilter, WholeTurns
from cam_rig.units import TURN, FloatArray, to_rpm

#: Smallest gap of a flight as a fraction of the lift, above the rounding of the displacements. If
#: the force is zero at a smaller gap, the follower has no preload and rests on the cam's dwell.
MIN_GAP_RATIO = 1e-9


@dataclass
class FlightCount:
    """Counter of the follower's flights in successive blocks of samples.

    Times are resolved to one sample.
    """

    min_gap: float  #: smallest gap of a follower that has left the cam, m
    _length: int = field(default=0, init=False)  #: samples of the flight so far
    _has_left: bool = field(default=False, init=False)  #: True if the gap was above `min_gap`
    _bounced: bool = field(default=False, init=False)  #: True if the flight started with a bounce

    def add(self, force: FloatArray, gap: FloatArray, impulse: FloatArray) -> tuple[int, int]:
        """Return the number of lift-offs in a block, and the length of the longest flight.

        The length is a number of samples. A flight starts with a lift-off or a bounce. A bounce is
        not counted as a lift-off.

        Parameters
        ----------
        force : (n,) array
            Contact force in N, continuing the previous block.
        gap : (n,) array
            Displacement of the follower less that of the cam, m.
        impulse : (n,) array
            Impulse of the landings, N·s.
        """
        flying = force == 0.0
        bounced = flying & (impulse > 0.0)
        changes = np.flatnonzero((flying[1:] != flying[:-1]) | bounced[1:]) + 1
        lift_offs, longest = 0, 0
        for start, end in pairwise([0, *changes.tolist(), force.size]):
            if bounced[start] or not flying[start]:
                self._length, self._has_left, self._bounced = 0, False, bool(bounced[start])
            if flying[start]:
                self._length += end - start
                if not self._has_left and float(gap[start:end].max()) > self.min_gap:
                    self._has_left, lift_offs = True, lift_offs + (not self._bounced)
                longest = max(longest, self._length * self._has_left)
        return lift_offs, longest


@dataclass(frozen=True)
class SpeedRow:
    """Results of one cam at one speed, over its whole settled turns.

    A turn is settled if it follows after the transient turns at the start of each speed.
    """

    cam: str
    rpm: float  #: cam speed
    turns: float  #: number of settled turns with samples
    #: sound level, dB re 20 µPa; None if the messages of the microphone are missing
    level_db: float | None
    peak_force: float  #: maximum contact force of the samples, N, 0 in flight
    min_force: float  #: minimum contact force, N; below 0 if the model cannot lose contact
    lift_offs: float  #: number of lift-offs per turn
    flight: float  #: longest time off the cam, s, with the resolution of one sample
    landing: float  #: largest landing impulse, N·s; landings within one sample are added
    peak_torque: float  #: maximum torque F s' on the cam, N·m (eq. 8 of the paper)
    min_torque: float  #: minimum torque, N·m; below 0 the follower drives the cam
    torque_mean: float  #: mean torque, N·m


#: Weights of the lift s and its derivatives s' and s'' by the cam angle that select s'. The torque
#: on the cam is the contact force times s'.
SLOPE = np.array([[0.0, 1.0, 0.0]])


@dataclass(frozen=True)
class _TickStatistics:
    """Statistics of the samples of one tick, or of several ticks at one speed.

    A tick is the time between two cam states.
    """

    samples: int = 0
    turned: float = 0.0  #: cam angle turned so far, rad
    max_force: float = -math.inf  #: N
    min_force: float = math.inf  #: N
    max_torque: float = -math.inf  #: N·m
    min_torque: float = math.inf  #: N·m
    torque_sum: float = 0.0  #: sum of the torque of all samples, N·m
    landing: float = 0.0  #: largest impulse, N·s
    lift_offs: int = 0
    longest: int = 0  #: samples of the longest flight

    def __add__(self, other: _TickStatistics) -> _TickStatistics:
        return _TickStatistics(
            samples=self.samples + other.samples,
            turned=self.turned + other.turned,
            max_force=max(self.max_force, other.max_force),
            min_force=min(self.min_force, other.min_force),
            max_torque=max(self.max_torque, other.max_torque),
            min_torque=min(self.min_torque, other.min_torque),
            torque_sum=self.torque_sum + other.torque_sum,
            landing=max(self.landing, other.landing),
            lift_offs=self.lift_offs + other.lift_offs,
            longest=max(self.longest, other.longest),
        )

    def row(self, cam: str, speed: float, rate: int, level: float | None) -> SpeedRow:
        """Return the table row of a cam at a speed (rad/s).

        `rate` is the sample rate in Hz. `level` is the sound level in dB, None if unknown.
        """
        turns = self.turned / TURN
        return SpeedRow(
            cam=cam,
            rpm=round(to_rpm(speed), 9),
            turns=turns,
            level_db=level,
            peak_force=self.max_force,
            min_force=self.min_force,
            lift_offs=self.lift_offs / turns,
            flight=self.longest / rate,
            landing=self.landing,
            peak_torque=self.max_torque,
            min_torque=self.min_torque,
            torque_mean=self.torque_sum / self.samples,
        )


class SpeedRows:
    """Accumulator that forms one table row per cam and speed from the ticks of a run.

    A tick is the time between two cam states.

    Parameters
    ----------
    laws : dict of str to Law
        Laws by the name of the cam.
    rate : int
        Sample rate, Hz.
    transient_turns : float
        Number of turns left out at the start of each speed.
    """

    def __init__(self, laws: dict[str, Law], rate: int, transient_turns: float) -> None:
        self._laws, self._rate = laws, rate
        self._turns = WholeTurns[_TickStatistics](TransientFilter(transient_turns))
        self._flights = FlightCount(0.0)
        self._steps: dict[tuple[str, float], _TickStatistics] = {}
        self._previous_key: tuple[str, float] | None = None

    @classmethod
    def of(cls, loaded: LoadedScene) -> SpeedRows:
        """Return an empty accumulator for a run of a scene."""
        scene = loaded.scene
        return cls(loaded.laws, int(scene.sample_rate.si), scene.schedule.transient_turns.si)

    def take(self, tick: TickSamples) -> None:
        """Add the samples of the next tick.

        The ticks must be in the order of time. A tick is the time between two cam states.
        """
        key = tick.cam, tick.start.speed
        steady_key = key if tick.steady else None
        if steady_key != self._previous_key:
            self._flights = FlightCount(MIN_GAP_RATIO * self._laws[tick.cam].lift)
        self._previous_key = steady_key
        first = round(float(tick.time[0]) * self._rate)
        span, turned = (first, first + tick.time.size), tick.angle_span(self._rate)
        statistics = self._statistics(tick, turned) if tick.steady else _TickStatistics()
        for completed in self._turns.add(tick.start, tick.steady, turned, span, statistics):
            self._steps[key] = self._steps.get(key, _TickStatistics()) + completed

    def _statistics(self, tick: TickSamples, turned: float) -> _TickStatistics:
        law = self._laws[tick.cam]
        angle, force, flying = tick.angle_in_turn, tick.force, tick.force == 0.0
        gap = np.zeros(flying.size)  # 0 on the cam
        if flying.any():
            gap[flying] = tick.lift[flying] - law(angle[flying])
        lift_offs, longest = self._flights.add(force, gap, tick.impulse)
        step = tick.start.speed / self._rate
        torque = force * sample(law, angle[0], step, angle.size, SLOPE, np.zeros(1))[0]
        return _TickStatistics(
            samples=torque.size,
            turned=turned,
            max_force=float(force.max()),
            min_force=float(force.min()),
            max_torque=float(torque.max()),
            min_torque=float(torque.min()),
            torque_sum=float(torque.sum()),
            landing=float(tick.impulse.max()),
            lift_offs=lift_offs,
            longest=longest,
        )

    def rows(self, levels: dict[str, dict[float, float]]) -> tuple[SpeedRow, ...]:
        """Return the table rows at the end of the run, sorted by cam and speed.

        `levels` contains the level in dB by cam and speed (rad/s), see `step_levels`.
        """
        order = {cam: i for i, cam in enumerate(dict.fromkeys(cam for cam, _ in self._steps))}
        return tuple(
            step.row(cam, speed, self._rate, levels.get(cam, {}).get(speed))
            for (cam, speed), step in sorted(
                self._steps.items(), key=lambda x: (order[x[0][0]], x[0][1])
            )
        )

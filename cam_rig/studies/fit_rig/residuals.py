"""How far a follower of some numbers is from what was measured, and how that changes with them.

Beside the numbers sought there are those of the instruments, told by the same samples: in each hold
the phase of the samples against the encoder and how far its speed is off, one error of the sensors'
clock, the zero of the lift, and where asked its backlash.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.events.trajectory import EndlessEventsError
from cam_rig.laws import Law
from cam_rig.studies.fit_rig.numbers import NUMBERS, follower_of, from_search, to_search
from cam_rig.studies.fit_rig.steady_turn import (
    PeriodicTurn,
    TwoMassTurn,
    bounces_of,
    one_mass_turn,
    resonant,
    two_mass_turn,
)
from cam_rig.studies.fit_rig.turns import HoldSamples, MeasuredHold
from cam_rig.units import TURN, FloatArray

#: Step of what is sought, of its size; of an angle, rad.
STEP, ANGLE_STEP = 1e-5, 1e-6
#: The clock's error is sought in parts of this.
PPM = 1e-6
#: What is off by a little at a landing is off by more at its bounces: of the angle since.
SERIES = 0.5
#: Places beside a sample at which a force is looked for. What is off by as much as a landing in a
#: series is no wider than half of it, so none of these places is beside the series alone.
ABOUT = 65
#: Residual, in standard deviations, of a follower without a steady turn.
FAR = 1e3
#: Errors of the instruments: of the sensors' clock (ppm), the lift's zero and backlash (m), the
#: force's zero (N), a resonance of the force sensor (logarithm of its frequency in Hz, and damping
#: ratio).
CLOCK, ZERO, BACKLASH, FORCE_ZERO, RESONANCE, RATIO = SINGLE = (
    *("clock", "zero", "backlash", "force_zero"),
    *("sensor_frequency", "sensor_damping"),
)
#: Cam angles (rad) at which the side of a backlash is known; slower than this part a cam stands.
SIDES, STILL = np.linspace(0.0, TURN, 4097), 1e-6


@dataclass(frozen=True)
class Instruments:
    """Where the numbers of the instruments stand behind those of the follower.

    ``first`` is how many those are, ``single`` the names of what there is once for all holds.
    """

    first: int
    holds: int
    single: tuple[str, ...]

    @property
    def phases(self) -> slice:
        """Of each hold, rad."""
        return slice(self.first, self.first + self.holds)

    @property
    def speeds(self) -> slice:
        """Of each hold: how far its speed is off, in standard errors of the encoder's."""
        return slice(self.first + self.holds, self.first + 2 * self.holds)

    @cached_property
    def at(self) -> dict[str, int]:
        """Where those of `SINGLE` stand that are sought."""
        return {name: self.speeds.stop + i for i, name in enumerate(self.single)}

    @property
    def size(self) -> int:
        """How many numbers there are, the follower's among them."""
        return self.first + 2 * self.holds + len(self.single)


@dataclass(frozen=True, eq=False)
class PredictedSignal:
    """One quantity at the samples of a hold that count, as the numbers make it, ``(n,)`` each.

    ``left``: ``value`` less what was measured; ``angle``: of the cam, rad.
    """

    angle: FloatArray
    value: FloatArray
    left: FloatArray


@dataclass(frozen=True, eq=False)
class Predicted:
    """A hold as the numbers make it."""

    turn: PeriodicTurn
    lift: PredictedSignal
    force: PredictedSignal


@dataclass(eq=False)
class Likelihood:
    """Residuals in standard deviations, and their slopes.

    ``sought``, ``given``: the follower's numbers that are sought, by name, and the others;
    ``lift_noise``, ``force_noise``: m and N, one standard deviation, and ``force_part`` in parts of
    the force beside it; ``backlash``, ``resonance``, ``zero_offset``: whether the gauge has a
    backlash, the force sensor a resonance, a zero; ``kept``, ``pressing``: of each hold, which
    samples of force count, all by default, and the forces (N) that their noise is in proportion to.
    """

    law: Law
    holds: tuple[MeasuredHold, ...]
    sought: tuple[str, ...]
    given: dict[str, float]
    stem_stiffness: float | None
    lift_noise: float = 1e-5
    force_noise: float = 1.0
    force_part: float = 0.0
    backlash: bool = False
    resonance: bool = False
    zero_offset: bool = False
    kept: list[NDArray[np.bool_]] = field(default_factory=list)
    pressing: list[FloatArray] = field(default_factory=list)

    def __post_init__(self) -> None:
        sizes = [hold.force.since.size for hold in self.holds]
        self.kept = self.kept or [np.ones(size, dtype=bool) for size in sizes]
        self.pressing = self.pressing or [np.zeros(size) for size in sizes]

    def samples(self, i: int) -> tuple[HoldSamples, HoldSamples]:
        """What counts of a hold: its lift, and its force beside no landing."""
        return self.holds[i].lift, self.holds[i].force.where(self.kept[i])

    def sizes(self, i: int) -> tuple[int, int]:
        """How many samples of lift and of force count in a hold."""
        return self.holds[i].lift.value.size, int(self.kept[i].sum())

    @property
    def noise(self) -> tuple[float, float, float]:
        """Of lift (m) and force (N), and the force's in proportion to it."""
        return self.lift_noise, self.force_noise, self.force_part

    def force_deviation(self, i: int) -> FloatArray:
        """Standard deviation (N) of the forces of a hold that count."""
        part = self.force_part * self.pressing[i][self.kept[i]]
        return np.asarray(np.hypot(self.force_noise, part))

    @cached_property
    def instruments(self) -> Instruments:
        """Where the instruments' numbers stand."""
        lift = any(hold.lift.since.size for hold in self.holds)
        there = True, lift, lift and self.backlash, self.zero_offset, self.resonance, self.resonance
        single = tuple(name for name, known in zip(SINGLE, there, strict=True) if known)
        return Instruments(len(self.sought), len(self.holds), single)

    def single(self, x: FloatArray, name: str) -> float:
        """The value of one of `SINGLE`; none where it is not sought."""
        at = self.instruments.at.get(name)
        return 0.0 if at is None else float(x[at])

    def values(self, x: FloatArray) -> dict[str, float]:
        """The follower's numbers, sought and given."""
        return self.given | from_search(self.sought, x)

    def speed_of(self, x: FloatArray, i: int) -> float:
        """The speed (rad/s) of a hold."""
        hold = self.holds[i].hold
        return hold.speed + float(x[self.instruments.speeds][i]) * hold.speed_error

    def steady(
        self, x: FloatArray, i: int, near: PeriodicTurn | None = None
    ) -> PeriodicTurn | None:
        """A hold's turn that is as the one before; None where none is, or a follower chatters."""
        follower, speed = follower_of(self.values(x), self.stem_stiffness), self.speed_of(x, i)
        try:
            if isinstance(follower, FollowerParameters):
                return one_mass_turn(self.law, follower, speed)
            near = near if isinstance(near, TwoMassTurn) else None
            return two_mass_turn(self.law, follower, speed, near)
        except EndlessEventsError:
            return None

    def predicted(
        self, x: FloatArray, i: int, near: PeriodicTurn | None = None
    ) -> Predicted | None:
        """A hold as the numbers make it; None where they make no steady turn."""
        turn = self.steady(x, i, near)
        if turn is None:
            return None
        measured = self.samples(i)
        angles = [self.angles(x, i, part.since) for part in measured]
        lift = turn.at(angles[0])[0] + self.single(x, ZERO)
        if (backlash := self.single(x, BACKLASH)) != 0.0:
            lift = lift - 0.5 * backlash * side_of(self.law, angles[0])
        values = lift, self._sensed(x, turn, i)(angles[1])
        shown = (
            PredictedSignal(angle, value, value - part.value)
            for angle, value, part in zip(angles, values, measured, strict=True)
        )
        return Predicted(turn, *shown)

    def _sensed(
        self, x: FloatArray, turn: PeriodicTurn, i: int
    ) -> Callable[[FloatArray], FloatArray]:
        """The force (N) over the cam angle (rad) as the sensor shows it."""
        zero = self.single(x, FORCE_ZERO)
        if not self.resonance:
            return lambda angle: turn.at(angle)[1] + zero
        frequency = float(np.exp(self.single(x, RESONANCE)))
        shown = resonant(turn, self.speed_of(x, i), frequency, self.single(x, RATIO))
        return lambda angle: shown(angle) + zero

    def angles(self, x: FloatArray, i: int, since: FloatArray) -> FloatArray:
        """Cam angle (rad) at times since a hold's middle (s)."""
        clock = PPM * self.single(x, CLOCK)
        begin = self.holds[i].angle + float(x[self.instruments.phases][i])
        return np.asarray(begin + self.speed_of(x, i) * (1.0 + clock) * since)

    def residuals(self, x: FloatArray) -> FloatArray:
        """All of them; far off where there is no steady turn."""
        found = list[FloatArray]()
        for i in range(len(self.holds)):
            there = self.predicted(x, i)
            if there is None:
                found.append(np.full(sum(self.sizes(i)), FAR))
            else:
                found.append(there.lift.left / self.lift_noise)
                found.append(there.force.left / self.force_deviation(i))
        return np.concatenate([*found, x[self.instruments.speeds]])

    def slopes(self, x: FloatArray) -> FloatArray:
        """The residuals' slopes, ``(m, n)``."""
        blocks = [self._slopes_of(x, i) for i in range(len(self.holds))]
        last = np.zeros((len(self.holds), x.size))
        last[:, self.instruments.speeds] = np.eye(len(self.holds))
        return np.vstack([*blocks, last])

    def _slopes_of(self, x: FloatArray, i: int) -> FloatArray:
        base, where = self.predicted(x, i), self.instruments
        lifts, forces = self.sizes(i)
        out = np.zeros((lifts + forces, x.size))
        if base is None:
            return out
        for k in (*range(where.first), where.speeds.start + i):
            step = STEP * self._size(x, k)
            beside = self.predicted(x + step * (np.arange(x.size) == k), i, base.turn)
            if beside is not None:
                out[:lifts, k] = (beside.lift.value - base.lift.value) / step
                out[lifts:, k] = (beside.force.value - base.force.value) / step
        by_angle = self._by_angle(x, i, base)
        out[:, where.phases.start + i] = by_angle
        since = np.concatenate([part.since for part in self.samples(i)])
        for name, at in where.at.items():
            if name == CLOCK:
                out[:, at] = by_angle * self.speed_of(x, i) * since * PPM
            elif name == ZERO:
                out[:lifts, at] = 1.0
            elif name == BACKLASH:
                out[:lifts, at] = -0.5 * side_of(self.law, base.lift.angle)
            elif name == FORCE_ZERO:
                out[lifts:, at] = 1.0
            else:
                beside_it = x + STEP * (np.arange(x.size) == at)
                force = self._sensed(beside_it, base.turn, i)(base.force.angle)
                out[lifts:, at] = (force - base.force.value) / STEP
        out[:lifts] /= self.lift_noise
        out[lifts:] /= self.force_deviation(i)[:, None]
        return out

    def _size(self, x: FloatArray, k: int) -> float:
        """What a step of something sought is to be measured by."""
        if k >= len(self.sought):
            return 10.0
        number = NUMBERS[self.sought[k]]
        return 1.0 if number.logarithm or number.high < 1.0 else max(abs(float(x[k])), 1.0)

    def _by_angle(self, x: FloatArray, i: int, base: Predicted) -> FloatArray:
        """What lift and force change with the angle, by differences on both sides of a sample."""
        shown = self._sensed(x, base.turn, i)
        both = (ANGLE_STEP, -ANGLE_STEP)
        lift = [base.turn.at(base.lift.angle + d)[0] for d in both]
        force = [shown(base.force.angle + d) for d in both]
        return np.concatenate([(up - down) / (2.0 * ANGLE_STEP) for up, down in (lift, force)])

    def start(self, values: dict[str, float], phase: float, zero: float) -> FloatArray:
        """What is sought, of numbers, one phase (rad) for all holds, and the lift's zero (m)."""
        where = self.instruments
        x = np.zeros(where.size)
        x[: where.first] = [to_search(name, values[name]) for name in self.sought]
        x[where.phases] = phase
        if ZERO in where.at:
            x[where.at[ZERO]] = zero
        return x

    def keep_clear(self, x: FloatArray, guard: float) -> bool:
        """Leave out the force next to landings (rad), where it jumps; whether that changed."""
        before, self.kept, self.pressing = self.kept, [], []
        for i, hold in enumerate(self.holds):
            turn, angle = self.steady(x, i), self.angles(x, i, hold.force.since)
            self.kept.append(self._beside(turn, angle, guard) == 0.0)
            pressing = np.zeros(angle.size) if turn is None else np.abs(turn.at(angle)[1])
            self.pressing.append(pressing)
        return any((a != b).any() for a, b in zip(before, self.kept, strict=True))

    def _beside(self, turn: PeriodicTurn | None, angle: FloatArray, guard: float) -> FloatArray:
        """By how much (rad) a landing beside each of ``angle`` may be off; 0 beside none."""
        found = np.zeros(angle.size)
        for at, begun in () if self.resonance else bounces_of(turn):
            wide = guard + SERIES * (at - begun)
            inside = ~_outside(angle, at - wide, at + wide)
            found[inside] = np.maximum(found[inside], wide)
        return found

    def beside(self, x: FloatArray, i: int, guard: float) -> FloatArray:
        """By how much (rad) a landing beside each force of a hold may be off; 0 beside none."""
        return self._beside(self.steady(x, i), self.angles(x, i, self.holds[i].force.since), guard)

    def forces_about(
        self, x: FloatArray, i: int, some: NDArray[np.intp], wide: FloatArray
    ) -> FloatArray:
        """``(2, n)``: least and largest force shown within ``wide`` (rad) of some samples."""
        turn = self.steady(x, i)
        if turn is None:
            return np.array([[-np.inf], [np.inf]]) * np.ones(some.size)
        angle = self.angles(x, i, self.holds[i].force.since[some])
        about = angle + wide * np.linspace(-1.0, 1.0, ABOUT)[:, None]
        shown = self._sensed(x, turn, i)(about.ravel()).reshape(about.shape)
        return np.stack([shown.min(axis=0), shown.max(axis=0)])

    def settled(self, x: FloatArray, guard: float) -> Likelihood:
        """The same without what is from ``guard`` (rad) before a landing to behind its bounces.

        There the follower is on the cam again, and what it does depends on no landing.
        """
        holds = tuple(self._settled(x, i, guard) for i in range(len(self.holds)))
        return replace(self, holds=holds, kept=[], pressing=[])

    def _settled(self, x: FloatArray, i: int, guard: float) -> MeasuredHold:
        hold, bounces = self.holds[i], bounces_of(self.steady(x, i))
        parts = []
        for part in (hold.lift, hold.force):
            angle = self.angles(x, i, part.since)
            clear = np.ones(angle.size, dtype=bool)
            for at, begun in bounces:
                clear &= _outside(angle, begun - guard, at + guard + SERIES * (at - begun))
            parts.append(part.where(clear))
        return replace(hold, lift=parts[0], force=parts[1])


def side_of(law: Law, angle: FloatArray) -> FloatArray:
    """1 after a rise and -1 after a fall at cam angles (rad): where backlash is taken up."""
    slope = law.motion_at(SIDES)[1]
    moving = np.abs(slope) > STILL * np.abs(slope).max()
    last = np.maximum.accumulate(np.where(moving, np.arange(slope.size), -1))
    last = np.where(last < 0, np.flatnonzero(moving)[-1], last)
    return np.asarray(np.sign(slope[last])[np.searchsorted(SIDES, np.mod(angle, TURN)) - 1])


def _outside(angle: FloatArray, low: float, high: float) -> NDArray[np.bool_]:
    """Whether cam angles (rad) of any turn are beyond ``low`` to ``high``."""
    return np.asarray(np.mod(angle - low, TURN) > high - low)

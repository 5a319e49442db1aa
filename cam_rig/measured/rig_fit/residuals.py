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
from cam_rig.dynamics.events.course import EndlessEventsError
from cam_rig.laws import Law
from cam_rig.measured.rig_fit.numbers import (
    BACKLASH,
    CLOCK,
    NUMBERS,
    RATIO,
    RESONANCE,
    SINGLE,
    TARE,
    ZERO,
    Follower,
    Instruments,
    follower_of,
    from_search,
    side_of,
    to_search,
)
from cam_rig.measured.rig_fit.steady_turn import (
    PeriodicTurn,
    TwoMassTurn,
    bounces_of,
    one_mass_turn,
    resonant,
    two_mass_turn,
)
from cam_rig.measured.rig_fit.turns import MeasuredHold
from cam_rig.units import TURN, FloatArray

#: Step of what is sought, of its size; of an angle, rad.
STEP, ANGLE_STEP = 1e-5, 1e-6

#: The clock's error is sought in parts of this.
PPM = 1e-6

#: What is off by a little at a landing is off by more at its bounces: of the angle since.
SERIES = 0.5

#: Residual, in standard deviations, of a follower without a steady turn.
FAR = 1e3


@dataclass(frozen=True, eq=False)
class Predicted:
    """A hold as the numbers make it: the steady turn, and lift and force at its samples.

    ``lift_left`` and ``force_left`` are these less what was measured.
    """

    turn: PeriodicTurn
    lift_angle: FloatArray
    force_angle: FloatArray
    lift: FloatArray
    force: FloatArray
    lift_left: FloatArray
    force_left: FloatArray


@dataclass(eq=False)
class Likelihood:
    """Residuals in standard deviations, and their slopes.

    Parameters
    ----------
    sought, given : the follower's numbers that are sought, by name, and the other ones
    lift_noise, force_noise : m and N, one standard deviation
    force_part : the force's noise in parts of the force, beside ``force_noise``
    play, resonance, tare : whether the gauge has backlash, the force sensor a resonance, a zero
    kept : of each hold, which samples of force count; all by default
    pressing : of each hold, the forces (N) that their noise is in proportion to; none by default
    """

    law: Law
    holds: tuple[MeasuredHold, ...]
    sought: tuple[str, ...]
    given: dict[str, float]
    stem_stiffness: float | None
    lift_noise: float = 1e-5
    force_noise: float = 1.0
    force_part: float = 0.0
    play: bool = False
    resonance: bool = False
    tare: bool = False
    kept: list[NDArray[np.bool_]] = field(default_factory=list)
    pressing: list[FloatArray] = field(default_factory=list)

    def __post_init__(self) -> None:
        if not self.kept:
            self.kept = [np.ones(hold.force.since.size, dtype=bool) for hold in self.holds]
        if not self.pressing:
            self.pressing = [np.zeros(hold.force.since.size) for hold in self.holds]

    @property
    def count(self) -> int:
        """Residuals there are: samples of lift, of force that count, and a speed for each hold."""
        lifts = sum(hold.lift.value.size for hold in self.holds)
        return lifts + sum(int(kept.sum()) for kept in self.kept) + len(self.holds)

    def force_deviation(self, i: int) -> FloatArray:
        """Standard deviation (N) of the forces of a hold that count."""
        part = self.force_part * self.pressing[i][self.kept[i]]
        return np.asarray(np.hypot(self.force_noise, part))

    @cached_property
    def instruments(self) -> Instruments:
        """Where the instruments' numbers stand."""
        lift = any(hold.lift.since.size for hold in self.holds)
        there = {
            CLOCK: True,
            ZERO: lift,
            BACKLASH: lift and self.play,
            TARE: self.tare,
            RESONANCE: self.resonance,
            RATIO: self.resonance,
        }
        single = tuple(name for name in SINGLE if there[name])
        return Instruments(len(self.sought), len(self.holds), single)

    def single(self, x: FloatArray, name: str) -> float:
        """The value of one of `SINGLE`; none where it is not sought."""
        at = self.instruments.at(name)
        return 0.0 if at is None else float(x[at])

    def values(self, x: FloatArray) -> dict[str, float]:
        """The follower's numbers, sought and given."""
        found = {n: from_search(n, float(v)) for n, v in zip(self.sought, x, strict=False)}
        return self.given | found

    def follower(self, x: FloatArray) -> Follower:
        """The follower of what is sought."""
        return follower_of(self.values(x), self.stem_stiffness)

    def speed_of(self, x: FloatArray, i: int) -> float:
        """The speed (rad/s) of a hold."""
        hold = self.holds[i]
        return hold.speed + float(x[self.instruments.speeds][i]) * hold.hold.speed_error

    def predicted(
        self, x: FloatArray, i: int, near: PeriodicTurn | None = None
    ) -> Predicted | None:
        """A hold as the numbers make it; None where they make no steady turn."""
        speed = self.speed_of(x, i)
        turn = _steady(self.law, self.follower(x), speed, near)
        if turn is None:
            return None
        lift_angle, force_angle = self.angles(x, i)
        lift = turn.at(lift_angle)[0] + self.single(x, ZERO)
        if (play := self.single(x, BACKLASH)) != 0.0:
            lift = lift - 0.5 * play * side_of(self.law, lift_angle)
        force = self._sensed(x, turn, speed)(force_angle)
        hold = self.holds[i]
        left = lift - hold.lift.value, force - hold.force.value[self.kept[i]]
        return Predicted(turn, lift_angle, force_angle, lift, force, *left)

    def _sensed(
        self, x: FloatArray, turn: PeriodicTurn, speed: float
    ) -> Callable[[FloatArray], FloatArray]:
        """The force (N) over the cam angle (rad) as the sensor shows it."""
        zero = self.single(x, TARE)
        if not self.resonance:
            return lambda angle: turn.at(angle)[1] + zero
        frequency = float(np.exp(self.single(x, RESONANCE)))
        shown = resonant(turn, speed, frequency, self.single(x, RATIO))
        return lambda angle: shown(angle) + zero

    def angles(self, x: FloatArray, i: int) -> tuple[FloatArray, FloatArray]:
        """Cam angle (rad) at the samples of lift, and at those of force that count, of a hold."""
        hold = self.holds[i]
        return (
            self._angles(x, i, hold.lift.since),
            self._angles(x, i, hold.force.since[self.kept[i]]),
        )

    def _angles(self, x: FloatArray, i: int, since: FloatArray) -> FloatArray:
        where = self.instruments
        clock = PPM * self.single(x, CLOCK)
        begin = self.holds[i].angle + float(x[where.phases][i])
        return np.asarray(begin + self.speed_of(x, i) * (1.0 + clock) * since)

    def residuals(self, x: FloatArray) -> FloatArray:
        """All of them; far off where there is no steady turn."""
        found = [self._residual(i, self.predicted(x, i)) for i in range(len(self.holds))]
        return np.concatenate([*found, x[self.instruments.speeds]])

    def _residual(self, i: int, predicted: Predicted | None) -> FloatArray:
        if predicted is None:
            return np.full(self.holds[i].lift.value.size + int(self.kept[i].sum()), FAR)
        lift, force = predicted.lift_left, predicted.force_left
        return np.concatenate([lift / self.lift_noise, force / self.force_deviation(i)])

    def slopes(self, x: FloatArray) -> FloatArray:
        """The residuals' slopes, ``(m, n)``."""
        blocks = [self._slopes_of(x, i) for i in range(len(self.holds))]
        last = np.zeros((len(self.holds), x.size))
        last[:, self.instruments.speeds] = np.eye(len(self.holds))
        return np.vstack([*blocks, last])

    def _slopes_of(self, x: FloatArray, i: int) -> FloatArray:
        hold, where = self.holds[i], self.instruments
        base = self.predicted(x, i)
        sizes = hold.lift.value.size, int(self.kept[i].sum())
        out = np.zeros((sum(sizes), x.size))
        if base is None:
            return out
        for k in (*range(where.first), where.speeds.start + i):
            step = STEP * self._size(x, k)
            beside = self.predicted(x + step * (np.arange(x.size) == k), i, base.turn)
            if beside is not None:
                out[: sizes[0], k] = (beside.lift - base.lift) / step
                out[sizes[0] :, k] = (beside.force - base.force) / step
        by_angle = self._by_angle(x, i, base)
        out[:, where.phases.start + i] = by_angle
        if (at := where.at(CLOCK)) is not None:
            since = np.concatenate([hold.lift.since, hold.force.since[self.kept[i]]])
            out[:, at] = by_angle * self.speed_of(x, i) * since * PPM
        if (at := where.at(ZERO)) is not None:
            out[: sizes[0], at] = 1.0
        if (at := where.at(BACKLASH)) is not None:
            out[: sizes[0], at] = -0.5 * side_of(self.law, base.lift_angle)
        if (at := where.at(TARE)) is not None:
            out[sizes[0] :, at] = 1.0
        for at in filter(None, (where.at(RESONANCE), where.at(RATIO))):
            beside = x + STEP * (np.arange(x.size) == at)
            force = self._sensed(beside, base.turn, self.speed_of(x, i))(base.force_angle)
            out[sizes[0] :, at] = (force - base.force) / STEP
        out[: sizes[0]] /= self.lift_noise
        out[sizes[0] :] /= self.force_deviation(i)[:, None]
        return out

    def _size(self, x: FloatArray, k: int) -> float:
        """What a step of something sought is to be measured by."""
        name = self.sought[k] if k < len(self.sought) else None
        if name is None:
            return 10.0
        if NUMBERS[name].logarithm or NUMBERS[name].high < 1.0:
            return 1.0
        return max(abs(float(x[k])), 1.0)

    def _by_angle(self, x: FloatArray, i: int, base: Predicted) -> FloatArray:
        """What lift and force change with the angle, by differences on both sides of a sample."""
        shown = self._sensed(x, base.turn, self.speed_of(x, i))
        both = (ANGLE_STEP, -ANGLE_STEP)
        lift = [base.turn.at(base.lift_angle + d)[0] for d in both]
        force = [shown(base.force_angle + d) for d in both]
        rises = [(up - down) / (2.0 * ANGLE_STEP) for up, down in (lift, force)]
        return np.concatenate(rises)

    def start(self, values: dict[str, float], phase: float, zero: float) -> FloatArray:
        """What is sought, of numbers, one phase (rad) for all holds, and the lift's zero (m)."""
        where = self.instruments
        x = np.zeros(where.size)
        x[: where.first] = [to_search(name, values[name]) for name in self.sought]
        x[where.phases] = phase
        if (at := where.at(ZERO)) is not None:
            x[at] = zero
        return x

    def keep_clear(self, x: FloatArray, guard: float) -> bool:
        """Leave out the force next to landings (rad), where it jumps; whether that changed."""
        before, kept, pressing = self.kept, [], []
        for i, hold in enumerate(self.holds):
            turn = _steady(self.law, self.follower(x), self.speed_of(x, i), None)
            angle = self._angles(x, i, hold.force.since)
            clear = np.ones(angle.size, dtype=bool)
            for at, begun in bounces_of(turn.events if turn is not None else ()):
                if not self.resonance:
                    wide = guard + SERIES * (at - begun)
                    clear &= _outside(angle, at - wide, at + wide)
            kept.append(clear)
            pressing.append(np.zeros(angle.size) if turn is None else np.abs(turn.at(angle)[1]))
        self.kept, self.pressing = kept, pressing
        return any((a != b).any() for a, b in zip(before, kept, strict=True))

    def settled(self, x: FloatArray, guard: float) -> Likelihood:
        """The same without what is from ``guard`` (rad) before a landing to behind its bounces.

        There the follower is on the cam again, and what it does depends on no landing.
        """
        holds = []
        for i, hold in enumerate(self.holds):
            turn = _steady(self.law, self.follower(x), self.speed_of(x, i), None)
            parts = []
            for part in (hold.lift, hold.force):
                angle = self._angles(x, i, part.since)
                clear = np.ones(angle.size, dtype=bool)
                for at, begun in bounces_of(turn.events if turn is not None else ()):
                    clear &= _outside(angle, begun - guard, at + guard + SERIES * (at - begun))
                parts.append(part.where(clear))
            holds.append(replace(hold, lift=parts[0], force=parts[1]))
        return replace(self, holds=tuple(holds), kept=[], pressing=[])


def _outside(angle: FloatArray, low: float, high: float) -> NDArray[np.bool_]:
    """Whether cam angles (rad) of any turn are beyond ``low`` to ``high``."""
    return np.asarray(np.mod(angle - low, TURN) > high - low)


def _steady(
    law: Law, follower: Follower, speed: float, near: PeriodicTurn | None
) -> PeriodicTurn | None:
    """A turn that is as the one before; None where none is, or a follower chatters without end."""
    try:
        if isinstance(follower, FollowerParameters):
            return one_mass_turn(law, follower, speed)
        return two_mass_turn(law, follower, speed, near if isinstance(near, TwoMassTurn) else None)
    except EndlessEventsError:
        return None

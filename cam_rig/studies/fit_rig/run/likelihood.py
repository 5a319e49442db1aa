"""Residuals of a computed follower against the measured samples, and their derivatives.

The run consists of segments, each with a steady cam speed. The same samples also identify the
errors of the instruments. Each segment has its own phase (cam angle minus encoder angle) and speed
error. All segments share the error of the sensors' clock and the zero of the lift. Optionally they
also share the backlash of the lift gauge, the zero of the force, and a resonance of the force
sensor.
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
from cam_rig.studies.fit_rig.parameters import build_follower, from_search, search_scale, to_search
from cam_rig.studies.fit_rig.run.instruments import (
    BACKLASH,
    CLOCK,
    FORCE_ZERO,
    RATIO,
    RESONANCE,
    SHARED,
    ZERO,
    Instruments,
    backlash_side,
)
from cam_rig.studies.fit_rig.run.steady_turn import (
    PeriodicTurn,
    TwoMassTurn,
    list_bounces,
    one_mass_turn,
    sensor_response,
    two_mass_turn,
)
from cam_rig.studies.fit_rig.run.turns import MeasuredSegment, SegmentSamples
from cam_rig.units import TURN, FloatArray

#: Step of a search variable for a difference quotient, relative to the scale of the variable.
RELATIVE_STEP = 1e-5
#: Scale of the search variable for the speed error of a steady-speed segment, in standard errors of
#: the speed. The step of the variable for a difference quotient is relative to this scale.
SPEED_SCALE = 10.0
#: Step of the cam angle for the difference quotients of lift and force, rad.
ANGLE_STEP = 1e-6
#: Factor from the search variable of the clock's error (ppm) to the relative error of the clock.
PPM = 1e-6
#: Possible error of the cam angle of a later landing in a series of bounces, as a fraction of the
#: angle since the first landing of the series. A small error of a landing grows from bounce to
#: bounce.
BOUNCE_ANGLE_FRACTION = 0.5
#: Number of cam angles near a force sample at which the computed force is evaluated to find its
#: range. The possible error of a landing is at most half the width of its series of bounces, so
#: some of these angles are outside the series.
FORCE_POINTS = 65
#: Residual, in standard deviations, of every sample at a speed at which the computed follower has
#: no periodic turn. It is large, so that a search avoids such parameters.
NO_TURN_RESIDUAL = 1e3


@dataclass(frozen=True, eq=False)
class PredictedSignal:
    """Computed lift or force at the samples of a steady-speed segment, ``(n,)`` each.

    ``value`` is the computed value, ``residual`` this minus the measured value (both m or N).
    ``angle`` is the cam angle in rad. Samples that are excluded near landings are not included.
    """

    angle: FloatArray
    value: FloatArray
    residual: FloatArray


@dataclass(frozen=True, eq=False)
class PredictedSegment:
    """Computed periodic turn at one steady speed, with lift and force at the samples."""

    turn: PeriodicTurn
    lift: PredictedSignal
    force: PredictedSignal


@dataclass(eq=False)
class Likelihood:
    """Residuals of a fit to a run in standard deviations, and their derivatives.

    ``segments`` are the samples at each steady speed. ``free`` are the names of the follower's free
    parameters, ``fixed`` the values (SI) of the others. ``stem_stiffness`` (N/m) is that of one
    mass, or None. ``lift_noise`` (m) and ``force_noise`` (N) are standard deviations.
    ``relative_force_noise`` is a further standard deviation of the force, relative to the force.
    ``backlash``, ``resonance`` and ``zero_offset`` are True if the lift gauge's backlash, and the
    force sensor's resonance and zero offset, are free. ``force_masks`` has one boolean mask per
    segment, True for the force samples that are included (default: all). ``pressing`` are the
    computed forces (N) to which the relative noise applies, one array per segment.
    """

    law: Law
    segments: tuple[MeasuredSegment, ...]
    free: tuple[str, ...]
    fixed: dict[str, float]
    stem_stiffness: float | None
    lift_noise: float = 1e-5
    force_noise: float = 1.0
    relative_force_noise: float = 0.0
    backlash: bool = False
    resonance: bool = False
    zero_offset: bool = False
    force_masks: list[NDArray[np.bool_]] = field(default_factory=list)
    pressing: list[FloatArray] = field(default_factory=list)

    def __post_init__(self) -> None:
        sizes = [segment.force.since.size for segment in self.segments]
        self.force_masks = self.force_masks or [np.ones(size, dtype=bool) for size in sizes]
        self.pressing = self.pressing or [np.zeros(size) for size in sizes]

    def samples(self, i: int) -> tuple[SegmentSamples, SegmentSamples]:
        """Return the included samples of lift and of force in a steady-speed segment.

        ``i`` is the index of the segment. Force samples next to landings are excluded.
        """
        return self.segments[i].lift, self.segments[i].force.where(self.force_masks[i])

    def sizes(self, i: int) -> tuple[int, int]:
        """Return the numbers of included samples of lift and force in segment ``i``.

        A segment is a time of steady cam speed. Force samples next to landings are excluded.
        """
        return self.segments[i].lift.value.size, int(self.force_masks[i].sum())

    @property
    def noise(self) -> tuple[float, float, float]:
        """Standard deviations of lift (m) and force (N), and the force's relative noise."""
        return self.lift_noise, self.force_noise, self.relative_force_noise

    def force_deviation(self, i: int) -> FloatArray:
        """Return the standard deviations (N) of segment ``i``'s included forces, ``(n,)``.

        A segment is a time of steady cam speed. Force samples next to landings are excluded.
        """
        part = self.relative_force_noise * self.pressing[i][self.force_masks[i]]
        return np.asarray(np.hypot(self.force_noise, part))

    @cached_property
    def instruments(self) -> Instruments:
        """Positions of the instrument errors in the vector of search variables."""
        lift = any(segment.lift.since.size for segment in self.segments)
        is_free = (True, lift, lift and self.backlash, self.zero_offset, *[self.resonance] * 2)
        single = tuple(name for name, free in zip(SHARED, is_free, strict=True) if free)
        return Instruments(len(self.free), len(self.segments), single)

    def single(self, x: FloatArray, name: str) -> float:
        """Return the value of a shared instrument error, or 0 if it is not free.

        ``x`` are the search variables. ``name`` is a key of `SHARED`. The unit is that of the key.
        """
        index = self.instruments.index.get(name)
        return 0.0 if index is None else float(x[index])

    def values(self, x: FloatArray) -> dict[str, float]:
        """Return all parameters of the follower (SI) by name at search variables ``x``."""
        return self.fixed | from_search(self.free, x)

    def speed_of(self, x: FloatArray, i: int) -> float:
        """Return the cam speed (rad/s) of steady-speed segment ``i``.

        It is corrected by its fitted error in the search variables ``x``.
        """
        segment = self.segments[i].line
        return segment.speed + float(x[self.instruments.speeds][i]) * segment.speed_error

    def steady(
        self, x: FloatArray, i: int, near: PeriodicTurn | None = None
    ) -> PeriodicTurn | None:
        """Return the periodic turn at the speed of a segment, or None if no turn repeats.

        A segment is a time of steady cam speed, and ``i`` is its index. A follower that chatters
        has no periodic turn. ``x`` are the search variables. ``near`` is a turn of nearly the same
        follower, from which the solution starts.
        """
        follower, speed = build_follower(self.values(x), self.stem_stiffness), self.speed_of(x, i)
        try:
            if isinstance(follower, FollowerParameters):
                return one_mass_turn(self.law, follower, speed)
            near = near if isinstance(near, TwoMassTurn) else None
            return two_mass_turn(self.law, follower, speed, near)
        except EndlessEventsError:
            return None

    def predicted(
        self, x: FloatArray, i: int, near: PeriodicTurn | None = None
    ) -> PredictedSegment | None:
        """Return computed lift and force of a segment, or None without a periodic turn.

        A segment is a time of steady cam speed, and ``i`` is its index. ``x`` are the search
        variables. ``near`` is a turn of nearly the same follower, from which the solution starts.
        """
        turn = self.steady(x, i, near)
        if turn is None:
            return None
        measured = self.samples(i)
        angles = [self.angles(x, i, part.since) for part in measured]
        lift = turn.evaluate(angles[0])[0] + self.single(x, ZERO)
        if (backlash := self.single(x, BACKLASH)) != 0.0:
            lift = lift - 0.5 * backlash * backlash_side(self.law, angles[0])
        values = lift, self._sensed(x, turn, i)(angles[1])
        signals = (
            PredictedSignal(angle, value, value - part.value)
            for angle, value, part in zip(angles, values, measured, strict=True)
        )
        return PredictedSegment(turn, *signals)

    def _sensed(
        self, x: FloatArray, turn: PeriodicTurn, i: int
    ) -> Callable[[FloatArray], FloatArray]:
        """Return a function for the force (N) that the sensor shows, by cam angle (rad).

        It includes the zero offset and the resonance of the sensor, if they are free. ``turn`` is
        the periodic turn of segment ``i``.
        """
        zero = self.single(x, FORCE_ZERO)
        if not self.resonance:
            return lambda angle: turn.evaluate(angle)[1] + zero
        frequency = float(np.exp(self.single(x, RESONANCE)))
        response = sensor_response(turn, self.speed_of(x, i), frequency, self.single(x, RATIO))
        return lambda angle: response(angle) + zero

    def angles(self, x: FloatArray, i: int, since: FloatArray) -> FloatArray:
        """Return the cam angles (rad) of segment ``i`` at times ``since`` its middle (s).

        A segment is a time of steady cam speed. The angles include the fitted phase, speed error
        and clock error in the search variables ``x``.
        """
        clock = PPM * self.single(x, CLOCK)
        begin = self.segments[i].angle + float(x[self.instruments.phases][i])
        return np.asarray(begin + self.speed_of(x, i) * (1.0 + clock) * since)

    def residuals(self, x: FloatArray) -> FloatArray:
        """Return all residuals in standard deviations, ``(m,)``.

        They are lift and force of each steady-speed segment, then one speed error per segment.
        Samples of a segment without a periodic turn have the residual `NO_TURN_RESIDUAL`.
        """
        blocks = list[FloatArray]()
        for i in range(len(self.segments)):
            predicted = self.predicted(x, i)
            if predicted is None:
                blocks.append(np.full(sum(self.sizes(i)), NO_TURN_RESIDUAL))
            else:
                blocks.append(predicted.lift.residual / self.lift_noise)
                blocks.append(predicted.force.residual / self.force_deviation(i))
        return np.concatenate([*blocks, x[self.instruments.speeds]])

    def jacobian(self, x: FloatArray) -> FloatArray:
        """Return the derivatives of the residuals by the search variables, ``(m, n)``.

        The rows are in the order of `residuals`.
        """
        blocks = [self._segment_jacobian(x, i) for i in range(len(self.segments))]
        last = np.zeros((len(self.segments), x.size))
        last[:, self.instruments.speeds] = np.eye(len(self.segments))
        return np.vstack([*blocks, last])

    def _segment_jacobian(self, x: FloatArray, i: int) -> FloatArray:
        """Return the derivatives of the residuals at one steady speed, ``(k, n)``.

        They are those of the k residuals of steady-speed segment ``i`` by the n search variables
        ``x``. They are zero if the follower has no periodic turn at this speed.
        """
        base, instruments = self.predicted(x, i), self.instruments
        lifts, forces = self.sizes(i)
        out = np.zeros((lifts + forces, x.size))
        if base is None:
            return out
        for k in (*range(instruments.first), instruments.speeds.start + i):
            scale = search_scale(self.free[k], float(x[k])) if k < len(self.free) else SPEED_SCALE
            step = RELATIVE_STEP * scale
            changed = self.predicted(x + step * (np.arange(x.size) == k), i, base.turn)
            if changed is not None:
                out[:lifts, k] = (changed.lift.value - base.lift.value) / step
                out[lifts:, k] = (changed.force.value - base.force.value) / step
        by_angle = self._by_angle(x, i, base)
        out[:, instruments.phases.start + i] = by_angle
        since = np.concatenate([part.since for part in self.samples(i)])
        for name, index in instruments.index.items():
            if name == CLOCK:
                out[:, index] = by_angle * self.speed_of(x, i) * since * PPM
            elif name == ZERO:
                out[:lifts, index] = 1.0
            elif name == BACKLASH:
                out[:lifts, index] = -0.5 * backlash_side(self.law, base.lift.angle)
            elif name == FORCE_ZERO:
                out[lifts:, index] = 1.0
            else:
                changed = x + RELATIVE_STEP * (np.arange(x.size) == index)
                force = self._sensed(changed, base.turn, i)(base.force.angle)
                out[lifts:, index] = (force - base.force.value) / RELATIVE_STEP
        out[:lifts] /= self.lift_noise
        out[lifts:] /= self.force_deviation(i)[:, None]
        return out

    def _by_angle(self, x: FloatArray, i: int, base: PredictedSegment) -> FloatArray:
        """Return the derivatives of a segment's lift and force by the cam angle, ``(k,)``.

        A segment is a time of steady cam speed. The derivatives are central differences at the
        samples of lift (m/rad), then of force (N/rad). ``x`` are the search variables, ``i`` is the
        index of the segment, and ``base`` its computed lift and force.
        """
        sensed = self._sensed(x, base.turn, i)
        steps = (ANGLE_STEP, -ANGLE_STEP)
        lift = [base.turn.evaluate(base.lift.angle + step)[0] for step in steps]
        force = [sensed(base.force.angle + step) for step in steps]
        return np.concatenate(
            [(after - before) / (2.0 * ANGLE_STEP) for after, before in (lift, force)]
        )

    def start(self, values: dict[str, float], phase: float, zero: float) -> FloatArray:
        """Return the search variables for given parameter values, ``(n,)``.

        ``values`` are in SI by name. ``phase`` (rad) is that of all steady-speed segments, ``zero``
        the zero of the lift (m). The other instrument errors are 0.
        """
        instruments = self.instruments
        x = np.zeros(instruments.size)
        x[: instruments.first] = [to_search(name, values[name]) for name in self.free]
        x[instruments.phases] = phase
        if ZERO in instruments.index:
            x[instruments.index[ZERO]] = zero
        return x

    def exclude_landings(self, x: FloatArray, guard: float) -> bool:
        """Exclude the force samples next to landings, where the force jumps.

        ``guard`` is the excluded distance in rad on both sides of a landing. Later landings of a
        series of bounces have a larger distance. Returns True if the set of included samples
        changed.
        """
        before, self.force_masks, self.pressing = self.force_masks, [], []
        for i, segment in enumerate(self.segments):
            turn, angle = self.steady(x, i), self.angles(x, i, segment.force.since)
            self.force_masks.append(self._landing_errors(turn, angle, guard) == 0.0)
            pressing = np.zeros(angle.size) if turn is None else np.abs(turn.evaluate(angle)[1])
            self.pressing.append(pressing)
        return any((a != b).any() for a, b in zip(before, self.force_masks, strict=True))

    def _landing_errors(
        self, turn: PeriodicTurn | None, angle: FloatArray, guard: float
    ) -> FloatArray:
        """Return the possible error (rad) of the landing next to each cam angle, ``(n,)``.

        It is ``guard`` for the first landing of a series of bounces, and larger for the later ones.
        It is 0 at angles that are not within this distance of a landing. ``turn`` is None without a
        periodic turn.
        """
        errors = np.zeros(angle.size)
        for landing, first in () if self.resonance else list_bounces(turn):
            width = guard + BOUNCE_ANGLE_FRACTION * (landing - first)
            inside = ~_outside(angle, landing - width, landing + width)
            errors[inside] = np.maximum(errors[inside], width)
        return errors

    def landing_errors(self, x: FloatArray, i: int, guard: float) -> FloatArray:
        """Return the possible error (rad) of the landing next to each force sample.

        The result has the shape ``(n,)`` for all samples of segment ``i``. It is 0 for samples that
        are not next to a landing. ``guard`` (rad) is the error of the first landing of a series of
        bounces.
        """
        return self._landing_errors(
            self.steady(x, i), self.angles(x, i, self.segments[i].force.since), guard
        )

    def force_range_near(
        self, x: FloatArray, i: int, samples: NDArray[np.intp], width: FloatArray
    ) -> FloatArray:
        """Return the smallest and largest computed force near force samples, ``(2, n)``.

        The range covers cam angles within ``width`` (rad) of each sample. ``samples`` are indices
        into segment ``i``. Without a periodic turn the range is -inf to inf.
        """
        turn = self.steady(x, i)
        if turn is None:
            return np.array([[-np.inf], [np.inf]]) * np.ones(samples.size)
        angle = self.angles(x, i, self.segments[i].force.since[samples])
        nearby = angle + width * np.linspace(-1.0, 1.0, FORCE_POINTS)[:, None]
        forces = self._sensed(x, turn, i)(nearby.ravel()).reshape(nearby.shape)
        return np.stack([forces.min(axis=0), forces.max(axis=0)])

    def without_landings(self, x: FloatArray, guard: float) -> Likelihood:
        """Return a copy of the likelihood without the samples during series of bounces.

        Lift and force samples are removed from ``guard`` (rad) before the first landing of a series
        to the end of its bounces. After that the follower is on the cam again, and its motion does
        not depend on the landings. ``x`` are the search variables.
        """
        segments = tuple(
            self._segment_without_landings(x, i, guard) for i in range(len(self.segments))
        )
        return replace(self, segments=segments, force_masks=[], pressing=[])

    def _segment_without_landings(self, x: FloatArray, i: int, guard: float) -> MeasuredSegment:
        """Return steady-speed segment ``i`` without lift and force samples in bounces.

        ``x`` are the search variables, and ``guard`` (rad) is the distance before a landing from
        which samples are removed.
        """
        segment, bounces = self.segments[i], list_bounces(self.steady(x, i))
        parts = []
        for part in (segment.lift, segment.force):
            angle = self.angles(x, i, part.since)
            clear = np.ones(angle.size, dtype=bool)
            for landing, first in bounces:
                clear &= _outside(
                    angle,
                    first - guard,
                    landing + guard + BOUNCE_ANGLE_FRACTION * (landing - first),
                )
            parts.append(part.where(clear))
        return replace(segment, lift=parts[0], force=parts[1])


def _outside(angle: FloatArray, low: float, high: float) -> NDArray[np.bool_]:
    """Return a mask of the cam angles (rad) outside the range ``low`` to ``high``.

    Angles that differ by whole turns count as equal.
    """
    return np.asarray(np.mod(angle - low, TURN) > high - low)

"""The two signed quantities whose zeros are the two-mass model's events: force and gap."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cam_rig.dynamics.exponential import FreeOutput, free_motion
from cam_rig.dynamics.linear import Run
from cam_rig.dynamics.scan import first_negative
from cam_rig.dynamics.two_mass import TwoMassParameters, contact_response, force_output
from cam_rig.dynamics.uniform import polynomial_part
from cam_rig.laws import TURN, Law, bernstein
from cam_rig.laws.bernstein import EPS, FloatArray
from cam_rig.laws.law import Scalar

#: A gap or a force this many rounding errors below zero is below zero.
ROUNDING_ERRORS = 64.0
#: Fewest grid points of a scan over one turn: the slow part of force and gap.
LEAST_PER_TURN = 512


@dataclass(frozen=True, eq=False)
class _Force:
    """The contact force in one part of a turn: its polynomial and the vibration's share."""

    ordinates: FloatArray
    length: float
    local: float
    free: FreeOutput

    def many(self, times: FloatArray) -> FloatArray:
        forced = bernstein.evaluate(self.ordinates, (self.local + times) / self.length)
        return np.asarray(forced + self.free.many(times))

    def one(self, time: float) -> float:
        return self._forced((self.local + time) / self.length) + self.free.one(time)

    @cached_property
    def _forced(self) -> Scalar:
        return bernstein.scalar(self.ordinates)


@dataclass(frozen=True, eq=False)
class _Gap:
    """Roller less cam in flight, m; ``angle`` (rad) and ``speed`` (rad/s) at time 0."""

    law: Law
    angle: float
    speed: float
    roller: FreeOutput
    rest: float

    def many(self, times: FloatArray) -> FloatArray:
        return np.asarray(
            self.roller.many(times) + self.rest - self.law(self.angle + self.speed * times)
        )

    def one(self, time: float) -> float:
        place = self.roller.one(time) + self.rest
        return place - self.law.lift_at(self.angle + self.speed * time)


def roller_motion(parameters: TwoMassParameters, state: FloatArray) -> FreeOutput:
    """Z of the flight after ``state`` (z, ż, y, ẏ), less `TwoMassParameters.roller_rest`."""
    p = parameters
    return FreeOutput(p.inner_matrix, p.roller_row, p.to_inner(state))


def fly(parameters: TwoMassParameters, state: FloatArray, times: FloatArray) -> FloatArray:
    """(z, ż, y, ẏ) of free motion at times (s) after ``state``, ``(4, len(times))``."""
    inner = free_motion(parameters.inner_matrix, parameters.to_inner(state), times)
    return parameters.from_inner(inner)


def lift_off(
    law: Law,
    parameters: TwoMassParameters,
    speed: float,
    angle: float,
    state: FloatArray,
    limit: float,
) -> tuple[float, FloatArray] | None:
    """Time (s) after which the contact force is negative, and (η, η̇) then.

    None when not within ``limit``; ``state`` is (η, η̇) at cam angle ``angle`` (rad).
    """
    response = contact_response(law, parameters, speed)
    for run in response.walk(state, angle, limit):
        found = _force_root(law, parameters, speed, run)
        if found is not None:
            at = np.array([found])
            vibration = run.part.forced(run.local + at)
            return run.begin + found, (vibration + free_motion(response.matrix, run.free, at))[:, 0]
    return None


def _force_root(law: Law, p: TwoMassParameters, speed: float, run: Run) -> float | None:
    response, output, part = contact_response(law, p, speed), force_output(p), run.part
    ordinates = polynomial_part(response, part, output)[0][0]
    rate = p.stiffness / p.end_mass
    energy = rate * run.free[0] ** 2 + run.free[1] ** 2
    vibration = (p.stem_stiffness / math.sqrt(rate) + p.stem_damping) * math.sqrt(energy)
    if ordinates.min() > vibration:  # the vibration cannot lift it: no need to look
        return None
    rounding = ROUNDING_ERRORS * EPS * float(np.abs(ordinates).max())
    free = FreeOutput(response.matrix, output.state[0], run.free)
    force = _Force(ordinates, part.length, run.local, free)
    if force.one(0.0) <= -rounding:
        return 0.0
    span = run.end - run.begin
    return first_negative(force, rounding, span, math.sqrt(rate), _least(span, speed))


def gap_rounding(law: Law, p: TwoMassParameters, state: FloatArray, reach: float) -> float:
    """Bound (m) on the error of a gap in a flight from ``state``, up to angle ``reach`` (rad).

    The roller's place is reckoned from where it would rest without the cam, which a weak spring
    puts far away.
    """
    largest, steepest, _ = law.bounds
    places = float(np.abs(state[[0, 2]]).max()) + 2.0 * abs(p.roller_rest)
    size = largest + places + (reach + TURN) * steepest
    return ROUNDING_ERRORS * EPS * size + law.largest_step


def landing(
    law: Law,
    parameters: TwoMassParameters,
    speed: float,
    angle: float,
    state: FloatArray,
    limit: float,
) -> tuple[float, FloatArray] | None:
    """Time (s) at which the roller meets the cam, and (z, ż, y, ẏ) then.

    None when not within ``limit``; ``state`` is (z, ż, y, ẏ) at cam angle ``angle`` (rad). A roller
    below the cam meets it at once.
    """
    rounding = gap_rounding(law, parameters, state, abs(angle) + speed * limit)
    gap = _Gap(law, angle, speed, roller_motion(parameters, state), parameters.roller_rest)
    if gap.one(0.0) <= -rounding:
        return 0.0, state
    found = first_negative(gap, rounding, limit, parameters.fastest_rate, _least(limit, speed))
    return None if found is None else (found, fly(parameters, state, np.array([found]))[:, 0])


def _least(span: float, speed: float) -> int:
    return 8 + int(LEAST_PER_TURN * span * speed / TURN)

"""What ends a phase of the two-mass model: the contact force falls to zero, or the gap does."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray
from cam_rig.dynamics.landing import Approach, Gap
from cam_rig.dynamics.linear.free_system import REACH, SERIES_DEGREE, Flight, bernstein_from_powers
from cam_rig.dynamics.linear.matrix_exponential import free_motion
from cam_rig.dynamics.linear.response import LinearResponse, LinearRun
from cam_rig.dynamics.linear.sampling import polynomial_part, polynomial_parts
from cam_rig.dynamics.root_scan import TOGETHER, clear_cells, fall, step
from cam_rig.dynamics.two_mass.flight import free_masses, from_inner, to_inner
from cam_rig.dynamics.two_mass.parameters import TwoMassParameters, contact_response, force_output
from cam_rig.laws import Law, bernstein
from cam_rig.laws.bernstein import EPS
from cam_rig.laws.law import Scalar
from cam_rig.units import TURN

#: A force this many rounding errors below zero is below zero.
ROUNDING_ERRORS = 64.0
#: A look at the force takes steps of this part of a window at least.
MIN_STEP = 1.0 / 16.0


@dataclass(frozen=True, eq=False)
class _Force:
    """The contact force in one part of a turn: its polynomial and the vibration's share.

    ``ordinates`` on the whole part of ``length`` s, of which ``local`` s are over at time 0;
    ``row`` is what the vibration ``start`` (η, η̇) and ``matrix`` contribute.
    """

    ordinates: FloatArray
    length: float
    local: float
    matrix: FloatArray
    row: FloatArray
    start: FloatArray

    def run(self, limit: float, noise: float) -> float | None:
        """Time (s) of the zero after which the force is below −``noise``, None up to ``limit``."""
        begin = self._above_until(0.0, limit, noise)
        while begin < limit:
            end = min(begin + self._window, limit)
            at = fall(self._series(begin, end), noise)
            if at is not None:
                return begin + at * (end - begin)
            begin = self._above_until(end, limit, noise)
        return None

    @property
    def _window(self) -> float:
        """Time (s) within which the vibration's series is exact to rounding."""
        return REACH / (math.sqrt(-self.matrix[1, 0]) - float(self.matrix[1, 1]))

    def _series(self, begin: float, end: float) -> FloatArray:
        """Bernstein ordinates of the force on [begin, end], no longer than a window."""
        length = end - begin
        power, terms = self._free(np.array([begin]))[:, 0], []
        for j in range(SERIES_DEGREE + 1):
            terms.append(self.row @ power)
            power = self.matrix @ power * (length / (j + 1))
        free = bernstein_from_powers(SERIES_DEGREE) @ np.array(terms)
        first, last = ((self.local + t) / self.length for t in (begin, end))
        first = min(first, 1.0 - 1e-16)
        forced = bernstein.restrict(self.ordinates, first, min(max(first, last), 1.0))
        degree = max(free.size, forced.size) - 1
        return bernstein.elevate(free, degree) + bernstein.elevate(forced, degree)

    def _above_until(self, begin: float, limit: float, noise: float) -> float:
        """Time from ``begin`` on up to which steps prove that the force is above ``noise``."""
        while begin < limit:
            free = self._free(np.array([begin]))[:, 0]
            bend = self._forced_bend + self._largest_bend(free)
            value = self._forced((self.local + begin) / self.length) + float(self.row @ free)
            wide = min(step(value, bend, MIN_STEP * self._window), limit)
            times = np.minimum(begin + wide * np.arange(TOGETHER + 1), limit)
            times = times[: np.argmax(times) + 1]
            bends = np.full(times.size - 1, bend)
            clear = clear_cells(times, self._many(times), bends, noise)
            begin = float(times[clear])
            if clear < times.size - 1:
                break
        return begin

    @cached_property
    def _forced(self) -> Scalar:
        return bernstein.scalar(self.ordinates)

    @cached_property
    def _forced_bend(self) -> float:
        """What the polynomial's share of |F̈| does not exceed, N/s²."""
        bend = bernstein.derivative(bernstein.derivative(self.ordinates))
        return float(np.abs(bend).max()) / self.length**2

    def _largest_bend(self, free: FloatArray) -> float:
        """What the vibration's share of |F̈| does not exceed after (η, η̇): energy does not grow."""
        a, b = self.matrix @ self.matrix @ free
        rate = math.sqrt(-self.matrix[1, 0])
        energy = math.hypot(rate * float(a), float(b))
        return energy * (abs(float(self.row[0])) / rate + abs(float(self.row[1])))

    def _free(self, times: FloatArray) -> FloatArray:
        return free_motion(self.matrix, self.start, times)

    def _many(self, times: FloatArray) -> FloatArray:
        forced = bernstein.evaluate(self.ordinates, (self.local + times) / self.length)
        return np.asarray(forced + self.row @ self._free(times))


def fly(parameters: TwoMassParameters, state: FloatArray, times: FloatArray) -> FloatArray:
    """(z, ż, y, ẏ) of free motion at times (s) after ``state``, ``(4, len(times))``."""
    start = to_inner(parameters, state)
    way, _ = free_masses(parameters).moved(start, times)
    return from_inner(parameters, start[:, None] + way)


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


def first_lift_off(
    law: Law, parameters: TwoMassParameters, speed: float, state: FloatArray, limit: float
) -> float | None:
    """Time (s) of the first lift-off of a run from θ = 0 on, None when not within ``limit``.

    As `lift_off`, but all parts of all turns are bounded at once, and the root is sought only in
    those that the bound leaves.
    """
    response = contact_response(law, parameters, speed)
    turns = max(1, math.ceil(limit * speed / TURN))
    free = response.free_starts(state, turns)
    for turn, i in np.argwhere(may_fall(response, parameters, free)).tolist():
        part = response.parts[i]
        begin = (turn * TURN + part.low) / speed
        run = LinearRun(part, begin, min(begin + part.length, limit), 0.0, free[turn, i])
        if begin < limit:
            found = _force_root(law, parameters, speed, run)
            if found is not None:
                return begin + found
    return None


def may_fall(
    response: LinearResponse, parameters: TwoMassParameters, free: FloatArray
) -> NDArray[np.bool_]:
    """Whether the force may fall to zero in each part of each turn, ``(turns, parts)``.

    It is no lower than at the lower end of a part less what a curve of so much bend may sag, nor
    than the polynomial's least ordinate less the vibration, whose energy does not grow.
    """
    output, matrix = force_output(parameters), response.matrix
    ordinates = polynomial_parts(response, output)
    width = max(rows.shape[1] for rows in ordinates)
    forced = np.stack([bernstein.elevate(rows[0], width - 1) for rows in ordinates])
    lengths = np.array([part.length for part in response.parts])
    change = np.abs(np.diff(forced, n=2, axis=1)).max(axis=1)
    bend = (width - 1) * (width - 2) * change / lengths**2
    row, rate = output.state[0], math.sqrt(-matrix[1, 0])
    reach = abs(float(row[0])) / rate + abs(float(row[1]))
    flows = np.stack([part.flow for part in response.parts])
    ends = np.einsum("pij,tpj->tpi", flows, free)
    acceleration = free @ (matrix @ matrix).T
    bend = bend + reach * np.hypot(rate * acceleration[..., 0], acceleration[..., 1])
    vibration = reach * np.hypot(rate * free[..., 0], free[..., 1])
    lower = np.minimum(forced[:, 0] + free @ row, forced[:, -1] + ends @ row)
    noise = ROUNDING_ERRORS * EPS * np.abs(forced).max(axis=1)
    above = np.maximum(lower - bend * lengths**2 / 8.0, forced.min(axis=1) - vibration)
    return np.asarray(above <= noise)


def _force_root(law: Law, p: TwoMassParameters, speed: float, run: LinearRun) -> float | None:
    response, output, part = contact_response(law, p, speed), force_output(p), run.part
    ordinates = polynomial_part(response, part, output)[0]
    rate = p.stiffness / p.end_mass
    energy = rate * run.free[0] ** 2 + run.free[1] ** 2
    vibration = (p.stem_stiffness / math.sqrt(rate) + p.stem_damping) * math.sqrt(energy)
    if ordinates.min() > vibration:  # the vibration cannot lift it: no need to look
        return None
    rounding = ROUNDING_ERRORS * EPS * float(np.abs(ordinates).max())
    row = output.state[0]
    force = _Force(ordinates, part.length, run.local, response.matrix, row, run.free)
    return force.run(run.end - run.begin, rounding)


def force_noise(law: Law, p: TwoMassParameters, speed: float) -> float:
    """By how much the roller's acceleration may be wrong where the force falls to zero, m/s²."""
    lift, slope, bend = law.bounds
    force = p.roller_mass * (speed**2 * bend) + p.share * p.preload
    force += p.spring_stiffness * lift + (p.stem_damping + p.damping) * speed * slope
    return ROUNDING_ERRORS * EPS * force / p.roller_mass


def landing(
    law: Law,
    parameters: TwoMassParameters,
    speed: float,
    angle: float,
    flight: Flight,
    limit: float,
) -> Gap:
    """Where the roller meets the cam after a flight's beginning at cam angle ``angle`` (rad).

    A roller below the cam meets it at once; ``landed`` is False for one in the air at ``limit`` s.
    """
    noise = force_noise(law, parameters, speed)
    return Approach(flight, law, angle, speed, noise).run(limit)

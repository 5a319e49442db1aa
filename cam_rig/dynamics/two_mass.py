"""The two-mass follower (eq. 14-19): in contact, at lift-off, in flight and landing.

A landing stops the roller mass on the cam (ż := ṡ, the paper's plastic re-contact) or rebounds with
Newton's restitution; the end mass goes on with the velocity it had. The same holds where the law's
velocity jumps: up is an impact on the roller mass, m₁ (1 + e) ω Δs', down lifts it off with the
velocity it had.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics.events.backend import dispatch
from cam_rig.dynamics.events.contact import find_loss_in_part
from cam_rig.dynamics.events.run_table import LOSS, CamWeights, RunTable
from cam_rig.dynamics.events.trajectory import ROUNDING_ERRORS, Phase, Trajectory, contact_table
from cam_rig.dynamics.free_masses import (
    TwoMassParameters,
    contact_response,
    force_output,
    free_masses,
    from_inner,
    to_inner,
)
from cam_rig.dynamics.interval import Block, FollowerState, Interval
from cam_rig.dynamics.linear.exponential import Flight
from cam_rig.dynamics.linear.response import LinearResponse, polynomial_parts, sample
from cam_rig.dynamics.parameters import require_angle, require_number, state_of, times_of, told
from cam_rig.dynamics.speed_ramp import with_ramps
from cam_rig.dynamics.velocity_jumps import short_of_velocity_jump
from cam_rig.laws import Law, bernstein
from cam_rig.laws.bernstein import EPS
from cam_rig.laws.sampling import sample as sample_law
from cam_rig.units import TURN, FloatArray


def first_lift_off(
    law: Law, parameters: TwoMassParameters, speed: float, state: FloatArray, limit: float
) -> float | None:
    """Time (s) of the first lift-off of a run from (η, η̇) at θ = 0; None if not within ``limit``.

    All parts of all turns are bounded at once, and the force's zero is sought only in those that
    the bound leaves.
    """
    response, output = contact_response(law, parameters, speed), force_output(parameters)
    turns = max(1, math.ceil(limit * response.speed / TURN))
    free = response.free_starts(state, turns)
    for turn, i in np.argwhere(may_fall(response, parameters, free)).tolist():
        part = response.parts[i]
        begin = (turn * TURN + part.low) / response.speed
        left = min(part.length, limit - begin)
        if left <= 0.0:
            break
        table = contact_table(response, output, part)
        loss = float(dispatch(find_loss_in_part, table, *free[turn, i].tolist(), float(left)))
        if loss < math.inf:
            return begin + loss
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


def force_noise(law: Law, p: TwoMassParameters, speed: float) -> float:
    """By how much the roller's acceleration may be wrong where the force falls to zero, m/s²."""
    lift, slope, bend = law.bounds
    force = p.roller_mass * (speed**2 * bend) + p.share * p.preload
    force += p.spring_stiffness * lift + (p.stem_damping + p.damping) * speed * slope
    return ROUNDING_ERRORS * EPS * force / p.roller_mass


class Separation(Trajectory):
    """The trajectory of two masses on one law at one speed (rad/s), from a cam angle (rad) on."""

    max_events = 20_000

    def __init__(
        self,
        law: Law,
        parameters: TwoMassParameters,
        speed: float,
        angle: float = 0.0,
        turns: int = 0,
    ) -> None:
        require_angle(angle)
        self.response: LinearResponse = contact_response(law, parameters, speed)
        system = free_masses(parameters)
        super().__init__(law, system, self.response.speed, float(angle), turns)
        self.parameters = parameters
        self._force = force_output(parameters)

    def run(self, duration: float, state: FloatArray | None = None, contact: bool = True) -> None:
        """Find all phases and events up to ``duration`` s, from rest on the cam by default.

        From rest is without vibration (η = η̇ = 0): the end mass goes with the turning cam.
        ``state`` is (η, η̇) in contact, else (z, ż, y, ẏ).
        """
        start: FloatArray | Flight = np.zeros(2)
        if state is not None:
            start = state_of(state, 2 if contact else 4)
            start = start if contact else Flight(self.system, to_inner(self.parameters, start))
        self.run_from(duration, start)

    def run_from(self, duration: float, start: FloatArray | Flight, step: float = 0.0) -> None:
        """The same from (η, η̇) or a flight, where ṡ has gained ``step`` m/s."""
        require_number("duration", duration, "> 0")
        require_angle(self.angle + self.speed * duration, "angle at the end")
        begun = self._begin(start if isinstance(start, Flight) else state_of(start, 2), step)
        self._find(self.run_table(float(duration)), begun, float(duration))

    def run_table(self, duration: float) -> RunTable:
        """Return the table of a run of ``duration`` s."""
        p, output = self.parameters, self._force
        drive, weights = self.response.drive[1].tolist(), output.law[0].tolist()
        return self._table(
            duration,
            mass=float(p.roller_mass),
            force=CamWeights._make((*weights, float(output.constant[0]))),
            losses=np.zeros(0, LOSS),
            has_stem=True,
            contact=contact_table(self.response, output),
            drive=CamWeights._make((*drive, 0.0)),
            end_share=float(p.end_mass / (p.roller_mass + p.end_mass)),
            spring_share=float(p.spring_stiffness / p.stiffness),
            preload_compression=float(p.preload / p.stiffness),
            restitution=float(told("restitution", p.restitution)),
            acceleration_rounding=float(force_noise(self.law, p, self.speed)),
        )

    def fly(self, flight: Flight, times: FloatArray) -> FloatArray:
        """(z, ż, y, ẏ) at times (s) of a flight, ``(4, len(times))``."""
        way, _ = self.system.moved(flight.start, times)
        return from_inner(self.parameters, flight.start[:, None] + way)

    def cam(self, time: FloatArray) -> FloatArray:
        """S, ṡ and s̈ at times in s, ``(3, len(time))``."""
        angle = self.angle + self.speed * time
        return self.law.motion_at(angle) * (self.speed ** np.arange(3.0))[:, None]

    def force(self, state: FloatArray, cam: FloatArray) -> FloatArray:
        """Contact force (N) of vibrations (η, η̇), ``(2, n)``, where the cam is at ``(3, n)``."""
        out = self._force
        return np.asarray((out.state @ state + out.law @ cam + out.constant[:, None])[0])

    def end(self, duration: float) -> FollowerState:
        """The follower where an interval ends, before a velocity jump that begins the next one."""
        if isinstance(self.last, Flight):
            z, v, _, _ = self.fly(self.last, np.zeros(1))[:, 0].tolist()
            inner = (*self.last.start.tolist(), *self.last.known)
            return FollowerState(z, v, 0.0, False, inner=inner)
        angle = short_of_velocity_jump(self.law, self.angle + self.speed * duration)
        s, slope, bend = self.law.at(angle)
        cam = np.array([s, slope * self.speed, bend * self.speed**2])
        force = float(self.force(self.last[:, None], cam[:, None])[0])
        return FollowerState(s, float(cam[1]), force, True, inner=tuple(self.last.tolist()))


def states(trajectory: Separation, times: FloatArray) -> FloatArray:
    """(z, ż, y, ẏ, F) at ascending times in s of a trajectory, ``(5, len(times))``."""
    end = trajectory.phases[-1].end if trajectory.phases else 0.0
    times = times_of(times, last=end * (1.0 + 1e-12))
    out = np.empty((5, times.size))
    for phase in trajectory.phases:
        last = phase is trajectory.phases[-1]
        a = int(np.searchsorted(times, phase.begin))
        b = times.size if last else int(np.searchsorted(times, phase.end))
        if a < b:
            out[:, a:b] = phase_states(trajectory, phase, times[a:b])
    return out


def phase_states(trajectory: Separation, phase: Phase, times: FloatArray) -> FloatArray:
    """The same in one phase."""
    if phase.flight is not None:
        flight = trajectory.fly(phase.flight, times - phase.begin)
        return np.vstack([flight, np.zeros(times.size)])
    angle = trajectory.angle + trajectory.speed * phase.begin
    vibration = trajectory.response.states(phase.vibration, angle, times - phase.begin)
    cam = trajectory.cam(times)
    end_mass = trajectory.parameters.static_place(cam) + vibration
    return np.vstack([cam[:2], end_mass, trajectory.force(vibration, cam)])


@with_ramps
def advance(
    law: Law,
    parameters: TwoMassParameters,
    state: FollowerState | None,
    interval: Interval,
    sample_rate: int,
    step: float,
) -> tuple[FollowerState, Block]:
    """The same of two masses; the block's motion is that of the roller mass, on the cam."""
    trajectory = Separation(law, parameters, interval.speed, interval.angle, interval.turns)
    start: FloatArray | Flight = np.zeros(2)
    if state is not None:
        inner = np.array(state.inner)
        start = (
            inner if state.in_contact else Flight(trajectory.system, inner[:4], *state.inner[4:])
        )
    trajectory.run_from(interval.duration, start, step)
    grid = interval.grid(sample_rate)
    block = Block(interval, grid.open_rows())
    block.rows[1:5] = 0.0
    for phase in trajectory.phases:
        if phase.flight is None and (within := grid.within(phase.begin, phase.end)):
            _show_contact(block, *within, sample_rate, trajectory, phase)
    return trajectory.finish(block, grid, state, trajectory.end(interval.duration))


def _show_contact(
    block: Block,
    here: slice,
    times: FloatArray,
    sample_rate: int,
    trajectory: Separation,
    phase: Phase,
) -> None:
    first, count, apart = float(times[0]), times.size, 1.0 / sample_rate
    block.motion[:, here] = sample_law(
        trajectory.law,
        trajectory.angle + trajectory.speed * first,
        trajectory.speed / sample_rate,
        count,
        np.diag(trajectory.speed ** np.arange(3.0)),
        np.zeros(3),
    )
    angle, since = trajectory.angle + trajectory.speed * phase.begin, first - phase.begin
    out = force_output(trajectory.parameters)
    block.force[here] = sample(
        trajectory.response, phase.vibration, angle, since, apart, count, out
    )[0]

"""Model `two_mass`: a follower of a roller mass and an end mass (paper, eq. 14-19).

The roller mass (contact mass) is on the cam, and the end mass is at the other end of an elastic
stem, on the closing spring. A landing stops the roller mass on the cam (ż := ṡ, the plastic
re-contact of the paper), or the roller mass rebounds with Newton's restitution e. The velocity of
the end mass does not change.

A velocity jump Δs' > 0 of the law is an impact on the roller mass, m₁ (1 + e) ω Δs'. A jump Δs' < 0
lifts the roller mass off with the velocity it has.
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
from cam_rig.dynamics.parameters import (
    check_state,
    check_times,
    require_angle,
    require_number,
    require_parameter,
)
from cam_rig.dynamics.speed_ramp import with_ramps
from cam_rig.dynamics.velocity_jumps import step_before_velocity_jump
from cam_rig.laws import Law, bernstein
from cam_rig.laws.bernstein import EPS
from cam_rig.laws.sampling import sample as sample_law
from cam_rig.units import TURN, FloatArray


def first_lift_off(
    law: Law, parameters: TwoMassParameters, speed: float, state: FloatArray, limit: float
) -> float | None:
    """Return the time (s) of the first lift-off, or None if later than ``limit`` (s).

    The run starts at cam angle 0 in contact, with the vibration ``state`` (η, η̇) of the end mass.
    The cam turns at ``speed`` rad/s. A lower bound of the contact force is computed for all parts
    of all turns at once. The zero of the force is searched for only in parts whose bound is not
    positive.
    """
    response, output = contact_response(law, parameters, speed), force_output(parameters)
    turns = max(1, math.ceil(limit * response.speed / TURN))
    free = response.free_starts(state, turns)
    for turn, i in np.argwhere(may_lose_contact(response, parameters, free)).tolist():
        part = response.parts[i]
        start = (turn * TURN + part.low) / response.speed
        duration = min(part.length, limit - start)
        if duration <= 0.0:
            break
        table = contact_table(response, output, part)
        loss = float(dispatch(find_loss_in_part, table, *free[turn, i].tolist(), float(duration)))
        if loss < math.inf:
            return start + loss
    return None


def may_lose_contact(
    response: LinearResponse, parameters: TwoMassParameters, free: FloatArray
) -> NDArray[np.bool_]:
    """Return a mask of the parts of the turn in which contact may be lost.

    It is True if the contact force may reach zero in a part, and has one element per part of each
    turn, ``(turns, parts)``. ``free`` is the free vibration (η, η̇) at the start of each part,
    ``(turns, parts, 2)``. The force has two lower bounds, and the larger one counts:

    - the smaller force at the ends of the part, less max |F̈| T²/8 for a part of T s
    - the smallest ordinate of the polynomial part of the force, less the share of the free
      vibration, whose energy does not grow
    """
    output, matrix = force_output(parameters), response.matrix
    ordinates = polynomial_parts(response, output)
    width = max(rows.shape[1] for rows in ordinates)
    forced = np.stack([bernstein.elevate(rows[0], width - 1) for rows in ordinates])
    lengths = np.array([part.length for part in response.parts])
    change = np.abs(np.diff(forced, n=2, axis=1)).max(axis=1)
    curvature = (width - 1) * (width - 2) * change / lengths**2
    row, rate = output.state[0], math.sqrt(-matrix[1, 0])
    norm = abs(float(row[0])) / rate + abs(float(row[1]))
    flows = np.stack([part.flow for part in response.parts])
    ends = np.einsum("pij,tpj->tpi", flows, free)
    acceleration = free @ (matrix @ matrix).T
    curvature = curvature + norm * np.hypot(rate * acceleration[..., 0], acceleration[..., 1])
    vibration = norm * np.hypot(rate * free[..., 0], free[..., 1])
    lower = np.minimum(forced[:, 0] + free @ row, forced[:, -1] + ends @ row)
    rounding = ROUNDING_ERRORS * EPS * np.abs(forced).max(axis=1)
    bound = np.maximum(lower - curvature * lengths**2 / 8.0, forced.min(axis=1) - vibration)
    return np.asarray(bound <= rounding)


def acceleration_rounding(law: Law, p: TwoMassParameters, speed: float) -> float:
    """Return an upper bound of the rounding error of the acceleration at a lift-off.

    The acceleration is that of the roller mass, in m/s². ``speed`` is the cam speed in rad/s.
    """
    lift, slope, curvature = law.bounds
    force = p.roller_mass * (speed**2 * curvature) + p.share * p.preload
    force += p.spring_stiffness * lift + (p.stem_damping + p.damping) * speed * slope
    return ROUNDING_ERRORS * EPS * force / p.roller_mass


class Separation(Trajectory):
    """Trajectory of two masses on a law at constant speed, with flights.

    Parameters
    ----------
    law : Law
        The motion law of the cam.
    parameters : TwoMassParameters
        The follower.
    speed : float
        Cam speed, rad/s, > 0.
    angle : float
        Cam angle at time 0, rad (default: 0).
    turns : int
        Whole turns before time 0 (default: 0). They only appear in the angles of the events.

    Raises
    ------
    DynamicsError
        If the speed or the angle is out of range.
    """

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
        """Find all contacts, flights, lift-offs and landings up to a time.

        They are stored in ``phases`` and ``events``.

        Parameters
        ----------
        duration : float
            Duration of the run, s, > 0.
        state : array, optional
            (η, η̇) if ``contact`` is True, else (z, ż, y, ẏ). By default the run starts in contact
            without vibration, η = η̇ = 0: the end mass moves with the turning cam.
        contact : bool
            True if the run starts in contact (default).

        Raises
        ------
        DynamicsError
            If the duration or the state is not finite or out of range.
        EndlessEventsError
            If there are more than ``max_events`` lift-offs and landings per turn.
        """
        start: FloatArray | Flight = np.zeros(2)
        if state is not None:
            start = check_state(state, 2 if contact else 4)
            start = start if contact else Flight(self.system, to_inner(self.parameters, start))
        self.run_from(duration, start)

    def run_from(self, duration: float, start: FloatArray | Flight, step: float = 0.0) -> None:
        """Find all contacts, flights, lift-offs and landings in ``duration`` s.

        They are stored in ``phases`` and ``events``. ``start`` is the vibration (η, η̇) in contact,
        or a flight. ``step`` is an abrupt change of the cam's velocity ṡ (m/s) just before the run,
        which is an impact or a lift-off.
        """
        require_number("duration", duration, "> 0")
        require_angle(self.angle + self.speed * duration, "angle at the end")
        first = self._start_record(
            start if isinstance(start, Flight) else check_state(start, 2), step
        )
        self._search(self.run_table(float(duration)), first, float(duration))

    def run_table(self, duration: float) -> RunTable:
        """Return the coefficients for the event search in a run of ``duration`` s."""
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
            restitution=float(require_parameter("restitution", p.restitution)),
            acceleration_rounding=float(acceleration_rounding(self.law, p, self.speed)),
        )

    def fly(self, flight: Flight, times: FloatArray) -> FloatArray:
        """Return (z, ż, y, ẏ) of the masses at times (s) since the start of a flight.

        z (m) is the displacement of the roller mass, and y (m) that of the end mass. The shape is
        ``(4, len(times))``.
        """
        change, _ = self.system.state_change(flight.start, times)
        return from_inner(self.parameters, flight.start[:, None] + change)

    def cam(self, time: FloatArray) -> FloatArray:
        """Return the cam's s (m), ṡ (m/s) and s̈ (m/s²) at times (s), ``(3, len(time))``."""
        angle = self.angle + self.speed * time
        return self.law.motion_at(angle) * (self.speed ** np.arange(3.0))[:, None]

    def force(self, state: FloatArray, cam: FloatArray) -> FloatArray:
        """Return the contact force (N) of two masses in contact, ``(n,)``.

        ``state`` are the vibrations (η, η̇), ``(2, n)``, and ``cam`` is the motion (s, ṡ, s̈) of the
        cam, ``(3, n)``.
        """
        out = self._force
        return np.asarray((out.state @ state + out.law @ cam + out.constant[:, None])[0])

    def end(self, duration: float) -> FollowerState:
        """Return the state of the follower at the end of an interval of ``duration`` s.

        A velocity jump of the law at this cam angle belongs to the next interval and is not
        included. The trajectory must have been computed by `run` or `run_from`.
        """
        if isinstance(self.last, Flight):
            z, v, _, _ = self.fly(self.last, np.zeros(1))[:, 0].tolist()
            inner = (*self.last.start.tolist(), *self.last.gap_state)
            return FollowerState(z, v, 0.0, False, inner=inner)
        angle = step_before_velocity_jump(self.law, self.angle + self.speed * duration)
        s, slope, curvature = self.law.at(angle)
        cam = np.array([s, slope * self.speed, curvature * self.speed**2])
        force = float(self.force(self.last[:, None], cam[:, None])[0])
        return FollowerState(s, float(cam[1]), force, True, inner=tuple(self.last.tolist()))


def states(trajectory: Separation, times: FloatArray) -> FloatArray:
    """Return the motion and the force (z, ż, y, ẏ, F) at ascending times (s).

    The shape is ``(5, len(times))``. z (m) is the displacement of the roller mass, y (m) that of
    the end mass, and F (N) the contact force. A time at the border of two phases belongs to the
    later one.
    """
    phases = trajectory.phases
    end = phases[-1].end if phases else 0.0
    times = check_times(times, last=end * (1.0 + 1e-12))
    cam, vibration = trajectory.cam(times), np.zeros((2, times.size))
    borders = np.searchsorted(times, [phase.begin for phase in phases[1:]]).tolist()
    for phase, first, stop in zip(phases, [0, *borders], [*borders, times.size], strict=False):
        if phase.flight is None and first < stop:
            angle, since = trajectory.angle + trajectory.speed * phase.begin, times[first:stop]
            vibration[:, first:stop] = trajectory.response.states(
                phase.vibration, angle, since - phase.begin
            )
    end_mass = trajectory.parameters.static_position(cam) + vibration
    out = np.vstack([cam[:2], end_mass, trajectory.force(vibration, cam)])
    is_flying, starts, since = trajectory.flights_at(times)
    change, _ = trajectory.system.state_change(starts, since)
    out[:4, is_flying] = from_inner(trajectory.parameters, starts + change)
    out[4, is_flying] = 0.0
    return out


@with_ramps
def advance(
    law: Law,
    parameters: TwoMassParameters,
    state: FollowerState | None,
    interval: Interval,
    sample_rate: int,
    step: float,
) -> tuple[FollowerState, Block]:
    """Return the state at the end of an interval, and its samples and events.

    The motion in the samples is that of the roller mass. ``state`` is None at the start of a run.
    ``sample_rate`` is in Hz. ``step`` is an abrupt change of the cam's velocity ṡ (m/s) just before
    the interval, which is an impact or a lift-off.
    """
    trajectory = Separation(law, parameters, interval.speed, interval.angle, interval.turns)
    start: FloatArray | Flight = np.zeros(2)
    if state is not None:
        inner = np.array(state.inner)
        start = (
            inner if state.in_contact else Flight(trajectory.system, inner[:4], *state.inner[4:])
        )
    trajectory.run_from(interval.duration, start, step)
    grid = interval.grid(sample_rate)
    block = Block(interval, grid.new_rows())
    block.rows[1:5] = 0.0
    for phase in trajectory.phases:
        if phase.flight is None and (within := grid.find_samples(phase.begin, phase.end)):
            _write_contact(block, *within, sample_rate, trajectory, phase)
    return trajectory.finish(block, grid, state, trajectory.end(interval.duration))


def _write_contact(
    block: Block,
    columns: slice,
    times: FloatArray,
    sample_rate: int,
    trajectory: Separation,
    phase: Phase,
) -> None:
    """Write motion and contact force of a contact phase to its columns of a block.

    ``columns`` are the indices of the samples, and ``times`` are their times since the start of the
    interval, s. ``sample_rate`` is in Hz.
    """
    first, count, period = float(times[0]), times.size, 1.0 / sample_rate
    block.motion[:, columns] = sample_law(
        trajectory.law,
        trajectory.angle + trajectory.speed * first,
        trajectory.speed / sample_rate,
        count,
        np.diag(trajectory.speed ** np.arange(3.0)),
        np.zeros(3),
    )
    angle, since = trajectory.angle + trajectory.speed * phase.begin, first - phase.begin
    out = force_output(trajectory.parameters)
    block.force[columns] = sample(
        trajectory.response, phase.vibration, angle, since, period, count, out
    )[0]

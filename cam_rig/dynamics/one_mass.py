"""Model `one_mass`: a rigid follower that lifts off and lands.

`OneMassTrajectory` finds the phases of contact and flight in one interval, and the lift-offs and
landings between them.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from cam_rig.dynamics.events.run_table import LOSS, CamWeights, RunTable
from cam_rig.dynamics.events.trajectory import NO_CONTACT, Trajectory
from cam_rig.dynamics.interval import Block, FollowerState, Interval
from cam_rig.dynamics.kinetostatic import contact_samples, force_rounding, loss_intervals, state_at
from cam_rig.dynamics.linear.exponential import Flight, FreeSystem, Pairs
from cam_rig.dynamics.parameters import FollowerParameters, require_parameter
from cam_rig.dynamics.speed_ramp import with_ramps
from cam_rig.dynamics.velocity_jumps import step_before_velocity_jump
from cam_rig.laws import Law
from cam_rig.units import FloatArray


@lru_cache(maxsize=64)
def free_mass(parameters: FollowerParameters) -> FreeSystem:
    """Return the equation of motion in flight, m ÿ + c ẏ + k y + preload = 0.

    Its state is (y, ẏ) of the follower in m and m/s.
    """
    p = parameters
    stiffness, damping = p.spring_stiffness / p.mass, p.damping / p.mass
    return FreeSystem(
        matrix=np.array([[0.0, 1.0], [-stiffness, -damping]]),
        load=np.array([0.0, -p.preload / p.mass]),
        row=np.array([1.0, 0.0]),
        energy=np.diag([np.sqrt(stiffness), 1.0]),
        pairs=Pairs(np.eye(2), np.eye(2), np.array([damping]), np.array([stiffness])),
    )


def flight_from(
    parameters: FollowerParameters,
    start: float,
    velocity: float,
    gap: float | None = None,
    gap_rate: float | None = None,
) -> Flight:
    """Return the flight of one mass from an initial displacement and velocity.

    ``start`` is the displacement in m and ``velocity`` is in m/s. ``gap`` (m) is the distance to
    the cam and ``gap_rate`` (m/s) its rate, or None if they are not known more accurately.
    """
    return Flight(free_mass(parameters), np.array([start, velocity]), gap, gap_rate)


#: Placeholder for the weights of a stem, which a follower without a stem does not use.
NO_WEIGHTS = CamWeights(lift=0.0, velocity=0.0, acceleration=0.0, constant=0.0)


class OneMassTrajectory(Trajectory):
    """Trajectory of one mass through an interval at constant cam speed, with its flights.

    `run` computes it.
    """

    max_events = 10_000

    def __init__(self, law: Law, parameters: FollowerParameters, interval: Interval) -> None:
        system = free_mass(parameters)
        super().__init__(law, system, interval.speed, interval.angle, interval.turns)
        self.parameters, self.interval = parameters, interval

    def run(self, state: FollowerState | None, step: float = 0.0) -> None:
        """Find all contacts, flights, lift-offs and landings in the interval.

        They are stored in ``phases`` and ``events``. The run starts from ``state``, or on the cam
        if it is None. ``step`` is an abrupt change of the cam's velocity ṡ (m/s) just before the
        interval, which is an impact or a lift-off.
        """
        start: FloatArray | Flight = np.zeros(2)
        if state is not None and not state.in_contact:
            start = flight_from(self.parameters, state.displacement, state.velocity, *state.inner)
        first = self._start_record(start, step)
        losses = loss_intervals(self.law, self.parameters, self.speed)
        duration = self.interval.duration
        on_cam = step == 0.0 and not isinstance(start, Flight)
        if on_cam and not losses and not self.law.velocity_jumps:  # contact is never lost
            first["phase_end"] = duration
            self._recorded.append(first)
        else:
            self._search(self.run_table(duration), first, duration)

    def run_table(self, duration: float) -> RunTable:
        """Return the coefficients for the event search in a run of ``duration`` s.

        The run starts at the start of the interval.
        """
        law, p, speed = self.law, self.parameters, self.speed
        return self._table(
            duration,
            mass=float(p.mass),
            force=CamWeights(
                lift=float(p.spring_stiffness),
                velocity=float(p.damping),
                acceleration=float(p.mass),
                constant=float(p.preload),
            ),
            losses=np.array(list(loss_intervals(law, p, speed)), dtype=LOSS),
            has_stem=False,
            contact=NO_CONTACT,
            drive=NO_WEIGHTS,
            end_share=0.0,
            spring_share=0.0,
            preload_compression=0.0,
            restitution=float(require_parameter("restitution", p.restitution)),
            acceleration_rounding=float(force_rounding(law, p, speed) / p.mass),
        )

    @property
    def end(self) -> FollowerState:
        """State of the follower at the end of the interval.

        A velocity jump of the law at this cam angle belongs to the next interval and is not
        included.
        """
        if isinstance(self.last, Flight):
            y, v = self.last.start.tolist()
            return FollowerState(y, v, 0.0, in_contact=False, inner=self.last.gap_state)
        angle = step_before_velocity_jump(self.law, self.angle + self.speed * self.phases[-1].end)
        return state_at(self.law, self.parameters, angle, self.speed)


@with_ramps
def advance(
    law: Law,
    parameters: FollowerParameters,
    state: FollowerState | None,
    interval: Interval,
    sample_rate: int,
    step: float,
) -> tuple[FollowerState, Block]:
    """Return the state at the end of an interval, and its samples and events.

    ``state`` is None at the start of a run. ``sample_rate`` is in Hz. ``step`` is an abrupt change
    of the cam's velocity ṡ (m/s) just before the interval, which is an impact or a lift-off.
    """
    trajectory = OneMassTrajectory(law, parameters, interval)
    trajectory.run(state, step)
    block = Block(interval, contact_samples(law, parameters, interval, sample_rate))
    return trajectory.finish(block, interval.grid(sample_rate), state, trajectory.end)

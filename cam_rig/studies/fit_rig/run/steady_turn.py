"""Lift and contact force of a follower over one periodic turn, at given cam angles.

A turn is periodic if the motion of the follower repeats from turn to turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter1d

from cam_rig.dynamics import FollowerParameters, Interval, TwoMassParameters
from cam_rig.dynamics.free_masses import contact_response
from cam_rig.dynamics.interval import Event
from cam_rig.dynamics.kinetostatic import force_weights, loss_intervals
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.parameters import MAX_DAMPING_RATIO
from cam_rig.dynamics.steady_rules import RETURN_RTOL, RETURN_TURNS
from cam_rig.dynamics.two_mass import Separation, states
from cam_rig.laws import Law
from cam_rig.units import NS, TURN, FloatArray

#: Largest number of Newton steps in the search for a periodic turn of two masses.
MAX_NEWTON_STEPS = 12
#: Step of the initial vibration for a difference quotient of the vibration one turn later, relative
#: to the scale of the vibration.
MAP_STEP = 1e-6


@dataclass(frozen=True, eq=False)
class OneMassTurn:
    """Periodic turn of one rigid mass.

    It is the last turn of ``trajectory``, from the time ``begin`` (s) on. ``events`` are its
    lift-offs and landings, with cam angles in [0, 2π).
    """

    trajectory: OneMassTrajectory
    begin: float
    events: tuple[Event, ...]

    def evaluate(self, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return lift (m) and contact force (N) at cam angles (rad), same shape.

        The angles may be in any turn.
        """
        trajectory = self.trajectory
        law, p, speed = trajectory.law, trajectory.parameters, trajectory.interval.speed
        inside = np.mod(angle, TURN)
        motion = _motion_at(law, inside.tobytes())
        lift, force = motion[0].copy(), force_weights(p, speed) @ motion + p.preload
        times = self.begin + inside / speed
        if trajectory.events:
            is_flying, starts, since = trajectory.flights_at(times)
            lift[is_flying] = trajectory.system.motion(starts, since)[0]
            force[is_flying] = 0.0
        return lift, force


@lru_cache(maxsize=64)
def _motion_at(law: Law, angles: bytes) -> FloatArray:
    """Return `Law.motion_at` of cam angles (rad), given as the bytes of an array.

    A fit evaluates many followers at the same angles.
    """
    return law.motion_at(np.frombuffer(angles))


@dataclass(frozen=True, eq=False)
class TwoMassTurn:
    """Periodic turn of two masses and a stem.

    ``start`` is the vibration (η, η̇) of the stem in m and m/s at the beginning of the turn.
    ``map`` ``(2, 2)`` is the derivative of the vibration after the turn by that before it.
    ``events`` are the lift-offs and landings of the turn.
    """

    trajectory: Separation
    start: FloatArray
    map: FloatArray
    events: tuple[Event, ...]

    def evaluate(self, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return lift (m) and contact force (N) at cam angles (rad), shape ``(n,)``.

        The angles may be in any turn.
        """
        times = np.mod(angle - self.trajectory.angle, TURN) / self.trajectory.speed
        order = np.argsort(times)
        columns = np.empty((5, times.size))
        columns[:, order] = states(self.trajectory, times[order])
        return columns[0], columns[4]


PeriodicTurn = OneMassTurn | TwoMassTurn


def one_mass_turn(law: Law, p: FollowerParameters, speed: float) -> OneMassTurn | None:
    """Return the periodic turn of one rigid mass, or None if no turn repeats.

    ``p`` is the follower, and ``speed`` the cam speed in rad/s. If contact is lost, the motion is
    computed over the numbers of turns in `RETURN_TURNS` until two turns are equal.
    """
    turn = TURN / speed
    for settling in RETURN_TURNS:
        turns = settling if loss_intervals(law, p, speed) else 1
        span = Interval(0, round((turns + 1) * turn * NS) + 1, 0.0, speed)
        trajectory = OneMassTrajectory(law, p, span)
        trajectory.run(None)
        begin = turns * turn
        if turns == 1 or _is_periodic(trajectory, begin - turn, begin):
            events = [event for event in trajectory.events if begin < event.time <= begin + turn]
            return OneMassTurn(trajectory, begin, tuple(events))
    return None


def _is_periodic(trajectory: OneMassTrajectory, first: float, second: float) -> bool:
    """Return True if a trajectory has the same flights in two turns.

    ``first`` and ``second`` are the start times (s) of the two successive turns.
    """
    turn = second - first
    times = [(x.begin, x.end) for x in trajectory.phases if x.flight]
    flights = [
        np.array([(begin, end) for begin, end in times if start < end <= start + turn])
        for start in (first, second)
    ]
    if flights[0].shape != flights[1].shape:
        return False
    return (
        flights[0].size == 0
        or float(np.abs(flights[1] - flights[0] - turn).max()) < RETURN_RTOL * turn
    )


def two_mass_turn(
    law: Law, p: TwoMassParameters, speed: float, near: TwoMassTurn | None = None
) -> TwoMassTurn | None:
    """Return the periodic turn of two masses, or None if no turn repeats.

    ``p`` is the follower, and ``speed`` the cam speed in rad/s. The result is also None if the
    damping ratio exceeds `MAX_DAMPING_RATIO`, which is the limit for a rig.

    The vibration after a turn is a function of the vibration before it. Newton's method finds its
    fixed point. It starts from the turn ``near`` of a follower with nearly the same parameters, and
    uses the derivatives of that turn. Without it, it starts from `_contact_after`.
    """
    if p.damping_ratio > MAX_DAMPING_RATIO:
        return None
    contact = (near.trajectory.angle, near.start) if near else _contact_after(law, p, speed)
    if contact is None:
        return None
    angle, start = contact
    # scale of (η, η̇) in m and m/s: deflection of the stem under the largest inertia force
    displacement = p.end_mass * law.bounds[2] * speed**2 / p.stiffness
    scale = np.array([displacement, displacement * float(np.sqrt(p.stiffness / p.end_mass))])
    for _ in range(MAX_NEWTON_STEPS):
        trajectory = _run_turn(law, p, speed, angle, start)
        if not isinstance(trajectory.last, np.ndarray):
            return None
        slopes = _jacobian(trajectory, start, scale) if near is None else near.map
        miss = trajectory.last - start
        if (np.abs(miss) <= RETURN_RTOL * scale).all():
            return TwoMassTurn(trajectory, start, slopes, tuple(trajectory.events))
        start = start + np.linalg.solve(np.eye(2) - slopes, miss)
    return None


def _contact_after(law: Law, p: TwoMassParameters, speed: float) -> tuple[float, FloatArray] | None:
    """Return a cam angle (rad) with contact, and the vibration (η, η̇) there.

    The motion starts from the steady vibration of a follower that never leaves the cam, and is
    computed over `RETURN_TURNS[2]` turns. The angle is the middle of the longest contact of the
    next turn, where a slightly different follower is in contact too. If contact is never lost, the
    angle is 0. The result is None if the last turn has no contact.
    """
    turn, response = TURN / speed, contact_response(law, p, speed)
    state = response.periodic()
    if not _run_turn(law, p, speed, 0.0, state).events:
        return 0.0, state
    trajectory = Separation(law, p, speed)
    trajectory.run_from((RETURN_TURNS[2] + 1) * turn, state)
    last = [x for x in trajectory.phases if x.flight is None and x.end > RETURN_TURNS[2] * turn]
    if not last:
        return None
    phase = max(last, key=lambda x: x.end - x.begin)
    middle = 0.5 * (phase.begin + phase.end)
    vibration = response.end(phase.vibration, speed * phase.begin, middle - phase.begin)
    return float(np.mod(speed * middle, TURN)), vibration


def _run_turn(
    law: Law, p: TwoMassParameters, speed: float, angle: float, start: FloatArray
) -> Separation:
    """Return the motion of two masses over one turn.

    The turn starts at a cam angle ``angle`` (rad), with contact and the vibration ``start`` (η, η̇)
    of the end mass. ``speed`` is in rad/s.
    """
    trajectory = Separation(law, p, speed, angle)
    trajectory.run_from(TURN / speed, start)
    return trajectory


def _jacobian(trajectory: Separation, start: FloatArray, scale: FloatArray) -> FloatArray:
    """Return the derivative ``(2, 2)`` of a turn's final by its initial vibration.

    ``scale`` ``(2,)`` are the magnitudes of the vibration in m and m/s, to which the steps of the
    difference quotients are relative.
    """
    jacobian = np.zeros((2, 2))
    for i, step in enumerate(MAP_STEP * scale):
        neighbour = start + step * np.eye(2)[i]
        cam = trajectory.law, trajectory.parameters, trajectory.speed, trajectory.angle
        other = _run_turn(*cam, neighbour).last
        if isinstance(other, np.ndarray) and isinstance(trajectory.last, np.ndarray):
            jacobian[:, i] = (other - trajectory.last) / step
    return jacobian


def list_bounces(turn: PeriodicTurn | None) -> list[tuple[float, float]]:
    """List the landings of a periodic turn as pairs of cam angles (rad).

    The first angle is that of the landing. The second is that of the first landing in the same
    series of bounces, and not larger. The list is empty if ``turn`` is None.
    """
    events = () if turn is None else turn.events
    first = next((k for k, event in enumerate(events) if event.kind == "lift-off"), 0)
    bounces, first_angle = list[tuple[float, float]](), None
    for k, event in enumerate(events[first:] + events[:first]):
        if event.kind == "lift-off":
            first_angle = None
            continue
        angle = event.angle + (TURN if k >= len(events) - first else 0.0)
        first_angle = angle if first_angle is None else first_angle
        bounces.append((angle, first_angle))
    return bounces


# Response of a force sensor with a resonance to a periodic contact force.

#: Number of cam angles per turn at which the contact force is evaluated to compute the response of
#: the sensor.
TURN_POINTS = 8192
#: Distance (rad) before and after a landing at which the force on either side of its jump is
#: evaluated.
LANDING_OFFSET = 1e-9


def sensor_response(
    turn: PeriodicTurn, speed: float, frequency: float, ratio: float
) -> Callable[[FloatArray], FloatArray]:
    """Return a function for the force (N) that a sensor with a resonance shows.

    Its argument is the cam angle (rad). The function is the periodic response to the contact force
    of ``turn`` and to the impulses of its landings. ``speed`` is the cam speed in rad/s,
    ``frequency`` the natural frequency of the sensor in Hz, ``ratio`` its damping ratio.
    """
    width = TURN / TURN_POINTS
    angles = width * np.arange(float(TURN_POINTS))
    orders = np.arange(TURN_POINTS // 2 + 1.0)
    force = turn.evaluate(angles)[1]
    landings = [event for event in turn.events if event.kind == "landing"]
    for event in landings:
        _share_landing_point(force, turn, math.fmod(event.angle, TURN), width)
    spectrum = np.fft.rfft(force)
    # The impulse (N·s) of a landing is added as a force over the time of one point.
    for event in landings:
        height = event.impulse * speed / width
        spectrum += height * np.exp(-1j * orders * math.fmod(event.angle, TURN))
    r = orders * speed / (TURN * frequency)
    response = np.fft.irfft(spectrum / (1.0 - r**2 + 2j * ratio * r), TURN_POINTS)
    spline = spline_filter1d(response, mode="grid-wrap")  # cubic and periodic

    def sensed(angle: FloatArray) -> FloatArray:
        position = [np.mod(angle, TURN) / width]
        return map_coordinates(spline, position, np.float64, mode="grid-wrap", prefilter=False)

    return sensed


def _share_landing_point(force: FloatArray, turn: PeriodicTurn, angle: float, width: float) -> None:
    """Set the force sample at the jump of a landing to a weighted mean of both sides.

    The sampled force then changes continuously with the angle of the landing. ``force`` (N) is
    changed in place. ``angle`` is that of the landing, ``width`` the distance of the samples, both
    in rad.
    """
    nearest = round(angle / width)
    before = nearest + 0.5 - angle / width
    sides = turn.evaluate(np.array([angle - LANDING_OFFSET, angle + LANDING_OFFSET]))[1]
    force[nearest % force.size] = (1.0 - before) * sides[0] + before * sides[1]

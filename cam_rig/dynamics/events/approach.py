"""Landing of a flying follower: the first zero of the gap to the cam.

The gap is g = z − s(θ), the displacement of the contact mass (the mass that meets the cam) less
that of the cam. Within a short interval of time, a window, its acceleration is a polynomial: the
follower's power series less ω² s''. Two integrations from the gap and its rate at the start give g.
At a lift-off both are known exactly, so a flight of any height is resolved. The zero at the start
is divided out, and the next zero is the landing.

Far from the cam no polynomial is needed: bounds of the acceleration prove step by step that the gap
is open. Numbers in brackets are the inequalities of docs/proofs.md, part 1.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cam_rig.dynamics.events.free_flight import (
    LiftOffState,
    acceleration_ordinates,
    advance,
    advance_contact_mass,
    contact_component,
)
from cam_rig.dynamics.events.law_table import (
    EPS,
    Cam,
    LawRow,
    angle_rounding_time,
    cam_at,
    gap_rounding,
    lift_within,
    piece_from,
)
from cam_rig.dynamics.velocity_jumps import SAME_ANGLE_RAD
from cam_rig.laws.polynomials import elevate, find_fall, integrate, restrict, value_at
from cam_rig.laws.vectors import Vector, max_abs

#: Upper bound of the rounding error of an acceleration or a gap, as a multiple of the float epsilon
#: of its largest Bernstein ordinate.
ACCELERATION_ROUNDING_ERRORS = 64.0
#: Upper limit (s) of the rounding error of the time of a velocity jump of the cam, (13) of
#: docs/proofs.md. It takes effect at slow cams, where the rounding of the angle corresponds to a
#: long time.
MAX_JUMP_ROUNDING_S = 1e-7
#: Shortest time step in which bounds prove that the gap between follower and cam is open, as a
#: fraction of the field ``window`` of `FREE_SYSTEM`. For shorter steps a polynomial of the gap is
#: cheaper (measured).
MIN_STEP_FRACTION = 1.0 / 16.0
#: Largest relative position in a polynomial piece of the law, just below 1, because the end belongs
#: to the next piece.
MAX_PIECE_POSITION = 1.0 - 1e-16
#: Shortest time (s) by which the search for a landing advances. At time 0 a step relative to the
#: time would be 0.
MIN_WINDOW_S = 1e-300


class Gap(NamedTuple):
    """Gap between the follower and the cam surface at one time of a flight."""

    time: float  #: time since the start of the flight, s
    gap: float  #: distance of the contact mass from the cam surface, m
    rate: float  #: rate of the gap, m/s; at a velocity jump of the cam the rate before it
    rounding: float  #: upper bound of the rounding error of ``gap``, m
    has_landed: bool  #: True if the flight ends here


class FlightOverCam(NamedTuple):
    """Flight of the follower over a turning cam.

    The motions of follower and cam both start at time 0.
    """

    lift_off: LiftOffState  #: state of the masses at the start of the flight
    cam: Cam  #: cam, its speed, and its angle at the start of the flight
    #: True if ``gap`` and ``gap_rate`` are set. They are more accurate than differences of the
    #: displacements and velocities of follower and cam.
    gap_known: bool
    gap: float  #: gap at the start of the flight, m
    gap_rate: float  #: rate of the gap at the start of the flight, m/s
    #: Uncertainty (m/s²) of the acceleration with which the gap opens at a lift-off, from the
    #: rounding of the contact force that falls to zero there.
    acceleration_rounding: float


def find_landing(flight: FlightOverCam, limit: float) -> Gap:
    """Find the time at which a flying follower meets the cam.

    Returns the gap at the landing, with ``has_landed`` True. If the follower does not land before
    ``limit`` (s after the start of the flight), it returns the gap at ``limit``.

    Invariant: from the start of the flight up to the time reached by the search, the gap is proven
    to be open, or zero to rounding.
    """
    cam, rounding = flight.cam, 0.0
    # By rounding, a velocity jump may be up to this time before the limit: r of inequality (13).
    if cam.law.has_velocity_jumps:
        rounding = max(SAME_ANGLE_RAD / cam.speed, 4.0 * angle_rounding_time(cam))
        rounding = min(rounding, MAX_JUMP_ROUNDING_S)
    point, last = _initial_gap(flight), limit - rounding
    while point.time < limit:
        # A time that may be that of a velocity jump, by rounding, is evaluated in the piece of the
        # law before the jump (13).
        piece_time = point.time - (rounding if point.time > last else 0.0)
        point = _search_window(flight, point, limit, piece_time)
        if point.has_landed:
            return point
        if point.time < last:
            point = _step_while_open(flight, point, last, limit)
    return point


def rate_before_jump(flight: FlightOverCam, time: float, cam_time: float) -> float:
    """Return the gap rate (m/s) just before a velocity jump of the cam.

    ``time`` (s) is the time of the jump, at which the follower's velocity is evaluated.
    ``cam_time`` (s) is a time just before it, at which the cam's velocity is evaluated.
    """
    rates = advance(flight.lift_off, time).rates
    return contact_component(flight.lift_off, rates) - cam_at(flight.cam, cam_time).velocity


def _initial_gap(flight: FlightOverCam) -> Gap:
    """Return the gap between follower and cam at the start of a flight.

    It is the stored gap if ``flight.gap_known`` is True, otherwise the difference of the
    displacements of the contact mass and the cam.
    """
    if flight.gap_known:
        return Gap(0.0, flight.gap, flight.gap_rate, 0.0, False)
    lift_off, cam = flight.lift_off, flight.cam
    displacement = contact_component(lift_off, lift_off.start)
    velocity = contact_component(lift_off, lift_off.rates)
    piece, _ = _initial_position(cam)
    lift, cam_velocity = lift_within(cam, piece, 0.0)
    rounding = gap_rounding(cam.law, displacement)
    return Gap(0.0, displacement - lift, velocity - cam_velocity, rounding, False)


def _initial_position(cam: Cam) -> tuple[int, float]:
    """Return the index of the law's piece in which a flight starts, and the position.

    ``cam`` has the cam angle at the start of the flight. The position is relative to the span of
    the polynomial piece, from 0 to below 1.
    """
    piece, low, high = piece_from(cam, 0.0)
    return piece, min(max((cam.angle - low) / (high - low), 0.0), MAX_PIECE_POSITION)


def _gap_at(flight: FlightOverCam, time: float, piece: int) -> Gap:
    """Return the gap at a time (s) of a flight, with small rounding errors.

    ``piece`` is the index of the polynomial piece of the law at that time. At the end of the piece
    the rate is that before the joint. In the piece in which the flight starts, the gap is the sum
    of its initial value, its initial rate times the time, and the difference of the double
    integrals of both accelerations. The values of s and s' and their rounding errors do not enter.
    """
    start, cam, lift_off = _initial_gap(flight), flight.cam, flight.lift_off
    state, initial = advance(lift_off, time), contact_component(lift_off, lift_off.start)
    change = contact_component(lift_off, state.change)
    velocity = contact_component(lift_off, state.rates)
    rounding = gap_rounding(cam.law, initial)
    first_piece, first = _initial_position(cam)
    duration = cam.law.pieces[first_piece]["span"] * (1.0 - first) / cam.speed
    if piece != first_piece or time > duration:
        lift, cam_velocity = lift_within(cam, piece, time)
        return Gap(time, initial + change - lift, velocity - cam_velocity, rounding, False)
    curvature = cam.law.polynomials[piece][LawRow.CURVATURE_ORDINATES]
    acceleration = restrict(curvature, cam.law.size, first, 1.0)
    for i in range(len(acceleration)):
        acceleration[i] *= cam.speed * cam.speed
    cam_velocities = integrate(acceleration, duration, 0.0)
    cam_changes = integrate(cam_velocities, duration, 0.0)
    u = min(time / duration, 1.0)
    cam_change = value_at(cam_changes, len(cam_changes), u)
    cam_gain = value_at(cam_velocities, len(cam_velocities), u)
    initial_velocity = contact_component(lift_off, lift_off.rates)
    gap = start.gap + start.rate * time + ((change - initial_velocity * time) - cam_change)
    rate = start.rate + ((velocity - initial_velocity) - cam_gain)
    return Gap(time, gap, rate, rounding, False)


def _step_while_open(flight: FlightOverCam, point: Gap, last: float, limit: float) -> Gap:
    """Return the gap at the last time up to which bounds prove that it is open.

    The time steps start at ``point``, and the result is ``point`` if no step is proven. Each step
    lies in one polynomial piece of the law. There |g̈| ≤ ‖E ẋ‖ + ω² max|s''| by (5) of
    docs/proofs.md, and (2) or (3) proves that the gap is positive in the step. No step ends after
    ``limit`` or starts after ``last`` (both in s). A step from a joint within rounding of ``limit``
    would return the rate after the velocity jump there (13).
    """
    cam, lift_off, time, gap, rate = flight.cam, flight.lift_off, point.time, point.gap, point.rate
    initial = contact_component(lift_off, lift_off.start)
    min_step = MIN_STEP_FRACTION * lift_off.free[0]["window"]
    max_acceleration = advance_contact_mass(lift_off, time).max_acceleration
    speed_squared, joint_rounding = cam.speed * cam.speed, SAME_ANGLE_RAD / cam.speed
    piece, _, high = piece_from(cam, time)
    proven_piece = -1
    while time < last:
        curvature = max_acceleration + speed_squared * cam.law.pieces[piece]["max_curvature"]
        rounding = gap_rounding(cam.law, abs(gap) + cam.law.max_lift)
        step = positive_duration(gap - rounding, max(rate, 0.0), curvature)
        end = min(time + max(min_step, step), limit)
        joint = (high - cam.angle) / cam.speed
        at_joint = joint <= end + joint_rounding
        end = min(max(joint, time), limit) if at_joint else end
        mass = advance_contact_mass(lift_off, end)
        lift, cam_velocity = lift_within(cam, piece, end)
        end_gap, end_rate = (initial + mass.change) - lift, mass.velocity - cam_velocity
        rounding = max(rounding, gap_rounding(cam.law, abs(end_gap) + cam.law.max_lift))
        if not is_positive_between(
            gap - rounding, rate, end_gap - rounding, end_rate, end - time, curvature
        ):
            break
        time, gap, rate, proven_piece = end, end_gap, end_rate, piece
        max_acceleration = mass.max_acceleration
        if at_joint:
            piece = (piece + 1) % len(cam.law.pieces)
            high = high + cam.law.pieces[piece]["span"]
            rate = mass.velocity - lift_within(cam, piece, time)[1]
    return point if proven_piece < 0 else _gap_at(flight, time, proven_piece)


def positive_duration(value: float, rate: float, curvature: float) -> float:
    """Return the duration (s) for which a function of time is proven to stay positive.

    ``value`` and ``rate`` are the function and its derivative at the start. ``curvature`` is an
    upper bound of its absolute second derivative. The result is T(value, rate, curvature) of
    inequality (1) in docs/proofs.md. It is infinite if the function cannot fall to zero.
    """
    if value <= 0.0:
        return 0.0
    if curvature <= 0.0:
        return math.inf if rate >= 0.0 else value / -rate
    root = math.sqrt(rate * rate + 2.0 * curvature * value)
    return (rate + root) / curvature if rate > 0.0 else 2.0 * value / (root - rate)


def is_positive_between(
    value: float, rate: float, end_value: float, end_rate: float, width: float, curvature: float
) -> bool:
    """Return True if a function of time is proven to be positive for ``width`` s.

    ``value`` and ``rate`` are the function and its derivative at the start, ``end_value`` and
    ``end_rate`` those at the end. ``curvature`` is an upper bound of its absolute second
    derivative. The proof is inequality (2) or (3) of docs/proofs.md.
    """
    if value <= 0.0 or end_value <= 0.0:
        return False
    if min(value, end_value) > curvature * width * width / 8.0:  # inequality (2)
        return True
    forward = positive_duration(value, rate, curvature)
    return width < forward + positive_duration(end_value, -end_rate, curvature)  # inequality (3)


def _search_window(flight: FlightOverCam, point: Gap, limit: float, piece_time: float) -> Gap:
    """Search for the landing in a short interval of time, with a polynomial of the gap.

    The interval, a window, starts at ``point`` and ends at ``limit`` (s) at the latest. It lies in
    the polynomial piece of the law that follows ``piece_time`` (s). Returns the gap at the landing,
    or the gap at the end of the window if the follower does not land in it.
    """
    cam, time = flight.cam, point.time
    piece, low, high = piece_from(cam, piece_time)
    window = flight.lift_off.free[0]["window"]
    end = min(time + window, limit)
    if piece_time == time:
        end = min(end, (high - cam.angle) / cam.speed)
    if not end > time:  # the window is shorter than the resolution of a float: advance to the next
        next_time = time + max(EPS * time, MIN_WINDOW_S)
        return Gap(next_time, point.gap, point.rate, point.rounding, False)
    duration, span = window if end == time + window else end - time, high - low
    first = min(max((cam.angle + cam.speed * time - low) / span, 0.0), MAX_PIECE_POSITION)
    last = min(max((cam.angle + cam.speed * end - low) / span, 0.0), 1.0)
    law, speed_squared = cam.law, cam.speed * cam.speed
    curvature = law.polynomials[piece][LawRow.CURVATURE_ORDINATES]
    curvature = restrict(curvature, law.size, first, max(first, last))
    rates = flight.lift_off.rates if time == 0.0 else advance(flight.lift_off, time).rates
    acceleration = acceleration_ordinates(flight.lift_off, rates, duration)  # series of lemma (10)
    # Rounding error of s'' in m/rad²: that of s'' itself, and that of s before differentiation.
    differences = (law.size - 1) / law.pieces[piece]["span"]
    curvature_size = ACCELERATION_ROUNDING_ERRORS * law.pieces[piece]["max_curvature"]
    curvature_size += differences * differences * law.max_lift
    acceleration_rounding = EPS * (
        ACCELERATION_ROUNDING_ERRORS * max_abs(acceleration) + speed_squared * curvature_size
    )
    count = max(len(curvature), len(acceleration))
    curvature, acceleration = elevate(curvature, count), elevate(acceleration, count)
    for i in range(len(acceleration)):
        acceleration[i] -= speed_squared * curvature[i]
    rates = integrate(acceleration, duration, point.rate)
    gaps = integrate(rates, duration, point.gap)
    # Change of the acceleration within the rounding error of the time of the lift-off, m/s².
    steepest, degree = 0.0, len(acceleration) - 1
    for i in range(min(2, degree)):
        steepest = max(steepest, abs(acceleration[i + 1] - acceleration[i]))
    time_rounding = degree / duration * steepest * angle_rounding_time(cam)
    initial_rounding = acceleration_rounding + flight.acceleration_rounding + time_rounding
    u = _first_fall(gaps, point, duration, initial_rounding)
    if u >= 0.0:
        return Gap(time + u * duration, 0.0, value_at(rates, len(rates), u), 0.0, True)
    rounding = point.rounding + duration * duration * acceleration_rounding
    return Gap(end, gaps[-1], rates[-1], rounding, False)


def _first_fall(gaps: Vector, point: Gap, duration: float, acceleration_rounding: float) -> float:
    """Return the first relative time u ∈ [0, 1] at which the gap to the cam closes.

    It is the time at which the gap falls below its rounding error. The result is negative if the
    gap stays open. ``gaps`` are the Bernstein ordinates (m) of the gap over ``duration`` s, and
    ``point`` is the gap at the start. A gap that starts at exactly zero is divided by u first, and
    once more if its rate is zero too, (9) of docs/proofs.md. ``acceleration_rounding`` (m/s²) is
    the rounding error of the gap's acceleration.
    """
    rounding = point.rounding + ACCELERATION_ROUNDING_ERRORS * EPS * max_abs(gaps)
    if point.gap != 0.0 or point.rounding != 0.0 or point.rate < 0.0:
        return find_fall(gaps, rounding)
    gaps, rounding = _divide_by_u(gaps), duration * duration * acceleration_rounding
    if point.rate == 0.0:
        return find_fall(_divide_by_u(gaps), rounding)
    return find_fall(gaps, min(rounding, 0.5 * duration * point.rate))


def _divide_by_u(row: Vector) -> Vector:
    """Return the Bernstein ordinates of a polynomial p(u) with p(0) = 0, divided by u.

    ``row`` are the ordinates bᵢ of p, of degree n. The result has n ordinates, bᵢ n/i for
    i = 1 … n, by (9) of docs/proofs.md.
    """
    degree = len(row) - 1
    out = np.zeros(degree)
    for i in range(degree):
        out[i] = row[i + 1] * (degree / (i + 1))
    return out

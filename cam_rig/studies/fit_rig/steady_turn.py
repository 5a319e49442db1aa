"""Lift and contact force of a follower over one turn that comes back to itself, at any angles."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

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

#: Steps to a turn that comes back to itself, at most; and of a slope, of the vibration's scale.
MOST_STEPS, STEP = 12, 1e-6


@dataclass(frozen=True, eq=False)
class OneMassTurn:
    """The last turn of a trajectory, begun at ``begin`` (s); events' angles are in [0, 2π)."""

    course: OneMassTrajectory
    begin: float
    events: tuple[Event, ...]

    def at(self, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Lift (m) and contact force (N) at cam angles (rad) of any turn."""
        law, p, speed = self.course.law, self.course.parameters, self.course.interval.speed
        inside = np.mod(angle, TURN)
        motion = law.motion_at(inside)
        lift, force = motion[0], force_weights(p, speed) @ motion + p.preload
        times = self.begin + inside / speed
        for phase in self.course.phases:
            if phase.flight is not None and phase.end > self.begin:
                here = (times >= phase.begin) & (times < phase.end)
                lift[here] = phase.flight.motion(times[here] - phase.begin)[0]
                force[here] = 0.0
        return lift, force


@dataclass(frozen=True, eq=False)
class TwoMassTurn:
    """A turn from the vibration ``start`` (η, η̇), and the ``map`` ``(2, 2)`` of its change."""

    course: Separation
    start: FloatArray
    map: FloatArray
    events: tuple[Event, ...]

    def at(self, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Lift (m) and contact force (N) at cam angles (rad) of any turn."""
        times = np.mod(angle - self.course.angle, TURN) / self.course.speed
        order = np.argsort(times)
        found = np.empty((5, times.size))
        found[:, order] = states(self.course, times[order])
        return found[0], found[4]


PeriodicTurn = OneMassTurn | TwoMassTurn


def one_mass_turn(law: Law, p: FollowerParameters, speed: float) -> OneMassTurn | None:
    """One rigid mass at ``speed`` (rad/s); None where no turn is as the one before."""
    turn = TURN / speed
    for settling in RETURN_TURNS:
        whole = settling if loss_intervals(law, p, speed) else 1
        span = Interval(0, round((whole + 1) * turn * NS) + 1, 0.0, speed)
        course = OneMassTrajectory(law, p, span)
        course.run(None)
        begin = whole * turn
        if whole == 1 or _came_back(course, begin - turn, begin):
            events = [one for one in course.events if begin < one.time <= begin + turn]
            return OneMassTurn(course, begin, tuple(events))
    return None


def _came_back(course: OneMassTrajectory, one: float, other: float) -> bool:
    """Whether a trajectory's flights of the turns that begin at two times (s) are the same."""
    turn = other - one
    found = [
        np.array([(x.begin, x.end) for x in course.phases if x.flight and at < x.end <= at + turn])
        for at in (one, other)
    ]
    if found[0].shape != found[1].shape:
        return False
    return (
        found[0].size == 0 or float(np.abs(found[1] - found[0] - turn).max()) < RETURN_RTOL * turn
    )


def two_mass_turn(
    law: Law, p: TwoMassParameters, speed: float, near: TwoMassTurn | None = None
) -> TwoMassTurn | None:
    """Two masses at ``speed`` (rad/s); None where no turn is as the one before.

    Nor is one sought beyond `MAX_DAMPING_RATIO`, which no rig may have.

    A turn maps the vibration before it to that after it; its fixed point is found by Newton's
    method, from the turn of nearly the same follower ``near`` with that one's slopes.
    """
    if p.damping_ratio > MAX_DAMPING_RATIO:
        return None
    begun = (near.course.angle, near.start) if near else _contact_after(law, p, speed)
    if begun is None:
        return None
    angle, start = begun
    # what (η, η̇) is measured by: the stem under the largest inertia, m and m/s
    place = p.end_mass * law.bounds[2] * speed**2 / p.stiffness
    scale = np.array([place, place * float(np.sqrt(p.stiffness / p.end_mass))])
    for _ in range(MOST_STEPS):
        course = _turned(law, p, speed, angle, start)
        if not isinstance(course.last, np.ndarray):
            return None
        slopes = _slopes(course, start, scale) if near is None else near.map
        miss = course.last - start
        if (np.abs(miss) <= RETURN_RTOL * scale).all():
            return TwoMassTurn(course, start, slopes, tuple(course.events))
        start = start + np.linalg.solve(np.eye(2) - slopes, miss)
    return None


def _contact_after(law: Law, p: TwoMassParameters, speed: float) -> tuple[float, FloatArray] | None:
    """An angle (rad) and the vibration there, in contact, after some turns from rest.

    In the middle of the longest contact of the last turn: what changes a little is so there too.
    """
    turn, response = TURN / speed, contact_response(law, p, speed)
    state = response.periodic()
    if not _turned(law, p, speed, 0.0, state).events:
        return 0.0, state
    course = Separation(law, p, speed)
    course.run_from((RETURN_TURNS[2] + 1) * turn, state)
    last = [x for x in course.phases if x.flight is None and x.end > RETURN_TURNS[2] * turn]
    if not last:
        return None
    phase = max(last, key=lambda x: x.end - x.begin)
    middle = 0.5 * (phase.begin + phase.end)
    vibration = response.end(phase.vibration, speed * phase.begin, middle - phase.begin)
    return float(np.mod(speed * middle, TURN)), vibration


def _turned(
    law: Law, p: TwoMassParameters, speed: float, angle: float, start: FloatArray
) -> Separation:
    course = Separation(law, p, speed, angle)
    course.run_from(TURN / speed, start)
    return course


def _slopes(course: Separation, start: FloatArray, scale: FloatArray) -> FloatArray:
    """``(2, 2)``: the vibration after a turn by that before it."""
    found = np.zeros((2, 2))
    for i, step in enumerate(STEP * scale):
        beside = start + step * np.eye(2)[i]
        other = _turned(course.law, course.parameters, course.speed, course.angle, beside).last
        if isinstance(other, np.ndarray) and isinstance(course.last, np.ndarray):
            found[:, i] = (other - course.last) / step
    return found


def bounces_of(turn: PeriodicTurn | None) -> list[tuple[float, float]]:
    """Cam angle (rad) of each landing of a turn, and of the first of its bounces, not above it."""
    there = () if turn is None else turn.events
    first = next((k for k, event in enumerate(there) if event.kind == "lift-off"), 0)
    found, begun = list[tuple[float, float]](), None
    for k, event in enumerate(there[first:] + there[:first]):
        if event.kind == "lift-off":
            begun = None
            continue
        angle = event.angle + (TURN if k >= len(there) - first else 0.0)
        begun = angle if begun is None else begun
        found.append((angle, begun))
    return found


# What a force sensor with a resonance of its own shows of a steady contact force.

#: Cam angles at which the force of a turn is taken.
POINTS = 8192
#: On either side of a landing, rad.
BESIDE = 1e-9


def resonant(
    turn: PeriodicTurn, speed: float, frequency: float, ratio: float
) -> Callable[[FloatArray], FloatArray]:
    """The force (N) that a sensor of natural ``frequency`` (Hz) shows over the cam angle."""
    width = TURN / POINTS
    angles = width * np.arange(float(POINTS))
    orders = np.arange(POINTS // 2 + 1.0)
    force = turn.at(angles)[1]
    landings = [event for event in turn.events if event.kind == "landing"]
    for event in landings:
        _share(force, turn, math.fmod(event.angle, TURN), width)
    spectrum = np.fft.rfft(force)
    for event in landings:  # N·s over the time of one point
        height = event.impulse * speed / width
        spectrum += height * np.exp(-1j * orders * math.fmod(event.angle, TURN))
    r = orders * speed / (TURN * frequency)
    shown = np.fft.irfft(spectrum / (1.0 - r**2 + 2j * ratio * r), POINTS)
    spline = spline_filter1d(shown, mode="grid-wrap")  # cubic and periodic

    def sensed(angle: FloatArray) -> FloatArray:
        place = [np.mod(angle, TURN) / width]
        return map_coordinates(spline, place, np.float64, mode="grid-wrap", prefilter=False)

    return sensed


def _share(force: FloatArray, turn: PeriodicTurn, angle: float, width: float) -> None:
    """Share the point beside a landing between both sides, so that it changes steadily."""
    nearest = round(angle / width)
    before = nearest + 0.5 - angle / width
    sides = turn.at(np.array([angle - BESIDE, angle + BESIDE]))[1]
    force[nearest % force.size] = (1.0 - before) * sides[0] + before * sides[1]

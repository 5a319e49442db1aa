"""The rig's own solution of each case, through the models' public functions."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from cam_rig.bench.cases.case import Case, Solution
from cam_rig.bench.cases.models import OneMass, Oscillator, Twist, TwoMasses
from cam_rig.dynamics import FollowerParameters, Interval, elastic_stem
from cam_rig.dynamics.one_mass.trajectory import OneMassTrajectory
from cam_rig.dynamics.torsional import motion as torsion
from cam_rig.dynamics.two_mass.model import states
from cam_rig.dynamics.two_mass.parameters import TwoMassParameters
from cam_rig.dynamics.two_mass.trajectory import Separation
from cam_rig.units import NS

#: A stiffness that plays no part in the result.
ANY_STIFFNESS = 3.3e8


def solve(case: Case) -> Solution:
    """The case by the rig."""
    return ADAPTERS[type(case.model)](case)


def _oscillator(case: Case) -> Solution:
    p = case.model
    assert isinstance(p, Oscillator)
    follower = FollowerParameters(p.mass, p.spring_stiffness, p.damping, 0.0, p.stem_stiffness)
    rows = elastic_stem.motion(case.law, follower, case.speed, 0.0, np.zeros(2), case.times)
    return Solution(rows[:1], rows[1:2])


def two_mass_course(case: Case) -> Separation:
    """All phases and events of two masses."""
    p = case.model
    assert isinstance(p, TwoMasses)
    parameters = TwoMassParameters(
        roller_mass=p.roller_mass,
        end_mass=p.stem_mass,
        stem_stiffness=p.stem_stiffness,
        spring_stiffness=p.spring_stiffness,
        stem_damping=p.stem_damping,
        damping=p.spring_damping,
        preload=p.preload,
    )
    course = Separation(case.law, parameters, case.speed)
    course.run(case.duration)
    return course


def _two_masses(case: Case) -> Solution:
    course = two_mass_course(case)
    rows = states(course, case.times)
    events = tuple((event.kind, event.time) for event in course.events)
    return Solution(rows[0:3:2], rows[1:4:2], events)


def one_mass_course(case: Case) -> OneMassTrajectory:
    """All phases and events of one mass."""
    p = case.model
    assert isinstance(p, OneMass)
    follower = FollowerParameters(
        p.mass, p.stiffness, p.damping, p.preload, ANY_STIFFNESS, p.restitution
    )
    course = OneMassTrajectory(
        case.law, follower, Interval(0, math.ceil(case.duration * NS), 0.0, case.speed)
    )
    course.run(None)
    return course


def _one_mass(case: Case) -> Solution:
    course = one_mass_course(case)
    motion = np.empty((2, case.times.size))
    for phase in course.phases:
        here = (case.times >= phase.begin) & (case.times < phase.end)
        times = case.times[here]
        if phase.flight is not None:
            motion[:, here] = phase.flight.state(times - phase.begin)
        else:
            angle = case.speed * times
            motion[:, here] = case.law(angle), case.speed * case.law(angle, 1)
    events = tuple((e.kind, e.time) for e in course.events if e.time <= case.duration)
    return Solution(motion[:1], motion[1:], events)


def _twist(case: Case) -> Solution:
    p = case.model
    assert isinstance(p, Twist)
    follower = FollowerParameters(p.mass, p.stiffness, p.damping, p.preload, ANY_STIFFNESS)
    parameters = torsion.TorsionalParameters(follower, p.inertia, p.shaft_stiffness)
    start = torsion.TorsionalState(0.0, 0.0, 0.0, case.speed)
    motion = torsion.solve(case.law, parameters, start, 0.0, case.duration)
    rows = motion.at(case.times)
    return Solution(rows[:1], rows[1:2])


ADAPTERS: dict[type, Callable[[Case], Solution]] = {
    Oscillator: _oscillator,
    TwoMasses: _two_masses,
    OneMass: _one_mass,
    Twist: _twist,
}

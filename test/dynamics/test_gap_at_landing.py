"""The gap at every event of random cams is zero to rounding: (13) of docs/proofs.md."""

import numpy as np
import pytest

from cam_rig.dynamics import FollowerParameters, Interval, TwoMassParameters
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.two_mass import Separation
from cam_rig.dynamics.velocity_jumps import SAME_PLACE
from cam_rig.laws import Law
from cam_rig.laws.bernstein import EPS
from cam_rig.units import NS, RPM, TURN

#: Cams per kind of law.
CAMS = 100
#: Their seeds. In the last case one mass used to land 4 mm above a straight-line cam.
SEEDS = (*range(CAMS - 1), 372)
#: Rounding errors that the gap of a sample may contain, compared with `gap_rounding`'s 16.
ROUNDING_ERRORS = 256.0


def random_law(kind: str, rng: np.random.Generator) -> Law:
    """Return a law of 3 to 8 straight lines, or of cubics with continuous velocity."""
    count = int(rng.integers(3, 9))
    spans = rng.uniform(0.3, 1.0, count)
    breaks = np.concatenate([[0.0], np.cumsum(spans) * TURN / spans.sum()])
    breaks[-1] = TURN
    lifts = 0.02 * rng.uniform(0.0, 1.0, count)
    next_lifts = np.roll(lifts, -1)
    if kind == "straight":
        return Law(kind, breaks, np.stack([lifts, next_lifts]))
    slopes, thirds = 0.01 * rng.standard_normal(count), np.diff(breaks) / 3.0
    inner = lifts + thirds * slopes, next_lifts - thirds * np.roll(slopes, -1)
    return Law(kind, breaks, np.stack([lifts, *inner, next_lifts]))


def random_course(law: Law, model: str, rng: np.random.Generator) -> OneMassTrajectory | Separation:
    """Return the trajectory of a random follower from rest over 2.5 turns."""
    speed, restitution = rng.uniform(100.0, 700.0) * RPM, float(rng.choice([0.0, 0.4, 0.8]))
    duration, preload, damping = 2.5 * TURN / speed, rng.uniform(0.0, 60.0), rng.uniform(0.1, 12.0)
    if model == "one_mass":
        one = FollowerParameters(1.3, 4030.0, damping, preload, 3.3e8, restitution=restitution)
        course = OneMassTrajectory(law, one, Interval(0, round(duration * NS), 0.0, speed))
        course.run(None)
        return course
    stem = 10.0 ** rng.uniform(5.0, 7.0)
    two = TwoMassParameters(0.52, 0.78, stem, 4030.0, 8.6, damping, preload, restitution)
    separation = Separation(law, two, speed)
    separation.run(duration)
    return separation


@pytest.mark.parametrize("model", ["one_mass", "two_mass"])
@pytest.mark.parametrize("kind", ["straight", "smooth"])
def test_the_gap_is_zero_at_every_event(kind, model):
    """A flight starts and lands on the cam and is never below it, also across velocity jumps."""
    events = jumps_in_flight = 0
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        law = random_law(kind, rng)
        course = random_course(law, model, rng)
        landings = {event.time for event in course.events if event.kind == "landing"}
        lift_offs = {event.time for event in course.events if event.kind == "lift-off"}
        lift, slope, _ = law.bounds
        for phase, following in zip(course.phases, [*course.phases[1:], None], strict=True):
            assert following is None or following.begin == phase.end
            if phase.flight is None:
                continue
            times = np.linspace(phase.begin, phase.end, 400)
            place, velocity, _ = phase.flight.motion(times - phase.begin)
            gap = place - law(course.speed * times)
            size = np.abs(place).max() + lift + course.speed * phase.end * slope
            fastest = slope + np.abs(velocity).max() / course.speed
            rounding = ROUNDING_ERRORS * EPS * size + 2.0 * SAME_PLACE * fastest
            assert gap.min() >= -rounding, (seed, phase.begin)
            if phase.end in landings:
                assert abs(gap[-1]) <= rounding, (seed, phase.end)
            if phase.begin in lift_offs | landings:
                assert abs(gap[0]) <= rounding, (seed, phase.begin)
            jumps_in_flight += following is not None and phase.end not in landings
        events += len(course.events)
    assert events > 20 * CAMS
    assert (jumps_in_flight > CAMS) == (kind == "straight")

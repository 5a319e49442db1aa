"""Tests of designs that are not convex: known optima, and written limits.

A design is a search for a motion law.
"""

import numpy as np
import pytest

import cam_rig
from cam_rig.acoustics import RadiationParameters
from cam_rig.acoustics.pressure import steady_power
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.kinetostatic import force_weights, shaft_torque
from cam_rig.laws import build_law
from cam_rig.laws.law import peak
from cam_rig.profile.disc import contours
from cam_rig.studies.campaign.inputs import with_numbers
from cam_rig.studies.design.request import LawClass, Multistart
from cam_rig.studies.design.space import Space, dwells, events, measured
from cam_rig.units import RPM, TURN

from ...conftest import dwell, rise
from .shared import NO_HARDER, RIG, cam, designed, peak_torque, problem, require_kept, term, written


def least_radius(start, law):
    """Return the smallest convex radius of curvature (m) of a cam's contour.

    Each radius is that of a circle through three neighbouring contour points.
    """
    radii = []
    for contour in contours(start.follower, law, 7200):
        points = contour.points[0] + 1j * contour.points[1]
        before, after = points - np.roll(points, 1), np.roll(points, -1) - points
        turned = np.angle(after / before)
        length = 0.5 * (np.abs(before) + np.abs(after))
        sense = np.sign(turned.sum())
        convex = sense * turned > 0.0
        radii.append(float((length[convex] / np.abs(turned[convex])).min()))
    return min(radii)


def test_torque_against_a_constant_force_is_that_of_the_least_peak_slope():
    """With the preload F₀ alone the least shaft torque is F₀ times the least peak s′.

    The least peak s′ comes from a convex design with a proof. All four starts have this result.
    """
    light = {"follower.spring_stiffness": 1e-6, "follower.mass": 1e-6, "follower.damping": 0.0}
    rig = with_numbers(RIG, {**light, "follower.preload": 50.0})
    law_class = LawClass(8, 2)
    options = {"rig": rig, "limits": NO_HARDER}
    slope = designed(law_class, minimise="peak_velocity", **options)
    torque = designed(law_class, minimise="shaft_torque@10rpm", **options)
    assert slope.certified
    assert torque.goal.result == pytest.approx(50.0 * slope.goal.result, rel=5e-4)
    assert torque.goal.bound is None
    assert not torque.certified
    assert torque.multistart == Multistart(4, starts_agreeing=4)


def test_one_free_ordinate_is_as_good_as_a_scan(tmp_path):
    """A search over one free ordinate per event is as good as a scan of 401 values.

    An event is the motion between two dwells, and ordinates are the coefficients of its law. The
    torque is evaluated by the kinetostatic model.
    """
    law_class, speed = LawClass(1, 3, 8), 250.0 * RPM
    found = designed(law_class, minimise="shaft_torque@250rpm")
    space = Space(build_law(cam()), law_class)
    laws = [space.law(space.joined(np.full(2, x)), "scan") for x in np.linspace(0.0, 1.0, 401)]
    follower, angles = FollowerParameters.from_rig(RIG), np.linspace(0.0, np.pi, 1201)
    halves = []
    for half in (angles, angles + np.pi):
        motions, weights = [law.motion_at(half) for law in laws], force_weights(follower, speed)
        halves.append(min(np.abs((weights @ m + follower.preload) * m[1]).max() for m in motions))
    law = build_law(written(found, tmp_path))
    assert peak_torque(law, speed) == pytest.approx(found.goal.result, rel=1e-5)
    by_model = max(abs(shaft_torque(law, follower, a, speed)) for a in np.linspace(0.0, TURN, 721))
    assert by_model == pytest.approx(found.goal.result, rel=1e-3)
    assert found.goal.result <= max(halves) * (1.0 + 2e-5)  # tolerance of the local search
    assert found.goal.result >= max(halves) * (1.0 - 2e-3)  # spacing of the scan


@pytest.mark.variants(1)
@pytest.mark.parametrize(
    ("name", "goal", "limits"),
    [
        ("poly345", "shaft_torque@300rpm", [*NO_HARDER, "pressure_angle<=25deg"]),
        ("poly345", "peak_jerk", ["radius_of_curvature>=45mm", "shaft_torque@250rpm<=5.5Nm"]),
        ("oscillating_roller", "pressure_angle", ["radius_of_curvature>=start", *NO_HARDER]),
        ("conjugate", "pressure_angle", NO_HARDER),
        ("inclined_flat", "peak_jerk", ["radius_of_curvature>=start"]),
        ("bezier15", "shaft_torque@300rpm", NO_HARDER),
    ],
)
def test_the_written_cam_keeps_its_limits(name, goal, limits, tmp_path):
    """The cam in the written file satisfies the limits of its design.

    Torque and radius are verified by the torque's formula and by circles through the contour.
    """
    found = designed(LawClass(8, 3), cam(name), starts=3, minimise=goal, limits=limits)
    require_kept(found)
    cam_read = written(found, tmp_path)
    law = build_law(cam_read)
    for measure in found.measures:
        if measure.term.name == "shaft_torque":
            expected = peak_torque(law, measure.term.low)
            assert expected == pytest.approx(measure.result, rel=1e-4)
        if measure.term.name == "radius_of_curvature" and measure.limit is not None:
            assert least_radius(cam_read, law) >= measure.limit * (1.0 - 2e-3)


@pytest.mark.variants(1)
@pytest.mark.parametrize("seed", range(4))
def test_random_cams_and_rigs(seed, tmp_path):
    """For random cams, rigs and speeds the design improves its goal within its limits."""
    random = np.random.default_rng(seed)
    lift = float(10.0 ** random.uniform(-3.5, -0.5))
    sizes = {"lift": lift, "follower.base_radius": random.uniform(1.5, 4.0) * lift}
    sizes["follower.roller_radius"] = random.uniform(0.1, 0.5) * lift
    start = with_numbers(cam(), sizes)
    numbers = {"follower.spring_stiffness": 10.0 ** random.uniform(2, 5)}
    numbers["follower.mass"] = 10.0 ** random.uniform(-1, 1)
    rig = with_numbers(RIG, numbers | {"follower.preload": random.uniform(5.0, 200.0)})
    rpm = float(random.uniform(20.0, 600.0))
    limits = [*NO_HARDER, "radius_of_curvature>=start"]
    goal = f"shaft_torque@{rpm!r}rpm"
    found = designed(LawClass(5, 2), start, rig, 2, minimise=goal, limits=limits)
    require_kept(found)
    expected = peak_torque(build_law(written(found, tmp_path)), rpm * RPM, rig)
    assert found.goal.result == pytest.approx(expected, rel=1e-4)
    assert found.goal.result >= expected * (1.0 - 1e-9)


def test_the_greatest_torque_of_a_range_is_no_less_than_at_any_speed_of_it():
    """The designed torque of a range of speeds is the largest over 45 speeds in it.

    The relative tolerance is 1e-5.
    """
    goal = "shaft_torque@60-500rpm"
    found = designed(LawClass(6, 3), starts=2, minimise=goal, limits=NO_HARDER)
    peaks = [peak_torque(found.law, speed * RPM) for speed in np.linspace(60.0, 500.0, 45)]
    assert max(peaks) == pytest.approx(found.goal.result, rel=1e-5)


def level(law, text):
    return measured(problem(LawClass(4, 3)), law, term(text), "<=")


def test_below_the_jump_speed_the_level_is_that_of_the_steady_force():
    """At 250 rpm, in contact, a design's level is that of the steady contact force.

    The tolerance is 0.003 dB.
    """
    case, speed = problem(LawClass(4, 3)), 250.0 * RPM
    power = steady_power(case.start, case.rigid, RadiationParameters.from_rig(RIG), speed)
    found = level(case.start, "sound_level_with_jumps@250rpm")
    assert found == pytest.approx(20.0 * np.log10(np.sqrt(power) / 20e-6), abs=3e-3)


@pytest.mark.parametrize("rpm", [480.0, 540.0])
def test_above_the_jump_speed_the_level_is_that_of_the_microphone(rpm):
    """Above the jump speed a design's sound level equals a simulation's.

    The tolerance is 0.02 dB.
    """
    law = build_law(cam())
    motion = cam_rig.simulate(law, RIG, model="one_mass", rpm=rpm, turns=4, sample_rate=48_000)
    assert motion.events
    found = level(law, f"sound_level_with_jumps@{rpm:g}rpm")
    assert found == pytest.approx(cam_rig.sound_level(motion).level_db, abs=0.02)


@pytest.mark.long
def test_a_search_is_quieter_than_the_optimum_without_landings():
    """Above the jump speed, a design that allows landings finds a quieter law.

    It is at least 0.1 dB quieter than the start law and than the optimum for permanent contact.
    """
    goal = "sound_level_with_jumps@500rpm"
    found, convex = (
        designed(LawClass(8, 3), starts=2, minimise=minimised, limits=NO_HARDER)
        for minimised in (goal, "sound_level_rigid@500rpm")
    )
    level_of_law = level(found.law, goal)
    assert found.goal.result == level_of_law
    assert level_of_law < min(found.goal.start, level(convex.law, goal)) - 0.1
    limit = found.measures[1]
    assert limit.result <= limit.limit * (1.0 + 1e-6)
    assert found.goal.bound is None


HEIGHTS, LIFT = np.array([0.4, 0.6, 1.0]), 0.05


@pytest.fixture
def two_rises(make_cam):
    """Cam with two rises, to 0.4 and 1 of the lift, and a fall, 80° each."""
    up = rise(80, 0.4), dwell(40), rise(80, 1)
    return make_cam(dwell(20), *up, dwell(40), rise(80, 0), dwell(20), roller_radius=0.01)


def moved(start, keep, joints=1, **words):
    return designed(LawClass(4, joints), start, starts=2, keep=keep, **words)


@pytest.mark.long
def test_optimal_spans_are_proportional_to_the_root_of_the_rise(two_rises, tmp_path):
    """The optimal spans β of three motions that share 240° are proportional to √h.

    The peak acceleration 4h/β² is then equal in all three. h is the rise of each. The dwells keep
    their lengths in the written file.
    """
    found = moved(two_rises, ["dwells", "lift"], minimise="peak_acceleration")
    spans = np.radians(240.0) * np.sqrt(HEIGHTS) / np.sqrt(HEIGHTS).sum()
    optimum = 4.0 * LIFT * HEIGHTS[0] / spans[0] ** 2
    law = build_law(written(found, tmp_path))
    assert abs(peak(law, 2).value) == pytest.approx(optimum, rel=2e-3)
    assert found.goal.result == pytest.approx(optimum, rel=2e-3)
    assert [b - a for a, b in dwells(law)] == pytest.approx(np.radians([20.0, 40.0, 40.0, 20.0]))
    assert [event.span for event in events(law, 1)] == pytest.approx(spans, rel=5e-3)
    assert found.goal.bound is None
    assert found.spans_bound is not None
    assert found.spans_bound <= found.goal.result <= found.spans_bound * 1.002


@pytest.mark.long
def test_a_limit_on_a_span_holds_and_dwells_give_way(two_rises):
    """With limits on the spans, rises and falls widen into the dwells.

    They keep their middles. The peak acceleration is 4h/β², with the limit β of the span and the
    lift h of the fall.
    """
    widest = 109.5
    limits = [f"event_angle@{number}<={widest}deg" for number in (1, 2, 3)]
    found = moved(two_rises, ["lift"], minimise="peak_acceleration", limits=limits)
    assert found.goal.result == pytest.approx(4.0 * LIFT / np.radians(widest) ** 2, rel=2e-3)
    assert found.measures[3].active
    for measure, event in zip(found.measures[1:], found.events, strict=True):
        assert measure.start == pytest.approx(np.radians(80.0))
        assert measure.result == pytest.approx(event.span)
        assert measure.result <= np.radians(widest) * (1.0 + 1e-6)
    middles = [event.start + 0.5 * event.span for event in found.events]
    assert middles == pytest.approx(np.radians([60.0, 180.0, 300.0]), abs=1e-6)


@pytest.mark.long
def test_limits_of_the_start_are_those_of_its_original_events(two_rises):
    """A limit "=start" of a design refers to the start law with its original spans.

    Spans that are free then lower the peak velocity at the same peak acceleration.
    """
    words = {"joints": 2, "minimise": "peak_velocity", "limits": NO_HARDER}
    fixed = moved(two_rises, ["events", "dwells", "lift"], **words)
    other = moved(two_rises, ["dwells", "lift"], **words)
    assert fixed.certified
    assert other.goal.result < fixed.goal.result
    assert other.goal.start == fixed.goal.start
    allowed = abs(peak(build_law(two_rises), 2).value)
    assert abs(peak(other.law, 2).value) <= allowed * (1.0 + 1e-6)

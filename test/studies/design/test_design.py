"""Tests of designs: known optima, limits, and bounds in exact fractions.

A design is a search for a motion law.
"""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.errors import DesignError
from cam_rig.laws import build_law
from cam_rig.laws.law import extremes, peak
from cam_rig.profile import contours
from cam_rig.studies.campaign.inputs import with_numbers
from cam_rig.studies.design.convex_program import MAX_ORDINATE, Affine, ConvexProgram
from cam_rig.studies.design.request import DesignRequest, LawClass, Multistart, parse_second
from cam_rig.studies.design.rows import add, keep_lift
from cam_rig.studies.design.space import ScaledLimit
from cam_rig.studies.design.study import front
from cam_rig.units import TURN, to_rpm

from .shared import NO_HARDER, RIG, cam, designed, integrated, problem, term, written

SPAN, LIFT = np.radians(117.5), 0.05


@pytest.mark.parametrize(
    ("goal", "joints", "lift", "factor"),
    [
        *(("peak_acceleration", 1, lift, 4.0 / SPAN**2) for lift in (5e-6, LIFT, 5.0)),
        ("peak_jerk", 2, LIFT, 32.0 / SPAN**3),
        ("rms_acceleration", 1, LIFT, np.sqrt(2.0 * 12.0 / SPAN**3 / TURN)),
    ],
)
def test_a_known_optimum_is_found(goal, joints, lift, factor):
    """A design between dwells reaches the known optimum for any lift h and span β.

    The smallest possible peak |s″| is 4h/β², peak |s‴| 32h/β³, and ∫s″² 12h²/β³ (relative 1e-6).
    """
    start = with_numbers(cam(), {"lift": lift, "follower.base_radius": 10.0})
    found = designed(LawClass(8, joints), start, minimise=goal)
    assert found.goal.result == pytest.approx(factor * lift, rel=1e-6)
    assert found.goal.bound == pytest.approx(factor * lift, rel=1e-6)
    assert found.certified
    low, high = extremes(found.law, 0)
    assert low.value >= -1e-9 * lift
    assert high.value == pytest.approx(lift, rel=1e-9)


def test_the_bound_holds_in_rational_arithmetic():
    """The bound of a design is proved by its multipliers in exact fractions.

    With the multipliers y, Σ y (c + A x + w t) ≥ 0 for every law x with the goal value t. Signs,
    the weight of t and |Aᵀ y| are summed exactly. The known optimum 4h/β² must not be below the
    bound.
    """
    case = problem(LawClass(4, 1))
    program = ConvexProgram(case.space.unknowns, case.space.link)
    keep_lift(program, case, sufficient=False)
    add(program, case, ScaledLimit(term("peak_acceleration"), "<=", None, 1.0), sufficient=False)
    solution = program.solve()
    exact = np.vectorize(lambda value: Fraction(float(value)), otypes=[object])
    blocks, y = solution.blocks, exact(solution.multipliers)
    free = np.concatenate([np.full(b.weight.size, b.kind == "zero") for b in blocks])
    assert (free | (y >= 0)).all()
    rows = Affine.stacked([block.rows for block in blocks])
    products, linked = y @ exact(rows.matrix.toarray()), blocks[0].weight.size
    assert abs(y @ exact(np.concatenate([b.weight for b in blocks])) + 1) < Fraction(1, 10**12)
    assert max(abs(products[-linked:])) < Fraction(1, 10**9)
    bound = y @ exact(rows.constant) + Fraction(MAX_ORDINATE) * sum(abs(products[:-linked]))
    assert float(bound) == pytest.approx(solution.bound, rel=1e-9)
    assert float(-bound) <= 4.0 * LIFT / SPAN**2 <= float(-bound) * (1.0 + 1e-6)


def test_jump_speed_of_a_rigid_follower_with_sixteen_pieces(tmp_path):
    """A design raises the jump speed of a rigid follower from 458.7 to above 558 rpm.

    The law has sixteen pieces, and its peak acceleration is that of the 3-4-5 law. The result has a
    proved bound. The written file has the limit and the jump speed within 1e-9.
    """
    found = designed(LawClass(16, 3), maximise="jump_speed_rigid", limits=NO_HARDER)
    assert to_rpm(found.goal.start) == pytest.approx(458.668, abs=1e-3)
    assert to_rpm(found.goal.result) > 558.0
    assert found.certified
    assert found.goal.result <= found.goal.bound
    assert found.measures[1].active
    law, limit = build_law(written(found, tmp_path)), abs(peak(build_law(cam()), 2).value)
    assert abs(peak(law, 2).value) <= limit * (1.0 + 1e-9)
    speed = rigid_jump_speed(law, FollowerParameters.from_rig(RIG))
    assert speed == pytest.approx(found.goal.result, rel=1e-9)


@pytest.mark.long
def test_residual_vibration_over_a_range_of_speeds():
    """A designed law of 24 pieces vibrates by less than 0.6 µm from 200 to 400 rpm.

    The start law vibrates by more than 16 µm. An independent integration verifies this at random
    speeds, at which the design program has no condition.
    """
    goal = "residual_vibration@200-400rpm"
    found = designed(LawClass(24, 3), minimise=goal, limits=NO_HARDER)
    assert found.goal.start > 16e-6
    assert found.goal.result < 0.6e-6
    for speed in np.random.default_rng(3).uniform(21.0, 41.8, 3):
        assert _left(found.law, float(speed)) < 1.02 * found.goal.result + 1e-9


def test_a_bound_is_not_better_than_the_law():
    """The reported bound of a goal is never better than the found law's value.

    In the case the optimum is only rounding (below 1 nm of vibration).
    """
    found = designed(LawClass(6, 3), minimise="residual_vibration@395-405rpm")
    assert found.goal.result < 1e-9
    assert found.goal.bound <= found.goal.result


def _left(law, speed):
    """Return the vibration amplitude (m) of the end mass after the rise.

    It is integrated by DOP853. `speed` is in rad/s.
    """
    p = TwoMassParameters.from_rig(RIG)
    start, rate = float(np.radians(31.25)), np.sqrt(p.stiffness / p.end_mass)
    damping = (p.stem_damping + p.damping) / p.end_mass

    def motion(time, state):
        _, slope, curvature = law.at(start + speed * time)
        drive = (p.stem_damping / p.end_mass - damping * p.share) * speed * slope
        drive -= p.share * speed**2 * curvature
        return [state[1], drive - damping * state[1] - rate**2 * state[0]]

    tight = {"rtol": 1e-10, "atol": 1e-15, "max_step": 2e-4}
    run = solve_ivp(motion, (0.0, SPAN / speed), [0.0, 0.0], "DOP853", **tight)
    return float(np.hypot(run.y[0, -1], run.y[1, -1] / rate))


@pytest.mark.long
def test_two_masses_from_rest_keep_contact_in_an_independent_integration():
    """A designed law keeps contact from rest at 0.999 times its jump speed.

    The force of two masses is integrated independently by DOP853, with a tolerance of 1 mN. The
    jump speed is above 470 rpm, that of the 3-4-5 law is 413.4 rpm.
    """
    found = designed(LawClass(8, 3), maximise="jump_speed", limits=NO_HARDER)
    assert found.certified
    assert to_rpm(found.goal.result) > 470.0
    speed = 0.999 * found.goal.result
    times = np.linspace(0.0, 4.0 * TURN / speed, 8001)
    assert integrated(found.law, TwoMassParameters.from_rig(RIG), speed, times).min() > -1e-3


def test_limits_that_contradict_each_other_are_named():
    """If two limits of a design contradict each other, the error names both."""
    limits = ["lift@90deg<=20mm", "lift@90deg>=21mm"]
    with pytest.raises(DesignError, match=r"lift at 9\d°.*and.*lift at 9\d°"):
        designed(LawClass(8, 2), minimise="peak_jerk", limits=limits)


def test_a_limit_on_the_jump_speed_holds_by_the_exact_search():
    """A limit on the jump speed is satisfied by the law's exact jump speed.

    The design program has conditions only at some speeds. The relative tolerance is 1e-5.
    """
    limits = ["jump_speed>=440rpm", *NO_HARDER]
    found = designed(LawClass(8, 3), minimise="peak_jerk", limits=limits)
    assert to_rpm(found.measures[1].result) >= 440.0 * (1.0 - 1e-5)
    assert found.goal.bound <= found.goal.result


def test_only_proved_contradictions_are_reported_as_impossible():
    """Limits of a design are reported as impossible only if this is proved.

    Otherwise the error states that a law may exist.
    """
    words = {"minimise": "peak_velocity", "law_class": LawClass(6, 3)}
    with pytest.raises(DesignError, match="although the class may have one"):
        designed(limits=["peak_acceleration<=68.12mm/rad^2"], **words)
    with pytest.raises(DesignError, match="no law of the class satisfies"):
        designed(limits=["peak_acceleration<=60mm/rad^2"], **words)


@pytest.mark.long
@pytest.mark.parametrize(
    ("lift", "damping"), [(5e-6, {}), (0.05, {"follower.damping": 0, "follower.stem_damping": 0})]
)
def test_hard_cases_of_two_masses_have_a_law_and_a_bound(lift, damping):
    """Designs for two masses with extreme numbers have a law and a proved bound.

    The cases are a lift of 5 µm and an undamped stem. The gap to the bound is below 0.5 %.
    """
    inputs = with_numbers(cam(), {"lift": lift}), with_numbers(RIG, damping)
    found = designed(LawClass(8, 3), *inputs, maximise="jump_speed", limits=NO_HARDER)
    assert found.goal.start < found.goal.result <= found.goal.bound
    assert found.gap < 5e-3


def test_a_roller_dropped_on_the_contour_of_the_written_cam_rises_by_its_law(tmp_path):
    """A roller on the contour points of the written cam rises by the designed law.

    Its height is the largest height at which a point of the contour touches it. The 36 000 points
    are 20 µm apart, so the error is 0.01 µm. The pressure angle of the start law, 25.2°, violates
    the limit of 24.8°.
    """
    found = designed(LawClass(8, 3), minimise="peak_jerk", limits=["pressure_angle<=24.8deg"])
    (limit,) = found.measures[1:]
    assert limit.start > limit.limit >= limit.result * (1.0 - 1e-6)
    assert limit.active
    file = written(found, tmp_path)
    curve, radius = contours(file.follower, build_law(file), 36_000)[0], 10e-3
    x, y = curve.points
    heights = []
    turned = np.linspace(0.0, TURN, 73)[:-1] + 0.01
    for angle in turned:
        across = x * np.cos(angle) - y * np.sin(angle)
        up = x * np.sin(angle) + y * np.cos(angle)
        under = np.abs(across) < radius
        heights.append((up[under] + np.sqrt(radius**2 - across[under] ** 2)).max())
    lift = np.array(heights) - 75e-3
    np.testing.assert_allclose(lift, build_law(file)(turned, 0), atol=1e-8)


def front_of(other, points, **words):
    """Return the Pareto front of a design's goal over another quantity.

    `points` is the number of its designs, and `words` are the goal, limits and class of laws.
    """
    return front(cam(), RIG, DesignRequest.of(**words), parse_second(other), points)


def test_a_front_is_monotone_and_certified():
    """On a Pareto front the peak jerk falls as the allowed peak acceleration rises.

    Each law satisfies its limit and has a proved bound.
    """
    found = front_of("peak_acceleration", 4, minimise="peak_jerk", law_class=LawClass(6, 2))
    jerks = [design.goal.result for design in found.designs]
    assert all(a >= b * (1.0 - 1e-7) for a, b in pairwise(jerks))
    assert jerks[0] > 1.05 * jerks[-1]
    for allowed, design in zip(found.allowed, found.designs, strict=True):
        assert design.certified
        assert design.measures[1].result <= allowed * (1.0 + 1e-6)
    data = found.data()
    assert data["quantities"]["other_unit"] == "m/rad^2"
    assert [row["result"] for row in data["front"]] == jerks
    (table,) = found.to_display()
    assert [column.unit for column in table.columns[:2]] == ["mm/rad²", "mm/rad³"]
    assert table.rows[0][0] == pytest.approx(found.allowed[0] * 1e3)


def test_a_front_over_the_span_of_an_event_is_certified_point_by_point():
    """On a front over the span β of an event, the peak acceleration is 4h/β².

    The laws are of class C1. An event is the motion between two dwells. This is the known optimum
    of a rise of lift h. Every point has a proved bound.
    """
    found = front_of("event_angle@1", 4, minimise="peak_acceleration", law_class=LawClass(4, 1))
    assert found.allowed[0] == pytest.approx(0.5 * SPAN)
    assert found.allowed[-1] == pytest.approx(np.radians(180.0), rel=2e-3)  # without dwells
    for span, design in zip(found.allowed, found.designs, strict=True):
        assert [event.span for event in design.events] == pytest.approx([span, span], rel=1e-4)
        assert design.certified
        assert design.goal.result == pytest.approx(4.0 * LIFT / span**2, rel=1e-3)


def test_a_front_over_spans_starts_at_the_first_law():
    """A front over the span of an event starts at the shortest possible span.

    For shorter spans no law satisfies the limit. An event is the motion between two dwells. At the
    limit A of the peak acceleration the rise h needs at least the span √(4h/A).
    """
    options = {"minimise": "peak_jerk", "limits": NO_HARDER, "law_class": LawClass(6, 2)}
    found = front_of("event_angle@2", 3, **options)
    shortest = np.sqrt(4.0 * 0.05 / found.designs[0].measures[1].limit)
    assert shortest < found.allowed[0] < np.radians(117.5)
    for design in found.designs:
        assert design.measures[1].result <= design.measures[1].limit * (1.0 + 1e-6)
    assert found.designs[0].goal.result > found.designs[-1].goal.result


@pytest.mark.long
def test_a_front_of_a_goal_that_is_not_convex_has_no_bounds():
    """A front of the shaft torque, which is not a convex goal, is marked as local.

    It falls, and has no column of bounds.
    """
    options = {"minimise": "shaft_torque@300rpm", "law_class": LawClass(6, 2)}
    found = front_of("peak_acceleration", 3, multistart=Multistart(2), **options)
    (table,) = found.to_display()
    assert [row[2:] for row in table.rows] == [("local",)] * 3  # no column of bounds
    torques = [design.goal.result for design in found.designs]
    assert all(a >= b * (1.0 - 1e-3) for a, b in pairwise(torques))
    assert found.plot().axes[0].get_legend_handles_labels()[1] == ["designed"]

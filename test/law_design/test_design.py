"""Designs: known optima, limits kept by the written file, bounds that hold in exact arithmetic."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from math import comb
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.jump.jump_speed import rigid_jump_speed
from cam_rig.errors import ConfigError, DesignError
from cam_rig.law_design.convex_program import BOX, ConvexProgram
from cam_rig.law_design.design import front
from cam_rig.law_design.request import DesignRequest, LawClass, Multistart, parse_second
from cam_rig.law_design.rows import add, keep_lift
from cam_rig.law_design.space import PARTS, Asked
from cam_rig.laws import Law, build_law
from cam_rig.laws.law import extremes, peak
from cam_rig.profile import contours
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.units import TURN, FloatArray, to_rpm

from .shared import RIG, cam, designed, problem, term, written

SPAN, LIFT = np.radians(117.5), 0.05


@pytest.mark.parametrize(
    ("goal", "joints", "optimum"),
    [
        ("peak_acceleration", 1, 4.0 * LIFT / SPAN**2),
        ("peak_jerk", 2, 32.0 * LIFT / SPAN**3),
        ("rms_acceleration", 1, np.sqrt(2.0 * 12.0 * LIFT**2 / SPAN**3 / TURN)),
    ],
)
def test_a_known_optimum_is_found(goal: str, joints: int, optimum: float) -> None:
    """Rest to rest: least peak |s″| 4h/β², least peak |s‴| 32h/β³, least ∫s″² 12h²/β³."""
    found = designed(LawClass(8, joints), minimise=goal)
    assert found.goal.result == pytest.approx(optimum, rel=1e-6)
    assert found.goal.bound == pytest.approx(optimum, rel=1e-6)
    assert found.certified


def test_the_written_file_keeps_its_limits_in_rational_arithmetic(tmp_path: Path) -> None:
    """Ordinates as fractions: none of s″ of a cut piece is above the limit, none of F below zero.

    The file's numbers are taken as they are written; de Casteljau cuts pieces in fractions.
    """
    found = designed(
        LawClass(8, 3), maximise="jump_speed_rigid", limits=["peak_acceleration<=start"]
    )
    law = build_law(written(found, tmp_path))
    limit = Fraction(abs(peak(build_law(cam()), 2).value))
    follower = FollowerParameters.from_rig(RIG)
    speed = Fraction(rigid_jump_speed(law, follower)) * (1 - Fraction(1, 10**9))
    for i in range(law.spans.size):
        ordinates = [Fraction(float(value)) for value in law.ordinates[:, i]]
        span = Fraction(float(law.spans[i]))
        slope = [x / span for x in _derivative(ordinates)]
        bend = [x / span for x in _derivative(slope)]
        highest = max(max(map(abs, part)) for part in _cut(bend, PARTS))
        assert highest <= limit * (1 + Fraction(1, 10**9))
        degree = len(ordinates) - 1
        force = [
            Fraction(follower.spring_stiffness) * s
            + Fraction(follower.damping) * speed * v
            + Fraction(follower.mass) * speed**2 * a
            + Fraction(follower.preload)
            for s, v, a in zip(
                ordinates, _elevated(slope, degree), _elevated(bend, degree), strict=True
            )
        ]
        assert min(min(part) for part in _cut(force, PARTS)) > -Fraction(1, 10)


def _derivative(ordinates: list[Fraction]) -> list[Fraction]:
    degree = len(ordinates) - 1
    return [degree * (b - a) for a, b in pairwise(ordinates)]


def _elevated(ordinates: list[Fraction], degree: int) -> list[Fraction]:
    own = len(ordinates) - 1
    return [
        sum(
            (
                Fraction(comb(own, j) * comb(degree - own, i - j), comb(degree, i)) * ordinates[j]
                for j in range(max(0, i - degree + own), min(own, i) + 1)
            ),
            Fraction(0),
        )
        for i in range(degree + 1)
    ]


def _cut(ordinates: list[Fraction], parts: int) -> list[list[Fraction]]:
    """A polynomial's ordinates on equal parts of [0, 1]."""
    found, rest = [], ordinates
    for left in range(parts, 0, -1):
        part, rest = _split(rest, Fraction(1, left))
        found.append(part)
    return found


def _split(ordinates: list[Fraction], u: Fraction) -> tuple[list[Fraction], list[Fraction]]:
    left, right, row = [], [], ordinates
    while row:
        left.append(row[0])
        right.append(row[-1])
        row = [a + u * (b - a) for a, b in pairwise(row)]
    return left, right[::-1]


def test_the_bound_holds_in_rational_arithmetic() -> None:
    """Multipliers as fractions: Σ y (c + A x + w t) ≥ 0 for every law of the class bounds t.

    Signs, the weight of t and |Aᵀ y| are summed exactly; 4h/β² is not passed.
    """
    own = problem(LawClass(4, 1))
    program = ConvexProgram(own.space.unknowns, own.space.link)
    keep_lift(program, own, hull=False)
    add(program, own, Asked(term("peak_acceleration"), "<=", None, 1.0), hull=False)
    solution = program.solve()
    y = [Fraction(float(value)) for value in solution.multipliers]
    rest = [Fraction(0)] * own.space.unknowns
    total, weight, at = Fraction(0), Fraction(0), 0
    for block in solution.blocks:
        rows = block.rows.matrix.tocsr()
        for k in range(block.weight.size):
            assert block.kind == "zero" or y[at] >= 0
            total += y[at] * Fraction(float(block.rows.constant[k]))
            weight += y[at] * Fraction(float(block.weight[k]))
            for j in range(rows.indptr[k], rows.indptr[k + 1]):
                rest[rows.indices[j]] += y[at] * Fraction(float(rows.data[j]))
            at += 1
    linked = solution.blocks[0].weight.size
    assert abs(weight + 1) < Fraction(1, 10**12)
    assert max(map(abs, rest[-linked:])) < Fraction(1, 10**9)
    bound = total + Fraction(BOX) * sum(map(abs, rest[:-linked]), Fraction(0))
    assert float(bound) == pytest.approx(solution.bound, rel=1e-9)
    assert float(-bound) <= 4.0 * LIFT / SPAN**2 <= float(-bound) * (1.0 + 1e-6)


def test_jump_speed_of_a_rigid_follower_with_sixteen_pieces() -> None:
    """3-4-5's events, lift and peak acceleration: from 458.7 to 558.9 rpm, the bound 0.1 % on."""
    found = designed(
        LawClass(16, 3), maximise="jump_speed_rigid", limits=["peak_acceleration<=start"]
    )
    assert to_rpm(found.goal.start) == pytest.approx(458.668, abs=1e-3)
    assert to_rpm(found.goal.result) > 558.0
    assert found.certified
    assert found.goal.result <= found.goal.bound  # type: ignore[operator]
    assert found.measures[1].active


@pytest.mark.long
def test_residual_vibration_over_a_range_of_speeds() -> None:
    """200 to 400 rpm, 24 pieces: below 0.6 µm at speeds between those of the program too.

    The amplitude is read from an integration of the end mass by an independent method, at speeds
    that no program knew.
    """
    found = designed(
        LawClass(24, 3),
        minimise="residual_vibration@200-400rpm",
        limits=["peak_acceleration<=start"],
    )
    assert found.goal.start > 16e-6
    assert found.goal.result < 0.6e-6
    for speed in np.random.default_rng(3).uniform(21.0, 41.8, 3):
        assert _left(found.law, float(speed)) < 1.02 * found.goal.result + 1e-9


def _left(law: Law, speed: float) -> float:
    """The amplitude of the end mass after the rise, by DOP853."""
    p = TwoMassParameters.from_rig(RIG)
    begin, rate = float(np.radians(31.25)), np.sqrt(p.stiffness / p.end_mass)
    damping = (p.stem_damping + p.damping) / p.end_mass

    def motion(time: float, state: FloatArray) -> list[float]:
        _, slope, bend = law.at(begin + speed * time)
        drive = (p.stem_damping / p.end_mass - damping * p.share) * speed * slope
        drive -= p.share * speed**2 * bend
        return [state[1], drive - damping * state[1] - rate**2 * state[0]]

    tight = {"rtol": 1e-10, "atol": 1e-15, "max_step": 2e-4}
    run = solve_ivp(motion, (0.0, SPAN / speed), [0.0, 0.0], "DOP853", **tight)
    return float(np.hypot(run.y[0, -1], run.y[1, -1] / rate))


@pytest.mark.long
def test_two_masses_from_rest_stay_on_by_an_independent_integration() -> None:
    """The law that is found keeps contact from rest just below its jump speed, by DOP853.

    Certified within 0.2 % of the bound; 3-4-5 itself jumps at 413.4 rpm.
    """
    found = designed(LawClass(8, 3), maximise="jump_speed", limits=["peak_acceleration<=start"])
    assert found.certified
    assert to_rpm(found.goal.result) > 470.0
    p, law, speed = TwoMassParameters.from_rig(RIG), found.law, 0.999 * found.goal.result

    def motion(time: float, state: FloatArray) -> list[float]:
        s, slope, _ = law.at(speed * time)
        force = p.stem_stiffness * (s - state[0]) + p.stem_damping * (speed * slope - state[1])
        pull = p.spring_stiffness * state[0] + p.damping * state[1] + p.preload
        return [state[1], (force - pull) / p.end_mass]

    start = [-p.preload / p.stiffness, 0.0]
    times = np.linspace(0.0, 4.0 * TURN / speed, 8001)
    run = solve_ivp(
        motion, (0.0, times[-1]), start, "DOP853", times, rtol=1e-9, atol=1e-14, max_step=2e-4
    )
    s, slope, bend = law.motion_at(speed * times)
    force = p.roller_mass * speed**2 * bend + p.stem_stiffness * (s - run.y[0])
    force += p.stem_damping * (speed * slope - run.y[1])
    assert force.min() > -1e-3


@pytest.mark.parametrize("lift", [5e-6, 5.0])
def test_any_lift_is_designed_alike(lift: float) -> None:
    """5 µm and 5 m: the least peak acceleration is 4h/β² of each."""
    own = cam()
    text = own.model_dump(by_alias=True, exclude_none=True)
    text["lift"] = {"given": lift, "unit": "m"}
    text["follower"]["base_radius"] = {"given": 10.0, "unit": "m"}
    start = CamConfig.model_validate(text)
    found = designed(LawClass(4, 1), start, minimise="peak_acceleration")
    assert found.goal.result == pytest.approx(4.0 * lift / SPAN**2, rel=1e-6)
    low, high = extremes(found.law, 0)
    assert low.value >= -1e-9 * lift
    assert high.value == pytest.approx(lift, rel=1e-9)


def test_limits_that_contradict_each_other_are_named() -> None:
    """5 mm at 90° and 10 mm at 89°, rising: the two limits stand in the message."""
    with pytest.raises(DesignError, match=r"lift at 9\d°.*and.*lift at 9\d°"):
        designed(
            LawClass(8, 2), minimise="peak_jerk", limits=["lift@90deg<=20mm", "lift@90deg>=21mm"]
        )


def test_a_start_that_breaks_a_limit_is_allowed() -> None:
    """3-4-5 has a pressure angle of 25.2°; the best law with 24.6° exists."""
    found = designed(LawClass(8, 2), minimise="peak_jerk", limits=["pressure_angle<=24.6deg"])
    (limit,) = found.measures[1:]
    assert limit.start > limit.limit >= limit.result * (1.0 - 1e-6)  # type: ignore[operator]
    assert limit.active


@pytest.mark.long
def test_a_wider_class_is_bounded_above_every_law_of_a_narrower_one() -> None:
    """Eight pieces can do what four can: what the bound of eight excludes, none of four reaches."""
    limits = ["peak_acceleration<=75mm/rad^2"]
    few, many = (
        designed(LawClass(pieces, 2), maximise="jump_speed", limits=limits) for pieces in (4, 8)
    )
    assert few.goal.result <= few.goal.bound * (1.0 + 1e-9)  # type: ignore[operator]
    assert few.goal.result <= many.goal.bound  # type: ignore[operator]
    assert few.goal.bound <= many.goal.bound * (1.0 + 2e-2)  # type: ignore[operator]


def test_a_limit_on_the_jump_speed_holds_by_the_exact_search() -> None:
    """Least jerk with contact kept to 440 rpm: resonances between the program's speeds too."""
    limits = ["jump_speed>=440rpm", "peak_acceleration<=start"]
    found = designed(LawClass(8, 3), minimise="peak_jerk", limits=limits)
    assert to_rpm(found.measures[1].result) >= 440.0 * (1.0 - 1e-5)
    assert found.goal.bound <= found.goal.result  # type: ignore[operator]


def test_what_is_not_proved_is_not_called_impossible() -> None:
    """Six pieces can keep 68.13 mm/rad², and not 60: not found is not the same as none."""
    words = {"minimise": "peak_velocity", "law_class": LawClass(6, 3)}
    with pytest.raises(DesignError, match="a law of the class may keep"):
        designed(limits=["peak_acceleration<=68.12mm/rad^2"], **words)  # type: ignore[arg-type]
    with pytest.raises(DesignError, match="no law of the class keeps"):
        designed(limits=["peak_acceleration<=60mm/rad^2"], **words)  # type: ignore[arg-type]


@pytest.mark.long
@pytest.mark.parametrize("change", [{"lift": 5e-6}, {"damping": 0.0, "stem_damping": 0.0}])
def test_hard_cases_of_two_masses_have_a_law_and_a_bound(change: dict[str, float]) -> None:
    """5 µm of lift jump at thousands of rpm; an undamped stem has resonances of no width."""
    text, rig = (
        cam().model_dump(by_alias=True, exclude_none=True),
        RIG.model_dump(exclude_none=True),
    )
    if "lift" in change:
        text["lift"] = {"given": change["lift"], "unit": "m"}
    else:
        for key, value in change.items():
            rig["follower"][key] = {"given": value, "unit": "N*s/m"}
    own = CamConfig.model_validate(text), RigConfig.model_validate(rig)
    limits = ["peak_acceleration<=start"]
    found = designed(LawClass(8, 3), *own, maximise="jump_speed", limits=limits)
    assert found.goal.start < found.goal.result <= found.goal.bound  # type: ignore[operator]
    assert found.gap < 5e-3


def test_a_roller_dropped_on_the_contour_of_the_written_cam_rises_by_its_law(
    tmp_path: Path,
) -> None:
    """No formula of the contour, its points alone: the roller rests where none is inside it.

    Each point under the roller holds its centre at a height, the highest one counts; 36 000 points
    stand 20 µm apart, so the least gap between two is missed by a hundredth of a µm.
    """
    found = designed(LawClass(8, 3), minimise="peak_jerk", limits=["pressure_angle<=24.8deg"])
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


# A front of two quantities: each point the best for its value, none beyond another's bound.

REQUEST = DesignRequest.of(minimise="peak_jerk", law_class=LawClass(6, 2))


def test_a_front_is_monotone_and_certified() -> None:
    """Less peak acceleration costs jerk; what a point allows, its law keeps."""
    found = front(cam(), RIG, REQUEST, term("peak_acceleration"), 4)
    jerks = [design.goal.result for design in found.designs]
    assert all(a >= b * (1.0 - 1e-7) for a, b in pairwise(jerks))
    assert jerks[0] > 1.05 * jerks[-1]
    for allowed, design in zip(found.allowed, found.designs, strict=True):
        assert design.certified
        assert design.measures[1].result <= allowed * (1.0 + 1e-6)
    data = found.data()
    assert data["quantities"]["other_unit"] == "m/rad^2"
    assert [row["result"] for row in data["front"]] == jerks
    (table,) = found.to_show()
    assert [column.unit for column in table.columns[:2]] == ["mm/rad²", "mm/rad³"]
    assert table.rows[0][0] == pytest.approx(found.allowed[0] * 1e3)


def test_a_front_that_is_none_is_refused() -> None:
    """The goal itself, too few points, or spans that are searched for already: one line."""
    for other, points, words in (("peak_jerk", 5, "is the goal"), ("peak_acceleration", 2, "3 to")):
        with pytest.raises(ConfigError, match=words):
            front(cam(), RIG, REQUEST, term(other), points)
    request = DesignRequest.of(minimise="peak_jerk", keep=["dwells", "lift"])
    with pytest.raises(ConfigError, match="allowed: without --keep"):
        front(cam(), RIG, request, parse_second("event_angle@1"), 4)


def test_a_front_over_the_span_of_an_event_is_certified_point_by_point() -> None:
    """Least peak acceleration of C1 laws for each span β is 4h/β²; dwells have what it leaves."""
    request = DesignRequest.of(minimise="peak_acceleration", law_class=LawClass(4, 1))
    found = front(cam(), RIG, request, parse_second("event_angle@1"), 4)
    assert found.allowed[0] == pytest.approx(0.5 * np.radians(117.5))
    assert found.allowed[-1] == pytest.approx(np.radians(180.0), rel=2e-3)  # no dwell is left
    for span, design in zip(found.allowed, found.designs, strict=True):
        assert [event.span for event in design.events] == pytest.approx([span, span], rel=1e-4)
        assert design.certified
        assert design.goal.result == pytest.approx(4.0 * 0.05 / span**2, rel=1e-3)


def test_a_front_over_spans_begins_where_the_first_law_is() -> None:
    """68.64 mm/rad² allow no rise shorter than √(4h/68.64 mm): the front is not below that."""
    limits = ["peak_acceleration<=start"]
    request = DesignRequest.of(minimise="peak_jerk", limits=limits, law_class=LawClass(6, 2))
    found = front(cam(), RIG, request, parse_second("event_angle@2"), 3)
    shortest = np.sqrt(4.0 * 0.05 / found.designs[0].measures[1].limit)  # type: ignore[operator]
    assert shortest < found.allowed[0] < np.radians(117.5)
    for design in found.designs:
        assert design.measures[1].result <= design.measures[1].limit * (1.0 + 1e-6)  # type: ignore[operator]
    assert found.designs[0].goal.result > found.designs[-1].goal.result


@pytest.mark.long
def test_a_front_of_what_is_not_convex_has_no_bounds() -> None:
    """Torque against peak acceleration: falling, and called local."""
    request = DesignRequest.of(
        minimise="shaft_torque@300rpm", law_class=LawClass(6, 2), multistart=Multistart(2)
    )
    found = front(cam(), RIG, request, parse_second("peak_acceleration"), 3)
    (table,) = found.to_show()
    assert [row[2:] for row in table.rows] == [("local",)] * 3  # no column of bounds
    torques = [design.goal.result for design in found.designs]
    assert all(a >= b * (1.0 - 1e-3) for a, b in pairwise(torques))
    assert found.plot().axes[0].get_legend_handles_labels()[1] == ["designed"]

"""Proven errors of written cams, against an exact evaluation of the text alone."""

import math
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

import cam_rig
from cam_rig.laws import Law
from cam_rig.laws.law import continuity, peak
from cam_rig.schema.load import config_root
from cam_rig.studies.electronic.building import Target, controller_cam
from cam_rig.studies.electronic.difference import difference_bounds
from cam_rig.studies.electronic.segmentation import Tolerances
from cam_rig.studies.electronic.structured_text import write_text
from cam_rig.studies.electronic.study import write_controller

from .exact import Pieces, largest_errors, points_of, segments_of

CAMS = sorted(path.stem for path in (config_root() / "cams").glob("*.yaml"))
SMOOTH = [name for name in CAMS if name != "worked_example_constant_velocity"]
COARSE = Tolerances(1e-6, 0.005)
#: Error (m) below which an error of s is rounding, and the like for derivatives.
ROUNDING = 1e-13
#: Largest ratio of a bound to the error at the angles of a test.
MAX_RATIO = 3.0


def random_degrees(count, seed):
    """Return random cam angles as fractions of deg, and the neighbourhood of bridges."""
    rng = np.random.default_rng(seed)
    return [Fraction(360 * int(n), 1 << 60) for n in rng.integers(0, 1 << 60, count)]


def bridges(points):
    """Return angles within the segments that are narrower than 0.02°."""
    pairs = pairwise(points)
    narrow = [(p[0], q[0]) for p, q in pairs if q[0] - p[0] < Fraction(1, 50)]
    return [a + (b - a) * Fraction(k, 41) for a, b in narrow for k in range(1, 41)]


def check(law, points, bounds, degrees):
    """Check bounds against the largest errors at angles."""
    errors = largest_errors(law, Pieces.of_points(points), degrees + bridges(points))
    for error, bound in zip(errors, bounds, strict=True):
        assert error <= bound
    scales = 1.0, 1.0, 1e2, 1e6
    for error, bound, scale in zip(errors, bounds, scales, strict=True):
        assert bound <= max(MAX_RATIO * error, ROUNDING * scale)
    return errors


@pytest.mark.parametrize("name", SMOOTH)
def test_bounds_of_shipped_cams_are_true_and_close(name):
    """The bounds of an XYVA text are true, and at most 3 times the error of its digits."""
    cam = cam_rig.load_cam(name)
    law = cam_rig.build_law(cam)
    made = controller_cam(cam, law, Target.CODESYS, COARSE)
    points, _, _ = points_of(write_text(made, Target.CODESYS), "codesys")
    check(law, points, difference_bounds(law, made.law), random_degrees(10_000, seed=1))


@pytest.mark.parametrize(
    "count", [10_000, pytest.param(100_000, marks=[pytest.mark.long, pytest.mark.slow])]
)
def test_bezier15_needs_at_most_20_segments(count):
    """Bézier 15 passes with 1 µm and 0.5 % of s'' as 12 segments."""
    result = cam_rig.electronic("bezier15", lift_error=1e-6, acceleration_error=0.005)
    points, rows, variables = points_of(result.text, "codesys")
    assert len(points) - 1 == result.rows[1].count == 12
    law = cam_rig.build_law("bezier15")
    errors = check(law, points, result.rows[1].bounds, random_degrees(count, seed=2))
    assert errors[0] <= 1e-6 and errors[2] <= 0.005 * np.abs(law.motion[2]).max()
    reference = variables["bezier15"][1]
    assert reference["byType"] == 3 and reference["nElements"] == len(rows)
    assert (reference["xStart"], reference["xEnd"]) == (0, 360)


def random_law(seed):
    """Return a random closed law of a few pieces with joints of class C2."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 5))
    inner = np.sort(rng.uniform(0.3, 6.0, count))
    breaks = np.concatenate([[0.0], inner, [2.0 * math.pi]])
    degree = int(rng.integers(7, 14))
    ends = rng.normal(0.0, 1.0, (3, count + 1))
    ends = np.column_stack([ends, ends[:, 0]]) * [[0.01], [0.005], [0.01]]
    columns = []
    for i, span in enumerate(np.diff(breaks)):
        column = rng.normal(0.0, 0.01, degree + 1)
        for side, step, k in ((0, 1, i), (-1, -1, i + 1)):
            y, v, a = ends[:, k]
            column[side] = y
            column[side + step] = y + step * span * v / degree
            column[side + 2 * step] = (
                y + 2 * step * span * v / degree + span**2 * a / (degree * (degree - 1))
            )
        columns.append(column)
    return Law(f"random{seed}", breaks, np.array(columns).T)


@pytest.mark.parametrize(
    "seed", [*range(8), *(pytest.param(s, marks=pytest.mark.long) for s in range(8, 60))]
)
def test_bounds_of_random_laws(seed):
    """The bounds of a random law are true and at most 3 times the error."""
    law, cam = random_law(seed), cam_rig.load_cam("bezier15")
    made = controller_cam(cam, law, Target.CODESYS, COARSE)
    points, _, _ = points_of(write_text(made, Target.CODESYS), "codesys")
    check(law, points, difference_bounds(law, made.law), random_degrees(2000, seed))


@pytest.mark.parametrize(
    ("name", "constructor", "kind"),
    [
        ("poly345", "SMCB.Poly5", "MOTIONFUNCTYPE_POLYNOM5_MM"),
        ("poly4567", "SMCB.Poly7", "MOTIONFUNCTYPE_POLYNOM7_MM"),
        ("cycloidal", "SMCB.InclinedSine", "MOTIONFUNCTYPE_BESTEHORN"),
        ("modified_sine", "SMCB.ModifiedSine_Lambda", "MOTIONFUNCTYPE_MODSINUSLINIE"),
    ],
)
def test_named_laws_pass_exactly(name, constructor, kind):
    """A law that the controller has is one segment per rise, and its error is rounding."""
    result = cam_rig.electronic(name, "codesys_builder")
    names = [segment[0] for segment in segments_of(result.text)]
    assert names[1] == names[3] == constructor and len(names) == 5
    bounds = result.rows[1].bounds
    assert bounds.lift < 1e-15 and bounds.acceleration < 1e-10
    _, rows, _ = points_of(cam_rig.electronic(name, "twincat").text, "twincat")
    assert [row["FunctionType"] for row in rows][1:4:2] == [kind, kind]
    assert [row["PointIndex"] for row in rows] == list(range(1, 7))


def test_a_jump_of_the_acceleration_has_no_overshoot():
    """s'' of an arc cam stays between its limits on each bridge, and jumps if it may."""
    cam = cam_rig.load_cam("tm21")
    law = cam_rig.build_law(cam)
    low, high = (float(f(law.motion[2])) for f in (np.min, np.max))
    made = controller_cam(cam, law, Target.TWINCAT)
    values = made.law.motion[2]
    assert low - 1e-4 * high <= values.min() and values.max() <= high * (1.0 + 1e-4)
    jumping = controller_cam(cam, law, Target.CODESYS_BUILDER)
    assert difference_bounds(law, jumping.law).acceleration < 0.002 * high
    assert all(b.left.x < b.right.x for b in made.segments)


@pytest.mark.parametrize("name", CAMS)
def test_each_shipped_cam_is_written(name):
    """Each shipped cam is written for each target that can pass it."""
    for target in Target:
        if name == "worked_example_constant_velocity" and not target.has_lines:
            continue
        text = cam_rig.electronic(name, target.value).text
        assert text.count("\n") > 5


@pytest.mark.parametrize("name", SMOOTH)
def test_requested_errors_are_kept(name):
    """The stated errors of a text are at most the requested ones, but on bridges of s''."""
    law, limits = cam_rig.build_law(name), Tolerances()
    for target in Target:
        bounds = cam_rig.electronic(name, target.value).rows[1].bounds
        assert bounds.lift <= limits.lift
        if not (target.shares_boundaries and continuity(law) < 2):
            assert bounds.acceleration <= limits.acceleration * abs(peak(law, 2).value)


def test_coefficients_have_the_same_motion():
    """Segments by VDI 2143 are the quintics of the other targets, in powers of z."""
    cam = cam_rig.load_cam("bezier15")
    law = cam_rig.build_law(cam)
    text = write_controller(controller_cam(cam, law, Target.VDI2143, COARSE), Target.VDI2143)
    rows = [line.split(",") for line in text.splitlines() if line[0].isdigit()]
    exact = Pieces(
        [Fraction(row[0]) * Fraction(math.pi) / 180 for row in rows],
        [Fraction(row[1]) * Fraction(math.pi) / 180 for row in rows],
        [
            [
                (Fraction(row[2]) * (k == 0) + Fraction(row[3]) * Fraction(c)) / 1000
                for k, c in enumerate(row[4:])
            ]
            for row in rows
        ],
    )
    errors = largest_errors(law, exact, random_degrees(2000, seed=3))
    assert 0.9e-6 < errors[0] <= 1e-6

"""Motions between given ends, ends taken over from neighbours, and tasks of segments."""

import itertools
import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cam_rig
from cam_rig.errors import CamRigError
from cam_rig.laws import bernstein, build_law
from cam_rig.laws.law import joints
from cam_rig.laws.segments import unit_rise
from cam_rig.laws.tasks import end_derivative, motion_between, segment_tasks
from cam_rig.units import TURN

from ..conftest import dwell, rise

#: Derivatives s' and s'' of an end by its letter, per unit rise and span.
ENDS = {"R": (0.0, 0.0), "G": (1.3, 0.0), "U": (0.0, -4.2), "B": (-0.7, 3.1)}
PAIRS = list(itertools.product(ENDS, ENDS))
FOLLOWER = {"type": "point", "base_radius": 0.04}
LAWS = ("poly5", "poly7", "harmonic_combination", "sine_line_combination")


def end(law, level, letter, jerk=0.0):
    """Return an end of a motion for `motion_between`."""
    return (level, *ENDS[letter], *((jerk,) if law == "poly7" else ()))


#: Law and letters of both ends. The sine-line combination has no acceleration at its ends.
CASES = [(law, *pair) for law in LAWS for pair in PAIRS if law in LAWS[:3] or not {*pair} & {*"UB"}]


@pytest.mark.parametrize(("law", "first", "last"), CASES)
def test_every_pair_of_ends_has_its_derivatives(law, first, last):
    """A motion has level, velocity and acceleration of both ends, for all pairs of tasks.

    The polynomial of degree 7 has the jerk too.
    """
    ends = end(law, 0.2, first, 5.0), end(law, 0.9, last, -7.0)
    pieces = motion_between(law, *ends)
    for is_end, expected in zip((False, True), ends, strict=True):
        values = [end_derivative(pieces, is_end, order) for order in range(len(expected))]
        np.testing.assert_allclose(values, expected, rtol=0, atol=2e-12)
    if len(pieces[1]) == 2:
        halves = [(pieces[0][i : i + 2], pieces[1][i : i + 1]) for i in (0, 1)]
        inner = [end_derivative(half, half is halves[0], 2) for half in halves]
        assert inner[0] == pytest.approx(inner[1], abs=1e-11)


@pytest.mark.parametrize(("first", "last"), PAIRS)
def test_polynomials_are_those_of_fifty_digits(first, last):
    """The polynomial between two ends is the solution of its conditions in 50 digits."""
    for law, count in (("poly5", 3), ("poly7", 4)):
        ends = end(law, 0.2, first, 5.0), end(law, 0.9, last, -7.0)
        with mp.workdps(50):
            rows, values = [], []
            for u, derivatives in zip((0, 1), ends, strict=True):
                for order, value in enumerate(derivatives):
                    powers = range(2 * count)
                    rows.append([mp.ff(k, order) * mp.mpf(u) ** max(k - order, 0) for k in powers])
                    values.append(mp.mpf(value))
            powers = mp.lu_solve(mp.matrix(rows), mp.matrix(values))
            degree = 2 * count - 1
            expected = [
                float(
                    mp.fsum(
                        mp.binomial(k, j) / mp.binomial(degree, j) * powers[j] for j in range(k + 1)
                    )
                )
                for k in range(degree + 1)
            ]
        (ordinates,) = motion_between(law, *ends)[1]
        np.testing.assert_allclose(ordinates, expected, rtol=0, atol=1e-15)


def harmonic(u, start, stop):
    """Return the harmonic combination by the solution of its equations in 50 digits."""
    (level, v0, a0), (top, v1, a1) = (tuple(map(mp.mpf, x)) for x in (start, stop))
    left = top - level - (v0 + v1) / 2
    matrix = mp.matrix([[2, 0, 2], [1, 4, 9], [-1, 4, -9]])
    sizes = mp.lu_solve(matrix, mp.matrix([left, a0 / mp.pi**2, a1 / mp.pi**2]))
    waves = mp.fsum(size * (1 - mp.cos((k + 1) * mp.pi * u)) for k, size in enumerate(sizes))
    return level + v0 * u + (v1 - v0) / 2 * (u - mp.sin(mp.pi * u) / mp.pi) + waves


def sine_line(u, start, stop):
    """Return the sine-line combination in 50 digits."""
    (level, v0, _), (top, v1, _) = (tuple(map(mp.mpf, x)) for x in (start, stop))
    left = top - level - (v0 + v1) / 2
    whole = u - mp.sin(2 * mp.pi * u) / (2 * mp.pi)
    return level + v0 * u + (v1 - v0) / 2 * (u - mp.sin(mp.pi * u) / mp.pi) + left * whole


def closed(law, span, ends):
    """Return the cam of a motion between two ends over a span (rad), and of its way back.

    The ends are in m and rad. The way back takes over the derivatives.
    """
    names = ("velocity", "acceleration")
    sides = [dict(zip(names, end[1:], strict=False)) for end in ends]
    if law == "poly7":
        sides = [side | {"jerk": 0.0} for side in sides]
    levels = [{"assumed": end[0], "unit": "m"} for end in ends]
    segments = [
        {"law": law, "span": span, "to": levels[1], "start": sides[0], "end": sides[1]},
        {"law": "poly5", "span": TURN - span, "to": levels[0]},
    ]
    values = []
    for name, beta, sides in ((law, span, ends), ("poly5", TURN - span, ends[::-1])):
        scaled = [[x * beta**k for k, x in enumerate(side)] for side in sides]
        scaled = [[*side, 0.0] if name == "poly7" else side for side in scaled]
        u = np.linspace(0.0, 1.0, 1001)
        values += [bernstein.evaluate(x, u) for x in motion_between(name, *scaled)[1]]
    return cam_rig.Cam(lift=float(np.ptp(values)), segments=segments, follower=FOLLOWER)


@pytest.mark.parametrize(
    ("law", "formula", "letters"),
    [("harmonic_combination", harmonic, "UB"), ("sine_line_combination", sine_line, "GR")],
)
def test_combinations_are_their_formulas_in_fifty_digits(law, formula, letters):
    """s to s''' of a combination agree with differences of its formula in 50 digits."""
    ends = end(law, 0.2, letters[0]), end(law, 0.9, letters[1])
    built, u = build_law(closed(law, 1.0, ends)), np.linspace(0.02, 0.98, 9)
    with mp.workdps(50):
        for order, limit in enumerate((2e-15, 1e-13, 1e-12, 1e-11)):
            exact = [
                float(mp.diff(lambda x: formula(x, *ends), mp.mpf(float(x)), order)) for x in u
            ]
            scale = np.abs(exact).max()
            np.testing.assert_allclose(built(u, order), exact, rtol=0, atol=limit * scale)


def test_motions_between_rests_are_the_named_rises():
    """Between two rests the motions are 3-4-5, 4-5-6-7 and cycloidal."""
    for law, named in (
        ("poly5", "poly345"),
        ("poly7", "poly4567"),
        ("sine_line_combination", "cycloidal"),
    ):
        u = np.linspace(0.0, 1.0, 21)
        values = []
        for breaks, columns in (unit_rise(law), unit_rise(named)):
            i = np.clip(np.searchsorted(breaks, u, side="right") - 1, 0, len(columns) - 1)
            local = [
                (x - breaks[k]) / (breaks[k + 1] - breaks[k]) for x, k in zip(u, i, strict=True)
            ]
            values.append(
                [
                    float(bernstein.evaluate(columns[k], np.array([x]))[0])
                    for x, k in zip(local, i, strict=True)
                ]
            )
        np.testing.assert_allclose(*values, rtol=0, atol=2e-15)


#: Ends of a pair of motions: letters, and factors of the derivatives.
letters = st.sampled_from("RGUB")
factors = st.floats(0.01, 30.0).flatmap(lambda x: st.sampled_from((x, -x)))


@given(
    st.floats(1.0, 300.0),
    st.floats(1e-6, 1.0),
    st.sampled_from(LAWS[:3]),
    st.tuples(letters, letters),
    st.tuples(factors, factors, factors, factors),
)
def test_motions_of_any_span_lift_and_velocity_join(span, lift, law, pair, sizes):
    """Two motions of any spans, lifts and velocities join with C2 and have their tasks.

    The second motion takes over the ends of the first one.
    """
    beta = math.radians(span)
    ends = [
        [
            level * lift,
            (letter in "GB") * sizes[k] * min(lift / beta, 1.0),
            (letter in "UB") * sizes[k + 2] * min(lift / beta**2, 1.0),
        ]
        for k, (level, letter) in enumerate(zip((0.0, 1.0), pair, strict=True))
    ]
    cam = closed(law, beta, ends)
    built = build_law(cam)
    assert min(joint.continuity for joint in joints(built)) >= 2
    first, back = segment_tasks(cam, built)
    assert first.rise == pytest.approx(lift, rel=1e-9)
    assert back.task == first.task[::-1]
    for angle, expected in zip((0.0, beta), ends, strict=True):
        for order, value in enumerate(expected):
            limit = 1e-10 * max(built.bounds[order], lift / beta**order)
            assert float(built(angle, order)) == pytest.approx(value, abs=limit)


#: Segments of the shipped cam of tasks, for the refusals.
TASKS = (
    {"task": "dwell", "span": "60 deg"},
    {"law": "poly5", "span": "90 deg", "to": "10 mm"},
    {"task": "constant_velocity", "span": "40 deg", "velocity": "12 mm/rad"},
    {
        "law": "poly7",
        "span": "70 deg",
        "to": "30 mm",
        "end": {"velocity": 0.0, "acceleration": "-40 mm/rad^2"},
    },
    {"law": "5th polynomial", "span": "100 deg", "to": 0.0},
)


def cam_of_tasks(changes=None):
    """Return the cam of `TASKS`, with changed keys by the index of the segment."""
    segments = [dict(segment) for segment in TASKS]
    for index, keys in (changes or {}).items():
        segments[index] = {k: v for k, v in (segments[index] | keys).items() if v is not ...}
    return cam_rig.Cam("turn", lift="30 mm", segments=segments, follower=FOLLOWER)


def test_ends_are_those_of_the_neighbours():
    """Segments without ends take them over, and every joint has the class of its laws."""
    cam = cam_of_tasks()
    law = build_law(cam)
    tasks = list(segment_tasks(cam, law))
    assert [task.task for task in tasks] == ["R-R", "R-G", "G-G", "G-U", "U-R"]
    assert [task.continuity for task in tasks] == [2, 2, 2, 3, 3]
    assert [task.law for task in tasks][4] == "poly5"
    straight = 12 * math.radians(40)
    rises = np.array([task.rise for task in tasks]) * 1e3
    assert rises == pytest.approx([0.0, 10.0, straight, 20 - straight, -30])
    turn = np.radians(260.0)
    values = [float(law(turn, order)) * 1e3 for order in range(3)]
    assert values == pytest.approx([30.0, 0.0, -40.0], abs=1e-9)


def test_a_stated_acceleration_may_differ_from_the_neighbour():
    """A stated acceleration next to a constant velocity is a step that the tasks show."""
    cam = cam_of_tasks({1: {"end": {"acceleration": "50 mm/rad^2"}}})
    tasks = list(segment_tasks(cam, build_law(cam)))
    assert (tasks[1].task, tasks[2].continuity) == ("R-B", 1)


def test_shipped_rises_have_their_tasks(cams, laws):
    """Dwells, rises, half-rises and simple harmonic motion have their tasks."""
    for name, expected in (
        ("half_rises", "R-R R-G G-G G-R R-R R-G G-G G-R R-R"),
        ("poly345", "R-R R-R R-R R-R R-R"),
        ("worked_example_constant_velocity", "R-R G-G R-R G-G"),
        ("motion_tasks", "R-R R-G G-G G-U U-R"),
    ):
        tasks = segment_tasks(cams[name], laws[name])
        assert " ".join(task.task for task in tasks) == expected, name


def test_relative_segments_close_the_turn_or_say_by_how_much():
    """Constant velocities close the turn if their rises add up to zero."""

    def segments(fall):
        half = {"task": "constant_velocity", "span": "180 deg"}
        return [half | {"velocity": 0.01}, half | {"velocity": fall}]

    cam = cam_rig.Cam(lift=0.01 * math.pi, segments=segments(-0.01), follower=FOLLOWER)
    assert build_law(cam).lift == pytest.approx(0.01 * math.pi, rel=1e-12)
    with pytest.raises(CamRigError, match=r"the end of the turn steps by 0.2 of the lift"):
        build_law(cam.replace(segments=segments(-0.008)))


#: Changed keys by the index of the segment, and the message.
REFUSALS = (
    (
        {3: {"end": ...}},
        "segments[4].start and segments[3].end are both without velocity; allowed: one value for "
        "the joint, so give segments[4].start.velocity",
    ),
    (
        {3: {"end": {"velocity": 0.0}}},
        "segments[4].start and segments[3].end are both without acceleration; allowed: one value",
    ),
    (
        {4: {"law": "poly7"}},
        "segments[3].end and segments[4].start are both without jerk; allowed: one value",
    ),
    (
        {1: {"end": {"velocity": 0.005}}},
        "segments[1].end.velocity is 5 mm/rad, segments[2].start has 12 mm/rad; allowed: the same",
    ),
    (
        {4: {"start": {"velocity": -0.005}}},
        "segments[4].start.velocity is -5 mm/rad, segments[3].end has 0 mm/rad; allowed: the same",
    ),
    (
        {4: {"start": {"acceleration": -0.005}}},
        "segments[4].start.acceleration is -5 mm/rad^2, segments[3].end has -40 mm/rad^2; allowed",
    ),
    (
        {3: {"law": "sine_line_combination"}},
        "segments[3] has the acceleration -40 mm/rad^2 at its end; allowed for "
        "sine_line_combination: 0, so use harmonic_combination or poly5",
    ),
    ({4: {"to": 0.2}}, "the law rises by 24.9547 mm, lift is 30 mm; allowed: the same within 2 %"),
    (
        {1: {"end": {"jerk": 0.005}}},
        "end.jerk: is 0.005 m/rad^3 (assumed); allowed: for poly7 only",
    ),
    (
        {2: {"to": 0.5}},
        "velocity: is 12 mm/rad (assumed); allowed: only for the law constant_velocity",
    ),
    ({2: {"velocity": ...}}, "segments[2].to: missing; it is required"),
    (
        {2: {"task": "rest"}},
        "task: is 'rest'; allowed: dwell or constant_velocity, without the key law",
    ),
    ({2: {"law": "dwell"}}, "task: is 'constant_velocity'; allowed: dwell or"),
    ({2: {"velocity": math.nan}}, "segments[2].velocity: is nan; allowed: finite numbers"),
    ({2: {"velocity": 1e9}}, "velocity: is 1e+09 m/rad; allowed: at most 1e+06 m/rad"),
    (
        {2: {"velocity": "12 mm"}},
        "velocity: has unit 'mm', not a velocity over angle; allowed: m/rad",
    ),
    ({2: {"velocity": 10.0}}, "mm, lift is 30 mm; allowed: the same within 2 %"),
    (
        {4: {"law": "poly345", "velocity": 0.1}},
        "velocity: is 0.1 m/rad (assumed); allowed: only for the law constant_velocity",
    ),
)


@pytest.mark.parametrize(("changes", "message"), REFUSALS)
def test_impossible_tasks_are_refused(changes, message):
    """An impossible task is refused in one line with segment, value, limit and remedy."""
    with pytest.raises(CamRigError) as caught:
        build_law(cam_of_tasks(changes))
    assert message in str(caught.value) and "\n" not in str(caught.value)
    assert "cam 'turn': " in str(caught.value)


def test_a_saved_cam_of_tasks_is_the_same(tmp_path):
    """A cam of tasks that is saved and read again has the same law."""
    cam = cam_of_tasks()
    cam.save(tmp_path / "turn.yaml")
    again = build_law(cam_rig.load_cam(tmp_path / "turn.yaml"))
    np.testing.assert_array_equal(again.ordinates, build_law(cam).ordinates)


def test_a_motion_may_follow_curves_and_tables(make_cam, laws):
    """A motion takes over the ends of Bézier curves, and its class is at least C2."""
    curve = {"law": "bezier", "span": 90.0, "ordinates": [0.0, 0.0, 0.1, 0.5]}
    up, down = ({"law": "poly5", "span": x, "to": y} for x, y in ((90.0, 1.0), (60.0, 0.0)))
    law = build_law(make_cam(dwell(30.0), down, curve, up, dwell(30.0), rise(60.0, 0.0, "poly7")))
    classes = {round(math.degrees(joint.angle)): joint.continuity for joint in joints(law)}
    assert classes[90] >= 2 and classes[180] >= 2

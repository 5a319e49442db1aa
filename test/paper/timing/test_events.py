"""The angles at which heights are passed, in closed form or not at all; and cam-rig timing."""

import json
import math
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from cam_rig import load_cam
from cam_rig.laws import Law, build_law
from cam_rig.paper.timing.events import DEGREE, LEVELS, PIECES, REACHED, events, held, shift_matrix
from cam_rig.paper.timing.study import CamTiming, EventControl, beside_b_spline

from ...cli.conftest import call as run


def test_simple_harmonic(make_cam):
    """(1 − cos πu)/2 passes p at u = arccos(1 − 2p)/π, and the fall is its mirror image."""
    cam = make_cam(
        {"law": "simple_harmonic", "to": 1, "span": 180},
        {"law": "simple_harmonic", "to": 0, "span": 180},
    )
    found = events(build_law(cam), cam.lift.si)
    up = np.arccos(1.0 - 2.0 * np.array(LEVELS))
    assert [event.angle for event in found] == pytest.approx([*up, *(2 * np.pi - up[::-1])])
    assert [event.rising for event in found] == [True] * 3 + [False] * 3
    half = found[1]
    assert half.slope == pytest.approx(0.5 * cam.lift.si, rel=1e-12)


def test_cycloidal():
    """u − sin(2πu)/2π = p has one root."""
    span, start = np.radians(117.5), np.radians(31.25)
    found = events(build_law(load_cam("cycloidal")), 0.05)
    for event in found[:3]:

        def away(u, level=event.level):
            return u - np.sin(2.0 * np.pi * u) / (2.0 * np.pi) - level

        u = brentq(away, 0.0, 1.0, xtol=1e-15)
        assert event.angle == pytest.approx(start + span * u, abs=1e-12)


@pytest.mark.parametrize("name", ["half_rises", "bezier_segments", "poly345", "trigonometric"])
def test_a_joint_on_the_height_counts_once(name):
    """Half-rises meet at half the lift, in the middle of rise and fall."""
    found = events(build_law(load_cam(name)), 0.05, [0.5])
    assert [event.angle for event in found] == pytest.approx([0.5 * np.pi, 1.5 * np.pi], abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_the_law_is_there(seed):
    """At every event the law has that height, over its lowest place; up and down alternate."""
    random = np.random.default_rng(seed)
    ordinates = np.concatenate([np.zeros(3), random.uniform(-0.5, 1.0, 9), np.zeros(3)])
    law = Law("random", [0.0, 2.0 * np.pi], 0.02 * ordinates[:, None])
    low = law(np.linspace(0.0, 2.0 * np.pi, 100_001)).min()
    level = 0.4 * law.lift
    found = events(law, level, [1.0])
    assert found
    for event in found:
        assert float(law(event.angle)) - low == pytest.approx(level, rel=1e-8)
        assert (event.slope > 0.0) == event.rising
    assert all(a.rising != b.rising for a, b in pairwise(found))


def test_a_height_that_is_not_reached():
    """Nothing passes it."""
    assert events(build_law(load_cam("poly345")), 0.05, [1.01]) == ()


# The command.


call = partial(run, "timing")


def test_one_cam(tmp_path):
    """Its ordinates, and the B-spline beside it."""
    csv = tmp_path / "timing.csv"
    result = call("bezier15", "--plot", tmp_path / "a.png", "--csv", csv, "--json", "-")
    assert result.exit_code == 0, result.stderr
    data = json.loads(result.stdout)
    assert [event["level"] for event in data["events"]] == [0.01, 0.5, 0.99, 0.99, 0.5, 0.01]
    assert len(data["ordinates"]) == 16
    shift = {(row["ordinate"], row["level"], row["rising"]): row for row in data["shifts"]}
    assert len(shift) == 16 * 6
    half = data["ordinates"][4]
    assert half["up_50"] == shift[4, 0.5, True]["shift"]
    assert half["free"] and half["down_50"] is None  # beyond its reach
    assert csv.read_text(encoding="utf-8").startswith("cam,up_1,up_50")
    others = {path.name for path in tmp_path.iterdir()} - {"timing.csv", "a.png"}
    assert others == {f"timing.{key}.csv" for key in ("ordinates", "control", "events", "shifts")}
    for words in ("what each ordinate moves", "Control of the events"):
        assert words in " ".join(result.stderr.split())


def test_several_cams():
    """Events alone, of those of Table 2."""
    result = call("--json", "-")
    found = json.loads(result.stdout)
    angles = {row["cam"]: row["up_50"] for row in found["cams"]}
    assert angles["poly345"] == pytest.approx(0.5 * math.pi)
    assert "what each ordinate moves" not in result.stderr
    assert "one cam alone is shown" in result.stderr


# -- what an ordinate moves: finite differences through the cam's file, closed forms of the reach


def timing_of(cam):
    return CamTiming.of(cam, build_law(cam))


def changed(cam, segment, change):
    """The cam with other ordinates in a segment, ``change`` in fractions of the lift."""
    values = (np.array(cam.segments[segment].ordinates.numbers) + change).tolist()
    quantity = {"assumed": values, "unit": "1", "source": "a test"}
    old = cam.segments[segment]
    new = type(old).model_validate({**old.model_dump(), "ordinates": quantity})
    segments = [*cam.segments[:segment], new, *cam.segments[segment + 1 :]]
    return cam.model_copy(update={"segments": segments})


@pytest.fixture(scope="module")
def bezier():
    return timing_of(load_cam("bezier15"))


@pytest.fixture(scope="module")
def beside(bezier):
    return beside_b_spline(bezier)


@pytest.mark.parametrize(("name", "segment"), [("bezier15", 0), ("b_spline", 1), ("b_spline", 3)])
def test_shifts_are_derivatives(name, segment):
    """Differences of the angles of the cam built anew; upwards, so that the lowest place stays."""
    cam, step = load_cam(name), 1e-5
    timing = timing_of(cam)
    ordinates = next(o for o in timing.ordinates if o.segment == segment)
    exact = shift_matrix(ordinates, timing.events, cam.lift.si)

    def angles(change):
        return np.array([event.angle for event in timing_of(changed(cam, segment, change)).events])

    for j in range(1, ordinates.values.size - 1):  # the first and last would step at the joint
        unit = np.eye(ordinates.values.size)[j] * step
        slope = (4.0 * angles(unit) - 3.0 * angles(0.0 * unit) - angles(2.0 * unit)) / (2.0 * step)
        assert np.abs(exact[:, j] - slope).max() < 1e-5 * np.abs(exact).max()


@pytest.mark.parametrize("name", ["bezier15", "b_spline", "poly4567"])
def test_all_together_lift_the_law(name):
    """Basis functions add up to one: all ordinates together move an event by −h/s'."""
    timing = timing_of(load_cam(name))
    for ordinates in timing.ordinates:
        for event in timing.events:
            if ordinates.breaks[0] < event.angle < ordinates.breaks[-1]:
                total = ordinates.shifts(event, 0.05).sum()
                assert total == pytest.approx(-0.05 / event.slope, rel=1e-12)


def test_reach_of_the_first(bezier):
    """(1 − u)^15 > r up to u = 1 − r^(1/15)."""
    (ordinates,) = bezier.ordinates
    exact = 2.0 * np.pi * (1.0 - REACHED ** (1.0 / 15.0))
    assert ordinates.reaches()[[0, -1]] == pytest.approx([exact, exact], rel=1e-12)


def test_reach_by_sampling(beside):
    """The part of the turn in which samples of the basis are above the bound."""
    for control in beside:
        (ordinates,) = control.timing.ordinates
        angles = np.linspace(0.0, 2.0 * np.pi, 4001)[:-1]
        above = np.stack([ordinates.at(angle) for angle in angles]) > REACHED
        sampled = 2.0 * np.pi * above.mean(axis=0)
        assert np.abs(ordinates.reaches() - sampled).max() < 2.0 * np.pi * 2.0 / 4000


def test_ordinates_that_joints_hold():
    """Equal ones hold a dwell, three on a line a slope, and the first always the level."""
    assert held([0.0, 0.0, 0.0, 1.0]) == 3
    assert held([0.0, 0.25, 0.5, 0.75, 0.75]) == 4
    assert held([0.0, 1.0, 3.0]) == 1
    for name, free in {"bezier15": 8, "poly345": 0, "half_rises": 0}.items():
        ordinates = timing_of(load_cam(name)).ordinates
        assert sum(one.values[one.free].size for one in ordinates) == free


def test_the_b_spline_has_lift_and_events_of_the_curve(beside):
    """Its greatest lift, six angles, and the ends at rest; the laws are 1e-3 of the lift apart."""
    curve, spline = (control.timing for control in beside)
    for one, other in zip(curve.events, spline.events, strict=True):
        assert (one.level, one.rising) == (other.level, other.rising)
        assert one.angle == pytest.approx(other.angle, abs=1e-11)
    assert spline.law.lift == pytest.approx(curve.law.lift, rel=1e-12)
    angles = np.linspace(0.0, 2.0 * np.pi, 1001)
    assert np.abs(spline.law(angles) - curve.law(angles)).max() < 1e-3 * curve.law.lift
    assert all(abs(float(spline.law(0.0, order))) < 1e-9 for order in range(4))


def test_control_is_local(beside):
    """A B-spline's ordinate reaches no farther than n + 1 knot spans; a Bézier curve's do."""
    curve, spline = beside
    support = (DEGREE + 1) * 2.0 * np.pi / PIECES
    assert spline.reaches.max() <= support < curve.reaches.min()
    assert spline.within.mean() < curve.within.mean()


@pytest.mark.parametrize("which", [0, 1])
def test_one_event_alone(beside, which):
    """A thousandth of the change moves that event by a thousandth of a degree, the others not."""
    control: EventControl = beside[which]
    timing, (ordinates,) = control.timing, control.timing.ordinates
    shifts = shift_matrix(ordinates, timing.events, timing.cam.lift.si)[:, ordinates.free]
    for k, alone in enumerate(control.alone):
        change = np.zeros(ordinates.values.size)
        change[ordinates.free] = np.radians(1.0) * np.linalg.pinv(shifts)[:, k]
        assert np.abs(change).max() == pytest.approx(alone.ordinate, rel=1e-9)
        moved = timing_of(changed(timing.cam, 0, 1e-3 * change)).events
        found = [np.degrees(b.angle - a.angle) for a, b in zip(timing.events, moved, strict=True)]
        assert np.abs(np.array(found) - 1e-3 * np.eye(6)[k]).max() < 2e-5


def test_only_one_curve_has_a_spline_beside():
    """A cam of several segments has none."""
    assert beside_b_spline(timing_of(load_cam("poly345"))) == []

"""The arc cam's three numbers: there and back, and found again from its own sound."""

import numpy as np
import pytest

from cam_rig.errors import LawError
from cam_rig.laws import build_law
from cam_rig.laws.cam import arc_cam
from cam_rig.paper.noise.arc_cam import ArcShape, ShapeProblem, with_geometry
from cam_rig.simulation.regression import cubic
from cam_rig.simulation.simulate import Acoustics, settled_turns
from cam_rig.units import rms

SPEEDS = np.array([200.0, 240.0, 280.0, 320.0, 360.0, 400.0]) * np.pi / 30.0


def test_shape_of_a_cam_file(cams, laws):
    """Lift, event and flank give the nose back, and the same law."""
    shape = ArcShape.of(cams["tm21"])
    circles = arc_cam(cams["tm21"])
    assert shape.nose(circles.base_radius) == pytest.approx(2.0 * circles.nose_half_angle, rel=1e-9)
    angle = np.linspace(0.0, 6.0, 50)
    np.testing.assert_allclose(shape.law(cams["tm21"])(angle, 0), laws["tm21"](angle, 0), atol=1e-9)


def test_impossible_shape_is_refused(cams):
    """A lift that no arcs of this event reach is an error that names the cam."""
    with pytest.raises(LawError, match="tm21"):
        ArcShape(0.5, 1.0, 2.0).law(cams["tm21"])


@pytest.fixture
def problem(make_loaded_scene):
    """A curve made by a shape like the filed one, 4 % lower and 2 % shorter."""
    loaded = make_loaded_scene(cams=["tm21"], speeds=[200])
    cam, acoustics = loaded.cams["tm21"], Acoustics(loaded.radiation)

    def turn(law):
        return settled_turns(law, "one_mass", loaded.follower, SPEEDS)

    true = ArcShape.of(cam).scaled(0.96, 0.98)
    return ShapeProblem(cam, acoustics.levels(turn(true.law(cam))), turn), acoustics, true


def test_fit_matches_the_curve_a_shape_was_made_with(problem):
    """From the filed shape, the curve of another is matched to 0.1 dB, the flank kept."""
    problem, acoustics, true = problem
    found = problem.fit(ArcShape.of(problem.cam), acoustics)
    left = cubic(SPEEDS) @ problem.cam_of(found).difference(acoustics)
    assert rms(left) < 0.1
    assert found.curvature == true.curvature


def test_sensitivity_is_the_derivative(problem):
    """Of lift and event, against a wider symmetric difference, where the follower keeps contact."""
    problem, acoustics, true = problem
    slope = problem.sensitivity(true, acoustics)
    for axis, step in enumerate(np.diag([0.05, 0.05])):
        up, down = (
            acoustics.levels(problem.cam_of(true.scaled(*(1.0 + s * step))).turns) for s in (1, -1)
        )
        np.testing.assert_allclose(slope[:3, axis], (up - down)[:3] / 0.1, rtol=0.25, atol=0.7)


def test_a_shape_is_run_once(make_loaded_scene):
    """Fits to other constants begin at the same shapes, which are kept."""
    loaded, runs = make_loaded_scene(cams=["tm21"], speeds=[200]), []

    def turn(law):
        runs.append(law)
        return settled_turns(law, "one_mass", loaded.follower, SPEEDS[:1])

    problem = ShapeProblem(loaded.cams["tm21"], np.zeros(1), turn)
    shape = ArcShape.of(loaded.cams["tm21"])
    assert problem.cam_of(shape) is problem.cam_of(shape)
    assert len(runs) == 1


def test_with_geometry(cams):
    """Other numbers in the same file: a whole turn, the event in its middle, same origins."""
    trial = with_geometry(cams["tm21"], lift_mm=8.0, event_deg=130.0, nose_deg=90.0)
    spans = [segment.span.raw for segment in trial.segments]
    assert spans == [115.0, 130.0, 115.0]
    assert trial.segments[1].nose_span.raw == 90.0
    assert trial.lift.si == pytest.approx(0.008, rel=1e-15)
    origins = {key: number.origin for key, number in trial.numbers().items()}
    assert origins == {key: number.origin for key, number in cams["tm21"].numbers().items()}


def test_same_geometry_is_the_same_law(cams, laws):
    """Putting a cam's own numbers back changes nothing."""
    cam = cams["tm21"]
    event = cam.segments[1]
    again = with_geometry(cam, 1e3 * cam.lift.si, event.span.raw, event.nose_span.raw)
    assert build_law(again).lift == pytest.approx(laws["tm21"].lift, rel=1e-12)

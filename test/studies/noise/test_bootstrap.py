"""Tests of the noise study's statistics: bootstrap bands, crossings, claims.

Further tests cover the fit of the arc cam's shape.
"""

from itertools import chain
from types import SimpleNamespace

import numpy as np
import pytest

from cam_rig.errors import LawError
from cam_rig.laws.cam import arc_cam
from cam_rig.simulation.regression import cubic_projection
from cam_rig.simulation.simulate import Acoustics, simulate_steady_turns
from cam_rig.studies.noise import methods as bootstrap
from cam_rig.studies.noise.arc_cam import ArcShape, ShapeProblem, with_geometry
from cam_rig.studies.noise.methods import (
    TESTED_ON,
    Band,
    crossing,
    crossing_interval,
    noise_claims,
    points_crossing,
    resample,
)
from cam_rig.studies.noise.roles import StudyRoles
from cam_rig.units import rms

RPM = np.linspace(200.0, 400.0, 21)


def test_draws_are_blocks_of_the_residual():
    """A bootstrap draw of the levels consists of blocks of neighbouring residuals.

    All residuals are equally likely, within 10 % of 1/21.
    """
    residual = np.arange(21.0)
    draws = resample(residual, np.random.default_rng(2))
    assert draws.shape == (bootstrap.DRAWS, 21)
    inner = np.diff(draws, axis=1).reshape(-1, 20)
    joints = [bootstrap.BLOCK - 1, 2 * bootstrap.BLOCK - 1]
    within = np.delete(inner, joints, axis=1)
    assert set(np.unique(within)) == {1.0, -20.0}  # next speed, or from last to first
    share = np.bincount(draws.astype(int).ravel(), minlength=21) / draws.size
    np.testing.assert_allclose(share, 1.0 / 21.0, rtol=0.1)


def test_the_band_contains_95_percent():
    """The 95 % band of normally distributed draws is ±1.96 standard deviations."""
    draws = np.random.default_rng(4).normal(80.0, 2.0, size=(20_000, 3))
    band = Band.of(draws)
    np.testing.assert_allclose(band.high - 80.0, 1.96 * 2.0, atol=0.1)
    assert band.holds(np.array([80.0, 77.0, 90.0])) == pytest.approx(2.0 / 3.0)


def test_crossing_of_known_lines():
    """`crossing` returns the speed (rpm) at which two level curves are equal, or None.

    Of several crossings it returns the one nearest to the given speed.
    """
    flat = np.full(21, 80.0)
    assert crossing(RPM, flat + 0.1 * (RPM - 330.0), flat, 335.0) == pytest.approx(330.0, abs=1e-6)
    bent = flat + 1e-3 * (RPM - 220.0) * (RPM - 340.0)
    assert crossing(RPM, bent, flat, 335.0) == pytest.approx(340.0, abs=1e-6)
    assert crossing(RPM, bent, flat, 210.0) == pytest.approx(220.0, abs=1e-6)
    assert crossing(RPM, flat + 1.0, flat, 335.0) is None


def test_crossing_of_points():
    """`points_crossing` returns the speed at which two level polylines cross, or None.

    Of several crossings it returns the one nearest to a given speed.
    """
    flat = np.full(21, 80.0)
    straight = flat + 0.1 * (RPM - 333.0)
    assert points_crossing(RPM, straight, flat, 335.0) == pytest.approx(333.0)
    kinked = flat + np.interp(RPM, [200.0, 300.0, 320.0, 400.0], [1.0, -1.0, -1.0, 1.0])
    assert points_crossing(RPM, kinked, flat, 335.0) == pytest.approx(360.0)
    assert points_crossing(RPM, kinked, flat, 240.0) == pytest.approx(250.0)
    assert points_crossing(RPM, flat + 1.0, flat, 335.0) is None


def test_deviation_of_a_crossing():
    """The standard deviation of a crossing is that of the levels divided by the slope.

    With a slope of 0.1 dB/rpm, a deviation of 0.5 dB of the levels is 5 rpm of the crossing.
    """
    flat, rising = np.full(21, 80.0), 80.0 + 0.1 * (RPM - 335.0)
    shift = np.random.default_rng(6).normal(0.0, 0.5, size=(bootstrap.DRAWS, 1))
    draws = (np.broadcast_to(flat, (bootstrap.DRAWS, 21)), rising + shift)
    found = crossing_interval(RPM, (flat, rising), draws, 335.0)
    assert found.rpm == pytest.approx(335.0, abs=1e-6)
    assert found.deviation == pytest.approx(5.0, rel=0.1)
    assert found.high - found.low == pytest.approx(2 * 1.96 * 5.0, rel=0.1)
    assert found.missing == 0.0


def test_draws_that_do_not_cross_are_counted():
    """Without a crossing in any bootstrap draw its interval is NaN.

    The missing fraction is 1.
    """
    flat = np.full((50, 21), 80.0)
    found = crossing_interval(RPM, (flat[0], flat[0] + 1.0), (flat, flat + 1.0), 335.0)
    assert found.rpm is None
    assert np.isnan(found.low)
    assert found.missing == 1.0


ROLES = StudyRoles(reference="conventional", predicted="proposed", arcs="arcs")


def claims(crossover=335.0, **levels):
    """Return the tests of each claim of the paper on noise, for given level curves.

    The curves are used as published, regression and computed levels. `crossover` is the speed (rpm)
    that separates the claims.
    """
    curves = {
        cam: SimpleNamespace(rpm=RPM, published_db=level, regression_db=level, level_db=level)
        for cam, level in levels.items()
    }
    found = noise_claims(ROLES, curves, crossover)
    return [found[i : i + len(TESTED_ON)] for i in range(0, len(found), len(TESTED_ON))]


def test_a_claim_that_is_true_at_every_speed():
    """A claim of the paper that is true at every speed is true in all cases.

    Its range of failing speeds is then None. The level curve of the arc cam crosses both others at
    335 rpm here.
    """
    tests = claims(arcs=(RPM - 335.0) / 10.0, conventional=0.0 * RPM + 0.5, proposed=0.0 * RPM)
    assert [[test.tested_on for test in claim] for claim in tests] == [list(TESTED_ON)] * 3
    assert [{test.cases for test in claim} for claim in tests] == [{14}, {7}, {7}]
    for test in chain(*tests):
        assert (test.holds, test.fails_rpm) == (test.cases, None)


def test_a_claim_that_is_false_at_some_speeds():
    """A claim of the paper that is false at some speeds is reported with their range.

    The arc cam's curve crosses at 355 rpm, so the claim is false at two speeds above 335 rpm.
    """
    found = claims(arcs=(RPM - 355.0) / 10.0, conventional=0.0 * RPM - 1.0, proposed=0.0 * RPM)
    (quietest, *_), (against_arcs, *_), (against_conventional, *_) = found
    assert quietest.fails_rpm is None
    assert (against_arcs.holds, against_arcs.fails_rpm) == (5, (340.0, 350.0))
    assert (against_conventional.holds, against_conventional.fails_rpm) == (0, (340.0, 400.0))


# -- shape of the arc cam: conversions, and a fit of the shape to simulated levels


SPEEDS = np.array([200.0, 240.0, 280.0, 320.0, 360.0, 400.0]) * np.pi / 30.0


def test_shape_of_a_cam_file(cams, laws):
    """The arc shape of a cam file has the nose angle and the law of that file."""
    shape = ArcShape.of(cams["tm21"])
    circles = arc_cam(cams["tm21"])
    assert shape.nose(circles.base_radius) == pytest.approx(2.0 * circles.nose_half_angle, rel=1e-9)
    angle = np.linspace(0.0, 6.0, 50)
    np.testing.assert_allclose(shape.law(cams["tm21"])(angle, 0), laws["tm21"](angle, 0), atol=1e-9)


def test_impossible_shape_is_refused(cams):
    """An arc shape whose lift arcs cannot reach raises LawError with the cam's name."""
    with pytest.raises(LawError, match="tm21"):
        ArcShape(0.5, 1.0, 2.0).law(cams["tm21"])


@pytest.fixture
def problem(make_loaded_scene):
    """Fit of an arc cam's shape to simulated levels, acoustics, and true shape.

    The true shape is 4 % lower and 2 % shorter than that of the cam file.
    """
    loaded = make_loaded_scene(cams=["tm21"], speeds=[200])
    cam, acoustics = loaded.cams["tm21"], Acoustics(loaded.radiation)

    def turn(law):
        return simulate_steady_turns(law, "one_mass", loaded.follower, SPEEDS)

    true = ArcShape.of(cam).scaled(0.96, 0.98)
    return ShapeProblem(cam, acoustics.levels(turn(true.law(cam))), turn), acoustics, true


def test_the_fit_reproduces_the_curve_of_a_shape(problem):
    """A shape fit from the cam file's shape reproduces the levels within 0.1 dB.

    The levels are those of a known, slightly smaller shape.
    """
    problem, acoustics, true = problem
    shape = problem.fit(ArcShape.of(problem.cam), acoustics)
    residual = cubic_projection(SPEEDS) @ problem.cam_of(shape).difference(acoustics)
    assert rms(residual) < 0.1
    assert shape.curvature == true.curvature


def test_sensitivity_is_the_derivative(problem):
    """The derivative of the levels by the cam's shape equals a difference quotient.

    This applies at speeds without lift-off.
    """
    problem, acoustics, true = problem
    slope = problem.sensitivity(true, acoustics)
    for axis, step in enumerate(np.diag([0.05, 0.05])):
        up, down = (
            acoustics.levels(problem.cam_of(true.scaled(*(1.0 + s * step))).turns) for s in (1, -1)
        )
        np.testing.assert_allclose(slope[:3, axis], (up - down)[:3] / 0.1, rtol=0.25, atol=0.7)


def test_with_geometry(cams):
    """A cam with another geometry still has spans of one turn in total.

    `with_geometry` changes lift, event angle and nose angle. The origin of each number is
    unchanged.
    """
    trial = with_geometry(cams["tm21"], lift_mm=8.0, event_deg=130.0, nose_deg=90.0)
    spans = [segment.span.raw for segment in trial.segments]
    assert spans == [115.0, 130.0, 115.0]
    assert trial.segments[1].nose_span.raw == 90.0
    assert trial.lift.si == pytest.approx(0.008, rel=1e-15)
    origins = {key: number.origin for key, number in trial.numbers().items()}
    assert origins == {key: number.origin for key, number in cams["tm21"].numbers().items()}

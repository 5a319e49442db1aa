"""A fit as files: they load, give the fitted law, and say where each number comes from."""

import numpy as np
import pytest

from cam_rig.laws import build_law
from cam_rig.measured.cam_fit.arcs import COORDINATES, FLANK, PRIME, Arcs
from cam_rig.measured.cam_fit.arcs_fit import fit_arcs
from cam_rig.measured.cam_fit.dwells import above_zero
from cam_rig.measured.cam_fit.files import arcs_cam, own_rig, own_scene, spline_cam
from cam_rig.measured.cam_fit.spline_fit import fit_spline
from cam_rig.profile.check_table import check_cam
from cam_rig.schema import load_cam, load_rig, load_scene

from .conftest import ANGLES, FLAT, ROLLER, all_around, readings_of

FINE = all_around(1000)


def written(files, folder):
    """The cam as it is read back."""
    for name, text in files.texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return load_cam(folder / next(iter(files.texts)))


@pytest.mark.parametrize(
    ("name", "kind"), [("poly345", "roller"), ("bezier15", "flat"), ("arcs_convex", "point")]
)
def test_the_file_of_a_spline_is_the_spline(measured, tmp_path, kind, name):
    """Read back: the law to a nanometre, dwells exact, and a contour that passes its checks."""
    fit = fit_spline(measured(name, 180, zero=0.002, outliers={50: 4e-4}))
    files = spline_cam("mine", fit, kind)
    cam = written(files, tmp_path)
    law = build_law(cam)
    assert law(FINE) == pytest.approx(fit.law(FINE), abs=2e-8)
    assert law(FINE) == pytest.approx(files.law(FINE), abs=1e-12)
    assert len(cam.segments[0].dwells) == len(fit.dwells)
    assert all(check.passed for check in check_cam(cam, law))
    assert "left out, an outlier: line 52" in files.texts["mine.csv"]
    assert any(f"follower {kind}" in words for words in files.assumed)


def test_origins_are_told_apart(measured, tmp_path):
    """The gauge's error is given, what was fitted identified, what nobody read assumed."""
    readings = measured("poly345")
    given = written(spline_cam("mine", fit_spline(readings, 3e-6), "roller", 0.055), tmp_path)
    assert given.segments[0].tolerance.origin == "given"
    assert given.follower.base_radius.origin == "given"
    assert given.follower.base_radius.si == pytest.approx(0.055)
    found = written(spline_cam("mine", fit_spline(readings), "roller", None, 0.009), tmp_path)
    assert found.follower.roller_radius.si == pytest.approx(0.009)
    assert found.follower.roller_radius.origin == "given"
    assert found.segments[0].tolerance.origin == "identified"
    assert found.lift.origin == "identified"
    assert "r.m.s." in found.lift.residual
    assert found.follower.base_radius.origin == "assumed"
    assert {dwell.start.origin for dwell in found.segments[0].dwells} == {"identified"}


@pytest.mark.parametrize("flank", [0.09, None, -0.15])
def test_the_file_of_arcs_is_the_contour(tmp_path, flank):
    """The law of the file is the arcs' lift, turned so that the nose is at 180°."""
    arcs = Arcs(0.03, 0.01, flank, 0.012, 0.7)
    fit = fit_arcs(readings_of(arcs, ROLLER), (False,), 0.01, 0.03)
    files = arcs_cam("mine", fit, "roller")
    law = build_law(written(files, tmp_path))
    assert law(FINE) == pytest.approx(arcs.lifts(ROLLER, FINE + 0.7 - np.pi), abs=1e-7)
    assert "40.11 deg of the readings" in files.texts["mine.yaml"]
    assert any("roller radius 10 mm" in words for words in files.assumed)


def test_the_radius_that_was_given_is_given():
    """Of base and roller radius one may be known beside the readings; the other is then found."""
    readings = readings_of(Arcs(0.03, 0.01, 0.09, 0.012, 0.7), ROLLER)
    for known, base, rolling in (
        (None, "identified", "assumed"),
        ("roller", "identified", "given"),
        ("base", "given", "identified"),
        ("both", "given", "given"),
    ):
        fit = fit_arcs(readings, (False,), 0.01, 0.03, known)
        follower = arcs_cam("mine", fit, "roller").cam.follower
        assert follower.base_radius.origin == base
        assert follower.roller_radius.origin == rolling


@pytest.mark.parametrize("noise", [1e-5, 1e-4])
def test_digits_are_those_that_readings_tell(noise):
    """Radii of a file have few digits, the interval beside them, and are as near to readings."""
    arcs = Arcs(0.03, 0.01, 0.09, 0.012, 0.7)
    readings = readings_of(arcs, ROLLER, FLAT, noise=noise, seed=1)
    fit = fit_arcs(readings, (False, True), 0.01, 0.03)
    files = arcs_cam("mine", fit, "roller")
    radius = files.cam.follower.base_radius
    assert len(f"{radius.raw:g}".replace(".", "")) <= 5
    assert "95 %: base radius + roller radius" in radius.residual
    away = files.law(ANGLES - fit.arcs.nose_angle + np.pi) - readings[0].lifts
    assert np.sqrt(np.mean(away**2)) < 1.01 * fit.fitted_columns[0].rms + 1e-9


def test_rig_and_scene_are_read_back(measured, tmp_path, config_dir):
    """Every number of the rig is assumed; the speeds go beyond the jump speed, and are few."""
    like = load_rig(config_dir / "rigs" / "tm21.yaml")
    (tmp_path / "rig.yaml").write_text(own_rig("mine", like), encoding="utf-8")
    rig = load_rig(tmp_path / "rig.yaml")
    assert rig.follower.mass.si == like.follower.mass.si
    assert {getattr(rig.follower, key).origin for key in ("mass", "preload")} == {"assumed"}
    assert rig.radiation.gain.origin == "assumed"
    assert rig.radiation.calibrated_on == ""
    law = fit_spline(measured("poly345")).law
    text, speeds = own_scene("mine", law, rig)
    (tmp_path / "scene.yaml").write_text(text, encoding="utf-8")
    scene = load_scene(tmp_path / "scene.yaml")
    assert scene.program.speeds.numbers == list(speeds)
    assert list(speeds) == sorted(speeds)
    assert len(speeds) == 5
    heavy = own_scene("mine", law, rig.with_follower(preload=1e9))[1]
    assert max(heavy) <= 20_000.0  # no speed lifts it off, and none is huge


def test_a_coarse_gauge_is_read_back(measured, tmp_path):
    """0.1 mm of noise on 10 mm: the points rise by more than their law, and the cam loads."""
    fit = fit_spline(measured("flat", noise=1e-4))
    law = build_law(written(spline_cam("mine", fit, "roller"), tmp_path))
    assert law(FINE) == pytest.approx(fit.law(FINE), abs=2e-8)
    assert np.ptp(fit.readings.lifts) > law.lift + 2e-4


# -- intervals of 95 % of what readings tell of a contour hold the truth as often as they say


FOLLOWERS = {"roller": (ROLLER,), "flat": (FLAT,), "both": (ROLLER, FLAT)}
SHAPES = {
    "straight": Arcs(0.03, 0.01, None, 0.012, 0.5),
    "convex": Arcs(0.03, 0.01, 0.09, 0.012, 0.5),
    "concave": Arcs(0.03, 0.01, -0.15, 0.012, 0.5),
}
CASES = [(shape, followers) for shape in SHAPES for followers in FOLLOWERS]


def curvature(radius):
    """1/radius, so that an interval over a straight flank is one stretch."""
    with np.errstate(divide="ignore"):
        return float(1.0 / np.float64(radius))


def holds(fit, arcs, index):
    """Whether the interval of a number holds the truth; None where it has none."""
    told, truth = fit.told[index], fit.best.search.form.coordinates(arcs)[index]
    if told.held:
        return None
    if index not in (PRIME, FLANK):
        return told.low <= truth <= told.high
    if told.high == np.inf and truth <= 0.0:  # a flat face: straight or concave
        return True
    return curvature(told.high) <= truth <= curvature(told.low)


def coverage(shape, followers, copies):
    """Part of noisy copies whose interval holds the truth, NaN of a number that is held."""
    arcs, kinds = SHAPES[shape], FOLLOWERS[followers]
    flats, fits = tuple(kind.flat for kind in kinds), []
    for seed in range(copies):  # every 5° with 20 µm, as the commands take them
        read = map(above_zero, readings_of(arcs, *kinds, noise=2e-5, seed=seed))
        fits.append(fit_arcs(tuple(read), flats, 0.01, 0.03))
    held = [[holds(fit, arcs, index) for index in COORDINATES] for fit in fits]
    return np.array(held, dtype=float).mean(axis=0)


@pytest.mark.long
@pytest.mark.parametrize(("shape", "followers"), CASES)
def test_200_copies(shape, followers):
    """Between 90 and 99 % of the intervals of each number: docs/accuracy.md."""
    parts = coverage(shape, followers, 200)
    cells = ("" if np.isnan(part) else f"{100.0 * part:.1f}" for part in parts)
    print(f"| {shape} | {followers} | {' | '.join(cells)} |")
    assert (np.isnan(parts) | (parts >= 0.90) & (parts <= 0.99)).all(), parts

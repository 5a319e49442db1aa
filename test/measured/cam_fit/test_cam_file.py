"""A fit as files: they load, give the fitted law, and say where each number comes from."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.errors import ConfigError
from cam_rig.laws import build_law
from cam_rig.laws.arc_law import ArcFollower
from cam_rig.measured.cam_fit.arcs import Arcs
from cam_rig.measured.cam_fit.arcs_fit import fit_arcs
from cam_rig.measured.cam_fit.dwells import above_zero
from cam_rig.measured.cam_fit.files import arcs_cam, own_rig, own_scene, require_told, spline_cam
from cam_rig.measured.cam_fit.gauge import put_in_order, read_gauge_table
from cam_rig.measured.cam_fit.spline_fit import fit_spline
from cam_rig.profile.check_table import check_cam
from cam_rig.schema import load_cam, load_rig, load_scene
from cam_rig.units import TURN

from .conftest import ANGLES, FLAT, ROLLER, all_around, in_order, readings_of

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


def test_a_base_radius_that_fails_the_checks_is_named_beside_one_that_passes(measured):
    """1 mm under 10 mm of lift, as asked: it is written, and not called assumed."""
    fit = fit_spline(measured("poly345"))
    files = spline_cam("mine", fit, "roller", 1e-3)
    (words,) = (one for one in files.assumed if "checks" in one)
    assert words.startswith("the base radius of 1 mm, as asked, does not pass all checks, ")
    passing = float(words.split("all checks, ")[1].split(" mm does")[0])
    other = spline_cam("mine", fit, "roller", 1e-3 * passing)
    assert all(c.passed for c in check_cam(other.cam, other.law))


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


# -- tangent arcs through readings: the GL 110's table, and contours made at random -----------


@pytest.fixture(scope="module")
def gl110(config_dir):
    """Both columns of the shipped table."""
    table = read_gauge_table(config_dir / "cams" / "gunt_gl110_convex.csv")
    return tuple(above_zero(put_in_order(table, column)) for column in table.columns)


@pytest.fixture(scope="module")
def gl110_fit(gl110):
    return fit_arcs(gl110, (None, None), 0.010, 0.03)


def random_arcs(seed):
    """A convex contour that a flat face can follow, the nose anywhere."""
    rng = np.random.default_rng(seed)
    base, lift = rng.uniform(0.02, 0.05), rng.uniform(0.006, 0.014)
    nose = rng.uniform(0.3, 0.7) * base
    least = base + 0.5 * lift
    return Arcs(base, lift, least * rng.uniform(1.6, 4.0), nose, rng.uniform(-3.0, 3.0))


def test_both_tables_of_the_gl110_within_0_07_mm(gl110_fit):
    """66 readings with five numbers; what is left and which is which: docs/own_cam.md.

    Every other kind for the columns leaves ten times as much.
    """
    assert sum(column.away.size for column in gl110_fit.fitted_columns) == 66
    assert sum(math.isfinite(told.error) for told in gl110_fit.told) == 5
    assert all(column.rms <= 0.07e-3 for column in gl110_fit.fitted_columns)
    swapped = [one.rms for one in gl110_fit.others if "lift_a_mm flat" in one.name]
    assert min(swapped) > 10.0 * gl110_fit.rms


def test_the_shipped_cam_is_the_fit(cams, laws, gl110, gl110_fit):
    """Its numbers are those found, rounded; its law is the roller's readings within 0.063 mm."""
    cam, arcs = cams["gunt_gl110"], gl110_fit.arcs
    segment = cam.segments[0]
    written = [cam.lift, cam.follower.base_radius, segment.flank_radius, segment.nose_radius]
    found = [arcs.lift, arcs.base_radius, arcs.flank_radius, arcs.nose_radius]
    assert [number.si for number in written] == pytest.approx(found, abs=6e-7)
    angles = gl110[0].angles - arcs.nose_angle + math.pi
    away = laws["gunt_gl110"](angles) - gl110[0].lifts
    assert np.sqrt(np.mean(away**2)) * 1e3 == pytest.approx(0.063, abs=0.0005)


def test_base_and_roller_radius_are_told_as_a_sum(gl110, gl110_fit):
    """Another roller radius: the same lifts, the same five numbers; and that is said."""
    roller = 0.016
    other = fit_arcs(gl110, (False, True), roller, 0.03)
    assert other.rms == pytest.approx(gl110_fit.rms, rel=1e-6)
    assert other.numbers == pytest.approx(gl110_fit.numbers, rel=1e-4)
    assert other.arcs.base_radius == pytest.approx(gl110_fit.arcs.base_radius + 0.01 - roller, 1e-4)
    assert "only as a sum" in gl110_fit.cannot_tell[0]


@pytest.mark.variants(1)
@pytest.mark.parametrize(
    ("seed", "kinds"), [(1, (False, True)), (0, (None, None)), (3, (False, True))]
)
def test_a_random_contour_comes_back(seed, kinds):
    """Exact lifts of two columns, unnamed or not, one read backwards: kinds, sense, numbers."""
    arcs = random_arcs(seed)
    columns = readings_of(arcs, ROLLER, FLAT, reverse=(1,))
    fit = fit_arcs(columns, kinds, 0.01, 0.03)
    assert [column.kind for column in fit.fitted_columns] == ["roller", "flat"]
    assert [column.reverse for column in fit.fitted_columns] == [False, True]
    assert fit.rms < 1e-8
    for key in ("base_radius", "lift", "flank_radius", "nose_radius"):
        assert getattr(fit.arcs, key) == pytest.approx(getattr(arcs, key), rel=1e-4)
    assert math.remainder(fit.arcs.nose_angle - arcs.nose_angle, TURN) == pytest.approx(
        0.0, abs=1e-5
    )


def test_a_flat_follower_alone_tells_differences():
    """Its lifts are the same for any base radius, so one is taken; no error is given for it."""
    arcs = random_arcs(2)
    columns = readings_of(arcs, FLAT)
    one, other = (fit_arcs(columns, (True,), 0.01, base) for base in (0.03, 0.06))
    assert one.rms < 1e-8
    assert other.rms < 1e-8
    assert one.told[0].held == "assumed"
    assert one.numbers[2:4] == pytest.approx(other.numbers[2:4], rel=1e-5)
    assert one.numbers[3] == pytest.approx(arcs.nose_radius - arcs.base_radius, rel=1e-4)
    assert "less the base radius" in one.cannot_tell[0]


def test_a_point_tells_all():
    """Without a roller nothing is a sum."""
    arcs = random_arcs(1)
    fit = fit_arcs(readings_of(arcs, ArcFollower(False, 0.0)), (False,), 0.0, 0.03)
    assert fit.arcs.base_radius == pytest.approx(arcs.base_radius, rel=1e-4)
    assert fit.cannot_tell == ()


def test_a_tangent_cam_under_both_followers():
    """A flat face bridges a straight flank: both columns tell it is straight, and the radii."""
    arcs = Arcs(0.03, 0.01, None, 0.012, 0.5)
    fit = fit_arcs(readings_of(arcs, ROLLER, FLAT, noise=1e-4), (False, True), 0.01, 0.03)
    assert fit.arcs.flank == "straight"
    assert fit.arcs.base_radius == pytest.approx(0.03, abs=1e-3)
    assert any("a tangent cam" in words for words in fit.conclusions())


def test_straight_is_taken_where_it_is_as_near_and_what_is_known_is_kept():
    """A roller alone with 0.1 mm does not tell straight from curved; the interval says so."""
    arcs = Arcs(0.03, 0.01, 1.0, 0.012, 0.5)
    columns = readings_of(arcs, ROLLER, noise=1e-4)
    fit = fit_arcs(columns, (False,), 0.01, 0.03)
    assert fit.arcs.flank == "straight"
    assert fit.told[2].over_straight
    assert fit.told[2].low < 1.01
    curved = fit_arcs(columns, (False,), 0.01, 0.03, None, "curved")
    assert curved.arcs.flank != "straight"
    asked = fit_arcs(columns, (False,), 0.01, 0.03, None, "straight")
    width = [one.told[0].high - one.told[0].low for one in (asked, fit)]
    assert width[0] < 0.2 * width[1]


def test_lifts_under_a_roller_alone_do_not_tell_the_base_radius():
    """A curved flank, 0.1 mm: the prime radius has no upper end, so no file is written of it."""
    columns = readings_of(Arcs(0.03, 0.01, 0.09, 0.012, 0.5), ROLLER, noise=1e-4)
    fit = fit_arcs(columns, (False,), 0.01, 0.03, None, "curved")
    assert fit.told[0].high == math.inf
    with pytest.raises(ConfigError, match=r"do not tell the base radius: .* is above"):
        require_told(fit, named=True)
    bridged = readings_of(Arcs(0.03, 0.01, None, 0.012, 0.5), FLAT, noise=1e-4)
    straight = fit_arcs(bridged, (False,), 0.01, 0.03)
    assert straight.arcs.flank == "straight"
    with pytest.raises(ConfigError, match=r"do not tell the base radius: .* is above"):
        require_told(straight, named=True)
    given = fit_arcs(columns, (False,), 0.01, 0.03, "both", "curved")
    require_told(given, named=True)
    assert given.told[0].held == "given"


def test_a_column_that_any_follower_may_have_made():
    """A flat follower's lifts are a roller's on a huge cam: the kind is asked for, not chosen."""
    columns = readings_of(Arcs(0.03, 0.01, 0.2, 0.012, 0.5), FLAT, noise=1e-4)
    fit = fit_arcs(columns, (None,), 0.01, 0.03)
    assert fit.unclear_kinds is not None
    with pytest.raises(ConfigError, match=r"do not tell the follower: .* allowed: --follower"):
        require_told(fit, named=False)


def test_the_farthest_reading_is_named_with_its_line():
    """One of 72 readings is 0.1 mm off, five times the others' scatter: not left out, but named."""
    arcs = Arcs(0.03, 0.01, 0.09, 0.012, 0.5)
    (column,) = readings_of(arcs, ROLLER, noise=2e-5)
    lifts = column.lifts.copy()
    lifts[10] += 1e-4
    fit = fit_arcs((replace(column, lifts=lifts),), (False,), 0.01, 0.03)
    named = [words for words in fit.conclusions() if "farthest from the law" in words]
    assert len(named) == 1
    assert f"line {column.lines[10]} (" in named[0]


def readings_of_a_bridge(seed, slips=()):
    """A flat face that bridges the flanks, read so that each passage between base and nose is a
    step of velocity: 36 to 360 readings, 1 to 50 µm; a slip of so many standard deviations where
    the two readings on either side lie on one circle with it; and where that is."""
    rng = np.random.default_rng(seed)
    base, nose = rng.uniform(0.02, 0.05), rng.uniform(0.2, 0.7)
    flank = rng.choice([None, -rng.uniform(0.05, 0.3)])
    arcs = Arcs(base, rng.uniform(0.006, 0.014), flank, nose * base, rng.uniform(-3.0, 3.0))
    count, noise = int(rng.choice([36, 72, 120, 360])), 10.0 ** rng.uniform(-6.0, -4.3)
    angles = all_around(count)
    exact = arcs.lifts(FLAT, angles)
    lifts, on_nose = exact + rng.normal(scale=noise, size=count), (exact > 0.0).astype(int)
    one_circle = np.isin(sum(np.roll(on_nose, step) for step in range(-2, 3)), [0, 5])
    places = sorted(rng.choice(np.flatnonzero(one_circle), len(slips), replace=False))
    for place, slip in zip(places, slips, strict=True):
        lifts[place] += slip * noise
    return above_zero(in_order(angles, lifts)), [place + 2 for place in places]


@pytest.mark.variants(1)
@pytest.mark.parametrize("count", [12, pytest.param(100, marks=pytest.mark.long)])
@pytest.mark.parametrize("slips", [(), (10.0,), (-10.0,), (-40.0,)])
def test_readings_beside_a_step_of_velocity_are_no_outliers_and_slips_are(count, slips):
    """Neighbours contradict a good reading there, and it hides a slip elsewhere: the arcs do not.

    No good reading is left out, and a slip is named, as an outlier or as the farthest from the
    law. Of 10 standard deviations one in fifty may be missed: a lowest reading is then the zero.
    """
    missed = wrong = 0
    for seed in range(count):
        readings, lines = readings_of_a_bridge(seed, slips)
        wrong += len(readings.outliers)
        fit = fit_arcs((readings,), (True,), 0.01, 0.05)
        left = [one.line for one in fit.fitted_columns[0].readings.outliers]
        assert set(left) <= set(lines), seed
        assert fit.best.search.count + len(left) == readings.angles.size + len(readings.outliers)
        words = " ".join(fit.conclusions())
        missed += not all(f"line {line} " in words for line in lines)
    assert missed <= count // 50
    assert slips or wrong  # of good readings alone, the neighbours contradict some


def test_radii_that_the_readings_contradict_are_taken_with_a_warning():
    """60 and 10 mm in place of 30 and 10: more is left, and the sum that readings tell is named."""
    columns = readings_of(Arcs(0.03, 0.01, 0.09, 0.012, 0.5), ROLLER, FLAT, noise=2e-5)
    wrong = fit_arcs(columns, (False, True), 0.01, 0.06, "both")
    assert wrong.arcs.base_radius == pytest.approx(0.06)
    assert any("contradict the radii given" in words for words in wrong.conclusions())
    right = fit_arcs(columns, (False, True), 0.01, 0.03, "both")
    assert not any("contradict" in words for words in right.conclusions())

"""Command `cam-rig fit sound`: fits to known constants, level tables, rig file.

Two constants, a gain and a corner frequency, convert the contact force to a sound level.
"""

import json
import math
from dataclasses import replace
from shutil import copytree

import numpy as np
import pytest

import cam_rig
from cam_rig.acoustics import level_db
from cam_rig.acoustics.pressure import steady_power
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.schema.load import config_root, read_yaml
from cam_rig.simulation.scene import load_scene
from cam_rig.studies.fit_sound.identified import set_identified
from cam_rig.studies.fit_sound.study import read_levels
from cam_rig.units import RPM

from ...cli.conftest import call, done

SPEEDS = np.arange(200.0, 401.0, 25.0)


@pytest.fixture(scope="module")
def scene():
    """Scene of the noise measurements in the paper (see docs/glossary.md)."""
    return load_scene("tm21_sweep")


def levels_of(scene, radiation, zigzag=0.0):
    """Return computed steady sound levels of the 3-4-5 cam: speed (rpm), level (dB).

    The shape is (n, 2). `zigzag` dB are added with alternating sign.
    """
    law, follower = scene.laws["poly345"], scene.follower
    power = [steady_power(law, follower, radiation, rpm * RPM) for rpm in SPEEDS.tolist()]
    levels = level_db(np.sqrt(np.array(power))) + zigzag * (-1.0) ** np.arange(SPEEDS.size)
    return np.column_stack([SPEEDS, levels])


@pytest.fixture
def save(tmp_path):
    """Function that writes a table of levels and returns its path."""

    def write(levels):
        path = tmp_path / "levels.csv"
        if not isinstance(levels, str):
            rows = [f"{rpm},{level}" for rpm, level in levels.tolist()]
            levels = "\n".join(["rpm,level [dB]", *rows])
        path.write_text(levels, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize(("gain", "corner"), [(2e-4, 15.0), (5e-5, 60.0)])
def test_recovers_gain_and_corner(scene, gain, corner):
    """The sound fit recovers gain and corner frequency from computed levels.

    The relative tolerance is 1e-4.
    """
    true = replace(scene.radiation, gain=gain, corner_frequency=corner)
    found = cam_rig.fit_sound(levels_of(scene, true), scene)
    assert found.cam == "poly345"
    assert found.gain == pytest.approx(gain, rel=1e-4)
    assert found.corner_frequency == pytest.approx(corner, rel=1e-4)
    assert found.rms < 1e-4


def test_residual_is_the_rms_difference(scene):
    """The residual of a sound fit is the r.m.s. difference of fitted and given levels.

    Alternating errors of ±0.5 dB give 0.4 to 0.5 dB.
    """
    found = cam_rig.fit_sound(levels_of(scene, scene.radiation, 0.5), scene)
    fitted = replace(scene.radiation, gain=found.gain, corner_frequency=found.corner_frequency)
    residual = levels_of(scene, fitted)[:, 1] - levels_of(scene, scene.radiation, 0.5)[:, 1]
    assert [row.difference for row in found.levels] == pytest.approx(residual, abs=1e-9)
    assert found.rms == pytest.approx(float(np.sqrt(np.mean(residual**2))), rel=1e-9)
    assert 0.4 < found.rms <= 0.5


@pytest.mark.parametrize(
    ("levels", "error"),
    [
        ([[200, 80], [300, 85]], r"3 or more different speeds, got \(2, 2\)"),
        ([[300, 80], [300, 81], [300, 82]], "3 or more different speeds"),
        ([[200, 80], [300, np.nan], [400, 88]], "levels must be between .* got nan at 300 rpm"),
        ([[200, 80], [300, 1e300], [400, 88]], "levels must be between .* got 1e.300 at 300 rpm"),
        ([[200, 80], [300, 20], [400, 88]], "must be above the background .* got 20 dB at 300 rpm"),
        ([[0, 80], [300, 85], [400, 88]], "speeds must be between 1 and 100000 rpm, got 0"),
        ([[1e-300, 80], [300, 85], [400, 88]], "speeds must be between .* got 1e-300"),
        ([[200, 80j], [300, 85], [400, 88]], "array of complex128; allowed: .* real"),
        ([["a", "b"]], "array of <U1"),
        ([[200, 75.6], [300, 83.4], [400, 89.9]], "do not determine the corner frequency"),
        ([[300, 80], [400, 85], [600, 90]], "cam 'poly345' must keep contact .* at 600 rpm"),
    ],
)
def test_refusals(scene, levels, error):
    """Invalid levels, and levels of an unknown cam, are refused.

    Levels of a cam that loses contact are refused too.
    """
    with pytest.raises((ConfigError, DynamicsError), match=error):
        cam_rig.fit_sound(np.array(levels), scene)
    with pytest.raises(ConfigError, match="has no cam 'no_such'"):
        cam_rig.fit_sound(levels_of(scene, scene.radiation), scene, cam="no_such")


@pytest.mark.parametrize(
    "text",
    [
        "rpm,dB\n200,75.6\n300,\n400,89.9\n",
        "Drehzahl [rpm];Pegel [dB]\n200;75,6\n400;89,9\n",
        "# meter\nlevel\tspeed\tnote\n75.6\t200\ta\n89.9\t400\tb\n",
        "Drehzahl [1/min],Pegel [dB]\n200,75.6\n400,89.9\n",
        "velocidad rpm,nivel dB(Z)\n200,75.6\n400,89.9\n",
    ],
)
def test_tables(save, text):
    """Tables of sound levels in various usual formats give the same numbers.

    They differ in separator, decimal mark, columns, unit names and empty levels.
    """
    assert read_levels(save(text)).tolist() == [[200.0, 75.6], [400.0, 89.9]]


@pytest.mark.parametrize(
    ("heading", "error"),
    [
        ("rpm,force", "must have one column of the level.* got rpm, force"),
        ("rpm,dBA", "must have one column of the level.* got rpm, dBA"),
        ("rpm,dB(A)", "'dB.A.' is unclear, .* level .dB, unweighted"),
        ("rpm,LAeq [dB]", "'LAeq .dB.' is unclear, .* level .dB, unweighted"),
        ("speed deg/s,dB", "'speed deg/s' is unclear"),
    ],
)
def test_other_columns_are_refused(save, heading, error):
    """A table of A-weighted levels, of forces, or of speeds in deg/s is refused.

    The levels must be in dB without weighting.
    """
    with pytest.raises(ConfigError, match=error):
        read_levels(save(heading + "\n5,75.6\n6,89.9\n"))


@pytest.mark.parametrize(
    ("heading", "speed"),
    [
        ("speed [Hz],dB", 200.0 / 60.0),
        ("drehzahl 1/s,dB", 200.0 / 60.0),
        ("speed rad/s,dB", 200.0 * math.pi / 30.0),
    ],
)
def test_units_of_speed_are_read(save, heading, speed):
    """Speeds in Hz, 1/s and rad/s are converted to rpm."""
    levels = read_levels(save(f"{heading}\n{speed!r},75.6\n"))
    assert levels == pytest.approx(np.array([[200.0, 75.6]]), rel=1e-12)


# -- the command `cam-rig fit sound`


def test_a_dry_run_writes_nothing(scene, save):
    """--dry-run prints the fitted numbers and does not change the rig file."""
    path, rig = save(levels_of(scene, scene.radiation)), config_root() / "rigs" / "tm21.yaml"
    before = rig.read_bytes()
    result = done("fit", "sound", path, "tm21_sweep", "--dry-run", "--json", "-")
    assert json.loads(result.stdout)["sound"]["corner_frequency"] == pytest.approx(18.42, rel=1e-6)
    assert "gain 9.86e-05 Pa·s/N, corner 18.42 Hz" in result.stderr
    assert rig.read_bytes() == before


def test_levels_of_another_cam_than_that_of_the_file_are_refused(scene, save):
    """Levels of another cam than that of the rig's calibration are refused.

    The error contains the names of both cams.
    """
    path = save(np.column_stack([SPEEDS, scene.published_levels("bezier15", SPEEDS)]))
    result = call("fit", "sound", path, "tm21_sweep", "--cam", "bezier15")
    assert result.exit_code == 2
    assert (
        "radiation.calibrated_on must be 'bezier15', the cam of the levels, got 'poly345'"
        in result.stderr
    )


def roles(scene):
    """Return the origin of each cam's sound level, such as calibrated, by cam."""
    loaded = load_scene(scene)
    return {cam: loaded.level_origin(cam) for cam in loaded.cams}


@pytest.mark.long
def test_a_calibration_is_valid_for_its_follower_only(tmp_path, save):
    """After a change of the follower's mass, all levels are relative to a reference.

    A new calibration makes them absolute again.
    """
    copytree(config_root(), tmp_path / "own")
    scene, rig = (tmp_path / "own" / f for f in ("scenes/tm21_sweep.yaml", "rigs/tm21.yaml"))
    rig.write_text(rig.read_text(encoding="utf-8").replace("given: 1.3,", "given: 1.2,"))
    assert set(roles(scene).values()) == {"relative"}
    published = load_scene(scene).published_levels("poly345", SPEEDS)
    done("fit", "sound", save(np.column_stack([SPEEDS, published])), scene)
    assert "one_mass, mass 1.2 kg, spring_stiffness 4030 N/m" in rig.read_text(encoding="utf-8")
    found = roles(scene)
    assert (found["poly345"], found["bezier15"]) == ("calibrated", "predicted")
    rig.write_text(rig.read_text(encoding="utf-8").replace("given: 1.2,", "given: 1.1,"))
    assert set(roles(scene).values()) == {"relative"}


# -- numbers in a YAML file

TEXT = """\
# A comment that stays.
radiation:
  gain: {assumed: 1.5e-4, unit: Pa*s/N}   # a guess
  corner_frequency:
    given: 20  # of a paper
    unit: Hz
    source: >
      a long
      story
    residual: 'none'
segments:
  - {law: dwell, span: {identified: 90, unit: deg, source: "old, with comma", residual: 2 dB}}
  - law: Größe
"""


@pytest.fixture
def path(tmp_path):
    """Small rig file with comments, which a test changes."""
    path = tmp_path / "rig.yaml"
    path.write_text(TEXT, encoding="utf-8")
    return path


def test_numbers_are_written_with_source_and_residual(path):
    """A fitted number is written as `identified`, with its source and residual.

    An earlier source and residual are replaced.
    """
    numbers = {("radiation", "gain"): 9.8e-5, ("radiation", "corner_frequency"): 18.4}
    set_identified(path, {**numbers, ("segments", 0, "span"): 117.5}, 'a "fit"', "0.6 dB, 2 of 3")
    origin = {"source": 'a "fit"', "residual": "0.6 dB, 2 of 3"}
    read = read_yaml(path)
    assert read["radiation"]["gain"] == {"identified": 9.8e-5, "unit": "Pa*s/N", **origin}
    assert read["radiation"]["corner_frequency"] == {"identified": 18.4, "unit": "Hz", **origin}
    assert read["segments"][0]["span"] == {"identified": 117.5, "unit": "deg", **origin}
    assert read["segments"][1]["law"] == "Größe"


def test_the_rest_of_the_file_is_unchanged(path):
    """Writing a fitted number keeps every other character of the rig file."""
    set_identified(path, {("radiation", "gain"): 2.0}, "s", "r")
    changed = TEXT.replace("assumed: 1.5e-4", 'identified: 2.0, source: "s", residual: "r"')
    assert path.read_text(encoding="utf-8") == changed


def test_writing_the_same_numbers_twice_gives_the_same_file(tmp_path, config_dir):
    """Writing the same fitted numbers again does not change the rig file."""
    path = tmp_path / "tm21.yaml"
    path.write_bytes((config_dir / "rigs" / "tm21.yaml").read_bytes())
    for _ in range(2):
        before = path.read_bytes()
        set_identified(path, {("radiation", "gain"): 1e-4}, "s", "r")
    assert path.read_bytes() == before
    assert read_yaml(path)["radiation"]["corner_frequency"]["identified"] == 18.42


def test_an_unwritable_file_raises_a_one_line_error(path, monkeypatch):
    """A rig file that cannot be written raises ConfigError and stays unchanged."""

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(ConfigError, match=r"rig.yaml: cannot be written \(No space left"):
        set_identified(path, {("radiation", "gain"): 2.0}, "s", "r")
    assert path.read_text(encoding="utf-8") == TEXT
    assert [p.name for p in path.parent.iterdir()] == ["rig.yaml"]

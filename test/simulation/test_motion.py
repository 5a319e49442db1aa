"""Tests of `cam_rig.simulate` and `cam_rig.sound_level` for one cam at one speed."""

import pickle
import sys

import numpy as np
import pytest

import cam_rig
from cam_rig.errors import ConfigError, DynamicsError, MissingLibraryError


@pytest.fixture(scope="module")
def law():
    """Law of the cam bezier15."""
    return cam_rig.build_law(cam_rig.load_cam("bezier15"))


def test_a_motion_has_the_level_of_a_scene(law, rig):
    """`sound_level` of a motion equals the first level of a scene, bit for bit.

    The scene has the same cam, rig and speed.
    """
    scene = cam_rig.run_scene("quick")
    motion = cam_rig.simulate(law, rig, rpm=200, turns=2, sample_rate=1000)
    tm21 = cam_rig.build_law(cam_rig.load_cam("tm21"))
    first = cam_rig.simulate(tm21, rig, rpm=200, turns=2, sample_rate=1000)
    assert cam_rig.sound_level(first).level_db == scene.noise.curves["tm21"].level_db[0]
    assert cam_rig.sound_level(motion).level_db != scene.noise.curves["tm21"].level_db[0]


def test_the_kinetostatic_motion_is_the_law(law, rig):
    """Lift and its derivatives are s, ω s' and ω² s'' at the samples' cam angles."""
    motion = cam_rig.simulate(law, rig, model="kinetostatic", rpm=300, turns=2, sample_rate=8000)
    speed = np.pi * 10.0
    np.testing.assert_allclose(motion.angle, speed * motion.time, rtol=1e-12)
    np.testing.assert_allclose(motion.lift, law(motion.angle), atol=1e-15)
    np.testing.assert_allclose(motion.velocity, speed * law(motion.angle, 1), atol=1e-12)
    np.testing.assert_allclose(motion.acceleration, speed**2 * law(motion.angle, 2), atol=1e-9)
    assert motion.rpm == 300 and motion.events == ()


def test_a_ramp_brings_the_cam_to_speed(law, rig):
    """With a ramp the cam starts at rest at angle 0 and reaches the requested speed.

    The angle at the end of the ramp is half the speed times its duration.
    """
    motion = cam_rig.simulate(law, rig, rpm=300, turns=1, sample_rate=1000, ramp=0.5)
    ramp_end = int(np.searchsorted(motion.time, 0.5))
    assert motion.angle[0] == 0.0
    assert motion.angle[ramp_end] == pytest.approx(0.5 * 0.5 * 10.0 * np.pi, rel=1e-9)


def test_arrays_are_read_only_views(law, rig):
    """Samples, turns and named rows of a motion share one array, which is read-only."""
    motion = cam_rig.simulate(law, rig, rpm=300, turns=2, sample_rate=1000)
    assert np.shares_memory(motion.force, motion.rows)
    assert np.shares_memory(motion.blocks[1].force, motion.rows)
    np.testing.assert_array_equal(
        np.concatenate([block.lift for block in motion.blocks]), motion.lift
    )
    for array in (motion.lift, motion.angle, motion.blocks[0].rows):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"rpm": 300, "turns": 0}, r"simulate: turns: is 0 turns; allowed: at least 1"),
        ({"rpm": 300, "sample_rate": 100, "ramp": -1}, r"simulate: ramp: is -1 s"),
        ({"rpm": 300, "model": "two_mass"}, r"rig tm21: follower.roller_share, .*: are missing"),
    ],
)
def test_the_error_names_a_wrong_argument(law, rig, arguments, message):
    """An invalid argument of `simulate` raises an error with its name and limit."""
    with pytest.raises(ConfigError, match=message):
        cam_rig.simulate(law, rig, **arguments)


def test_the_level_leaves_out_the_first_turns(law, rig):
    """The level is the energy mean over the turns after the first `transient_turns`.

    The tolerance is 1e-9 dB. At least one turn must remain.
    """
    # At 375 rpm each turn has 640 samples, so all turns have the same weight.
    motion = cam_rig.simulate(law, rig, rpm=375, turns=4, sample_rate=4000)
    result = cam_rig.sound_level(motion, transient_turns=2)
    mean = 10.0 * np.log10(np.mean(10.0 ** (result.by_turn[2:] / 10.0)))
    assert result.level_db == pytest.approx(mean, abs=1e-9)
    with pytest.raises(
        ConfigError, match=r"transient_turns must be between 0 and 3, fewer than the 4"
    ):
        cam_rig.sound_level(motion, transient_turns=4)


def test_a_level_reports_its_calibration(law, rig):
    """The text of a sound level states whether it is calibrated or relative.

    It is calibrated if the radiation constants were fitted to measurements.
    """
    data = rig.model_dump(exclude_none=True)
    data["radiation"]["gain"] = {"assumed": rig.radiation.gain.si, "unit": "Pa*s/N"}
    with_assumption = type(rig).model_validate(data)
    calibrated, relative = (
        cam_rig.sound_level(cam_rig.simulate(law, r, rpm=300, turns=2, sample_rate=4000))
        for r in (rig, with_assumption)
    )
    assert calibrated.calibrated and not relative.calibrated
    assert calibrated.level_db == relative.level_db
    assert str(calibrated).endswith("(calibrated on poly345)")
    assert str(relative).endswith("(relative: uncalibrated)")


def test_results_have_tables(law, rig):
    """A motion and its level are converted to data frames and plain data.

    There is one column per quantity. Turns that are excluded from the level are marked.
    """
    motion = cam_rig.simulate(law, rig, rpm=300, turns=2, sample_rate=1000)
    table = motion.to_pandas()
    assert list(table)[:3] == ["time", "angle", "lift"]
    np.testing.assert_array_equal(table["force"], motion.force)
    turns = cam_rig.sound_level(motion).to_pandas()
    assert turns["settled"].tolist() == [False, True]
    assert motion.data()["samples"][3]["lift"] == motion.lift[3]
    events = cam_rig.simulate(law, rig, rpm=800, turns=1, sample_rate=1000).to_pandas("events")
    assert events["kind"].tolist()[:2] == ["lift-off", "landing"]


def test_results_have_figures(law, rig, figures):
    """The figures of a motion and a level show lift, force and level by turn."""
    motion = cam_rig.simulate(law, rig, rpm=800, turns=2, sample_rate=4000)
    assert motion.events
    lift, force = motion.plot().axes
    np.testing.assert_array_equal(force.lines[0].get_ydata(), motion.force)
    np.testing.assert_array_equal(lift.lines[1].get_ydata(), law(motion.angle) * 1e3)
    (levels,) = cam_rig.sound_level(motion).plot().axes
    assert levels.lines[0].get_ydata().size == 2


@pytest.mark.parametrize(
    ("library", "method", "remedy"),
    [
        ("pandas", "to_pandas", "pandas is not installed: pip install pandas"),
        ("matplotlib", "plot", r"matplotlib is not installed: pip install 'cam_rig\[plots\]'"),
    ],
)
def test_the_error_names_a_missing_library(law, rig, monkeypatch, library, method, remedy):
    """If pandas or matplotlib is missing, the error states how to install it."""
    for name in [*sys.modules]:
        if name.split(".")[0] == library or name.endswith((".figure", ".figures")):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, library, None)
    motion = cam_rig.simulate(law, rig, rpm=300, turns=1, sample_rate=1000)
    with pytest.raises(MissingLibraryError, match=f"^{remedy}$"):
        getattr(motion, method)()


@pytest.mark.parametrize("model", ["one_mass", "kinetostatic"])
def test_a_law_with_a_jump_of_lift_is_an_error(rig, model):
    """A law whose lift jumps is refused with the height and angle of the jump.

    This is so even if the slopes on both sides are equal.
    """
    saw = cam_rig.Law("saw", [0.0, 2.0 * np.pi], [[0.0], [0.1]])
    with pytest.raises(DynamicsError, match=r"law 'saw': lift jumps by 0\.1 m at 0°"):
        cam_rig.simulate(saw, rig, model=model, rpm=300)


def test_a_motion_can_be_pickled(law, rig):
    """A pickled motion keeps its samples and its law.

    It can therefore be sent to another process.
    """
    motion = cam_rig.simulate(law, rig, rpm=400, turns=1, sample_rate=1000)
    copy = pickle.loads(pickle.dumps(motion))
    np.testing.assert_array_equal(copy.lift, motion.lift)
    assert copy.law.at(1.0) == law.at(1.0)

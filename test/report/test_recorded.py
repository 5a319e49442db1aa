"""A recording beside the run: the same levels, or a refusal that says what is wrong with it."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.errors import BagError
from cam_rig.report.sections import read_recorded
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.simulate import simulate, step_levels


@pytest.fixture
def quick(config_dir):
    """The scene of the golden bag."""
    return open_scene(config_dir / "scenes" / "quick.yaml")


@pytest.fixture
def golden(config_dir):
    """A recording of it."""
    return config_dir.parent / "bags" / "golden"


def test_recorded_levels_are_the_simulated(quick, golden):
    """Node graph and one process: the same numbers."""
    found = read_recorded(golden, quick)
    levels = step_levels(simulate(quick), quick.scene.program.settle_turns.si)
    assert found.level_db.keys() == levels.keys()
    for cam, steps in levels.items():
        expected = np.array([steps[speed] for speed in sorted(steps)])
        assert found.level_db[cam] == pytest.approx(expected, abs=1e-9)


def test_bag_of_another_scene(golden, config_dir):
    """The scene it is of, the scene it should be of, and what to do."""
    loaded = open_scene(config_dir / "scenes" / "tm21_sweep.yaml")
    with pytest.raises(BagError, match=r"scene 'quick'; allowed: of 'tm21_sweep'.*cam-rig run"):
        read_recorded(golden, loaded)


def test_bag_of_an_older_rig(quick, golden):
    """The same scene on a rig whose preload was changed since; words may change."""
    follower = quick.rig.follower
    preload = follower.preload.model_copy(update={"assumed": 99.0})
    rig = quick.rig.model_copy(
        update={"follower": follower.model_copy(update={"preload": preload})}
    )
    with pytest.raises(BagError, match="recorded with another follower than the files have now"):
        read_recorded(golden, replace(quick, rig=rig))
    renamed = replace(quick, rig=quick.rig.model_copy(update={"title": "another"}))
    assert read_recorded(golden, renamed).messages > 0


def test_truncated_bag(quick, golden, tmp_path):
    """Half a file is no recording."""
    bag = shutil.copytree(golden, tmp_path / "golden")
    (file,) = bag.glob("*.mcap")
    file.write_bytes(file.read_bytes()[:60_000])
    with pytest.raises(BagError, match=r"was not closed: .*cam-rig recover"):
        read_recorded(bag, quick)

"""Numbers leave the rig: a row each speed from simulate and analyze, all samples from export."""

import csv
import io

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin
from typer.testing import CliRunner

from cam_rig.cli.main import app
from cam_rig.schema.load import config_root

from .test_bags import as_ros2_records

GOLDEN = config_root().parent / "bags" / "golden"


def call(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_a_scene_and_its_bag_give_the_same_rows():
    """As CSV on stdout: keys, and numbers that agree to rounding."""
    tables = []
    for words in (["simulate", "quick"], ["analyze", GOLDEN]):
        result = call(*words, "--csv", "-")
        assert result.exit_code == 0, result.stderr
        keys, *rows = csv.reader(io.StringIO(result.stdout))
        assert keys[:5] == ["cam", "rpm", "turns", "level", "force_peak"]
        assert [row[1] for row in rows[:4]] == ["200.0", "300.0", "350.0", "400.0"]
        tables.append(np.array([row[1:] for row in rows], dtype=float))
    np.testing.assert_allclose(*tables, rtol=1e-9)


@pytest.mark.parametrize("source", ["quick", GOLDEN, GOLDEN / "golden_0.mcap"])
def test_export_says_what_it_wrote(tmp_path, source):
    """Of a scene, a bag, or a bag's file."""
    target = tmp_path / "new" / "a.npz"
    result = call("export", source, "--cam", "tm21", "--rpm", "350", "--to", target)
    assert result.exit_code == 0, result.stderr
    with np.load(target) as columns:
        assert set(columns["cam"]) == {"tm21"}
        assert f"{columns['force_N'].size} samples" in result.stderr
    assert "gaps" not in result.stderr


@pytest.mark.variants(1)
@pytest.mark.parametrize("plugin", list(StoragePlugin), ids=lambda plugin: plugin.name)
def test_a_bag_of_ros2_bag_record(tmp_path, plugin):
    """With the wall's time and no scene: the same samples, when the scene is named."""
    as_ros2_records(tmp_path / "theirs", plugin)
    for source, words in ((tmp_path / "theirs", ["--scene", "quick"]), (GOLDEN, [])):
        result = call("export", source, *words, "--to", tmp_path / f"{source.name}.csv")
        assert result.exit_code == 0, result.stderr
    one, other = ((tmp_path / f"{name}.csv").read_text() for name in ("theirs", "golden"))
    assert one == other


def test_what_cannot_be_exported_is_said_in_a_line(tmp_path):
    """Kind of file, place, speed."""
    for words, error in (
        (["quick", "--to", tmp_path / "a.xlsx"], "allowed: .parquet, .csv, .npz, .wav"),
        (["quick", "--to", tmp_path], "unknown kind of file"),
        (["quick", "--rpm", "222", "--to", tmp_path / "a.csv"], "no samples of a cam at 222 rpm"),
        (["quik", "--to", tmp_path / "a.csv"], "did you mean 'quick'"),
    ):
        result = call("export", *words)
        assert result.exit_code == 2
        assert error in result.stderr
        assert result.stderr.strip().count("\n") == 0
    assert list(tmp_path.iterdir()) == []

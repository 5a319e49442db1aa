"""Numbers leave the rig: a row each speed from simulate and analyze, all samples from export."""

import csv
import io

import numpy as np
import pytest

from .calls import GOLDEN, call


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

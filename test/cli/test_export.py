"""All samples of a run leave the rig."""

import numpy as np
import pytest

from .calls import GOLDEN, done


@pytest.mark.parametrize("source", ["quick", GOLDEN, GOLDEN / "golden_0.mcap"])
def test_export_says_what_it_wrote(tmp_path, source):
    """Of a scene, a bag, or a bag's file."""
    target = tmp_path / "new" / "a.npz"
    result = done("export", source, "--cam", "tm21", "--rpm", "350", "--to", target)
    with np.load(target) as columns:
        assert set(columns["cam"]) == {"tm21"}
        assert f"{columns['force_N'].size} samples" in result.stderr
    assert "gaps" not in result.stderr

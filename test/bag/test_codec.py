"""Laws and blocks survive the way through a labelled array bit for bit."""

import numpy as np
import pytest

from cam_rig.bag.codec import BLOCK_LABEL, decode_block, decode_law, encode_block, encode_law
from cam_rig.errors import RefusedError
from cam_rig.laws import build_law
from cam_rig.schema import load_cam
from cam_rig.schema.load import config_root


@pytest.mark.parametrize("cam", ["poly345", "cycloidal", "bezier15", "tm21"])
def test_a_law_comes_back_bit_for_bit(cam):
    """What the law server publishes is the exact law, not a sampling of it."""
    law = build_law(load_cam(config_root() / "cams" / f"{cam}.yaml"))
    dimensions, data = encode_law(law)
    back = decode_law(dimensions, data.ravel())
    assert back.name == law.name
    assert np.array_equal(back.breaks, law.breaks)
    assert np.array_equal(back.ordinates, law.ordinates)


def test_a_block_comes_back_bit_for_bit():
    """The samples are the numbers of the core, unrounded."""
    rows = np.random.default_rng(1).normal(size=(6, 7))
    dimensions, data = encode_block(rows)
    assert np.array_equal(decode_block(dimensions, data.ravel()), rows)


@pytest.mark.parametrize(
    "dimensions",
    [
        [],
        [(BLOCK_LABEL, 6)],
        [(BLOCK_LABEL, 6), ("sample", 3)],
        [("other", 6), ("sample", 2)],
        [(BLOCK_LABEL, 3), ("sample", 4)],
    ],
)
def test_another_layout_is_refused(dimensions):
    """A block whose labels or sizes are not ours is an error that says so."""
    with pytest.raises(RefusedError, match="allowed"):
        decode_block(dimensions, np.zeros(12))


def test_a_law_with_a_hole_is_refused():
    """Numbers that are no law are refused before anything turns."""
    law = build_law(load_cam(config_root() / "cams" / "bezier15.yaml"))
    dimensions, data = encode_law(law)
    broken = data.ravel().copy()
    broken[3] = np.nan
    with pytest.raises(RefusedError, match="finite"):
        decode_law(dimensions, broken)
    with pytest.raises(RefusedError, match="law coefficients"):
        decode_law([("x", 1), ("y", broken.size)], broken)

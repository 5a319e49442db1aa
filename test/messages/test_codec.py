"""Laws and blocks survive the way through a labelled array bit for bit."""

from types import SimpleNamespace

import numpy as np
import pytest

from cam_rig.errors import RefusedError
from cam_rig.laws import build_law
from cam_rig.messages.codec import (
    BLOCK_LABEL,
    cam_state_of,
    decode_block,
    decode_law,
    encode_block,
    encode_law,
)
from cam_rig.schema import load_cam
from cam_rig.schema.load import config_root
from cam_rig.simulation.schedule import CamState
from cam_rig.units import TURN


def test_laws_and_blocks_come_back_bit_for_bit():
    """What the law server publishes is the exact law, not a sampling of it; samples are the core's
    numbers, unrounded."""
    for cam in ("poly345", "cycloidal", "bezier15", "tm21"):
        law = build_law(load_cam(config_root() / "cams" / f"{cam}.yaml"))
        dimensions, data = encode_law(law)
        back = decode_law(dimensions, data.ravel())
        assert back.name == law.name
        assert np.array_equal(back.breaks, law.breaks)
        assert np.array_equal(back.ordinates, law.ordinates)
    rows = np.random.default_rng(1).normal(size=(6, 7))
    dimensions, data = encode_block(rows)
    assert np.array_equal(decode_block(dimensions, data.ravel()), rows)


def test_another_layout_is_refused():
    """A block with other labels or sizes is refused with both."""
    for dimensions in (
        [],
        [(BLOCK_LABEL, 6)],
        [(BLOCK_LABEL, 6), ("sample", 3)],
        [("other", 6), ("sample", 2)],
        [(BLOCK_LABEL, 3), ("sample", 4)],
    ):
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


def message(positions, velocities=None, stamp=(3, 7), frame="tm21"):
    """A JointState as rclpy and rosbags give it."""
    velocities = [50.0] * len(positions) if velocities is None else velocities
    header = SimpleNamespace(stamp=SimpleNamespace(sec=stamp[0], nanosec=stamp[1]), frame_id=frame)
    return SimpleNamespace(header=header, position=positions, velocity=velocities)


def test_a_cam_state_comes_back_bit_for_bit():
    """Its angle too, however long the cam has turned: one number would lose the last digits."""
    for turns in (0, 1, 2_000, 10_000_000):
        rng = np.random.default_rng(turns)
        for angle in (0.0, *rng.uniform(0.0, TURN, 50), np.nextafter(TURN, 0.0)):
            state = CamState(3_000_000_007, float(angle), 50.0, "tm21", turns)
            assert cam_state_of(message([state.unwrapped, state.angle])) == state


def test_a_cam_state_of_before_is_taken():
    """A bag that has the angle as one number is read, to what that holds."""
    state = cam_state_of(message([2000.0 * TURN + 1.25]))
    assert state.turns == 2000
    assert state.angle == pytest.approx(1.25, abs=4e-12)


@pytest.mark.parametrize(
    ("positions", "words"),
    [
        ([7.0, 0.5], r"θ 7.0 rad and 0.5 rad within the turn are 0.217 rad apart; allowed: 1e-06"),
        ([7.0, 7.0], r"7.0 rad within the turn; allowed: 0 to 2π"),
        ([7.0, float("nan")], r"nan rad within the turn; allowed"),
        ([0.5, -1e-9], r"allowed: 0 to 2π"),
        ([1.0, 1.0, 1.0], r"3 positions, 3 velocities.*cam and cam_in_turn, or the first alone"),
        ([], r"0 positions, 0 velocities"),
        ([1e300], r"θ 1e\+300 rad.*allowed"),
    ],
)
def test_what_is_not_a_cam_state_is_refused(positions, words):
    """By what is wrong with it."""
    with pytest.raises(RefusedError, match=words):
        cam_state_of(message(positions))

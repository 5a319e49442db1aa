"""A recording made once and kept: whoever changes the rig must still reproduce it."""

from pathlib import Path

import pytest

from cam_rig.bag.completeness import require_complete
from cam_rig.bag.reader import read_recording
from cam_rig.simulation.simulate import simulate, step_levels

GOLDEN = Path(__file__).parents[2] / "bags" / "golden"


def test_the_golden_bag_is_small_and_complete():
    """Under 2 MB, with every tick of its scene by count."""
    assert sum(f.stat().st_size for f in GOLDEN.iterdir()) < 2_000_000
    recording = read_recording(GOLDEN)
    counts = require_complete(GOLDEN, recording.loaded.scene)
    assert counts["/follower/samples"] == len(recording.ticks)


def test_the_golden_bag_is_reproduced():
    """The scene attached to it, simulated now, gives the recorded levels to 1e-9 dB."""
    recording = read_recording(GOLDEN)
    settle = recording.loaded.scene.program.settle_turns.si
    recorded = step_levels(recording.ticks, settle)
    now = step_levels(simulate(recording.loaded), settle)
    assert recorded.keys() == now.keys() == {"tm21", "bezier15"}
    for cam, steps in recorded.items():
        assert steps == pytest.approx(now[cam], abs=1e-9)

"""The torsional model in a scene: blocks that do not depend on how time is cut."""

import itertools

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, Interval
from cam_rig.errors import ConfigError
from cam_rig.schema import load_rig
from cam_rig.units import NS

SPEED = 350.0 * np.pi / 30.0


def blocks(law, parameters, cuts):
    state, rows = None, []
    for a, b in itertools.pairwise(cuts):
        interval = Interval(a, b, SPEED * a / NS, SPEED)
        state, block = MODELS["torsional"].advance(law, parameters, state, interval, 24_000)
        rows.append(block.rows)
    return np.hstack(rows)


@pytest.fixture(scope="module")
def parameters(config_dir):
    return MODELS["torsional"].parameters(load_rig(config_dir / "rigs" / "paper_table2.yaml"))


@pytest.mark.parametrize("milliseconds", [10, 200])
def test_the_length_of_an_interval_does_not_enter(laws, parameters, milliseconds):
    """One call over 0.4 s, or ticks of 10 ms or 200 ms: the same samples to 1e-10."""
    total, step = 400_000_000, milliseconds * 1_000_000
    whole = blocks(laws["poly345"], parameters, [0, total])
    ticked = blocks(laws["poly345"], parameters, list(range(0, total + 1, step)))
    size = np.abs(whole).max(axis=1)
    assert (np.abs(ticked - whole).max(axis=1)[:5] < 1e-10 * size[:5]).all()


def test_a_stiff_shaft_turns_the_cam_like_the_drive(laws, parameters, follower):
    """With an almost rigid shaft the follower moves as in the kinetostatic model."""
    from dataclasses import replace

    stiff = replace(parameters, follower=follower, shaft_stiffness=1e9, shaft_damping=1e3)
    interval = Interval(0, 200_000_000, 0.0, SPEED)
    law = laws["poly345"]
    one = MODELS["torsional"].advance(law, stiff, None, interval, 10_000)[1].rows
    other = MODELS["kinetostatic"].advance(law, follower, None, interval, 10_000)[1].rows
    np.testing.assert_allclose(one[1], other[1], atol=1e-8)
    np.testing.assert_allclose(one[4], other[4], atol=1e-2)


def test_a_rig_without_a_shaft_is_refused(rig):
    """The model says what the rig file must have."""
    with pytest.raises(ConfigError, match="shaft: is missing; needed by the model torsional"):
        MODELS["torsional"].parameters(rig)

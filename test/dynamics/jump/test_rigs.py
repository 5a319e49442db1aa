"""Many rigs at once: each row is that rig's alone, and one without an answer harms no other."""

import numpy as np
import pytest

import cam_rig
from cam_rig.errors import ConfigError

#: Rigs of a test.
COUNT = 12


@pytest.fixture(params=["paper_table2", "tm21"])
def rig(request):
    """Two masses, and one."""
    return cam_rig.load_rig(request.param)


def test_a_row_is_the_rig_alone(laws, rig):
    """Speed, angle and time of a random spring, preload, mass and damping: the same bits."""
    rng, law = np.random.default_rng(5), laws["poly345"]
    numbers = {
        "mass": rng.uniform(0.5, 2.0, COUNT),
        "spring_stiffness": rng.uniform(2e3, 8e3, COUNT),
        "damping": rng.uniform(1.0, 20.0, COUNT),
        "preload": rng.uniform(10.0, 60.0, COUNT),
    }
    found = cam_rig.jump_speed(law, rig, duration=0.5, **numbers)
    for i, row in enumerate(found.rows):
        one = {name: float(values[i]) for name, values in numbers.items()}
        alone = cam_rig.jump_speed(law, rig.with_follower(**one), duration=0.5)
        assert {name: getattr(row, name) for name in one} == one
        assert (row.rpm, row.angle, row.time) == (alone.rpm, alone.angle, alone.time)
    half = {name: values[: COUNT // 2] for name, values in numbers.items()}
    assert cam_rig.jump_speed(law, rig, duration=0.5, **half).rows == found.rows[: COUNT // 2]


def test_a_rig_without_an_answer_says_why(laws, rig):
    """No preload, a negative one and NaN among others: rows with a reason."""
    preload = np.array([30.0, 0.0, -1.0, np.nan, 30.0])
    found = cam_rig.jump_speed(laws["poly345"], rig, preload=preload)
    first, *others, last = found.rows
    assert (first.rpm, first.reason) == (last.rpm, "")
    assert all(np.isnan(row.rpm) and "preload" in row.reason for row in others)
    assert found.rpm[0] == cam_rig.jump_speed(laws["poly345"], rig, preload=30.0).rpm[0]


def test_arrays_go_together(laws, rig):
    """Of one length each, or one number for all."""
    law = laws["poly345"]
    assert len(cam_rig.jump_speed(law, rig, mass=1.0, preload=np.full(3, 30.0)).rows) == 3
    with pytest.raises(ConfigError, match="mass 2, preload 3 numbers; allowed: as many each"):
        cam_rig.jump_speed(law, rig, mass=np.ones(2), preload=np.full(3, 30.0))
    with pytest.raises(
        ConfigError,
        match=r"preload: is an array of shape .*; allowed: a number, or several on one axis",
    ):
        cam_rig.jump_speed(law, rig, preload=np.ones((2, 2)))

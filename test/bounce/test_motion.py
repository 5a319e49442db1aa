"""What a run is called holds for any law, follower and speed."""

import math

import numpy as np
import pytest

import cam_rig
from cam_rig.bounce.motion import IN_CONTACT, IRREGULAR, NOT_TOLD, PERIODIC, bouncing, motion_of
from cam_rig.errors import ConfigError

from ..dynamics.test_turn_map import random_map


@pytest.mark.variants(12)
@pytest.mark.parametrize("seed", range(120))
def test_a_name_is_kept(laws, seed):
    """Periodic: turns later it is where it was. Irregular: more growth than error."""
    turn_map, _ = random_map(laws, seed)
    run = turn_map.run(160)
    found = motion_of(turn_map, run, 60)
    last, scale = run.states[-1], turn_map.law.lift * np.array([1.0, turn_map.speed])
    if found.kind == IN_CONTACT:
        assert not run.landings[-60:].any()
        assert (last == 0.0).all()
    elif found.kind == PERIODIC:
        assert found.settled <= 160 - 2 * found.period
        again = turn_map.run(found.period, tuple(last)).states[-1]
        if turn_map.law.spans.size < 1000:  # hundreds of bounces on a noisy one enlarge a rounding
            grows = max(1.0, np.abs(run.derivatives[-found.period :]).max())
            assert np.abs((again - last) / scale).max() < 1e-8 * grows
        assert found.exponent < 1e-6
    elif found.kind == IRREGULAR:
        assert found.exponent > found.error > 0.0
        assert (run.on_cam[-60:] == 0.0).all()
    else:
        assert found.kind == NOT_TOLD
        assert found.period is None


def test_the_exponent_is_no_less_than_half_of_the_contraction(laws):
    """The larger of two whose sum is known."""
    told = 0
    for seed in range(40):
        turn_map, _ = random_map(laws, seed)
        run = turn_map.run(160)
        found = motion_of(turn_map, run, 60)
        if found.kind in (PERIODIC, IRREGULAR) and math.isfinite(found.exponent):
            kept = run.growth[-(found.period or 60) :].sum(axis=1).mean()
            assert found.exponent >= 0.5 * kept - 1e-6
            told += 1
    assert told > 3


def test_a_restitution_is_the_rigs_or_the_callers(config_dir):
    """A rig without one takes the caller's, and else says that it lacks one."""
    rig = cam_rig.load_rig("tm21")
    assert bouncing(rig, None).restitution == 0.0
    assert bouncing(rig, 0.4).restitution == 0.4
    data = rig.model_dump(exclude_none=True)
    del data["follower"]["restitution"]
    silent = type(rig).model_validate(data)
    assert bouncing(silent, 0.4).restitution == 0.4
    with pytest.raises(ConfigError, match=r"by bouncing; .* or give --restitution"):
        bouncing(silent, None)

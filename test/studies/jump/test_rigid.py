"""The rigid jump speed against a closed form and against the rigid model's own loss of contact."""

from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics.contact_force import loss_intervals
from cam_rig.laws import build_law
from cam_rig.studies.jump.rigid import rigid_jump_speed


def test_eccentric(make_cam, follower):
    """s = h/2 (1 − cos θ) without damping: the top lets go at Ω² = (k h + preload)/(m h/2)."""
    cam = make_cam(
        {"law": "simple_harmonic", "to": 1, "span": 180},
        {"law": "simple_harmonic", "to": 0, "span": 180},
    )
    free = replace(follower, damping=0.0)
    expected = np.sqrt((free.spring_stiffness * 0.05 + free.preload) / (free.mass * 0.025))
    assert rigid_jump_speed(build_law(cam), free) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("cam", ["poly345", "cycloidal", "bezier15", "tm21"])
def test_contact_is_lost_above_and_kept_below(laws, follower, cam):
    """On either side by 1e-6 the exact kinetostatic model says the same."""
    speed = rigid_jump_speed(laws[cam], follower)
    assert not loss_intervals(laws[cam], follower, speed * (1.0 - 1e-6))
    assert loss_intervals(laws[cam], follower, speed * (1.0 + 1e-6))

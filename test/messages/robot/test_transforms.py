"""/tf is what anybody makes of the URDF and the joints' positions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cam_rig.messages.frames import CAM, FOLLOWER, Robot
from cam_rig.messages.motion import Transforms
from cam_rig.messages.urdf import urdf
from cam_rig.units import NS

from .urdf_reader import homogeneous, poses

TF = "tf2_msgs/msg/TFMessage"
Read = Callable[[bytes, str], Any]


def matrices(message: Any) -> dict[tuple[str, str], Any]:
    """``(4, 4)`` of each transform by (parent, child)."""
    found = {}
    for one in message.transforms:
        r, t = one.transform.rotation, one.transform.translation
        turn = Rotation.from_quat([r.x, r.y, r.z, r.w])
        assert abs(r.x**2 + r.y**2 + r.z**2 + r.w**2 - 1.0) < 1e-14
        found[one.header.frame_id, one.child_frame_id] = homogeneous(turn, [t.x, t.y, t.z])
    return found


@pytest.mark.variants(5)
def test_moving_links_are_where_the_urdf_puts_them(robot: Robot, read: Read) -> None:
    """At random angles, over many turns, and lifts: to 1e-11, stamped with their instants."""
    random, count = np.random.default_rng(7), 50
    stamps = np.sort(random.integers(0, 100 * NS, count))
    angle, lift = random.uniform(-10.0, 1000.0, count), random.uniform(0.0, 0.02, count)
    text = urdf(robot)
    found = Transforms(robot).moving(stamps, angle, lift)
    for stamp, a, s, cdr in zip(stamps, angle, lift, found, strict=True):
        message = read(cdr, TF)
        expected = poses(text, {CAM: a, FOLLOWER: s})
        for pair, pose in matrices(message).items():
            np.testing.assert_allclose(pose, expected[pair], rtol=0, atol=1e-11)
        times = {t.header.stamp.sec * NS + t.header.stamp.nanosec for t in message.transforms}
        assert times == {stamp}


def test_all_links_have_a_place(robot: Robot, read: Read) -> None:
    """/tf and /tf_static together hold each joint of the URDF, the fixed ones to 1e-11."""
    expected = poses(urdf(robot), {CAM: 0.0, FOLLOWER: 0.0})
    made = Transforms(robot)
    fixed = matrices(read(made.fixed(5 * NS + 3), TF))
    (cdr,) = made.moving(np.array([0]), np.zeros(1), np.zeros(1))
    moving = matrices(read(cdr, TF))
    assert fixed.keys() | moving.keys() == expected.keys()
    assert not fixed.keys() & moving.keys()
    for pair, pose in fixed.items():
        np.testing.assert_allclose(pose, expected[pair], rtol=0, atol=1e-11)

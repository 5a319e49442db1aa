"""The golden bag's frames: of every header, in one tree, and the picture that they make."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation

from cam_rig.messages import topics
from cam_rig.messages.markers import SPHERE
from cam_rig.profile import contours_at
from cam_rig.simulation.scene import open_scene

ROOT = Path(__file__).parents[2]
#: Topics about nodes, which are nowhere.
WITHOUT_A_PLACE = {topics.DIAGNOSTICS.name}


@pytest.fixture(scope="module")
def golden() -> list[tuple[str, int, Any]]:
    """Topic, log time and message of all, in the order of the file."""
    with AnyReader([ROOT / "bags" / "golden"]) as reader:
        return [
            (connection.topic, time, reader.deserialize(raw, connection.msgtype))
            for connection, time, raw in reader.messages()
        ]


def headers(message: Any) -> list[Any]:
    """Every header of a message, nested ones too."""
    if hasattr(message, "frame_id"):
        return [message]
    if isinstance(message, list):
        return [header for one in message for header in headers(one)]
    fields = getattr(message, "__dataclass_fields__", {})
    return [header for name in fields for header in headers(getattr(message, name))]


def test_every_frame_is_a_link_of_the_robot(golden: list[tuple[str, int, Any]]) -> None:
    """Empty alone in /diagnostics, and in the picture that no marker has."""
    descriptions = [m.data for topic, _, m in golden if topic == topics.ROBOT_DESCRIPTION.name]
    links = {
        link.get("name")
        for text in descriptions
        for link in ElementTree.fromstring(text).iter("link")
    }
    seen = set()
    for topic, _, message in golden:
        for header in headers(message):
            if topic in WITHOUT_A_PLACE:
                assert header.frame_id == ""
            elif topic.endswith("/markers") and header.frame_id == "":
                continue  # of its texture
            else:
                assert header.frame_id in links, (topic, header.frame_id)
                seen.add(topic)
    assert {"/cam/state", "/joint_states", "/follower/contact", "/tf", "/tf_static"} <= seen
    assert {"/cam/markers", "/follower/markers", "/microphone/pressure", "/cam/profile"} <= seen


def test_transforms_form_one_tree_at_every_instant(golden: list[tuple[str, int, Any]]) -> None:
    """Each link has one parent, /tf_static and /tf together; base_link has none."""
    parents: dict[str, str] = {}
    for topic, _, message in golden:
        if topic in ("/tf", "/tf_static"):
            for one in message.transforms:
                parent = parents.setdefault(one.child_frame_id, one.header.frame_id)
                assert parent == one.header.frame_id
    assert set(parents.values()) - set(parents) == {"base_link"}


def test_tf_is_made_of_the_joints_beside_it(golden: list[tuple[str, int, Any]]) -> None:
    """At each instant: the cam turned by the joint's θ, the follower raised by its lift; and the
    point of contact, taken into the cam's frame by /tf, is on the mounted cam's contour."""
    loaded = open_scene(ROOT / "config" / "scenes" / "quick.yaml")
    of = {
        name: {time: m for topic, time, m in golden if topic == name}
        for name in ("/joint_states", "/tf", "/follower/markers")
    }
    assert of["/joint_states"].keys() == of["/tf"].keys() == of["/follower/markers"].keys()
    cams = {time: m.header.frame_id for topic, time, m in golden if topic == "/cam/state"}
    mounted, touching = list(cams.items()), 0
    for time, joints in of["/joint_states"].items():
        theta, lift = joints.position
        transforms = {one.child_frame_id: one.transform for one in of["/tf"][time].transforms}
        r = transforms["cam"].rotation
        turn = Rotation.from_quat([r.x, r.y, r.z, r.w])
        np.testing.assert_allclose(
            turn.as_matrix(), Rotation.from_rotvec([0.0, 0.0, theta]).as_matrix(), atol=1e-11
        )
        assert transforms["follower"].translation.y == pytest.approx(lift, abs=1e-12)
        marker = of["/follower/markers"][time].markers[0]
        if marker.type != SPHERE:
            assert joints.effort[1] == 0.0
            continue
        touching += 1
        cam = [name for begin, name in mounted if begin <= time][-1]
        point = np.array([marker.pose.position.x, marker.pose.position.y, 0.0])
        of_cam = turn.inv().apply(point)[:2]
        law, follower = loaded.laws[cam], loaded.cams[cam].follower
        contour = contours_at(follower, law, np.array([theta]))[0].points[:, 0]
        np.testing.assert_allclose(of_cam, contour, rtol=0, atol=1e-9)
    assert touching > 1000

"""The URDF is one tree that URDF's own parser takes, and says what the files say."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from cam_rig.robot.frames import BASE, CAM, FOLLOWER, GUIDE, MICROPHONE, MOTOR, Robot
from cam_rig.robot.urdf import urdf

from .urdf_reader import poses


def test_the_links_form_one_tree(robot: Robot) -> None:
    """Every link but the root hangs on one joint; all named links and each cam's are there."""
    root = ElementTree.fromstring(urdf(robot))
    links = [link.get("name") for link in root.iter("link")]
    children = [joint.find("child").get("link") for joint in root.iter("joint")]
    parents = {joint.find("parent").get("link") for joint in root.iter("joint")}
    assert len(set(links)) == len(links)
    assert sorted([*children, BASE]) == sorted(links)
    assert parents <= set(links)
    assert {
        GUIDE,
        MOTOR,
        CAM,
        FOLLOWER,
        MICROPHONE,
        *robot.loaded.scene.cams,
        robot.mounted.name,
    } <= set(links)


def test_the_parser_of_ros_takes_it(robot: Robot, tmp_path: Path) -> None:
    """urdfdom, with which robot_state_publisher and RViz read a URDF, finds the root."""
    file = tmp_path / "rig.urdf"
    file.write_text(urdf(robot))
    folders = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    parser = shutil.which("check_urdf", path=folders)
    assert parser is not None, "neither cmeel-urdfdom nor liburdfdom-tools is installed"
    answer = subprocess.run(
        [parser, file], capture_output=True, text=True, check=False, timeout=100
    )
    assert answer.returncode == 0, answer.stderr
    assert f"root Link: {BASE}" in answer.stdout
    assert "rror" not in answer.stderr


def test_the_picture_stands_upright(robot: Robot) -> None:
    """A translating follower moves up along z of base_link; the shaft points along x."""
    pose = poses(urdf(robot), {CAM: 0.0, FOLLOWER: 0.0})[BASE, GUIDE]
    assert pose[:3, :3] @ [0.0, 1.0, 0.0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-15)
    assert pose[:3, :3] @ [0.0, 0.0, 1.0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-15)


def test_dimensions_are_the_files(robot: Robot) -> None:
    """Base circle and roller are as large as the cam's file says."""
    follower = robot.mounted.follower
    root = ElementTree.fromstring(urdf(robot))
    radii = {
        link.get("name"): [float(c.get("radius")) for c in link.iter("cylinder")]
        for link in root.iter("link")
    }
    assert radii[CAM][0] == follower.base_radius.si
    assert radii[FOLLOWER] == ([pytest.approx(follower.roller)] if follower.roller else [])


def test_the_greatest_lift_is_within_the_joint_s_limits(robot: Robot) -> None:
    """Joint limits leave room for the whole lift, and for lift-off."""
    joints = {j.get("name"): j for j in ElementTree.fromstring(urdf(robot)).iter("joint")}
    limit = joints[FOLLOWER].find("limit")
    assert float(limit.get("lower")) <= 0.0
    assert float(limit.get("upper")) > float(np.max(robot.law(np.linspace(0.0, 6.28, 720))))
    assert float(limit.get("effort")) > 0.0
    assert float(limit.get("velocity")) > 0.0

"""The URDF is one tree that URDF's own parser takes, and says what the files say."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapely.affinity import rotate, translate
from shapely.geometry import Point, Polygon, box
from shapely.ops import unary_union

from cam_rig.live.law_server import contour_of
from cam_rig.messages.bodies import Body, inertial
from cam_rig.messages.frames import BASE, CAM, FOLLOWER, GUIDE, MICROPHONE, MOTOR, Robot
from cam_rig.messages.urdf import urdf
from cam_rig.simulation.scene import LoadedScene

from .urdf_reader import numbers, poses


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
    assert pose[:3, :3] @ [0.0, 1.0, 0.0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-11)
    assert pose[:3, :3] @ [0.0, 0.0, 1.0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-11)


def test_dimensions_are_the_files(robot: Robot) -> None:
    """Base circle and roller are as large as the cam's file says, the follower as heavy."""
    follower = robot.mounted.follower
    root = ElementTree.fromstring(urdf(robot))
    links = {link.get("name"): link for link in root.iter("link")}
    radii = {
        name: [float(c.get("radius")) for c in link.findall("visual/geometry/cylinder")]
        for name, link in links.items()
    }
    near = partial(pytest.approx, rel=1e-5)
    assert radii[CAM][0] == near(follower.base_radius.si)
    assert radii[FOLLOWER] == ([near(follower.roller)] if follower.roller else [])
    mass = links[FOLLOWER].find("inertial/mass").get("value")
    assert float(mass) == near(robot.loaded.rig.follower.mass.si)


def test_one_follower_s_joint_for_all_cams_of_the_scene(scene_of_kinds: LoadedScene) -> None:
    """Its limits leave room for the largest lift of the scene's cams, and for lift-off.

    So do the bodies of the bench: which cam is mounted changes neither.
    """
    limits, bench = [], []
    for cam in scene_of_kinds.scene.cams:
        root = ElementTree.fromstring(urdf(Robot.of(scene_of_kinds, cam)))
        joints = {joint.get("name"): joint for joint in root.iter("joint")}
        links = {link.get("name"): link for link in root.iter("link")}
        limits.append(joints[FOLLOWER].find("limit").attrib)
        sizes = [link.find("visual/geometry/*").attrib for link in map(links.get, (BASE, MOTOR))]
        places = poses(ElementTree.tostring(root, encoding="unicode"), {CAM: 0.0, FOLLOWER: 0.0})
        motor = numbers(links[MOTOR].find("visual/origin").get("xyz"))
        bench.append((sizes, (places[BASE, MOTOR][:3, 3] + motor).round(8).tolist()))
    assert limits == [limits[0]] * len(limits)
    assert bench == [bench[0]] * len(bench)
    laws = (scene_of_kinds.laws[cam] for cam in scene_of_kinds.scene.cams)
    lift = max(float(law(np.linspace(0.0, 6.28, 720)).max()) for law in laws)
    assert float(limits[0]["lower"]) <= 0.0
    assert float(limits[0]["upper"]) > 1.1 * lift
    assert float(limits[0]["effort"]) > 0.0
    assert float(limits[0]["velocity"]) > 0.0


def test_the_cam_looks_like_its_contour(robot: Robot) -> None:
    """Boxes and cylinder together, seen along the shaft: the contour's area, to half a percent."""
    root = ElementTree.fromstring(urdf(robot))
    links = {link.get("name"): link for link in root.iter("link")}
    parts = [Point(0.0, 0.0).buffer(robot.mounted.follower.base_radius.si, 128)]
    for visual in links[robot.mounted.name].iter("visual"):
        x, y, _ = 0.5 * numbers(visual.find("geometry/box").get("size"))
        (_, _, yaw), place = (numbers(visual.find("origin").get(key)) for key in ("rpy", "xyz"))
        turned = rotate(box(-x, -y, x, y), yaw, origin=(0, 0), use_radians=True)
        parts.append(translate(turned, *place[:2]))
    seen = unary_union(parts)
    contour = Polygon(contour_of(robot.mounted, robot.law).T)
    assert seen.difference(contour).area < 5e-4 * contour.area
    assert contour.difference(seen).area < 5e-3 * contour.area


def test_every_link_has_a_mass_that_can_be(robot: Robot) -> None:
    """Gazebo drops a link without one; principal inertias keep the triangle's inequality.

    What is seen can be touched, and what is assumed says so.
    """
    for link in ElementTree.fromstring(urdf(robot)).iter("link"):
        assert float(link.find("inertial/mass").get("value")) > 0.0
        i = {key: float(value) for key, value in link.find("inertial/inertia").attrib.items()}
        principal = np.linalg.eigvalsh(
            [
                [i["ixx"], i["ixy"], i["ixz"]],
                [i["ixy"], i["iyy"], i["iyz"]],
                [i["ixz"], i["iyz"], i["izz"]],
            ]
        )
        assert principal[0] > 0.0
        assert principal[0] + principal[1] > (1.0 - 1e-4) * principal[2]
        seen, touched = (
            [(body.tag, body.attrib) for body in link.findall(f"{kind}/geometry/*")]
            for kind in ("visual", "collision")
        )
        assert seen == touched
    assert urdf(robot).count("assumed") == len(
        list(ElementTree.fromstring(urdf(robot)).iter("link"))
    )


def test_numbers_are_for_people(robot: Robot) -> None:
    """Six digits, and twelve where others compute with them: none has seventeen."""
    found = re.findall(r"\d+\.\d+", urdf(robot))
    assert max(len(number.replace(".", "").lstrip("0")) for number in found) <= 12


def test_inertia_of_a_turned_box() -> None:
    """As of small cubes that fill it; about the centre of both bodies."""
    rng = np.random.default_rng(3)
    bodies = [
        Body((0.1, 0.2, 0.3), "steel", (0.05, -0.1, 0.2), (0.3, -0.5, 1.1)),
        Body((0.06, 0.4), "brass", (-0.2, 0.1, 0.0), (0.7, 0.2, -0.4)),
    ]
    points, masses = [], []
    for body in bodies:
        inside = rng.uniform(-0.5, 0.5, (400_000, 3))
        if len(body.size) == 3:
            inside *= body.size
        else:
            inside = inside[np.hypot(*inside.T[:2]) <= 0.5] * [2 * 0.06, 2 * 0.06, 0.4]
        turn = Rotation.from_euler("xyz", body.rpy).as_matrix()
        points.append(inside @ turn.T + body.xyz)
        masses.append(np.full(len(inside), body.mass / len(inside)))
    where, weight = np.concatenate(points), np.concatenate(masses)
    centre = weight @ where / weight.sum()
    away = where - centre
    expected = (weight @ (away**2).sum(axis=1)) * np.eye(3) - (away.T * weight) @ away
    element = inertial(bodies)
    i = {key: float(value) for key, value in element.find("inertia").attrib.items()}
    found = [i["ixx"], i["ixy"], i["ixz"], i["iyy"], i["iyz"], i["izz"]]
    rows, columns = np.triu_indices(3)
    np.testing.assert_allclose(found, expected[rows, columns], rtol=0, atol=5e-3 * expected.max())
    np.testing.assert_allclose(numbers(element.find("origin").get("xyz")), centre, atol=1e-3)

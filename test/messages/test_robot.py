"""The URDF is one tree that others take, /tf is what anybody makes of it, and markers lie on it."""

import os
import re
import shutil
import sys
from functools import partial
from xml.etree import ElementTree

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation
from shapely.affinity import rotate, translate
from shapely.geometry import Point, Polygon, box
from shapely.ops import unary_union

from cam_rig.live.law_server import CONTOUR_POINTS, contour_of
from cam_rig.messages import markers
from cam_rig.messages.frames import BASE, CAM, FOLLOWER, GUIDE, MICROPHONE, MOTOR, Robot
from cam_rig.messages.motion import Transforms
from cam_rig.messages.urdf import Body, inertial, urdf
from cam_rig.profile import contours, contours_at
from cam_rig.profile.faces import GuidedFace, Swung, SwungFace
from cam_rig.units import NS

from ..processes import ended

TYPES = get_typestore(Stores.ROS2_KILTED)
near = partial(pytest.approx, rel=1e-5)


def numbers(text):
    return np.array([float(word) for word in text.split()])


def links_of(text):
    return {link.get("name"): link for link in ElementTree.fromstring(text).iter("link")}


def homogeneous(rotation, place):
    """``(4, 4)`` of a rotation and a translation (m)."""
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = rotation.as_matrix(), place
    return found


def poses(text, positions):
    """``(4, 4)`` of each joint's child in its parent, by (parent, child), at joint positions. Where
    a URDF puts its links: read and composed without the rig's own code."""
    found = {}
    for joint in ElementTree.fromstring(text).iter("joint"):
        position, mimic = positions.get(joint.get("name")), joint.find("mimic")
        if mimic is not None:
            of = positions[mimic.get("joint")]
            position = float(mimic.get("multiplier")) * of + float(mimic.get("offset"))
        origin = joint.find("origin")
        # xyz in lower case are rotations about the parent's axes.
        turn = Rotation.from_euler("xyz", numbers(origin.get("rpy")))
        pose = homogeneous(turn, numbers(origin.get("xyz")))
        if joint.get("type") == "prismatic":
            axis = numbers(joint.find("axis").get("xyz"))
            pose = pose @ homogeneous(Rotation.identity(), axis * position)
        elif joint.get("type") != "fixed":
            axis = numbers(joint.find("axis").get("xyz"))
            pose = pose @ homogeneous(Rotation.from_rotvec(axis * position), np.zeros(3))
        found[joint.find("parent").get("link"), joint.find("child").get("link")] = pose
    return found


AT_REST = {CAM: 0.0, FOLLOWER: 0.0}


def test_the_links_form_one_tree(kind):
    """Every link but the root hangs on one joint; all named links and each cam's are there."""
    robot, root = kind.robot, ElementTree.fromstring(kind.urdf)
    links = [link.get("name") for link in root.iter("link")]
    children = [joint.find("child").get("link") for joint in root.iter("joint")]
    parents = {joint.find("parent").get("link") for joint in root.iter("joint")}
    assert len(set(links)) == len(links) and sorted([*children, BASE]) == sorted(links)
    assert parents <= set(links)
    named = {GUIDE, MOTOR, CAM, FOLLOWER, MICROPHONE, robot.mounted.name}
    assert named | set(robot.loaded.scene.cams) <= set(links)
    # Six digits are for people, and twelve where others compute with them: none has seventeen.
    found = re.findall(r"\d+\.\d+", kind.urdf)
    assert max(len(number.replace(".", "").lstrip("0")) for number in found) <= 12


@pytest.mark.variants(2)
def test_the_parser_of_ros_takes_it(kind, tmp_path):
    """urdfdom, with which robot_state_publisher and RViz read a URDF, finds the root."""
    file = tmp_path / "kind.urdf"
    file.write_text(kind.urdf)
    folders = f"{os.path.dirname(sys.executable)}:{os.environ['PATH']}"
    parser = shutil.which("check_urdf", path=folders)
    assert parser is not None, "neither cmeel-urdfdom nor liburdfdom-tools is installed"
    answer = ended(parser, file)
    assert answer.returncode == 0, answer.stderr
    assert f"root Link: {BASE}" in answer.stdout and "rror" not in answer.stderr


def test_dimensions_are_the_files(kind):
    """Base circle, roller and mass are as in the files; a follower moves up along z of base_link.
    The shaft points along x."""
    follower, links = kind.robot.mounted.follower, links_of(kind.urdf)
    radii = {
        name: [float(c.get("radius")) for c in link.findall("visual/geometry/cylinder")]
        for name, link in links.items()
    }
    assert radii[CAM][0] == near(follower.base_radius.si)
    assert radii[FOLLOWER] == ([near(follower.roller)] if follower.roller else [])
    mass = links[FOLLOWER].find("inertial/mass").get("value")
    assert float(mass) == near(kind.robot.loaded.rig.follower.mass.si)
    pose = poses(kind.urdf, AT_REST)[BASE, GUIDE]
    assert pose[:3, :3] @ [0.0, 1.0, 0.0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-11)
    assert pose[:3, :3] @ [0.0, 0.0, 1.0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-11)


def test_one_follower_s_joint_for_all_cams_of_the_scene(scene_of_kinds):
    """Its limits leave room for the largest lift of the scene's cams, and for lift-off. So do the
    bodies of the bench: which cam is mounted changes neither."""
    limits, bench = [], []
    fastest = max(scene_of_kinds.scene.program.speeds.si_list)
    for cam in scene_of_kinds.scene.cams:
        text = urdf(Robot.of(scene_of_kinds, cam))
        links = links_of(text)
        joint = ElementTree.fromstring(text).find(f"joint[@name='{FOLLOWER}']")
        limits.append(joint.find("limit").attrib)
        sizes = [links[name].find("visual/geometry/*").attrib for name in (BASE, MOTOR)]
        motor = numbers(links[MOTOR].find("visual/origin").get("xyz"))
        place = poses(text, AT_REST)[BASE, MOTOR][:3, 3] + motor
        bench.append((sizes, place.round(8).tolist()))
    assert limits == [limits[0]] * len(limits) and bench == [bench[0]] * len(bench)
    around = np.linspace(0.0, 2.0 * np.pi, 3601)
    laws = [scene_of_kinds.laws[cam] for cam in scene_of_kinds.scene.cams]
    lift = max(float(law(around).max()) for law in laws)
    speed = max(float(np.abs(law(around, 1)).max()) for law in laws) * fastest
    assert float(limits[0]["lower"]) <= 0.0 and float(limits[0]["upper"]) > 1.1 * lift
    assert float(limits[0]["effort"]) > 0.0
    assert float(limits[0]["velocity"]) == pytest.approx(speed, rel=1e-3)


def test_the_cam_looks_like_its_contour(kind):
    """Boxes and cylinder together, seen along the shaft: the contour's area, to half a percent."""
    robot = kind.robot
    parts = [Point(0.0, 0.0).buffer(robot.mounted.follower.base_radius.si, 128)]
    for visual in links_of(kind.urdf)[robot.mounted.name].iter("visual"):
        x, y, _ = 0.5 * numbers(visual.find("geometry/box").get("size"))
        (_, _, yaw), place = (numbers(visual.find("origin").get(key)) for key in ("rpy", "xyz"))
        turned = rotate(box(-x, -y, x, y), yaw, origin=(0, 0), use_radians=True)
        parts.append(translate(turned, *place[:2]))
    seen = unary_union(parts)
    contour = Polygon(contour_of(robot.mounted, robot.law).T)
    assert seen.difference(contour).area < 5e-4 * contour.area
    assert contour.difference(seen).area < 5e-3 * contour.area


def inertia(link):
    """``(3, 3)`` as a URDF has it."""
    i = {key: float(value) for key, value in link.find("inertia").attrib.items()}
    return np.array([[i["i" + "".join(sorted(a + b))] for b in "xyz"] for a in "xyz"])


def test_every_link_has_a_mass_that_can_be(kind):
    """Gazebo drops a link without one; principal inertias keep the triangle's inequality. What is
    seen can be touched, and what is assumed says so."""
    links = links_of(kind.urdf)
    for link in links.values():
        assert float(link.find("inertial/mass").get("value")) > 0.0
        principal = np.linalg.eigvalsh(inertia(link.find("inertial")))
        assert principal[0] > 0.0
        assert principal[0] + principal[1] > (1.0 - 1e-4) * principal[2]
        seen, touched = (
            [(body.tag, body.attrib) for body in link.findall(f"{kind}/geometry/*")]
            for kind in ("visual", "collision")
        )
        assert seen == touched
    assert kind.urdf.count("assumed") == len(links)


def test_inertia_of_a_turned_box():
    """As of small cubes that fill it; about the centre of both bodies."""
    rng = np.random.default_rng(3)
    bodies = [
        Body((0.1, 0.2, 0.3), "steel", (0.05, -0.1, 0.2), (0.3, -0.5, 1.1)),
        Body((0.06, 0.4), "brass", (-0.2, 0.1, 0.0), (0.7, 0.2, -0.4)),
    ]
    points, masses = [], []
    for body in bodies:
        inside = rng.uniform(-0.5, 0.5, (200_000, 3))
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
    np.testing.assert_allclose(inertia(element), expected, rtol=0, atol=5e-3 * expected.max())
    np.testing.assert_allclose(numbers(element.find("origin").get("xyz")), centre, atol=1e-3)


# /tf, by the joints' positions.


def matrices(cdr):
    """``(4, 4)`` of each transform of a serialized message by (parent, child), and its stamps."""
    found, stamps = {}, set()
    for one in TYPES.deserialize_cdr(cdr, "tf2_msgs/msg/TFMessage").transforms:
        r, t = one.transform.rotation, one.transform.translation
        turn = Rotation.from_quat([r.x, r.y, r.z, r.w])
        assert abs(r.x**2 + r.y**2 + r.z**2 + r.w**2 - 1.0) < 1e-14
        found[one.header.frame_id, one.child_frame_id] = homogeneous(turn, [t.x, t.y, t.z])
        stamps.add(one.header.stamp.sec * NS + one.header.stamp.nanosec)
    return found, stamps


def test_links_are_where_the_urdf_puts_them(kind):
    """At random angles, over many turns, and lifts: to 1e-11, stamped with their instants. /tf and
    /tf_static together hold each joint of the URDF once."""
    random, count, made = np.random.default_rng(7), 10, Transforms(kind.robot)
    stamps = np.sort(random.integers(0, 100 * NS, count))
    angle, lift = random.uniform(-10.0, 1000.0, count), random.uniform(0.0, 0.02, count)
    fixed, _ = matrices(made.fixed(5 * NS + 3))
    for stamp, a, s, cdr in zip(stamps, angle, lift, made.moving(stamps, angle, lift), strict=True):
        moving, times = matrices(cdr)
        expected = poses(kind.urdf, {CAM: a, FOLLOWER: s})
        assert times == {stamp}
        assert fixed.keys() | moving.keys() == expected.keys()
        assert not fixed.keys() & moving.keys()
        for pair, pose in {**fixed, **moving}.items():
            np.testing.assert_allclose(pose, expected[pair], rtol=0, atol=1e-11)


# Markers: seen through /tf, in the cam's and the follower's frames.

COUNT, GAP = 45, 1.3e-3
ANGLE, STAMPS = np.linspace(0.001, 12.0, COUNT), np.arange(COUNT) * 10**7 + 3


def flat(points):
    return np.array([[p.x, p.y, 0.0, 1.0] for p in points])


def markers_of(made):
    """The markers of each message."""
    kind = "visualization_msgs/msg/MarkerArray"
    return [TYPES.deserialize_cdr(cdr, kind).markers for cdr in made]


def time_of(marker):
    return marker.header.stamp.sec * NS + marker.header.stamp.nanosec


def seen_from(robot, lift, link, points):
    """Points ``(n, 4)`` of the guide, one an instant, in a link."""
    moving = Transforms(robot).moving(np.zeros(COUNT, np.int64), ANGLE, lift)
    into = np.stack([np.linalg.inv(matrices(cdr)[0][GUIDE, link]) for cdr in moving])
    return np.einsum("nij,nj->ni", into, points)


def off_the_follower(robot, points):
    """How far points of the link follower are from roller, point or face, m."""
    shape, rest = robot.shape, np.zeros(1)
    element = shape.element
    place = shape.place(rest)
    if isinstance(element, Swung):  # the link lies along the arm at rest
        turn = -float(shape.turn(rest)[0])
        place = place - shape.origin(rest)
        place = place @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]).T
    away = points[:, :2] - place
    if isinstance(element, SwungFace):
        return np.abs(away[:, 1])
    if isinstance(element, GuidedFace):
        return np.abs(away @ [-np.sin(element.inclination), np.cos(element.inclination)])
    return np.abs(np.hypot(*away.T) - element.roller)


def require_on_both(robot, lift, of_cam, of_follower):
    """To 1e-9 m: points are on the cam's contour, and on the follower."""
    contour = contours_at(robot.mounted.follower, robot.law, ANGLE)[0].points.T
    on_cam = seen_from(robot, lift, CAM, of_cam)[:, :2]
    np.testing.assert_allclose(on_cam, contour, rtol=0, atol=1e-9)
    assert off_the_follower(robot, seen_from(robot, lift, FOLLOWER, of_follower)).max() < 1e-9


def test_contact_is_drawn_where_it_is_and_as_hard(kind):
    """The point is on cam and follower; the arrow is along the common normal. Its part along y of
    the link follower is the contact force."""
    robot, force = kind.robot, np.linspace(1.0, 50.0, COUNT)
    lift = robot.law(ANGLE)
    found = markers_of(markers.FollowerMarkers(robot).at(STAMPS, ANGLE, lift, force))
    spheres, arrows = zip(*found, strict=True)
    assert {(m.type, m.action, m.header.frame_id) for m in spheres} == {(markers.SPHERE, 0, GUIDE)}
    assert [time_of(m) for m in spheres] == list(STAMPS)
    points = flat([m.pose.position for m in spheres])
    require_on_both(robot, lift, points, points)
    assert {m.type for m in arrows} == {markers.ARROW}
    ends = [flat([m.points[k] for m in arrows]) for k in (0, 1)]
    vector = (ends[1] - ends[0]) * [1.0, 1.0, 1.0, 0.0]
    newtons_per_metre = force / seen_from(robot, lift, FOLLOWER, vector)[:, 1]
    np.testing.assert_allclose(newtons_per_metre, newtons_per_metre[0], rtol=1e-9)
    of_cam = seen_from(robot, lift, CAM, vector)
    normal = contours_at(robot.mounted.follower, robot.law, ANGLE)[0].normal.T
    across = of_cam[:, 0] * normal[:, 1] - of_cam[:, 1] * normal[:, 0]
    assert np.abs(across).max() < 1e-9


def test_in_flight_the_gap_is_drawn_and_said(kind):
    """From the contour to the follower, with its length in µm; the same markers, replaced. Of
    contact and flight in one tick, each instant is drawn by its own force."""
    robot = kind.robot
    lift = robot.law(ANGLE) + GAP
    found = markers_of(markers.FollowerMarkers(robot).at(STAMPS, ANGLE, lift, np.zeros(COUNT)))
    assert {(m[0].type, m[1].type) for m in found} == {(markers.LINE_STRIP, markers.TEXT)}
    assert {(m[0].ns, m[0].id, m[1].ns, m[1].id) for m in found} == {("contact", 0, "contact", 1)}
    starts, ends = (flat([m[0].points[k] for m in found]) for k in (0, 1))
    require_on_both(robot, lift, starts, ends)
    gaps = np.hypot(*(ends - starts)[:, :2].T) * 1e6
    said = [float(m[1].text.removeprefix("gap ").removesuffix(" µm")) for m in found]
    np.testing.assert_allclose(said, gaps, atol=0.051)
    force = np.where(np.arange(COUNT) % 3, 20.0, 0.0)
    found = markers_of(markers.FollowerMarkers(robot).at(STAMPS, ANGLE, robot.law(ANGLE), force))
    assert [m[0].type == markers.SPHERE for m in found] == list(force > 0.0)
    assert [time_of(m[0]) for m in found] == list(STAMPS)


def test_the_cam_is_drawn_with_its_own_contour(kind):
    """The line is the profile's contour, closed; both filled faces have the contour's area."""
    robot = kind.robot
    ((line, body),) = markers_of([markers.cam_markers(robot)])
    assert (line.type, body.type) == (markers.LINE_STRIP, markers.TRIANGLE_LIST)
    assert line.header.frame_id == body.header.frame_id == robot.mounted.name
    outline = contours(robot.mounted.follower, robot.law, CONTOUR_POINTS)[0].points.T
    points = np.array([[p.x, p.y] for p in line.points])
    np.testing.assert_array_equal(points, np.vstack([outline, outline[:1]]))
    corners = np.array([[p.x, p.y, p.z] for p in body.points]).reshape(-1, 3, 3)
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = 0.5 * np.cross(one, other)
    x, y = outline.T
    area = 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    along = normals[:, 2]
    assert along[along > 0.0].sum() == pytest.approx(area, rel=1e-12)
    assert along[along < 0.0].sum() == pytest.approx(-area, rel=1e-12)
    np.testing.assert_allclose(normals.sum(axis=0), 0.0, atol=1e-12)  # a closed surface

"""Tests of the robot: URDF, /tf and markers agree with each other and the files."""

import os
import re
import shutil
import sys
from functools import partial
from itertools import islice
from xml.etree import ElementTree

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation
from shapely.affinity import rotate, translate
from shapely.geometry import Point, Polygon, box
from shapely.ops import unary_union

from cam_rig.live.law_server import CONTOUR_POINTS, contour_of
from cam_rig.live.state_validation import speed_limits
from cam_rig.messages import markers
from cam_rig.messages.frames import BASE, CAM, FOLLOWER, GUIDE, MICROPHONE, MOTOR, Robot
from cam_rig.messages.motion import MotionMessages, Transforms
from cam_rig.messages.urdf import Body, inertial, urdf
from cam_rig.profile import contours, contours_at
from cam_rig.profile.faces import GuidedFace, Swung, SwungFace
from cam_rig.simulation.scene import max_contact_force
from cam_rig.simulation.schedule import cam_states
from cam_rig.simulation.simulate import FollowerSimulator
from cam_rig.units import NS

from ..processes import ended

TYPES = get_typestore(Stores.ROS2_KILTED)
#: Comparison of numbers of the URDF, which have six digits.
near = partial(pytest.approx, rel=1e-5)


def numbers(text):
    return np.array([float(word) for word in text.split()])


def links_of(text):
    return {link.get("name"): link for link in ElementTree.fromstring(text).iter("link")}


def homogeneous(rotation, translation):
    """Return the matrix of a rotation and a translation (m), shape (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation.as_matrix(), translation
    return matrix


def poses(text, positions):
    """Return the pose of each link of a URDF in its parent as a matrix, shape (4, 4).

    The keys are (parent, child). `text` is the URDF, which is read independently of the code of
    cam_rig. `positions` are joint positions (rad or m) by name.
    """
    result = {}
    for joint in ElementTree.fromstring(text).iter("joint"):
        position, mimic = positions.get(joint.get("name")), joint.find("mimic")
        if mimic is not None:
            leader = positions[mimic.get("joint")]
            position = float(mimic.get("multiplier")) * leader + float(mimic.get("offset"))
        origin = joint.find("origin")
        # "xyz" in lower case means rotations about the parent's axes.
        rotation = Rotation.from_euler("xyz", numbers(origin.get("rpy")))
        pose = homogeneous(rotation, numbers(origin.get("xyz")))
        if joint.get("type") == "prismatic":
            axis = numbers(joint.find("axis").get("xyz"))
            pose = pose @ homogeneous(Rotation.identity(), axis * position)
        elif joint.get("type") != "fixed":
            axis = numbers(joint.find("axis").get("xyz"))
            pose = pose @ homogeneous(Rotation.from_rotvec(axis * position), np.zeros(3))
        result[joint.find("parent").get("link"), joint.find("child").get("link")] = pose
    return result


AT_REST = {CAM: 0.0, FOLLOWER: 0.0}


def test_the_links_form_one_tree(kind):
    """The links of the URDF form one tree, and each cam of the scene has a link.

    Numbers have at most twelve digits.
    """
    robot, root = kind.robot, ElementTree.fromstring(kind.urdf)
    links = [link.get("name") for link in root.iter("link")]
    children = [joint.find("child").get("link") for joint in root.iter("joint")]
    parents = {joint.find("parent").get("link") for joint in root.iter("joint")}
    assert len(set(links)) == len(links) and sorted([*children, BASE]) == sorted(links)
    assert parents <= set(links)
    named = {GUIDE, MOTOR, CAM, FOLLOWER, MICROPHONE, robot.mounted.name}
    assert named | set(robot.loaded.scene.cams) <= set(links)
    # Numbers have six digits, or twelve if other programs compute with them, but not seventeen.
    decimals = re.findall(r"\d+\.\d+", kind.urdf)
    assert max(len(number.replace(".", "").lstrip("0")) for number in decimals) <= 12


@pytest.mark.variants(2)
def test_the_parser_of_ros_accepts_the_urdf(kind, tmp_path):
    """The parser of ROS, urdfdom, accepts the URDF and finds its root."""
    file = tmp_path / "kind.urdf"
    file.write_text(kind.urdf)
    folders = f"{os.path.dirname(sys.executable)}:{os.environ['PATH']}"
    parser = shutil.which("check_urdf", path=folders)
    assert parser is not None, "neither cmeel-urdfdom nor liburdfdom-tools is installed"
    result = ended(parser, file)
    assert result.returncode == 0, result.stderr
    assert f"root Link: {BASE}" in result.stdout and "rror" not in result.stderr


def test_the_cam_joint_has_the_limits_of_the_drive(kind):
    """In the URDF the velocity limit of the joint `cam` is the scene's highest speed.

    This is the highest speed of commands. The effort limit is at least the shaft torque at each
    angle: contact force times ds/dθ.
    """
    limit = ElementTree.fromstring(kind.urdf).find(f"joint[@name='{CAM}']/limit")
    robot = kind.robot
    assert float(limit.get("velocity")) == near(speed_limits(robot.loaded.scene)[1])
    angles = np.linspace(0.0, 2.0 * np.pi, 721)
    for cam in robot.cams:
        law = robot.loaded.laws[cam]
        force = max_contact_force(robot.loaded, cam, robot.top_speed)
        torque = force * np.abs(law(angles, 1)).max()
        assert torque <= float(limit.get("effort")) * (1.0 + 1e-5)


@pytest.mark.parametrize("namespace", ["", "/rig1"])
def test_the_element_of_ros2_control_names_the_topics_of_the_rig(scene_of_kinds, namespace):
    """In the URDF, ros2_control commands the cam's velocity and reads both joints.

    The topics are those of the rig in its namespace.
    """
    robot = Robot.of(scene_of_kinds)
    assert ElementTree.fromstring(urdf(robot)).find("ros2_control") is None
    element = ElementTree.fromstring(urdf(robot, namespace)).find("ros2_control")
    texts = {param.get("name"): param.text for param in element.findall("hardware/param")}
    assert texts == {
        "joint_commands_topic": f"{namespace}/joint_commands",
        "joint_states_topic": f"{namespace}/joint_states",
    }
    commands = {j.get("name"): [c.get("name") for c in j.findall("command_interface")]
                for j in element.findall("joint")}  # fmt: skip
    assert commands == {CAM: ["velocity"], FOLLOWER: []}
    bounds = {
        p.get("name"): float(p.text) for p in element.findall("joint/command_interface/param")
    }
    assert bounds == {"min": 0.0, "max": near(speed_limits(scene_of_kinds.scene)[1])}


def frames_of(message):
    """Yield the names of the frames in a message and in the messages that it contains."""
    for name, value in vars(message).items():
        if name in ("frame_id", "child_frame_id") and value:
            yield value
        for part in value if isinstance(value, list) else [value]:
            if hasattr(part, "__msgtype__"):
                yield from frames_of(part)


def test_a_frame_prefix_applies_to_all_frames_of_messages(scene_of_kinds):
    """With a prefix each frame name in the messages for viewers starts with it.

    Without a prefix no frame has it, and the messages are otherwise the same.
    """
    start, end = islice(cam_states(scene_of_kinds.scene), 2)
    simulator = FollowerSimulator.of(scene_of_kinds)
    simulator.turn_to(start)
    _, block = simulator.turn_to(end)
    frames = {}
    for prefix in ("", "rig1/"):
        motion = MotionMessages(scene_of_kinds, 8, frame_prefix=prefix)
        derived = motion.of_cam(start.cam) + motion.of_tick(start, end, block.rows)
        frames[prefix] = [
            (m.topic.name, list(frames_of(TYPES.deserialize_cdr(m.cdr, m.topic.type))))
            for m in derived
        ]
    prefixed = [(name, [f"rig1/{frame}" for frame in names]) for name, names in frames[""]]
    assert prefixed == frames["rig1/"] and any(names for _, names in prefixed)


def test_dimensions_are_those_of_the_files(kind):
    """The URDF has base circle, roller and mass of the cam and rig files.

    The follower moves up along z of base_link, and the shaft points along x.
    """
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


def test_the_follower_joint_is_the_same_for_all_cams_of_the_scene(scene_of_kinds):
    """The URDFs of all cams of a scene have the same follower joint and bench.

    The limits of the follower's joint include the largest lift of all cams, and the gap in flight.
    """
    limits, bench = [], []
    fastest = max(scene_of_kinds.scene.schedule.speeds.si_list)
    for cam in scene_of_kinds.scene.cams:
        text = urdf(Robot.of(scene_of_kinds, cam))
        links = links_of(text)
        joint = ElementTree.fromstring(text).find(f"joint[@name='{FOLLOWER}']")
        limits.append(joint.find("limit").attrib)
        sizes = [links[name].find("visual/geometry/*").attrib for name in (BASE, MOTOR)]
        motor = numbers(links[MOTOR].find("visual/origin").get("xyz"))
        position = poses(text, AT_REST)[BASE, MOTOR][:3, 3] + motor
        bench.append((sizes, position.round(8).tolist()))
    assert limits == [limits[0]] * len(limits) and bench == [bench[0]] * len(bench)
    angles = np.linspace(0.0, 2.0 * np.pi, 3601)
    laws = [scene_of_kinds.laws[cam] for cam in scene_of_kinds.scene.cams]
    lift = max(float(law(angles).max()) for law in laws)
    speed = max(float(np.abs(law(angles, 1)).max()) for law in laws) * fastest
    assert float(limits[0]["lower"]) <= 0.0 and float(limits[0]["upper"]) > 1.1 * lift
    assert float(limits[0]["effort"]) > 0.0
    assert float(limits[0]["velocity"]) == pytest.approx(speed, rel=1e-3)


def test_the_bodies_of_the_cam_approximate_its_contour(kind):
    """The solids of the cam cover its contour, within 0.5 % of its area."""
    robot = kind.robot
    parts = [Point(0.0, 0.0).buffer(robot.mounted.follower.base_radius.si, 128)]
    for visual in links_of(kind.urdf)[robot.mounted.name].iter("visual"):
        x, y, _ = 0.5 * numbers(visual.find("geometry/box").get("size"))
        (_, _, yaw), centre = (numbers(visual.find("origin").get(key)) for key in ("rpy", "xyz"))
        rotated = rotate(box(-x, -y, x, y), yaw, origin=(0, 0), use_radians=True)
        parts.append(translate(rotated, *centre[:2]))
    projection = unary_union(parts)
    contour = Polygon(contour_of(robot.mounted, robot.law).T)
    assert projection.difference(contour).area < 5e-4 * contour.area
    assert contour.difference(projection).area < 5e-3 * contour.area


def inertia(link):
    """Return the inertia matrix (kg·m²) of a link element of a URDF, shape (3, 3)."""
    i = {key: float(value) for key, value in link.find("inertia").attrib.items()}
    return np.array([[i["i" + "".join(sorted(a + b))] for b in "xyz"] for a in "xyz"])


def test_every_link_has_a_possible_mass_and_inertia(kind):
    """Each link has a positive mass and a physically possible inertia.

    Principal moments of inertia satisfy the triangle inequality. Gazebo drops links without a mass.
    Bodies for display and collision are equal, and a comment states each assumption.
    """
    links = links_of(kind.urdf)
    for link in links.values():
        assert float(link.find("inertial/mass").get("value")) > 0.0
        principal = np.linalg.eigvalsh(inertia(link.find("inertial")))
        assert principal[0] > 0.0
        assert principal[0] + principal[1] > (1.0 - 1e-4) * principal[2]
        visual, collision = (
            [(body.tag, body.attrib) for body in link.findall(f"{kind}/geometry/*")]
            for kind in ("visual", "collision")
        )
        assert visual == collision
    assert kind.urdf.count("assumed") == len(links)


def test_inertia_of_a_turned_box():
    """The inertia of rotated bodies equals that of points that fill them, to 0.5 %."""
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
        rotation = Rotation.from_euler("xyz", body.rpy).as_matrix()
        points.append(inside @ rotation.T + body.xyz)
        masses.append(np.full(len(inside), body.mass / len(inside)))
    positions, weights = np.concatenate(points), np.concatenate(masses)
    centre = weights @ positions / weights.sum()
    offset = positions - centre
    expected = (weights @ (offset**2).sum(axis=1)) * np.eye(3) - (offset.T * weights) @ offset
    element = inertial(bodies)
    np.testing.assert_allclose(inertia(element), expected, rtol=0, atol=5e-3 * expected.max())
    np.testing.assert_allclose(numbers(element.find("origin").get("xyz")), centre, atol=1e-3)


# -- transforms of /tf at given joint positions


def matrices(cdr):
    """Return the transforms of a serialized TFMessage by (parent, child), and stamps.

    A transform is a matrix, shape (4, 4). The stamps are in ns.
    """
    result, stamps = {}, set()
    for stamped in TYPES.deserialize_cdr(cdr, "tf2_msgs/msg/TFMessage").transforms:
        r, t = stamped.transform.rotation, stamped.transform.translation
        rotation = Rotation.from_quat([r.x, r.y, r.z, r.w])
        assert abs(r.x**2 + r.y**2 + r.z**2 + r.w**2 - 1.0) < 1e-14
        pair = stamped.header.frame_id, stamped.child_frame_id
        result[pair] = homogeneous(rotation, [t.x, t.y, t.z])
        stamps.add(stamped.header.stamp.sec * NS + stamped.header.stamp.nanosec)
    return result, stamps


def test_transforms_equal_the_poses_of_the_urdf(kind):
    """The transforms of a message equal the poses of the URDF, to 1e-11.

    Lifts and angles are random over many turns. The stamps are those of the samples. /tf and
    /tf_static together contain each joint once.
    """
    random, count, transforms = np.random.default_rng(7), 10, Transforms(kind.robot)
    stamps = np.sort(random.integers(0, 100 * NS, count))
    angle, lift = random.uniform(-10.0, 1000.0, count), random.uniform(0.0, 0.02, count)
    fixed, _ = matrices(transforms.fixed(5 * NS + 3))
    messages = transforms.moving(stamps, angle, lift)
    for stamp, a, s, cdr in zip(stamps, angle, lift, messages, strict=True):
        moving, times = matrices(cdr)
        expected = poses(kind.urdf, {CAM: a, FOLLOWER: s})
        assert times == {stamp}
        assert fixed.keys() | moving.keys() == expected.keys()
        assert not fixed.keys() & moving.keys()
        for pair, pose in {**fixed, **moving}.items():
            np.testing.assert_allclose(pose, expected[pair], rtol=0, atol=1e-11)


# -- markers, transformed by /tf into the frames of the cam and the follower

#: Number of samples in the tests of markers.
COUNT = 45
#: Gap between cam and follower in flight (m).
GAP = 1.3e-3
#: Cam angle at each sample (rad).
ANGLE = np.linspace(0.001, 12.0, COUNT)
#: Rig time of each sample (ns).
STAMPS = np.arange(COUNT) * 10**7 + 3


def flat(points):
    return np.array([[p.x, p.y, 0.0, 1.0] for p in points])


def markers_of(messages):
    """Return the list of markers of each serialized MarkerArray."""
    kind = "visualization_msgs/msg/MarkerArray"
    return [TYPES.deserialize_cdr(cdr, kind).markers for cdr in messages]


def time_of(marker):
    return marker.header.stamp.sec * NS + marker.header.stamp.nanosec


def in_link(robot, lift, link, points):
    """Transform points of the guide's frame into the frame of a link, one per sample.

    `lift` (m) is that of the samples, at the cam angles `ANGLE`.
    """
    moving = Transforms(robot).moving(np.zeros(COUNT, np.int64), ANGLE, lift)
    into = np.stack([np.linalg.inv(matrices(cdr)[0][GUIDE, link]) for cdr in moving])
    return np.einsum("nij,nj->ni", into, points)


def distance_to_follower(robot, points):
    """Return the distance (m) of points from the follower's roller, tip or face.

    The points are in the frame of the link follower.
    """
    shape, lift_0 = robot.shape, np.zeros(1)
    element = shape.element
    origin = shape.place(lift_0)
    if isinstance(element, Swung):  # the link is along the arm at lift 0
        turn = -float(shape.turn(lift_0)[0])
        origin = origin - shape.origin(lift_0)
        origin = origin @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]).T
    offset = points[:, :2] - origin
    if isinstance(element, SwungFace):
        return np.abs(offset[:, 1])
    if isinstance(element, GuidedFace):
        return np.abs(offset @ [-np.sin(element.inclination), np.cos(element.inclination)])
    return np.abs(np.hypot(*offset.T) - element.roller)


def require_on_both(robot, lift, cam_points, follower_points):
    """Require that points are on the cam's contour and on the follower, to 1e-9 m.

    There is one point per sample, in the frame of the guide.
    """
    contour = contours_at(robot.mounted.follower, robot.law, ANGLE)[0].points.T
    on_cam = in_link(robot, lift, CAM, cam_points)[:, :2]
    np.testing.assert_allclose(on_cam, contour, rtol=0, atol=1e-9)
    on_follower = in_link(robot, lift, FOLLOWER, follower_points)
    assert distance_to_follower(robot, on_follower).max() < 1e-9


def test_markers_in_contact_are_the_contact_point_and_the_force(kind):
    """In contact the markers are the contact point and an arrow of the force.

    The point is on cam and follower, and the arrow is along the common normal. The component of the
    arrow along y of the link follower is proportional to the contact force.
    """
    robot, force = kind.robot, np.linspace(1.0, 50.0, COUNT)
    lift = robot.law(ANGLE)
    messages = markers.FollowerMarkers(robot).messages(STAMPS, ANGLE, lift, force)
    spheres, arrows = zip(*markers_of(messages), strict=True)
    assert {(m.type, m.action, m.header.frame_id) for m in spheres} == {(markers.SPHERE, 0, GUIDE)}
    assert [time_of(m) for m in spheres] == list(STAMPS)
    points = flat([m.pose.position for m in spheres])
    require_on_both(robot, lift, points, points)
    assert {m.type for m in arrows} == {markers.ARROW}
    ends = [flat([m.points[k] for m in arrows]) for k in (0, 1)]
    vector = (ends[1] - ends[0]) * [1.0, 1.0, 1.0, 0.0]
    newtons_per_metre = force / in_link(robot, lift, FOLLOWER, vector)[:, 1]
    np.testing.assert_allclose(newtons_per_metre, newtons_per_metre[0], rtol=1e-9)
    arrow = in_link(robot, lift, CAM, vector)
    normal = contours_at(robot.mounted.follower, robot.law, ANGLE)[0].normal.T
    tangential = arrow[:, 0] * normal[:, 1] - arrow[:, 1] * normal[:, 0]
    assert np.abs(tangential).max() < 1e-9


def test_markers_in_flight_are_a_line_along_the_gap_and_its_length(kind):
    """In flight the markers are a line from contour to follower, and its length in µm.

    They have the ids of the markers in contact, which they thus replace. If a tick (interval
    between cam states) contains contact and flight, the force of each sample decides.
    """
    robot = kind.robot
    follower_markers, lift = markers.FollowerMarkers(robot), robot.law(ANGLE) + GAP
    pairs = markers_of(follower_markers.messages(STAMPS, ANGLE, lift, np.zeros(COUNT)))
    assert {(m[0].type, m[1].type) for m in pairs} == {(markers.LINE_STRIP, markers.TEXT)}
    assert {(m[0].ns, m[0].id, m[1].ns, m[1].id) for m in pairs} == {("contact", 0, "contact", 1)}
    starts, ends = (flat([m[0].points[k] for m in pairs]) for k in (0, 1))
    require_on_both(robot, lift, starts, ends)
    gaps = np.hypot(*(ends - starts)[:, :2].T) * 1e6
    displayed = [float(m[1].text.removeprefix("gap ").removesuffix(" µm")) for m in pairs]
    np.testing.assert_allclose(displayed, gaps, atol=0.051)
    force = np.where(np.arange(COUNT) % 3, 20.0, 0.0)
    pairs = markers_of(follower_markers.messages(STAMPS, ANGLE, robot.law(ANGLE), force))
    assert [m[0].type == markers.SPHERE for m in pairs] == list(force > 0.0)
    assert [time_of(m[0]) for m in pairs] == list(STAMPS)


def test_the_markers_of_the_cam_have_its_exact_contour(kind):
    """The markers of a cam are its closed contour and a solid with the same area."""
    robot = kind.robot
    ((line, body),) = markers_of([markers.cam_markers(robot)])
    assert (line.type, body.type) == (markers.LINE_STRIP, markers.TRIANGLE_LIST)
    assert line.header.frame_id == body.header.frame_id == robot.mounted.name
    outline = contours(robot.mounted.follower, robot.law, CONTOUR_POINTS)[0].points.T
    points = np.array([[p.x, p.y] for p in line.points])
    np.testing.assert_array_equal(points, np.vstack([outline, outline[:1]]))
    corners = np.array([[p.x, p.y, p.z] for p in body.points]).reshape(-1, 3, 3)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = 0.5 * np.cross(first, second)
    x, y = outline.T
    area = 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    along = normals[:, 2]
    assert along[along > 0.0].sum() == pytest.approx(area, rel=1e-12)
    assert along[along < 0.0].sum() == pytest.approx(-area, rel=1e-12)
    np.testing.assert_allclose(normals.sum(axis=0), 0.0, atol=1e-12)  # a closed surface

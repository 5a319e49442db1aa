"""Launch file of RViz: robot_state_publisher with the scene's URDF, and rviz2 with a layout.

It displays a running rig or `ros2 bag play`. rig.launch.py includes it if rviz:=true.
"""

import tempfile
from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from cam_rig.messages import topics
from cam_rig.messages.frames import Robot
from cam_rig.messages.urdf import urdf
from cam_rig.schema.load import config_root, resolve_path
from cam_rig.simulation.scene import open_scene

#: Scene of a rig without the launch argument scene.
DEFAULT_SCENE = "tm21_sweep"
#: Topics to which the nodes subscribe in the root namespace, remapped for a rig in a namespace.
REMAPPED = (topics.CLOCK, topics.ROBOT_DESCRIPTION, topics.CAM_MARKERS, topics.FOLLOWER_MARKERS)
#: Maximum rate (Hz of rig time) of published transforms, enough for 72 per turn up to 800 rpm.
PUBLISH_FREQUENCY = 1000.0


def write_layout(frame_prefix: str) -> str:
    """Return the path of the layout for RViz, with the prefix in the frames that it names."""
    layout = config_root() / "layouts" / "cam_rig.rviz"
    if not frame_prefix:
        return str(layout)
    text = layout.read_text(encoding="utf-8")
    text = text.replace("Fixed Frame: base_link", f"Fixed Frame: {frame_prefix}base_link")
    text = text.replace('TF Prefix: ""', f"TF Prefix: {frame_prefix.rstrip('/')}")
    copy = Path(tempfile.mkdtemp(prefix="cam_rig_")) / layout.name
    copy.write_text(text, encoding="utf-8")
    return str(copy)


def make_nodes(context: LaunchContext) -> list[Node]:
    """Return the actions that start both nodes for the rig of a namespace."""
    names = ("scene", "namespace", "frame_prefix", "control")
    arguments = {name: LaunchConfiguration(name).perform(context) for name in names}
    robot = Robot.of(open_scene(resolve_path("scenes", arguments["scene"] or DEFAULT_SCENE)))
    name = arguments["namespace"].strip("/")
    namespace = f"/{name}" if name else ""
    remaps = [(topic.name, topic.within(namespace)) for topic in REMAPPED] if namespace else []
    # the joint states of a tick arrive at once, and the sensor QoS would keep only five of them
    joints = f"qos_overrides.{topics.JOINT_STATES.within(namespace)}.subscription"
    control = namespace if arguments["control"].lower() in ("true", "1") else None
    parameters = {
        "robot_description": ParameterValue(urdf(robot, control), value_type=str),
        "frame_prefix": arguments["frame_prefix"],
        "publish_frequency": PUBLISH_FREQUENCY,
        "use_sim_time": True,
        f"{joints}.reliability": "reliable",
        f"{joints}.history": "keep_last",
        f"{joints}.depth": topics.MOTION_DEPTH,
    }
    publisher = Node(
        package="robot_state_publisher",
        executable="robot_state_publisher",
        namespace=namespace,
        parameters=[parameters],
        # /robot_description is published by the law server, which knows the mounted cam
        remappings=[("robot_description", "robot_state_publisher/robot_description"), *remaps[:1]],
        output="screen",
    )
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", write_layout(arguments["frame_prefix"])],
        parameters=[{"use_sim_time": True}],
        remappings=remaps,
        condition=IfCondition(LaunchConfiguration("rviz")),
        output="screen",
    )
    return [publisher, rviz]


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments, and start both nodes, rviz2 only if rviz is true."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "scene", default_value="", description="scene file, or a name in config/scenes"
            ),
            DeclareLaunchArgument(
                "namespace", default_value="", description="namespace of the rig, such as rig1"
            ),
            DeclareLaunchArgument(
                "frame_prefix",
                default_value="",
                description="text before the names of the frames, such as rig1/",
            ),
            DeclareLaunchArgument(
                "control",
                default_value="false",
                description="true: the URDF has the element ros2_control",
            ),
            DeclareLaunchArgument(
                "rviz", default_value="true", description="false: robot_state_publisher alone"
            ),
            OpaqueFunction(function=make_nodes),
        ]
    )

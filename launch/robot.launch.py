"""The rig in RViz: robot_state_publisher for the scene's URDF, and rviz2 with the shipped layout.

Beside a running rig, or beside `ros2 bag play`; rig.launch.py includes it with rviz:=true.
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from cam_rig.messages import topics
from cam_rig.messages.frames import Robot
from cam_rig.messages.urdf import urdf
from cam_rig.schema.load import named_path
from cam_rig.simulation.scene import open_scene

#: The scene of a rig that is given none.
DEFAULT_SCENE = "tm21_sweep"
#: What both nodes subscribe to by its name in the root namespace.
SHOWN = (topics.CLOCK, topics.ROBOT_DESCRIPTION, topics.CAM_MARKERS, topics.FOLLOWER_MARKERS)
#: Per second of rig time, the most it takes: 72 instants a turn up to 800 rpm.
PUBLISH_FREQUENCY = 1000.0


def nodes(context: LaunchContext) -> list[Node]:
    """Start both nodes for the rig of a namespace."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ("scene", "namespace")}
    robot = Robot.of(open_scene(named_path("scenes", given["scene"] or DEFAULT_SCENE)))
    inside = given["namespace"].strip("/")
    namespace = f"/{inside}" if inside else ""
    shown = [(topic.name, topic.within(namespace)) for topic in SHOWN] if namespace else []
    # The motion of a tick comes all at once: what is meant for sensors would keep five of it.
    joints = f"qos_overrides.{topics.JOINT_STATES.within(namespace)}.subscription"
    parameters = {
        "robot_description": ParameterValue(urdf(robot), value_type=str),
        "publish_frequency": PUBLISH_FREQUENCY,
        "use_sim_time": True,
        f"{joints}.reliability": "reliable",
        f"{joints}.history": "keep_last",
        f"{joints}.depth": topics.MOTION_DEPTH,
    }
    layout = PathJoinSubstitution(
        [FindPackageShare("cam_rig"), "config", "layouts", "cam_rig.rviz"]
    )
    publisher = Node(
        package="robot_state_publisher",
        executable="robot_state_publisher",
        namespace=namespace,
        parameters=[parameters],
        # On /robot_description the law server's counts, which has the cam that is mounted.
        remappings=[("robot_description", "robot_state_publisher/robot_description"), *shown[:1]],
        output="screen",
    )
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", layout],
        parameters=[{"use_sim_time": True}],
        remappings=shown,
        condition=IfCondition(LaunchConfiguration("rviz")),
        output="screen",
    )
    return [publisher, rviz]


def generate_launch_description() -> LaunchDescription:
    """Start both; rviz2 may be left out."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "scene", default_value="", description="scene file, or a name in config/scenes"
            ),
            DeclareLaunchArgument(
                "namespace", default_value="", description="namespace of the rig, such as rig1"
            ),
            DeclareLaunchArgument(
                "rviz", default_value="true", description="false: robot_state_publisher alone"
            ),
            OpaqueFunction(function=nodes),
        ]
    )

"""The rig: five nodes, one scene, one bag."""

from time import strftime

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, SetEnvironmentVariable, Shutdown
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def config(*path: str) -> PathJoinSubstitution:
    """Name a file under share/cam_rig/config."""
    return PathJoinSubstitution([FindPackageShare("cam_rig"), "config", *path])


def argument(name: str) -> dict[str, ParameterValue]:
    """Pass a launch argument on as the string parameter of the same name."""
    return {name: ParameterValue(LaunchConfiguration(name), value_type=str)}


def node(name: str, *arguments: str, **options: object) -> Node:
    """Start the node of this name with the scene and any further arguments."""
    parameters = [argument("scene"), *map(argument, arguments)]
    return Node(
        package="cam_rig", executable=name, parameters=parameters, output="screen", **options
    )


def generate_launch_description() -> LaunchDescription:
    """Start the recorder first, and stop them all when the drive has run its program."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "scene",
                default_value=config("scenes", "tm21_sweep.yaml"),
                description="scene file: which cams, which rig, what to run and measure",
            ),
            DeclareLaunchArgument(
                "bag",
                default_value=strftime("bags/rig_%Y_%m_%d-%H_%M_%S"),
                description="folder to record into; it must not exist yet",
            ),
            SetEnvironmentVariable("FASTDDS_DEFAULT_PROFILES_FILE", config("fastdds_loopback.xml")),
            node("recorder", "bag"),
            node("microphone"),
            node("follower"),
            node("law_server"),
            node("cam_drive", on_exit=Shutdown(reason="the cam drive has ended")),
        ]
    )

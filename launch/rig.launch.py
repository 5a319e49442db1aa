"""The rig: five nodes, one scene, one bag; with view:=true a sixth shows it in Rerun."""

import atexit
import shutil
import tempfile
from time import strftime

from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    OpaqueFunction,
    SetEnvironmentVariable,
    SetLaunchConfiguration,
    Shutdown,
)
from launch.conditions import IfCondition, UnlessCondition
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def config(*path: str) -> PathJoinSubstitution:
    """Name a file under share/cam_rig/config."""
    return PathJoinSubstitution([FindPackageShare("cam_rig"), "config", *path])


def argument(name: str, kind: type = str) -> dict[str, ParameterValue]:
    """Pass a launch argument on as the parameter of the same name."""
    return {name: ParameterValue(LaunchConfiguration(name), value_type=kind)}


def ended(event: ProcessExited, context: LaunchContext) -> Shutdown | None:
    """End all when the drive has run its program, or when a node died and is not to return."""
    again = LaunchConfiguration("respawn").perform(context).lower() in ("true", "1")
    if again and event.returncode != 0:
        return None
    return Shutdown(reason=f"{event.process_name} has ended")


def handover(_context: LaunchContext) -> list[SetLaunchConfiguration]:
    """Make a folder where nodes leave what their successors must know; it goes with the launch."""
    folder = tempfile.mkdtemp(prefix="cam_rig-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return [SetLaunchConfiguration("handover", folder)]


def node(name: str, *more: dict[str, ParameterValue], condition: IfCondition | None = None) -> Node:
    """Start the node of this name with the scene and any further parameters."""
    return Node(
        package="cam_rig",
        executable=name,
        parameters=[argument("scene"), argument("handover"), *more],
        output="screen",
        respawn=LaunchConfiguration("respawn"),
        respawn_delay=0.5,
        on_exit=ended,
        condition=condition,
    )


def generate_launch_description() -> LaunchDescription:
    """Start who listens before who speaks, as `cam-rig run` does."""
    network = LaunchConfiguration("network")
    quiet, loud = UnlessCondition(network), IfCondition(network)
    profile = "FASTDDS_DEFAULT_PROFILES_FILE"
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
            DeclareLaunchArgument(
                "view",
                default_value="false",
                description="open Rerun and show the run while it runs",
            ),
            DeclareLaunchArgument(
                "pacing",
                default_value="free",
                description="rig time beside wall time: free, real_time, or Nx such as 20x",
            ),
            DeclareLaunchArgument(
                "autostart", default_value="true", description="false: wait for /cam_drive/start"
            ),
            DeclareLaunchArgument(
                "patience",
                default_value="120.0",
                description="wall time without an answer after which the drive gives up, s",
            ),
            DeclareLaunchArgument(
                "respawn", default_value="false", description="start a node again that died"
            ),
            DeclareLaunchArgument(
                "network", default_value="false", description="true: the subnet may listen"
            ),
            SetEnvironmentVariable(profile, config("fastdds_loopback.xml"), condition=quiet),
            # Any other range, LOCALHOST too, would replace the profile's transports.
            SetEnvironmentVariable(
                "ROS_AUTOMATIC_DISCOVERY_RANGE", "SYSTEM_DEFAULT", condition=quiet
            ),
            # One in the working directory would open the subnet.
            SetEnvironmentVariable("SKIP_DEFAULT_XML_FILE", "1", condition=quiet),
            SetEnvironmentVariable(profile, config("fastdds_subnet.xml"), condition=loud),
            OpaqueFunction(function=handover),
            node("recorder", argument("bag")),
            node("viewer", condition=IfCondition(LaunchConfiguration("view"))),
            node("microphone"),
            node("follower"),
            node("law_server"),
            node(
                "cam_drive",
                argument("pacing"),
                argument("autostart", bool),
                argument("patience", float),
            ),
        ]
    )

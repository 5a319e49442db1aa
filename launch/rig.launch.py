"""The rig: five nodes, one scene, one bag; with view:=true a sixth shows it in Rerun."""

import atexit
import shutil
import tempfile
from time import strftime

from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    LogInfo,
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

from cam_rig.runner.node_table import NODES, NodeEntry


def config(*path: str) -> PathJoinSubstitution:
    """Name a file under share/cam_rig/config."""
    return PathJoinSubstitution([FindPackageShare("cam_rig"), "config", *path])


def argument(name: str, kind: type = str) -> dict[str, ParameterValue]:
    """Pass a launch argument on as the parameter of the same name."""
    return {name: ParameterValue(LaunchConfiguration(name), value_type=kind)}


def ended(event: ProcessExited, context: LaunchContext) -> Shutdown | None:
    """End all when the drive has run its program, or when a node ended that is not restarted."""
    again = LaunchConfiguration("respawn").perform(context).lower() in ("true", "1")
    if again and event.returncode != 0:
        return None
    return Shutdown(reason=f"{event.process_name} has ended")


def left_out(event: ProcessExited, _context: LaunchContext) -> LogInfo:
    """Report the end of a node that is not essential, as `cam-rig run` does."""
    code, name = event.returncode, event.process_name
    return LogInfo(msg=f"node {name} ended with code {code}: the run goes on without it")


def checkpoint(_context: LaunchContext) -> list[SetLaunchConfiguration]:
    """Make the folder of the nodes' checkpoints; it is removed with the launch."""
    folder = tempfile.mkdtemp(prefix="cam_rig-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return [SetLaunchConfiguration("checkpoint", folder)]


def node(entry: NodeEntry) -> Node:
    """Start a node of the table with the scene and its further parameters."""
    given = [argument(name, kind) for name, kind in entry.parameters.items()]
    optional = {
        "respawn": True,
        "respawn_max_retries": entry.max_respawns,
        "condition": IfCondition(LaunchConfiguration("view")),
        "on_exit": left_out,
    }
    essential = {"respawn": LaunchConfiguration("respawn"), "on_exit": ended}
    return Node(
        package="cam_rig",
        executable=entry.name,
        parameters=[argument("scene"), argument("checkpoint"), *given],
        output="screen",
        respawn_delay=0.5,
        **(essential if entry.essential else optional),
    )


def generate_launch_description() -> LaunchDescription:
    """Start the nodes of the runner's table, in its order."""
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
                description="show the run in Rerun while it runs",
            ),
            DeclareLaunchArgument(
                "address",
                default_value="",
                description="Rerun's address, with view:=true; empty opens a window",
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
                "respawn", default_value="false", description="start a node again that was killed"
            ),
            DeclareLaunchArgument(
                "network", default_value="false", description="true: the subnet may subscribe"
            ),
            SetEnvironmentVariable(profile, config("fastdds_loopback.xml"), condition=quiet),
            # Any other range, LOCALHOST too, would replace the profile's transports.
            SetEnvironmentVariable(
                "ROS_AUTOMATIC_DISCOVERY_RANGE", "SYSTEM_DEFAULT", condition=quiet
            ),
            # One in the working directory would open the subnet.
            SetEnvironmentVariable("SKIP_DEFAULT_XML_FILE", "1", condition=quiet),
            SetEnvironmentVariable(profile, config("fastdds_subnet.xml"), condition=loud),
            OpaqueFunction(function=checkpoint),
            *map(node, NODES),
        ]
    )

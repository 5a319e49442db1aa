"""The rig: five nodes, one scene, one bag; with view:=true a sixth shows it in Rerun."""

import signal
from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    LogInfo,
    OpaqueFunction,
    SetEnvironmentVariable,
    Shutdown,
)
from launch.conditions import IfCondition, UnlessCondition
from launch.events.process import ProcessExited
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from cam_rig.nodes.parameters import PARAMETERS
from cam_rig.runner.node_table import DRIVE, END, NODES, PATIENCE_S, STAY, NodeEntry

#: Arguments with what they are without being given, and what they mean; where there is nothing, a
#: node's parameter is as the parameter file or its own default has it.
ARGUMENTS = {
    "scene": ("", "scene file, or a name in config/scenes: which cams, which rig, what to run and "
              "measure; tm21_sweep where nothing else says so"),
    "bag": ("", "folder to record into; it must not exist yet; bags/SCENE_DATE without one"),
    "max_bagfile_size": ("", "bytes after which the bag goes on in another file; 0: no limit"),
    "max_bagfile_duration": ("", "rig time after which the bag goes on in another file, s; 0: no "
                             "limit"),
    "params_file": ("", "parameter file (YAML) of the nodes, such as those in config/params; an "
                    "argument that is given here comes before it"),
    "namespace": ("", "namespace of the nodes and their topics, such as rig1"),
    "use_sim_time": ("", "true: the nodes' clocks follow /clock, which the drive makes"),
    "view": ("false", "true: show the run in Rerun while it runs"),
    "rviz": ("false", "true: show the run in RViz, with robot_state_publisher"),
    "address": ("", "Rerun's address, with view:=true; empty opens a window"),
    "pacing": ("", "rig time beside wall time: free, real_time, or a factor such as 20 or 20x"),
    "autostart": ("", "false: wait for the service cam_drive/start"),
    "points_per_turn": ("", "instants a turn of /joint_states and the like; 0: as the scene says"),
    "motion_rate": ("", "with a pacing, how often a second of wall time they come, Hz"),
    "patience": ("", "wall time without an answer after which the drive gives up, s; "
                 f"{PATIENCE_S:g} without a parameter file"),
    "at_end": ("", f"what the nodes do when the run is over: {END}, or {STAY} for another run, "
               "which the service cam_drive/start begins"),
    "network": ("false", "true: the subnet may subscribe"),
}  # fmt: skip


def share(*path: str) -> PathJoinSubstitution:
    """Name a file under share/cam_rig."""
    return PathJoinSubstitution([FindPackageShare("cam_rig"), *path])


def config(*path: str) -> PathJoinSubstitution:
    """Name a file under share/cam_rig/config."""
    return share("config", *path)


def value(name: str, context: LaunchContext) -> str:
    """Return the text of a launch argument, or an empty string if it is not given."""
    return LaunchConfiguration(name).perform(context)


def ended(event: ProcessExited, _context: LaunchContext) -> Shutdown:
    """Shut down the launch when an essential node has ended.

    The launch service reports an exception of a handler as an error, shuts down the other nodes and
    ends with code 1. It has no other way to end with a code.

    Raises
    ------
    RuntimeError
        If the node has failed.
    """
    code, name = event.returncode, event.process_name
    # SIGALRM ends a node that has done all its work, and waits for DDS (cam_rig/nodes/process.py)
    if code not in (0, -signal.SIGALRM):
        raise RuntimeError(f"{name} has ended with code {code}, see its error above")
    return Shutdown(reason=f"{name} has ended in order")


def left_out(event: ProcessExited, _context: LaunchContext) -> LogInfo:
    """Report the end of a node that is not essential, as `cam-rig run` does."""
    code, name = event.returncode, event.process_name
    return LogInfo(msg=f"node {name} ended with code {code}: the run goes on without it")


def node(entry: NodeEntry, context: LaunchContext) -> Node:
    """Start a node of the table with those of its parameters that were given."""
    kinds = {spec.name: type(spec.default) for spec in PARAMETERS[entry.name]}
    wanted = {name: kinds[name] for name in ARGUMENTS if name in kinds} | {"use_sim_time": bool}
    if not entry.essential:
        del wanted["at_end"]
    given = {
        name: ParameterValue(LaunchConfiguration(name), value_type=kind)
        for name, kind in wanted.items()
        if value(name, context)
    }
    file = value("params_file", context)
    if entry.name == DRIVE and not file:
        given.setdefault("patience", PATIENCE_S)
    optional = {
        "condition": IfCondition(LaunchConfiguration("view")),
        "on_exit": left_out,
    }
    return Node(
        package="cam_rig",
        executable=entry.name,
        name=entry.name,
        namespace=LaunchConfiguration("namespace"),
        parameters=[*([file] if file else []), given],
        output="screen",
        **({"on_exit": ended} if entry.essential else optional),
    )


def nodes(context: LaunchContext) -> list[Node]:
    """Start the nodes of the runner's table, in its order; raise RuntimeError without a file."""
    file = value("params_file", context)
    if file and not Path(file).is_file():  # launch_ros only warns, and starts with the defaults
        raise RuntimeError(f"params_file must be an existing file, got {file!r}")
    return [node(entry, context) for entry in NODES]


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments, keep the nodes' sockets on this machine, start the nodes."""
    network = LaunchConfiguration("network")
    quiet, loud = UnlessCondition(network), IfCondition(network)
    profile = "FASTDDS_DEFAULT_PROFILES_FILE"
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=words)
                for name, (default, words) in ARGUMENTS.items()
            ),
            SetEnvironmentVariable(profile, config("fastdds_loopback.xml"), condition=quiet),
            # Any other range, LOCALHOST too, would replace the profile's transports.
            SetEnvironmentVariable(
                "ROS_AUTOMATIC_DISCOVERY_RANGE", "SYSTEM_DEFAULT", condition=quiet
            ),
            # One in the working directory would open the subnet.
            SetEnvironmentVariable("SKIP_DEFAULT_XML_FILE", "1", condition=quiet),
            SetEnvironmentVariable(profile, config("fastdds_subnet.xml"), condition=loud),
            OpaqueFunction(function=nodes),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(share("launch", "robot.launch.py")),
                launch_arguments={
                    name: LaunchConfiguration(name) for name in ("scene", "namespace")
                }.items(),
                condition=IfCondition(LaunchConfiguration("rviz")),
            ),
        ]
    )

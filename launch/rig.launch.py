"""Launch file of the rig: five nodes that run a scene and record a bag, and optional viewers."""

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
from launch.substitutions import EqualsSubstitution, LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from cam_rig.nodes.parameters import PARAMETERS
from cam_rig.runner.node_table import DRIVE, END, NODES, PROGRESS_TIMEOUT_S, STAY, NodeEntry

#: Launch argument -> (default, description). If the default is empty, a node has the value of the
#: parameter file, or else the default of its parameter.
ARGUMENTS = {
    "scene": ("", "scene file, or a name in config/scenes, with cams, rig, speeds and measurement "
              "(default: tm21_sweep)"),
    "output_uri": ("", "folder to record into, which must not exist (default: bags/SCENE_DATE)"),
    "max_bagfile_size": ("", "size in bytes after which a new file of the bag starts; 0: no limit"),
    "max_bagfile_duration": ("", "rig time (s) after which a new file of the bag starts; 0: no "
                             "limit"),
    "params_file": ("", "parameter file (YAML) of the nodes, such as those in config/params; "
                    "launch arguments have priority over it"),
    "namespace": ("", "namespace of the nodes and their topics, such as rig1"),
    "frame_prefix": ("", "text before the names of the frames, such as rig1/ for the rig of a "
                     "namespace"),
    "log_level": ("info", "lowest level of the log lines: debug, info, warn, error or fatal"),
    "use_sim_time": ("", "true: the clocks of the nodes follow /clock, which the drive publishes"),
    "view": ("false", "true: show the run in Rerun while it runs"),
    "rviz": ("false", "true: show the run in RViz, with robot_state_publisher"),
    "address": ("", "address of Rerun, with view:=true (default: a window)"),
    "pacing": ("", "real-time factor: free, real_time, or a multiple such as 20 or 20x"),
    "autostart": ("", "false: wait for the service cam_drive/start"),
    "samples_per_turn": ("", "samples per turn of /joint_states and similar topics; 0: as in the "
                        "scene"),
    "visualization_rate": ("", "rate (Hz, wall-clock) of /joint_states and similar topics of a "
                           "paced run"),
    "progress_timeout": ("", "wall time (s) without an answer after which the drive gives up "
                         f"(default: {PROGRESS_TIMEOUT_S:g} without a parameter file)"),
    "on_finish": ("", f"state of the nodes after the run: {END}, or {STAY} for another run, "
                  "started by the service cam_drive/start"),
    "discovery": ("localhost", "machines that discover the nodes: localhost, or subnet"),
}  # fmt: skip


def share(*path: str) -> PathJoinSubstitution:
    """Return the path of a file in share/cam_rig."""
    return PathJoinSubstitution([FindPackageShare("cam_rig"), *path])


def argument_text(name: str, context: LaunchContext) -> str:
    """Return the text of a launch argument, or an empty string if it is not given."""
    return LaunchConfiguration(name).perform(context)


def shut_down(event: ProcessExited, _context: LaunchContext) -> Shutdown:
    """Shut down the launch when an essential node has ended.

    If a handler raises an exception, the launch service reports it, shuts down the other nodes and
    ends with code 1. There is no other way to end a launch with an exit code.

    Raises
    ------
    RuntimeError
        If the node has failed.
    """
    code, name = event.returncode, event.process_name
    # SIGALRM ends a node that has completed its work and waits for DDS (cam_rig/nodes/process.py)
    if code not in (0, -signal.SIGALRM):
        raise RuntimeError(f"{name} has ended with code {code}, see its error above")
    return Shutdown(reason=f"{name} has ended in order")


def report_exit(event: ProcessExited, _context: LaunchContext) -> LogInfo:
    """Report the end of a node that is not essential, as `cam-rig run` does."""
    code, name = event.returncode, event.process_name
    return LogInfo(msg=f"node {name} ended with code {code}; the run continues without it")


def make_node(entry: NodeEntry, context: LaunchContext) -> Node:
    """Return the action that starts a node, with its parameters among the launch arguments."""
    types = {spec.name: type(spec.default) for spec in PARAMETERS[entry.name]}
    accepted = {name: types[name] for name in ARGUMENTS if name in types} | {"use_sim_time": bool}
    if not entry.essential:
        del accepted["on_finish"]
    parameters = {
        name: ParameterValue(LaunchConfiguration(name), value_type=value_type)
        for name, value_type in accepted.items()
        if argument_text(name, context)
    }
    file = argument_text("params_file", context)
    if entry.name == DRIVE and not file:
        parameters.setdefault("progress_timeout", PROGRESS_TIMEOUT_S)
    optional = {
        "condition": IfCondition(LaunchConfiguration("view")),
        "on_exit": report_exit,
    }
    return Node(
        package="cam_rig",
        executable=entry.name,
        name=entry.name,
        namespace=LaunchConfiguration("namespace"),
        parameters=[*([file] if file else []), parameters],
        output="screen",
        ros_arguments=["--log-level", LaunchConfiguration("log_level")],
        **({"on_exit": shut_down} if entry.essential else optional),
    )


def make_nodes(context: LaunchContext) -> list[Node]:
    """Return the actions that start the nodes, in the order of the runner's table.

    Raises
    ------
    RuntimeError
        If the parameter file does not exist.
    """
    file = argument_text("params_file", context)
    if file and not Path(file).is_file():  # launch_ros only warns, and starts with the defaults
        raise RuntimeError(f"params_file must be an existing file, got {file!r}")
    return [make_node(entry, context) for entry in NODES]


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments, restrict sockets to this machine, and start the nodes."""
    is_subnet = EqualsSubstitution(LaunchConfiguration("discovery"), "subnet")
    local, subnet = UnlessCondition(is_subnet), IfCondition(is_subnet)
    profile = "FASTDDS_DEFAULT_PROFILES_FILE"
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(
                    name,
                    default_value=default,
                    description=description,
                    choices=["localhost", "subnet"] if name == "discovery" else None,
                )
                for name, (default, description) in ARGUMENTS.items()
            ),
            SetEnvironmentVariable(
                profile, share("config", "fastdds_loopback.xml"), condition=local
            ),
            # any other range, LOCALHOST included, would replace the transports of the profile
            SetEnvironmentVariable(
                "ROS_AUTOMATIC_DISCOVERY_RANGE", "SYSTEM_DEFAULT", condition=local
            ),
            # a default profile in the working directory would open the subnet
            SetEnvironmentVariable("SKIP_DEFAULT_XML_FILE", "1", condition=local),
            SetEnvironmentVariable(
                profile, share("config", "fastdds_subnet.xml"), condition=subnet
            ),
            OpaqueFunction(function=make_nodes),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(share("launch", "robot.launch.py")),
                launch_arguments={
                    name: LaunchConfiguration(name)
                    for name in ("scene", "namespace", "frame_prefix")
                }.items(),
                condition=IfCondition(LaunchConfiguration("rviz")),
            ),
        ]
    )

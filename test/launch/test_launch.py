"""Tests that the launch files start the same nodes as the command `cam-rig run`.

`launch` and `launch_ros` cannot be installed as Python packages, so fake modules replace them. A
fake action only stores its arguments.
"""

import runpy
import signal
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from cam_rig.messages import topics
from cam_rig.messages.frames import Robot
from cam_rig.messages.urdf import urdf
from cam_rig.nodes.parameters import PARAMETERS
from cam_rig.runner.node_process import live_nodes
from cam_rig.runner.node_table import DRIVE, NODES, VIEWER
from cam_rig.simulation.scene import open_scene

LAUNCH = Path(__file__).parents[2] / "launch"
MODULES = (
    "launch launch.actions launch.conditions launch.events launch.events.process "
    "launch.launch_description_sources launch.substitutions launch_ros launch_ros.actions "
    "launch_ros.parameter_descriptions launch_ros.substitutions"
)


class FakeAction:
    """Replacement of a launch action that stores its arguments."""

    def __init__(self, *given, **named):
        self.given, self.named = given, named

    def perform(self, context):
        """Return the value of the launch argument that this substitution names."""
        return context[self.given[0]]


class FakeModule(ModuleType):
    """Replacement of a launch package in which every name is a class of fake actions."""

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return type(name, (FakeAction,), {})


@pytest.fixture
def load(monkeypatch):
    """Function that runs a launch file with fake modules and returns its actions."""
    for module in MODULES.split():
        monkeypatch.setitem(sys.modules, module, FakeModule(module))
    return lambda name: runpy.run_path(str(LAUNCH / name))["generate_launch_description"]().given[0]


def of(actions, kind):
    """Return the actions of the class with the name `kind` in a list of actions."""
    return [action for action in actions if type(action).__name__ == kind]


def launch_nodes(actions, **given):
    """Return the arguments of the launched nodes by executable.

    `given` are the launch arguments.
    """
    defaults = {
        action.given[0]: action.named["default_value"]
        for action in of(actions, "DeclareLaunchArgument")
    }
    assert set(given) <= set(defaults)
    (function,) = (action.named["function"] for action in of(actions, "OpaqueFunction"))
    return {node.named["executable"]: node.named for node in function(defaults | given)}


def test_launch_starts_the_nodes_of_the_runner_in_order(load):
    """rig.launch.py starts the nodes of the command `cam-rig run`, in the same order.

    Each node declares all parameters that it gets, and gets those that the command sets.
    """
    actions = load("rig.launch.py")
    declared = (action.given[0] for action in of(actions, "DeclareLaunchArgument"))
    nodes = launch_nodes(actions, **dict.fromkeys(declared, "true") | {"params_file": __file__})
    runner = live_nodes(Path("scene"), Path("bag"), screen="", pacing="free")
    assert list(nodes) == list(runner)
    for name, node in nodes.items():
        _file, given = node["parameters"]
        declared = {spec.name for spec in PARAMETERS[name]}
        assert set(given) <= declared | {"use_sim_time"}
        of_runner = set(runner[name]) - {"consumers"}
        assert of_runner - ({"on_finish"} if name == VIEWER else set()) <= set(given)


def test_launch_arguments_have_priority_over_the_parameter_file(load):
    """A launch argument has priority over the parameter file of the launch.

    Only arguments that the user has given override the values of the file.
    """
    nodes = launch_nodes(load("rig.launch.py"), params_file=__file__, scene="quick")
    for name, node in nodes.items():
        file, given = node["parameters"]
        assert file == __file__ and list(given) == ["scene"], name
        assert node["name"] == name  # otherwise the parameters would be global, with lower priority
        assert node["namespace"].given == ("namespace",)
    default = launch_nodes(load("rig.launch.py"))
    assert {name: list(node["parameters"][0]) for name, node in default.items()} == {
        name: ["progress_timeout"] if name == DRIVE else [] for name in default
    }


def test_every_argument_is_described(load):
    """Each launch argument has a description, which `--show-args` lists."""
    actions = of(load("rig.launch.py"), "DeclareLaunchArgument")
    assert {"params_file", "namespace", "use_sim_time"} <= {action.given[0] for action in actions}
    assert all(len(action.named["description"]) > 15 for action in actions)


def test_end_of_a_node_ends_the_launch(load):
    """The end of any node ends the launch.

    If the node has failed, the error contains its name.
    """
    on_exit = launch_nodes(load("rig.launch.py"))["recorder"]["on_exit"]

    def end(code):
        return on_exit(SimpleNamespace(process_name="recorder-1", returncode=code), {})

    for code in (0, -signal.SIGALRM):
        assert end(code).named["reason"] == "recorder-1 has ended in order"
    for code in (1, 2, -9):
        with pytest.raises(RuntimeError, match=f"recorder-1 has ended with code {code}"):
            end(code)


def test_missing_parameter_file_is_an_error(load, tmp_path):
    """A parameter file that does not exist, or that is a folder, is an error.

    launch_ros would only warn, and start the nodes with their defaults.
    """
    for file in ("none.yaml", str(tmp_path)):
        with pytest.raises(RuntimeError, match="params_file must be an existing file"):
            launch_nodes(load("rig.launch.py"), params_file=file)


def test_profiles_restrict_sockets_unless_the_subnet_is_allowed(load):
    """A launch argument selects the loopback or the subnet profile of Fast DDS.

    Each profile is set under a condition, and both profile files exist.
    """
    variables = of(load("rig.launch.py"), "SetEnvironmentVariable")
    profiles = {v.given[1].given[0][-1] for v in variables if "FASTDDS" in v.given[0]}
    assert profiles == {"fastdds_loopback.xml", "fastdds_subnet.xml"}
    assert all((LAUNCH.parent / "config" / name).is_file() for name in profiles)
    assert all("condition" in v.named for v in variables)


def test_run_continues_without_its_viewer(load):
    """The end of the optional viewer does not end the launch.

    It is reported in one line. The viewer is the only optional node.
    """
    nodes = launch_nodes(load("rig.launch.py"))
    event = SimpleNamespace(process_name="viewer-2", returncode=1)
    handlers = {True: "shut_down", False: "report_exit"}
    for entry in NODES:
        assert nodes[entry.name]["on_exit"].__name__ == handlers[entry.essential]
    assert [entry.name for entry in NODES if not entry.essential] == [VIEWER]
    assert "the run continues without it" in nodes[VIEWER]["on_exit"](event, None).named["msg"]


@pytest.mark.parametrize("namespace", ["", "rig1"])
def test_robot_state_publisher_has_the_robot_of_the_scene(load, namespace):
    """robot.launch.py starts robot_state_publisher with the URDF of the scene.

    Its queue has room for all messages of a tick (one turn by default), and it uses rig time. A
    namespace applies to its topics.
    """
    actions = load("robot.launch.py")
    node = launch_nodes(actions, scene="quick", namespace=namespace)["robot_state_publisher"]
    (parameters,) = node["parameters"]
    robot = Robot.of(open_scene(LAUNCH.parent / "config" / "scenes" / "quick.yaml"))
    assert parameters["robot_description"].given == (urdf(robot),)
    assert parameters["use_sim_time"] is True
    prefix = f"/{namespace}" if namespace else ""
    depth = f"qos_overrides.{prefix}/joint_states.subscription.depth"
    assert parameters[depth] >= topics.MOTION_DEPTH
    assert 0.0 < parameters["publish_frequency"] <= 1000.0
    description, *clock = node["remappings"]
    assert description[0] == "robot_description"  # the law server publishes the topic
    assert clock == ([("/clock", "/rig1/clock")] if namespace else [])


def test_rviz_opens_the_shipped_layout(load):
    """RViz opens the shipped layout in rig time, and starts only if rviz is true."""
    rviz = launch_nodes(load("robot.launch.py"), namespace="/rig1")["rviz2"]
    flag, layout = rviz["arguments"]
    assert flag == "-d"
    assert Path(layout).samefile(LAUNCH.parent / "config" / "layouts" / "cam_rig.rviz")
    prefixed = launch_nodes(load("robot.launch.py"), frame_prefix="rig1/")["rviz2"]
    text = Path(prefixed["arguments"][1]).read_text(encoding="utf-8")
    assert "Fixed Frame: rig1/base_link" in text and "TF Prefix: rig1\n" in text
    assert rviz["parameters"] == [{"use_sim_time": True}]
    assert ("/cam/markers", "/rig1/cam/markers") in rviz["remappings"]
    (include,) = of(load("rig.launch.py"), "IncludeLaunchDescription")
    assert include.given[0].given[0].given[0][1:] == ["launch", "robot.launch.py"]
    assert include.named["condition"].given[0].given[0] == "rviz"
    declared = {action.given[0] for action in of(load("robot.launch.py"), "DeclareLaunchArgument")}
    assert {name for name, _ in include.named["launch_arguments"]} <= declared


def test_the_sweep_includes_the_rig(load):
    """tm21_sweep.launch.py starts the rig by including rig.launch.py."""
    (include,) = load("tm21_sweep.launch.py")
    assert "rig.launch.py" in include.given[0].given[0].given[0]


def test_log_level_and_frame_prefix_reach_the_nodes(load):
    """The log level applies to every node, and the frame prefix to nodes with frames."""
    nodes = launch_nodes(load("rig.launch.py"), frame_prefix="rig1/")
    for name, node in nodes.items():
        option, level = node["ros_arguments"]
        assert (option, level.given) == ("--log-level", ("log_level",))
        assert ("frame_prefix" in node["parameters"][0]) == (name in ("follower", "law_server"))
    publisher = launch_nodes(load("robot.launch.py"), frame_prefix="rig1/")
    (parameters,) = publisher["robot_state_publisher"]["parameters"]
    assert parameters["frame_prefix"] == "rig1/"


@pytest.mark.parametrize(("control", "expected"), [("true", True), ("false", False)])
def test_the_urdf_has_the_element_of_ros2_control_on_request(load, control, expected):
    """With control:=true the URDF that is published contains the element ros2_control."""
    nodes = launch_nodes(load("robot.launch.py"), namespace="rig1", control=control)
    (parameters,) = nodes["robot_state_publisher"]["parameters"]
    (text,) = parameters["robot_description"].given
    assert ("<ros2_control" in text) == ("/rig1/joint_commands" in text) == expected


def test_launch_itself_loads_the_launch_files():
    """The real launch loads each launch file, with a description of each argument.

    The test is skipped where launch is not installed, which is the case with the wheels.
    """
    pytest.importorskip("launch_ros", reason="launch has no wheels")
    sources = pytest.importorskip("launch.launch_description_sources")
    for file in sorted(LAUNCH.glob("*.launch.py")):
        description = sources.get_launch_description_from_python_launch_file(str(file))
        assert all(argument.description for argument in description.get_launch_arguments()), file

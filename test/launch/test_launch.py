"""The launch files wire the same graph as the runner.

`launch` and `launch_ros` are no Python packages of their own, so stand-ins take their place here:
each action only keeps what it was given.
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
from cam_rig.runner.node_process import live
from cam_rig.runner.node_table import DRIVE, NODES, VIEWER
from cam_rig.simulation.scene import open_scene

LAUNCH = Path(__file__).parents[2] / "launch"
MODULES = (
    "launch launch.actions launch.conditions launch.events launch.events.process "
    "launch.launch_description_sources launch.substitutions launch_ros launch_ros.actions "
    "launch_ros.parameter_descriptions launch_ros.substitutions"
)


class Kept:
    """An action that keeps what it was given."""

    def __init__(self, *given, **named):
        self.given, self.named = given, named

    def perform(self, context):
        """The value of a launch argument."""
        return context[self.given[0]]


class StandIn(ModuleType):
    """A module of such actions, of whatever names."""

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return type(name, (Kept,), {})


@pytest.fixture
def load(monkeypatch):
    for module in MODULES.split():
        monkeypatch.setitem(sys.modules, module, StandIn(module))
    return lambda name: runpy.run_path(str(LAUNCH / name))["generate_launch_description"]().given[0]


def of(actions, kind):
    return [action for action in actions if type(action).__name__ == kind]


def nodes_of(actions, **given):
    """The nodes by executable, launched with these arguments."""
    defaults = {
        action.given[0]: action.named["default_value"]
        for action in of(actions, "DeclareLaunchArgument")
    }
    assert set(given) <= set(defaults)
    (function,) = (action.named["function"] for action in of(actions, "OpaqueFunction"))
    return {node.named["executable"]: node.named for node in function(defaults | given)}


def test_the_same_nodes_in_the_same_order(load):
    """With parameters that they declare, and what the runner gives them among these."""
    actions = load("rig.launch.py")
    declared = (action.given[0] for action in of(actions, "DeclareLaunchArgument"))
    nodes = nodes_of(actions, **dict.fromkeys(declared, "true") | {"params_file": __file__})
    runner = live(Path("scene"), Path("bag"), screen="", pacing="free")
    assert list(nodes) == list(runner)
    for name, node in nodes.items():
        _file, given = node["parameters"]
        own = {spec.name for spec in PARAMETERS[name]}
        assert set(given) <= own | {"use_sim_time"}
        wanted = set(runner[name]) - {"consumers"}
        assert wanted - ({"at_end"} if name == VIEWER else set()) <= set(given)


def test_what_is_not_given_is_left_to_the_parameter_file(load):
    """The file comes first, and after it nothing but what was given: that counts."""
    nodes = nodes_of(load("rig.launch.py"), params_file=__file__, scene="quick")
    for name, node in nodes.items():
        file, given = node["parameters"]
        assert file == __file__ and list(given) == ["scene"], name
        assert node["name"] == name  # else what is given would be of all nodes, and count less
        assert node["namespace"].given == ("namespace",)
    alone = nodes_of(load("rig.launch.py"))
    assert {name: list(node["parameters"][0]) for name, node in alone.items()} == {
        name: ["patience"] if name == DRIVE else [] for name in alone
    }


def test_every_argument_is_described(load):
    """As `ros2 launch --show-args` lists them; `nodes_of` finds no other than those declared."""
    actions = of(load("rig.launch.py"), "DeclareLaunchArgument")
    assert {"params_file", "namespace", "use_sim_time"} <= {action.given[0] for action in actions}
    assert all(len(action.named["description"]) > 15 for action in actions)


def test_a_node_that_ends_in_order_ends_the_launch(load):
    """A node that fails ends it with code 1, as an exception of a handler; the reason names it."""
    on_exit = nodes_of(load("rig.launch.py"))["recorder"]["on_exit"]

    def end(code):
        return on_exit(SimpleNamespace(process_name="recorder-1", returncode=code), {})

    for code in (0, -signal.SIGALRM):
        assert end(code).named["reason"] == "recorder-1 has ended in order"
    for code in (1, 2, -9):
        with pytest.raises(RuntimeError, match=f"recorder-1 has ended with code {code}"):
            end(code)


def test_a_missing_parameter_file_starts_nothing(load, tmp_path):
    """launch_ros would warn, and start the nodes with their defaults."""
    for file in ("none.yaml", str(tmp_path)):
        with pytest.raises(RuntimeError, match="params_file must be an existing file"):
            nodes_of(load("rig.launch.py"), params_file=file)


def test_no_socket_leaves_the_machine_unless_asked(load):
    """The profiles exist, and each is set under its condition."""
    variables = of(load("rig.launch.py"), "SetEnvironmentVariable")
    profiles = {v.given[1].given[0][-1] for v in variables if "FASTDDS" in v.given[0]}
    assert profiles == {"fastdds_loopback.xml", "fastdds_subnet.xml"}
    assert all((LAUNCH.parent / "config" / name).is_file() for name in profiles)
    assert all("condition" in v.named for v in variables)


def test_a_run_goes_on_without_its_viewer(load):
    """Under both: it alone is not essential, and its end is reported in one line."""
    nodes = nodes_of(load("rig.launch.py"))
    event = SimpleNamespace(process_name="viewer-2", returncode=1)
    for entry in NODES:
        assert nodes[entry.name]["on_exit"].__name__ == ("ended" if entry.essential else "left_out")
    assert [entry.name for entry in NODES if not entry.essential] == [VIEWER]
    assert "the run goes on without it" in nodes[VIEWER]["on_exit"](event, None).named["msg"]


@pytest.mark.parametrize("namespace", ["", "rig1"])
def test_robot_state_publisher_gets_the_scene_s_robot(load, namespace):
    """Its URDF is the one of `cam-rig urdf`; it keeps a whole tick's joints, on rig time."""
    actions = load("robot.launch.py")
    node = nodes_of(actions, scene="quick", namespace=namespace)["robot_state_publisher"]
    (parameters,) = node["parameters"]
    robot = Robot.of(open_scene(LAUNCH.parent / "config" / "scenes" / "quick.yaml"))
    assert parameters["robot_description"].given == (urdf(robot),)
    assert parameters["use_sim_time"] is True
    inside = f"/{namespace}" if namespace else ""
    depth = f"qos_overrides.{inside}/joint_states.subscription.depth"
    assert parameters[depth] >= topics.MOTION_DEPTH
    assert 0.0 < parameters["publish_frequency"] <= 1000.0
    own, *clock = node["remappings"]
    assert own[0] == "robot_description"  # the law server's counts
    assert clock == ([("/clock", "/rig1/clock")] if namespace else [])


def test_rviz_opens_the_shipped_layout(load):
    """The file exists; RViz runs on rig time, and only where asked for."""
    rviz = nodes_of(load("robot.launch.py"), namespace="/rig1")["rviz2"]
    flag, layout = rviz["arguments"]
    assert flag == "-d"
    assert LAUNCH.parent.joinpath(*layout.given[0][1:]).is_file()
    assert rviz["parameters"] == [{"use_sim_time": True}]
    assert ("/cam/markers", "/rig1/cam/markers") in rviz["remappings"]
    (include,) = of(load("rig.launch.py"), "IncludeLaunchDescription")
    assert include.given[0].given[0].given[0][1:] == ["launch", "robot.launch.py"]
    assert include.named["condition"].given[0].given[0] == "rviz"
    declared = {action.given[0] for action in of(load("robot.launch.py"), "DeclareLaunchArgument")}
    assert {name for name, _ in include.named["launch_arguments"]} <= declared


def test_the_sweep_includes_the_rig(load):
    """tm21_sweep.launch.py is rig.launch.py with its default scene."""
    (include,) = load("tm21_sweep.launch.py")
    assert "rig.launch.py" in include.given[0].given[0].given[0]

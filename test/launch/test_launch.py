"""The launch files wire the same graph as the runner.

`launch` and `launch_ros` are no Python packages of their own, so stand-ins take their place here:
each action only keeps what it was given.
"""

import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from cam_rig.nodes.common.parameters import PARAMETERS
from cam_rig.runner.graph import live
from cam_rig.runner.node_table import NODES, VIEWER

LAUNCH = Path(__file__).parents[2] / "launch"
NAMES = {
    "launch": "LaunchContext LaunchDescription",
    "launch.actions": "DeclareLaunchArgument LogInfo OpaqueFunction SetEnvironmentVariable "
    "SetLaunchConfiguration Shutdown IncludeLaunchDescription",
    "launch.conditions": "IfCondition UnlessCondition",
    "launch.events": "",
    "launch.events.process": "ProcessExited",
    "launch.launch_description_sources": "PythonLaunchDescriptionSource",
    "launch.substitutions": "LaunchConfiguration PathJoinSubstitution",
    "launch_ros": "",
    "launch_ros.actions": "Node",
    "launch_ros.parameter_descriptions": "ParameterValue",
    "launch_ros.substitutions": "FindPackageShare",
}


class Kept:
    """An action that keeps what it was given."""

    def __init__(self, *given, **named):
        self.given, self.named = given, named


@pytest.fixture
def load(monkeypatch):
    for module, names in NAMES.items():
        made = ModuleType(module)
        for name in names.split():
            setattr(made, name, type(name, (Kept,), {}))
        monkeypatch.setitem(sys.modules, module, made)

    def load(name):
        (actions,) = runpy.run_path(str(LAUNCH / name))["generate_launch_description"]().given
        return actions

    return load


def of(actions, kind):
    return [action for action in actions if type(action).__name__ == kind]


def test_the_same_nodes_in_the_same_order(load):
    """With parameters that they declare, and what the runner gives them among these."""
    nodes = of(load("rig.launch.py"), "Node")
    runner = live(Path("scene"), Path("bag"), screen="", pacing="free")
    assert [node.named["executable"] for node in nodes] == list(runner)
    for node in nodes:
        name = node.named["executable"]
        given = {key for parameters in node.named["parameters"] for key in parameters}
        assert given <= {spec.name for spec in PARAMETERS[name]}
        assert set(runner[name]) - {"consumers"} <= given


def test_no_socket_leaves_the_machine_unless_asked(load):
    """The profiles exist, and each is set under its condition."""
    variables = of(load("rig.launch.py"), "SetEnvironmentVariable")
    profiles = {v.given[1].given[0][-1] for v in variables if "FASTDDS" in v.given[0]}
    assert profiles == {"fastdds_loopback.xml", "fastdds_subnet.xml"}
    assert all((LAUNCH.parent / "config" / name).is_file() for name in profiles)
    assert all("condition" in v.named for v in variables)


def test_every_argument_that_is_used_is_declared(load):
    """A misspelt argument would only fail on a full ROS installation."""
    actions = load("rig.launch.py")
    declared = {action.given[0] for action in of(actions, "DeclareLaunchArgument")} | {"checkpoint"}
    for node in of(actions, "Node"):
        for parameters in node.named["parameters"]:
            for value in parameters.values():
                assert value.given[0].given[0] in declared
        if node.named["respawn"] is not True:
            assert node.named["respawn"].given[0] in declared


def test_a_run_goes_on_without_its_viewer(load):
    """Under both: it alone is not essential, and its end is reported in one line."""
    nodes = {node.named["executable"]: node.named for node in of(load("rig.launch.py"), "Node")}
    event = SimpleNamespace(process_name="viewer-2", returncode=1)
    for entry in NODES:
        assert nodes[entry.name]["on_exit"].__name__ == ("ended" if entry.essential else "left_out")
    assert [entry.name for entry in NODES if not entry.essential] == [VIEWER]
    assert "the run goes on without it" in nodes[VIEWER]["on_exit"](event, None).named["msg"]


def test_the_sweep_includes_the_rig(load):
    """tm21_sweep.launch.py is rig.launch.py with its default scene."""
    (include,) = load("tm21_sweep.launch.py")
    assert "rig.launch.py" in include.given[0].given[0].given[0]

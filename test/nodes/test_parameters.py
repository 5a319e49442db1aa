"""Parameters, topics and help texts of the nodes, and their common scene."""

import re
import sys

import pytest
import rclpy
import yaml
from rclpy.parameter import Parameter

from cam_rig.errors import ConfigError
from cam_rig.laws import build_law
from cam_rig.nodes.__main__ import NODES
from cam_rig.nodes.base.parameter_table import ParameterTable
from cam_rig.nodes.base.rig_node import scene_identity
from cam_rig.nodes.clock_source import require_same_scene
from cam_rig.nodes.parameters import ABOUT, PARAMETERS, published_topics, usage
from cam_rig.schema.load import config_root
from cam_rig.simulation.schedule import cam_states
from cam_rig.units import RPM
from tools.docs.parameters import FOLDER, text

from ..processes import ended

pytestmark = pytest.mark.ros
LIVE = ("law_server", "cam_drive", "follower", "microphone", "recorder")
QUICK = str(config_root() / "scenes" / "quick.yaml")
#: Topics that rclpy creates in every node.
OF_RCLPY = {"/rosout", "/parameter_events"}


@pytest.fixture
def parameter_table(domain):
    """Function that returns the parameter table of a node for some ROS arguments."""

    def parameter_table(name, *arguments, **node):
        context = rclpy.Context()
        rclpy.init(args=["--ros-args", *arguments], context=context)
        options = {"automatically_declare_parameters_from_overrides": True}
        created = rclpy.create_node(name, context=context, **options, **node)
        try:
            return ParameterTable(created, PARAMETERS[name])
        finally:
            created.destroy_node()
            context.shutdown()

    return parameter_table


@pytest.fixture
def values_of(parameter_table):
    """Function that creates a node with ROS arguments and returns its parameters."""
    return lambda name, *arguments, **node: parameter_table(name, *arguments, **node).values


def test_a_node_has_the_interface_of_its_tables(make):
    """Each node has exactly the parameters, topics and services of cam_rig's tables.

    Parameters have descriptions and limits, and are read-only unless they are marked as live.
    """
    for name in LIVE:
        node, interface = make(name), ABOUT[name]
        for spec in PARAMETERS[name]:
            descriptor = node.describe_parameter(spec.name)
            assert descriptor.description == spec.description
            assert descriptor.read_only == (not spec.live)
            if spec.max_value is not None:
                (span,) = (*descriptor.floating_point_range, *descriptor.integer_range)
                assert (span.from_value, span.to_value) == (spec.min_value, spec.max_value)
            if spec.choices:
                assert all(choice in descriptor.additional_constraints for choice in spec.choices)
        subscribed = {subscription.topic_name for subscription in node.subscriptions}
        assert subscribed == {topic.name for topic in interface.subscribed}
        published = {publisher.topic_name for publisher in node.publishers} - OF_RCLPY
        assert published == {topic.name for topic in published_topics(name)}
        names = {service.service_name.removeprefix(f"/{name}/") for service in node.services}
        services = {text for text in names if not re.search("parameter|type_desc", text)}
        assert services == set(interface.services)


def test_integers_and_names_are_converted_at_the_start(values_of):
    """Arguments of a node are converted to the type of their parameter at the start.

    Integers become numbers or pacings (20 becomes 20x), and names of scenes become paths.
    """
    arguments = (
        "-p",
        "rpm:=300",
        "-p",
        "pacing:=20",
        "-p",
        "scene:=quick",
        "-p",
        "progress_timeout:=60",
    )
    values = values_of("cam_drive", *arguments)
    assert (values["rpm"], values["pacing"], values["progress_timeout"]) == (300.0, "20x", 60.0)
    assert type(values["rpm"]) is float and values["scene"] == QUICK
    assert values_of("cam_drive", "-p", "pacing:=0.5")["pacing"] == "0.5x"


#: Cases: an invalid argument of a node, and the text of its error.
WRONG = {
    "rpm:=fast": "rpm must be a number, got 'fast'",
    "rpm:=-1": "rpm must be between 0 and 100000, got -1",
    "rpm:=.nan": "rpm must be between 0 and 100000, got nan",
    "autostart:=1": "autostart must be true or false, got 1",
    "pacing:=-3": "pacing must be free, real_time, or a factor",
    "on_finish:=never": "on_finish must be one of end, stay, wait, got never",
    "scene:=7": "scene must be a text, got 7",
    "consumers:=[nobody]": "consumers must be one of recorder",
}


def test_an_invalid_value_at_the_start_is_rejected_with_the_allowed_values(values_of):
    """An invalid argument of a node raises ConfigError with the allowed values.

    An argument of a wrong type does so too, in place of an error of rclpy.
    """
    for argument, message in WRONG.items():
        with pytest.raises(ConfigError) as rejected:
            values_of("cam_drive", "-p", argument)
        assert message in str(rejected.value)


def test_a_value_that_is_set_is_converted_or_rejected(make):
    """A live parameter is converted when it is set, or rejected with a reason.

    A rejected value has no effect.
    """
    drive = make("cam_drive")
    assert drive.set_parameters_atomically([Parameter("rpm", value=250)]).successful
    assert drive.program.schedule.state.speed == 250.0 * RPM
    assert drive.set_parameters_atomically([Parameter("pacing", value=20)]).successful
    assert drive.get_parameter("pacing").value == "20x"
    for name, value, message in (
        ("rpm", "fast", "rpm must be a number, got 'fast'"),
        ("rpm", None, "rpm must be a number, got None"),
        ("scene", [1, 2], "read-only"),
    ):
        before = drive.get_parameter(name).value
        result = drive.set_parameters_atomically([Parameter(name, value=value)])
        assert not result.successful
        assert message in result.reason and "expected" not in result.reason
        assert drive.get_parameter(name).value == before


def test_the_speed_parameter_is_the_set_point(make):
    """The parameter `rpm` of the drive is the speed set by a user, and 0 without one.

    While the scene sets the speed it stays 0. A user who sets the value that was read, as `ros2
    param load` does, thus changes nothing.
    """
    drive = make("cam_drive")
    state = next(cam_states(drive._loaded.scene))
    drive.program.laws[state.cam] = build_law(drive._loaded.cams[state.cam])
    drive.send(state)
    assert state.speed > 0.0 and drive.get_parameter("rpm").value == 0.0
    drive.set_parameters([drive.get_parameter("rpm")])
    assert drive.program.schedule.state.speed is None  # the scene's speeds


def test_a_parameter_file_contains_every_default(values_of):
    """The shipped parameter file of a node contains the default of each parameter.

    It applies in any namespace, and later arguments override it. It equals the output of
    tools/docs/parameters.py.
    """
    for name in PARAMETERS:
        file = FOLDER / f"{name}.yaml"
        assert file.read_text(encoding="utf-8") == text(name)
        (values,) = (part["ros__parameters"] for part in yaml.safe_load(text(name)).values())
        assert values == {spec.name: spec.default for spec in PARAMETERS[name]}
        actual = values_of(name, "--params-file", str(file), namespace="/rig1/left")
        assert actual == {spec.name: spec.convert(spec.default) for spec in PARAMETERS[name]}
        later = ("-p", "on_finish:=wait")
        assert values_of(name, "--params-file", str(file), *later)["on_finish"] == "wait"


def test_an_unknown_parameter_makes_a_warning(parameter_table):
    """An unknown parameter is ignored with a warning that suggests a name.

    A parameter file may serve several nodes.
    """
    misspelled = ("-p", "scen:=quick", "-p", "use_sim_time:=false")
    assert parameter_table("follower", *misspelled).unknown == [
        "ignoring unknown parameter 'scen' (did you mean 'scene'?)"
    ]


# Help texts.


def test_the_help_text_contains_every_parameter_and_topic():
    """The help of a node contains each parameter and topic, and an example."""
    for name in NODES:
        help_text = usage(name)
        for spec in PARAMETERS[name]:
            assert f"  {spec.name}" in help_text and spec.description in help_text
        for topic in (*ABOUT[name].subscribed, *published_topics(name)):
            assert topic.name in help_text and topic.type in help_text
        assert f"ros2 run cam_rig {name} --ros-args" in help_text


def test_help_does_not_start_a_node():
    """--help prints on stdout and ends with code 0, also without rclpy."""

    def output(*command, code=0):
        process = ended(sys.executable, *command)
        assert process.returncode == code
        return process.stdout

    without_rclpy = (
        "import sys; sys.modules['rclpy'] = None; sys.argv[1:] = ['--help'];"
        "from cam_rig.nodes.__main__ import follower; follower()"
    )
    assert output("-c", without_rclpy) == usage("follower") + "\n"
    help_text = output("-m", "cam_rig.nodes", "--help")
    assert all(name in help_text for name in NODES)
    output("-m", "cam_rig.nodes", "folower", code=1)


# All nodes must have the scene of the drive.


def test_scenes_are_compared_by_name_and_content(tmp_path):
    """A node whose scene differs from that of the drive is refused.

    The scenes are compared by name and content. Copies in other folders are equal. A node without a
    scene is accepted, as are the consumers of a player. A file that was removed after it was read
    is not compared.
    """

    def scene(name, text, folder=""):
        path = tmp_path / (folder or text) / f"{name}.yaml"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return str(path)

    require_same_scene("follower", scene_identity(scene("one", "a")), scene("one", "a", "copy"))
    for theirs, message in (("two", "and two for"), ("one", "and another file of")):
        with pytest.raises(ConfigError, match=message):
            require_same_scene("follower", scene_identity(scene(theirs, "b")), scene("one", "a"))
    require_same_scene("viewer", "", scene("one", "a"))
    require_same_scene("follower", "one#00000000", "")
    assert scene_identity("/nowhere/one.yaml") == ""

"""What a node takes: its parameters, its topics, what --help says of them, one scene for all."""

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
from cam_rig.nodes.parameters import ABOUT, PARAMETERS, published, usage
from cam_rig.schema.load import config_root
from cam_rig.simulation.schedule import cam_states
from cam_rig.units import RPM
from tools.docs.parameters import FOLDER, text

from ..processes import ended

pytestmark = pytest.mark.ros
LIVE = ("law_server", "cam_drive", "follower", "microphone", "recorder")
QUICK = str(config_root() / "scenes" / "quick.yaml")
#: Topics and services that rclpy gives every node.
OF_RCLPY = {"/rosout", "/parameter_events"}


@pytest.fixture
def given(domain):
    """What a function of a node and its parameters gives, declared with such arguments."""

    def given(name, *arguments, table=False, **node):
        context = rclpy.Context()
        rclpy.init(args=["--ros-args", *arguments], context=context)
        how = {"automatically_declare_parameters_from_overrides": True}
        made = rclpy.create_node(name, context=context, **how, **node)
        try:
            found = ParameterTable(made, PARAMETERS[name])
            return found if table else found.values
        finally:
            made.destroy_node()
            context.shutdown()

    return given


def test_a_node_has_what_its_tables_say(make):
    """Each parameter described, with type, unit and range; what is not live is read-only. Topics
    and services neither one more nor one less."""
    for name in LIVE:
        node, about = make(name), ABOUT[name]
        for spec in PARAMETERS[name]:
            shown = node.describe_parameter(spec.name)
            assert shown.description == spec.description
            assert shown.read_only == (not spec.live)
            if spec.most is not None:
                (span,) = (*shown.floating_point_range, *shown.integer_range)
                assert (span.from_value, span.to_value) == (spec.least, spec.most)
            if spec.choices:
                assert all(choice in shown.additional_constraints for choice in spec.choices)
        assert {one.topic_name for one in node.subscriptions} == {one.name for one in about.takes}
        out = {one.topic_name for one in node.publishers} - OF_RCLPY
        assert out == {one.name for one in published(name)}
        services = {one.service_name.removeprefix(f"/{name}/") for one in node.services}
        own = {one for one in services if not re.search("parameter|type_desc", one)}
        assert own == set(about.services)


def test_whole_numbers_and_names_are_taken_at_the_start(given):
    """An integer where a number is meant, a factor without its x, a scene by its name."""
    arguments = ("-p", "rpm:=300", "-p", "pacing:=20", "-p", "scene:=quick", "-p", "patience:=60")
    values = given("cam_drive", *arguments)
    assert (values["rpm"], values["pacing"], values["patience"]) == (300.0, "20x", 60.0)
    assert type(values["rpm"]) is float and values["scene"] == QUICK
    assert given("cam_drive", "-p", "pacing:=0.5")["pacing"] == "0.5x"


WRONG = {
    "rpm:=fast": "rpm: is 'fast'; allowed: a number",
    "rpm:=-1": "rpm: is -1; allowed: 0 to 100000",
    "rpm:=.nan": "rpm: is nan; allowed: 0 to 100000",
    "autostart:=1": "autostart: is 1; allowed: true or false",
    "pacing:=-3": "pacing: is '-3x'; allowed: free, real_time, or a factor",
    "at_end:=never": "at_end: has never; allowed: end, stay, wait",
    "scene:=7": "scene: is 7; allowed: a text",
    "consumers:=[nobody]": "consumers: has nobody; allowed: recorder",
}


def test_a_wrong_value_is_refused_with_what_is_allowed(given):
    """Whatever its type: no node ends with a traceback of rclpy's."""
    for argument, words in WRONG.items():
        with pytest.raises(ConfigError) as refused:
            given("cam_drive", "-p", argument)
        assert words in str(refused.value)


def test_what_is_set_is_converted_or_refused_in_words(make):
    """A whole number is a number too; what no node of the rig declares stays as it is. Refused by
    the node itself, and nothing is changed."""
    drive = make("cam_drive")
    assert drive.set_parameters_atomically([Parameter("rpm", value=250)]).successful
    assert drive.program.schedule.state.speed == 250.0 * RPM
    assert drive.set_parameters_atomically([Parameter("pacing", value=20)]).successful
    assert drive.get_parameter("pacing").value == "20x"
    for name, value, words in (
        ("rpm", "fast", "rpm: is 'fast'; allowed: a number"),
        ("rpm", None, "rpm: is None; allowed: a number"),
        ("scene", [1, 2], "read-only"),
    ):
        before = drive.get_parameter(name).value
        result = drive.set_parameters_atomically([Parameter(name, value=value)])
        assert not result.successful
        assert words in result.reason and "expected" not in result.reason
        assert drive.get_parameter(name).value == before


def test_the_speed_parameter_is_the_set_point(make):
    """Reading it and setting what was read, as `ros2 param dump` and `load` do, changes nothing."""
    drive = make("cam_drive")
    state = next(cam_states(drive._loaded.scene))
    drive.program.laws[state.cam] = build_law(drive._loaded.cams[state.cam])
    drive.send(state)
    assert state.speed > 0.0 and drive.get_parameter("rpm").value == 0.0
    drive.set_parameters([drive.get_parameter("rpm")])
    assert drive.program.schedule.state.speed is None  # the scene's speeds


def test_a_parameter_file_holds_every_default(given):
    """In any namespace, and what is given after it counts; tools/docs/parameters.py writes it."""
    for name in PARAMETERS:
        file = FOLDER / f"{name}.yaml"
        assert file.read_text(encoding="utf-8") == text(name)
        (values,) = (part["ros__parameters"] for part in yaml.safe_load(text(name)).values())
        assert values == {spec.name: spec.default for spec in PARAMETERS[name]}
        taken = given(name, "--params-file", str(file), namespace="/rig1/left")
        assert taken == {spec.name: spec.convert(spec.default) for spec in PARAMETERS[name]}
        own = ("-p", "at_end:=wait")
        assert given(name, "--params-file", str(file), *own)["at_end"] == "wait"


def test_a_parameter_of_another_name_is_told(given):
    """A slip of the pen is no reason to end, as a file may be meant for several nodes."""
    slip = ("-p", "scen:=quick", "-p", "use_sim_time:=false")
    assert given("follower", *slip, table=True).unknown == [
        "ignoring unknown parameter 'scen' (did you mean 'scene'?)"
    ]


# What --help prints.


def test_every_parameter_and_topic_is_named():
    """With defaults and limits, and an example."""
    for name in NODES:
        said = usage(name)
        for spec in PARAMETERS[name]:
            assert f"  {spec.name}" in said and spec.description in said
        for topic in (*ABOUT[name].takes, *published(name)):
            assert topic.name in said and topic.type in said
        assert f"ros2 run cam_rig {name} --ros-args" in said


def test_help_starts_nothing():
    """Code 0, on stdout, in a Python that has no rclpy."""

    def output(*command, code=0):
        done = ended(sys.executable, *command)
        assert done.returncode == code
        return done.stdout

    without = (
        "import sys; sys.modules['rclpy'] = None; sys.argv[1:] = ['--help'];"
        "from cam_rig.nodes.__main__ import follower; follower()"
    )
    assert output("-c", without) == usage("follower") + "\n"
    named = output("-m", "cam_rig.nodes", "--help")
    assert all(name in named for name in NODES)
    output("-m", "cam_rig.nodes", "folower", code=1)


# Every node has the drive's scene, or the run does not begin.


def test_the_file_of_a_scene_counts_not_its_folder(tmp_path):
    """Copies are one; another is refused by name, or by what the file holds. A node without a scene
    is taken: the player's consumers have the bag's own; a file may be gone since it was read."""

    def scene(name, text, folder=""):
        path = tmp_path / (folder or text) / f"{name}.yaml"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return str(path)

    require_same_scene("follower", scene_identity(scene("one", "a")), scene("one", "a", "copy"))
    for theirs, words in (("two", "and two for"), ("one", "and another file of")):
        with pytest.raises(ConfigError, match=words):
            require_same_scene("follower", scene_identity(scene(theirs, "b")), scene("one", "a"))
    require_same_scene("viewer", "", scene("one", "a"))
    require_same_scene("follower", "one#00000000", "")
    assert scene_identity("/nowhere/one.yaml") == ""

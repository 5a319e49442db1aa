"""Every node's parameters: as `ros2 param describe` shows them, as they may be given."""

import pytest
import rclpy
import yaml
from rclpy.parameter import Parameter

from cam_rig.errors import ConfigError
from cam_rig.nodes.parameter_values import convert, declare, unknown_names
from cam_rig.nodes.parameters import PARAMETERS
from cam_rig.schema.load import config_root
from tools.docs.parameters import FOLDER, text

pytestmark = pytest.mark.ros
LIVE = ("law_server", "cam_drive", "follower", "microphone", "recorder")
QUICK = str(config_root() / "scenes" / "quick.yaml")


@pytest.fixture
def given(ros_domain):
    """A node's values, declared with such arguments."""

    def given(name, *arguments, **node):
        context = rclpy.Context()
        rclpy.init(args=["--ros-args", *arguments], context=context)
        made = rclpy.create_node(name, context=context, **node)
        try:
            return declare(made, PARAMETERS[name])
        finally:
            made.destroy_node()
            context.shutdown()

    return given


@pytest.mark.parametrize("name", LIVE)
def test_every_parameter_is_described(make, name):
    """Type, unit and range are given; what is not live is read-only."""
    node = make(name)
    for spec in PARAMETERS[name]:
        about = node.describe_parameter(spec.name)
        assert about.description == spec.description
        assert about.read_only == (not spec.live)
        if spec.most is not None:
            (span,) = (*about.floating_point_range, *about.integer_range)
            assert (span.from_value, span.to_value) == (spec.least, spec.most)
        if spec.choices:
            assert all(choice in about.additional_constraints for choice in spec.choices)


def test_whole_numbers_and_names_are_taken_at_the_start(given):
    """An integer where a number is meant, a factor without its x, a scene by its name."""
    arguments = ("-p", "rpm:=300", "-p", "pacing:=20", "-p", "scene:=quick", "-p", "patience:=60")
    values = given("cam_drive", *arguments)
    assert (values["rpm"], values["pacing"], values["patience"]) == (300.0, "20x", 60.0)
    assert type(values["rpm"]) is float and values["scene"] == QUICK
    assert given("cam_drive", "-p", "pacing:=0.5")["pacing"] == "0.5x"


@pytest.mark.parametrize(
    ("argument", "words"),
    [
        ("rpm:=fast", "rpm: is 'fast'; allowed: a number"),
        ("rpm:=-1", "rpm: is -1; allowed: 0 to 100000"),
        ("rpm:=.nan", "rpm: is nan; allowed: 0 to 100000"),
        ("autostart:=1", "autostart: is 1; allowed: true or false"),
        ("pacing:=-3", "pacing: is '-3x'; allowed: free, real_time, or a factor"),
        ("at_end:=never", "at_end: has never; allowed: end, stay, wait"),
        ("scene:=7", "scene: is 7; allowed: a text"),
        ("consumers:=[nobody]", "consumers: has nobody; allowed: recorder"),
    ],
)
def test_a_wrong_value_is_refused_with_what_is_allowed(given, argument, words):
    """Whatever its type: no node ends with a traceback of rclpy's."""
    with pytest.raises(ConfigError) as refused:
        given("cam_drive", "-p", argument)
    assert words in str(refused.value)


def test_what_is_set_is_converted():
    """A whole number is a number too; what no node of the rig declares stays as it is."""
    wanted = [Parameter("rpm", value=250), Parameter("other", value=1)]
    assert [one.value for one in convert(PARAMETERS["cam_drive"], wanted)] == [250.0, 1]


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("rpm", "fast", "rpm: is 'fast'; allowed: a number"),
        ("rpm", True, "rpm: is True; allowed: a number"),
        ("rpm", None, "rpm: is None; allowed: a number"),
        ("rpm", -1, "rpm"),
        ("scene", [1, 2], "scene: is [1, 2]; allowed: a text"),
    ],
)
def test_a_wrong_value_is_refused_live_in_words(make, name, value, words):
    """By the node itself, and nothing is changed."""
    drive = make("cam_drive")
    before = drive.get_parameter(name).value
    result = drive.set_parameters_atomically([Parameter(name, value=value)])
    assert not result.successful
    assert words in result.reason
    assert "expected" not in result.reason
    assert drive.get_parameter(name).value == before


@pytest.mark.parametrize("name", PARAMETERS)
def test_a_parameter_file_holds_every_default(given, name):
    """In any namespace, and what is given after it counts; tools/docs/parameters.py writes it."""
    file = FOLDER / f"{name}.yaml"
    assert file.read_text(encoding="utf-8") == text(name)
    (values,) = (part["ros__parameters"] for part in yaml.safe_load(text(name)).values())
    assert values == {spec.name: spec.default for spec in PARAMETERS[name]}
    for namespace in ("/", "/rig1/left"):
        taken = given(name, "--params-file", str(file), namespace=namespace)
        assert taken == {spec.name: spec.convert(spec.default) for spec in PARAMETERS[name]}
    own = ("-p", "at_end:=wait")
    assert given(name, "--params-file", str(file), *own)["at_end"] == "wait"


def test_a_parameter_of_another_name_is_told(given, ros_domain):
    """A slip of the pen is no reason to end, as a file may be meant for several nodes."""
    context = rclpy.Context()
    rclpy.init(
        args=["--ros-args", "-p", "scen:=quick", "-p", "use_sim_time:=false"], context=context
    )
    node = rclpy.create_node("follower", context=context)
    try:
        declare(node, PARAMETERS["follower"])
        assert unknown_names(node, PARAMETERS["follower"]) == [
            "parameter 'scen' is none of this node's (did you mean 'scene'?); it is left aside"
        ]
    finally:
        node.destroy_node()
        context.shutdown()

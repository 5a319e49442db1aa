"""What the microphone read in a recording, as a replay sets it again."""

import pytest

from cam_rig.bag.replay import played, quantity_of
from cam_rig.messages.serialization import header, new
from cam_rig.messages.topics import QUANTITY

from .bags import GOLDEN


def diagnosis(node, words, **values):
    pairs = [new("diagnostic_msgs/KeyValue", key, value) for key, value in values.items()]
    status = new("diagnostic_msgs/DiagnosticStatus", 0, node, words, "rig", pairs)
    return new("diagnostic_msgs/DiagnosticArray", header(0, ""), [status])


def test_a_recording_says_what_its_microphone_read():
    """At each second of rig time, and nothing else in between."""
    assert {one.quantity for one in played(GOLDEN)} == {"", "LZF"}


@pytest.mark.parametrize("words", ["hears LAF", "any other words", ""])
def test_a_quantity_is_a_value_and_no_part_of_a_sentence(words):
    """Whatever the words are, and however they change; another node reads none."""
    assert quantity_of(diagnosis("microphone", words, **{QUANTITY: "LCS"})) == "LCS"
    assert quantity_of(diagnosis("microphone", words)) == ""
    assert quantity_of(diagnosis("follower", words, **{QUANTITY: "LCS"})) == ""


@pytest.mark.parametrize("value", ["", "L", "LBF", "LAFx", "laf"])
def test_what_is_no_level_is_not_set(value):
    """A bag may be of anybody's making: a symbol that no meter has is as none."""
    assert quantity_of(diagnosis("microphone", "hears LAF", **{QUANTITY: value})) == ""

"""Rigs in namespaces: two in one ROS domain, and their bags."""

from dataclasses import replace
from pathlib import Path

import pytest

from cam_rig.bag.completeness import require_complete
from cam_rig.bag.files import bag_file
from cam_rig.bag.reader import raw_messages, read_counts, read_recording
from cam_rig.bag.recover import recover
from cam_rig.bag.writer import BagWriter
from cam_rig.errors import BagError
from cam_rig.messages.topics import RECORDING, recorded_topic
from cam_rig.runner.graph import Graph

from .conftest import OneProcess, patient, payloads_of

pytestmark = pytest.mark.ros
GOLDEN = Path(__file__).parents[2] / "bags" / "golden"


def test_two_rigs_in_one_domain_are_each_as_alone(
    forked, domain, short_scene, undisturbed, tmp_path
):
    """One of processes, and one in this: the messages of each are those of the run alone."""
    bags = {name: tmp_path / name for name in ("rig1", "rig2")}
    graph = Graph(patient(short_scene, bags["rig1"]), namespace="/rig1")
    with graph, OneProcess(patient(short_scene, bags["rig2"]), namespace="/rig2") as here:
        runs = [graph.progress(), here.progress()]
        while runs:  # side by side, a tick of each in turn
            runs = [run for run in runs if next(run, None) is not None]
    for name, bag in bags.items():
        require_complete(bag, read_recording(bag).loaded.scene)
        payloads = payloads_of(bag)
        names = {t.name: t.within(f"/{name}") for t in RECORDING}
        assert payloads == {names[topic]: found for topic, found in undisturbed.items()}


def test_a_bag_of_a_namespace_is_read_and_recovered_like_any_other(namespaced, tmp_path):
    """Counts and messages bear the names of the table, and a recovered bag those of its rig."""
    bag, expected = namespaced("/lab/rig1")
    assert read_counts(bag) == expected
    with bag_file(bag).open("r+b") as stream:
        stream.truncate(stream.seek(0, 2) - 40)
    recovered = recover(bag, tmp_path / "recovered")
    assert not recovered.loss.gaps
    assert read_counts(tmp_path / "recovered") == expected
    assert all(name.startswith("/lab/rig1/") for name in payloads_of(tmp_path / "recovered"))


def test_a_bag_of_two_rigs_is_refused_by_their_names(namespaced):
    """`ros2 bag record -a` takes both rigs; which one is meant is not guessed."""
    bag, _ = namespaced("", "/rig2")
    with pytest.raises(BagError, match="holds several rigs, /, /rig2; allowed: one"):
        read_counts(bag)


@pytest.fixture
def namespaced(tmp_path):
    """Makes the golden bag anew, in one or more namespaces; it, and its messages by topic."""

    def make(*namespaces):
        bag, expected = tmp_path / "namespaced", read_counts(GOLDEN)
        with BagWriter(bag) as writer:
            for namespace in namespaces:
                for connection, time_ns, data in raw_messages(GOLDEN, set(expected)):
                    topic = recorded_topic(connection.topic)
                    topic = replace(topic, name=namespace + topic.name)
                    writer.write(topic, time_ns, bytes(data))
        return bag, expected

    return make

"""Bags of others and bags that are broken: recover, replay, analyze."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from mcap.records import Attachment
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from cam_rig.bag.files import bag_file
from cam_rig.bag.partial_reader import PartialReader
from cam_rig.bag.reader import read_counts
from cam_rig.bag.writer import BagWriter
from cam_rig.messages.topics import recorded_topic

from ..bag.bags import cut_off
from ..foreign_bags import number as write_number
from ..foreign_bags import write_bag
from .conftest import GOLDEN, call, done

MESSAGES = sum(read_counts(GOLDEN).values())


def as_ros2_records(target, plugin):
    """The golden run as `ros2 bag record` writes it: wall times, no attachments."""
    types, wall = get_typestore(Stores.ROS2_KILTED), 1_767_225_600_000_000_000
    with AnyReader([GOLDEN]) as reader, Writer(target, version=9, storage_plugin=plugin) as writer:
        made = {
            c.topic: writer.add_connection(c.topic, c.msgtype, typestore=types)
            for c in reader.connections
        }
        for number, (connection, _, data) in enumerate(reader.messages()):
            writer.write(made[connection.topic], wall + 1_000_003 * number, data)


@pytest.mark.slow
@pytest.mark.variants(1)
@pytest.mark.parametrize("plugin", list(StoragePlugin), ids=lambda p: p.name)
def test_a_bag_of_ros2_bag_record(tmp_path, plugin):
    """MCAP or SQLite by the wall's time, its scene named: the run's levels, samples, drawing."""
    theirs = tmp_path / "theirs"
    as_ros2_records(theirs, plugin)
    nameless = call("analyze", theirs)
    assert nameless.exit_code == 1
    assert "has no scene attached" in nameless.stderr and "--scene" in nameless.stderr
    for bag, words in ((theirs, ["--scene", "quick"]), (GOLDEN, [])):
        for verb, option, suffix in (
            ("analyze", "--json", "json"),
            ("export", "--to", "csv"),
            ("view", "--save", "rrd"),
        ):
            done(verb, bag, *words, option, tmp_path / f"{bag.name}.{suffix}")
    one, other = (json.loads((tmp_path / f"{n}.json").read_text()) for n in ("theirs", "golden"))
    assert one["levels"] == other["levels"]
    counts = {row["topic"]: row["count"] for row in other["messages"]}
    assert counts["/follower/samples"] == 16
    texts = [(tmp_path / f"{name}.csv").read_text() for name in ("theirs", "golden")]
    assert texts[0] == texts[1]
    sizes = [(tmp_path / f"{name}.rrd").stat().st_size for name in ("theirs", "golden")]
    assert sizes[0] == pytest.approx(sizes[1], rel=0.01)


def test_recover_of_a_cut_bag(tmp_path):
    """A cut copy of a bag: recovered beside it, the damaged one is as it was."""
    torn = cut_off(tmp_path / "torn", bag_file(GOLDEN).stat().st_size - 5_000)
    before = bag_file(torn).read_bytes()
    refused = call("analyze", torn)
    assert refused.exit_code == 1 and "cam-rig recover" in refused.stderr
    result = done("recover", torn)
    assert "saved; nothing lost" in result.stderr and "bytes" not in result.stderr
    assert bag_file(torn).read_bytes() == before and read_counts(tmp_path / "torn_recovered")
    again = call("recover", torn)
    assert again.exit_code == 1 and "exists already, not overwriting" in again.stderr


def test_recover_counts_times_from_the_start_of_a_bag_in_wall_time(tmp_path):
    """A bag of another program, cut off: not billions of seconds."""
    times = [0.01 * k for k in range(2000)]
    bag = write_bag(tmp_path / "bench", {"/gauge": (write_number, times, times)})
    file = bag / "bench.mcap"
    file.write_bytes(file.read_bytes()[:60_000])
    words = " ".join(done("recover", bag).stderr.split())
    saved = int(words.split(" messages to ")[0].split()[-1])
    assert f"to {times[saved - 1]:.6g} s saved" in words and "e+" not in words
    assert f"bench.mcap has {2000 - saved} messages fewer than metadata.yaml lists" in words


def test_analyze_says_what_a_recovered_bag_lacks(tmp_path):
    """A recovered bag looks like any other: what is missing is attached to it, and reported."""
    words = call("recover", cut_off(tmp_path / "torn", 0.8)).stderr.replace("\n", " ")
    missing = f"ticks {read_counts(tmp_path / 'torn_recovered')['/cam/state']} to 16 of 16"
    assert missing in words
    bag = tmp_path / "torn_recovered"
    for command in (
        ("analyze", bag, "--json", tmp_path / "a.json"),
        ("export", bag, "--to", tmp_path / "a.npz"),
        ("view", bag, "--save", tmp_path / "a.rrd"),
        ("compare", bag, "quick"),
    ):
        said = call(*command).stderr.replace("\n", " ")
        assert "recovered: " in said and missing in said, command
    notes = json.loads((tmp_path / "a.json").read_text())["run"]["notes"]
    assert missing in notes[0] and "not complete" in notes[1]
    assert "recovered: " not in call("analyze", GOLDEN).stderr


def test_the_newest_bag_is_one_that_was_closed(tmp_path, monkeypatch):
    """A recording that still runs, or was cut off, is named and passed over."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(GOLDEN, tmp_path / "bags" / "golden")
    torn = shutil.copytree(GOLDEN, tmp_path / "bags" / "torn")
    file = (torn / "golden_0.mcap").rename(torn / "torn_0.mcap")
    file.write_bytes(file.read_bytes()[:-5_000])
    os.utime(torn / "metadata.yaml", (2e9, 2e9))
    result = done("analyze")
    words = " ".join(result.stderr.split())
    assert "bags/torn: was not closed, an older one is taken" in words
    assert f"bags/golden: {MESSAGES} messages, 16 ticks" in words
    shutil.rmtree(tmp_path / "bags" / "golden")
    result = call("analyze")
    assert result.exit_code == 1 and "no bag in bags/" in result.stderr


def test_recover_from_inside_the_bag(tmp_path, monkeypatch):
    """Named by a dot, it is recovered beside itself all the same."""
    monkeypatch.chdir(shutil.copytree(GOLDEN, tmp_path / "mine"))
    done("recover", ".")
    assert read_counts(tmp_path / "mine_recovered")
    assert call("recover", "/").exit_code == 1


@pytest.mark.slow
@pytest.mark.ros
def test_replay_gives_the_recorded_numbers(ros_domain, tmp_path):
    """Recorded cam states and laws through the live follower and microphone."""
    kept = tmp_path / "config"  # as the folder of a bag's attached files is called
    result = done("replay", GOLDEN, "--tolerance", "1e-10", "--output", kept)
    assert "/microphone/pressure" in result.stderr
    assert read_counts(kept)["/follower/samples"] == 16
    assert call("replay", GOLDEN, "--output", kept).exit_code == 1


class Replayed:
    """Stands in for the nodes of a replay: they recorded the golden bag."""

    def __init__(self, nodes):
        self._bag = Path(shutil.copytree(GOLDEN, nodes["recorder"]["bag"]))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def progress(self):
        return iter(())

    def require_closed(self):
        assert read_counts(self._bag)


def test_replay_finds_a_changed_number(tmp_path, monkeypatch):
    """One level in the bag is off by 1e-9: the command says where, and ends with code 1."""
    monkeypatch.setattr("cam_rig.runner.graph.Graph", Replayed)
    types = get_typestore(Stores.ROS2_KILTED)
    with AnyReader([GOLDEN]) as reader:
        one = next(c for c in reader.connections if c.topic == "/microphone/level")
        _, _, data = next(iter(reader.messages([one])))
        level = types.deserialize_cdr(data, one.msgtype)
    level.data *= 1.0 + 1e-9
    wrong = bytes(types.serialize_cdr(level, one.msgtype))
    bag = tmp_path / "bag"
    with BagWriter(bag) as writer:
        for record in PartialReader(bag_file(GOLDEN)).records():
            if isinstance(record, Attachment):
                writer.attach(record.name, record.data)
                continue
            _, channel, message = record
            changed = wrong if message.data == bytes(data) else message.data
            writer.write(recorded_topic(channel.topic), message.log_time, changed)
    result = call("replay", bag, "--tolerance", "1e-10")
    assert result.exit_code == 1 and "/microphone/level value differs by" in result.stderr


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("missing", None, "no such bag"),
        ("folder", "", "is not a bag: no .mcap file in it"),
        ("read_me", "# Read me", "is not a bag: not an .mcap file"),
        ("garbage.mcap", "garbage" * 99, "does not begin as an MCAP file does"),
    ],
)
@pytest.mark.parametrize("verb", ["view", "analyze"])
def test_what_never_was_a_bag_is_not_to_be_recovered(tmp_path, verb, name, text, words):
    """Each is told apart, in one line, and none is sent to ``recover``."""
    path = tmp_path / name
    if text:
        path.write_text(text)
    elif text is not None:
        path.mkdir()
    save = ("--save", tmp_path / "a.rrd") if verb == "view" else ()
    result = call(verb, path, *save)
    assert result.exit_code == 1 and f"{path}: " in result.stderr
    assert words in result.stderr and "recover" not in result.stderr
    assert "PosixPath" not in result.stderr and len(result.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize("plugin", list(StoragePlugin), ids=lambda plugin: plugin.name)
@pytest.mark.parametrize("scene", [(), ("--scene", "quick")])
@pytest.mark.parametrize("command", [("analyze",), ("view", "--save"), ("export", "--to")])
def test_a_bag_of_another_program_is_for_compare(tmp_path, command, scene, plugin):
    """With its topics, and the whole command."""
    bag = write_bag(tmp_path / "bench", {"/gauge": (write_number, [0.0, 1.0], [1.0, 2.0])}, plugin)
    options = (command[1], tmp_path / "out.rrd") if command[0] == "view" else ()
    options = (command[1], tmp_path / "out.csv") if command[0] == "export" else options
    result = call(command[0], bag, *options, *scene)
    assert result.exit_code == 1
    assert "is not a recording of cam_rig, and holds /gauge [std_msgs/msg/Float64]" in result.stderr
    assert f"cam-rig compare {bag} SCENE --topics" in result.stderr


@pytest.mark.parametrize("source", ["quick", GOLDEN, GOLDEN / "golden_0.mcap"])
def test_export_says_what_it_wrote(tmp_path, source):
    """Of a scene, a bag, or a bag's file."""
    target = tmp_path / "new" / "a.npz"
    result = done("export", source, "--cam", "tm21", "--rpm", "350", "--to", target)
    with np.load(target) as columns:
        assert set(columns["cam"]) == {"tm21"}
        assert f"{columns['force_N'].size} samples" in result.stderr
    assert "gaps" not in result.stderr


def test_a_run_is_repeated_with_its_options(monkeypatch, tmp_path):
    """The line under a failed run has all of them but the bag, whose folder now exists."""
    commands = []
    monkeypatch.setattr("cam_rig.cli.run._run", lambda *arguments: commands.append(arguments[-1]))
    words = ["--pacing", "real_time", "--network", "--namespace", "/rig1", "--split", "100MB"]
    done("run", "quick", "--bag", tmp_path / "bag", *words)
    assert commands == [" ".join(["cam-rig run quick", *words])]

"""Commands recover, replay, analyze and export with damaged and foreign bags."""

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
from cam_rig.bag.partial_reader import read_partial
from cam_rig.bag.reader import read_counts
from cam_rig.bag.writer import BagWriter
from cam_rig.cli.run import print_analysis
from cam_rig.messages.topics import recorded_topic
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.studies.simulate.recorded import read_bag

from ..bag.bags import cut_off
from ..conftest import scene_data
from ..foreign_bags import number as write_number
from ..foreign_bags import write_bag
from .conftest import GOLDEN, call, done, shipped, written

MESSAGES = sum(read_counts(GOLDEN).values())


def as_ros2_records(target, plugin):
    """Write the golden run in the form of `ros2 bag record`.

    It has wall-clock times and no attachments.
    """
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
def test_bag_of_ros2_bag_record_gives_the_same_results(tmp_path, plugin):
    """A bag of `ros2 bag record` with --scene has the results of the golden bag.

    Levels and samples are equal for MCAP and SQLite. Without --scene the bag is refused.
    """
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
    foreign, golden = (
        json.loads((tmp_path / f"{name}.json").read_text()) for name in ("theirs", "golden")
    )
    assert foreign["levels"] == golden["levels"]
    counts = {row["topic"]: row["count"] for row in golden["messages"]}
    assert counts["/follower/samples"] == 16
    texts = [(tmp_path / f"{name}.csv").read_text() for name in ("theirs", "golden")]
    assert texts[0] == texts[1]
    sizes = [(tmp_path / f"{name}.rrd").stat().st_size for name in ("theirs", "golden")]
    assert sizes[0] == pytest.approx(sizes[1], rel=0.01)


def test_recover_of_a_truncated_bag(tmp_path):
    """`recover` writes a recovered bag next to a truncated one, which stays unchanged."""
    torn = cut_off(tmp_path / "torn", bag_file(GOLDEN).stat().st_size - 5_000)
    before = bag_file(torn).read_bytes()
    refused = call("analyze", torn)
    assert refused.exit_code == 1 and "cam-rig recover" in refused.stderr
    result = done("recover", torn)
    assert "saved; nothing lost" in result.stderr and "bytes" not in result.stderr
    assert bag_file(torn).read_bytes() == before and read_counts(tmp_path / "torn_recovered")
    again = call("recover", torn)
    assert again.exit_code == 1 and "exists already, not overwriting" in again.stderr


def test_recover_reports_times_relative_to_the_start_of_the_bag(tmp_path):
    """`recover` prints times from the start of the bag, not since 1970."""
    times = [0.01 * k for k in range(2000)]
    bag = write_bag(tmp_path / "bench", {"/gauge": (write_number, times, times)})
    file = bag / "bench.mcap"
    file.write_bytes(file.read_bytes()[:60_000])
    words = " ".join(done("recover", bag).stderr.split())
    saved = int(words.split(" messages up to ")[0].split()[-1])
    assert f"to {times[saved - 1]:.6g} s saved" in words and "e+" not in words
    assert f"bench.mcap has {2000 - saved} messages fewer than metadata.yaml lists" in words


def test_missing_ticks_of_a_recovered_bag_are_reported(tmp_path):
    """Each command that reads a recovered bag reports its missing ticks (time steps)."""
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
        text = call(*command).stderr.replace("\n", " ")
        assert "recovered: " in text and missing in text, command
    notes = json.loads((tmp_path / "a.json").read_text())["run"]["notes"]
    assert missing in notes[0] and "not complete" in notes[1]
    assert "recovered: " not in call("analyze", GOLDEN).stderr


def test_analyze_takes_the_newest_closed_bag(tmp_path, monkeypatch):
    """`analyze` without an argument reads the newest complete bag in bags/.

    A truncated bag is reported and skipped. Without a complete bag the command fails.
    """
    monkeypatch.chdir(tmp_path)
    shutil.copytree(GOLDEN, tmp_path / "bags" / "golden")
    torn = shutil.copytree(GOLDEN, tmp_path / "bags" / "torn")
    file = (torn / "golden_0.mcap").rename(torn / "torn_0.mcap")
    file.write_bytes(file.read_bytes()[:-5_000])
    os.utime(torn / "metadata.yaml", (2e9, 2e9))
    result = done("analyze")
    words = " ".join(result.stderr.split())
    assert "bags/torn: was not closed and is skipped" in words
    assert f"bags/golden: {MESSAGES} messages, 16 ticks" in words
    shutil.rmtree(tmp_path / "bags" / "golden")
    result = call("analyze")
    assert result.exit_code == 1 and "no closed bag in bags/" in result.stderr


def test_recover_from_inside_the_bag(tmp_path, monkeypatch):
    """`recover .` inside a bag writes the recovered bag next to its folder."""
    monkeypatch.chdir(shutil.copytree(GOLDEN, tmp_path / "mine"))
    done("recover", ".")
    assert read_counts(tmp_path / "mine_recovered")
    assert call("recover", "/").exit_code == 1


@pytest.mark.slow
@pytest.mark.ros
def test_replay_gives_the_recorded_numbers(ros_domain, tmp_path):
    """The nodes of a replay compute the recorded numbers to 1e-10.

    Follower and microphone receive the recorded cam states and laws.
    """
    output = tmp_path / "config"  # equals a folder of attached files
    result = done("replay", GOLDEN, "--tolerance", "1e-10", "--output", output)
    assert "/microphone/pressure" in result.stderr
    assert read_counts(output)["/follower/samples"] == 16
    assert call("replay", GOLDEN, "--output", output).exit_code == 1


class FakeGraph:
    """Replacement of the nodes of a replay: it records a copy of the golden bag."""

    def __init__(self, nodes):
        self._bag = Path(shutil.copytree(GOLDEN, nodes["recorder"]["output_uri"]))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def progress(self):
        return iter(())

    def require_closed(self):
        assert read_counts(self._bag)


def test_replay_detects_a_changed_number(tmp_path, monkeypatch):
    """`replay` ends with code 1 and the topic if a level in the bag differs by 1e-9."""
    monkeypatch.setattr("cam_rig.runner.graph.Graph", FakeGraph)
    types = get_typestore(Stores.ROS2_KILTED)
    with AnyReader([GOLDEN]) as reader:
        connection = next(c for c in reader.connections if c.topic == "/microphone/level")
        _, _, data = next(iter(reader.messages([connection])))
        level = types.deserialize_cdr(data, connection.msgtype)
    level.data *= 1.0 + 1e-9
    wrong = bytes(types.serialize_cdr(level, connection.msgtype))
    bag, records = tmp_path / "bag", []
    read_partial(bag_file(GOLDEN), records.append)
    with BagWriter(bag) as writer:
        for record in records:
            if isinstance(record, Attachment):
                writer.attach(record.name, record.data)
                continue
            _, channel, message, _ = record
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
        ("garbage.mcap", "garbage" * 99, "are not those of MCAP"),
    ],
)
@pytest.mark.parametrize("verb", ["view", "analyze"])
def test_file_that_is_not_a_bag_is_refused(tmp_path, verb, name, text, words):
    """A file that is not a bag is refused in one line with the reason.

    The line does not suggest `recover`.
    """
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
def test_bag_of_another_program_is_referred_to_compare(tmp_path, command, scene, plugin):
    """A bag of another program is refused with its topics and a `compare` command."""
    bag = write_bag(tmp_path / "bench", {"/gauge": (write_number, [0.0, 1.0], [1.0, 2.0])}, plugin)
    options = (command[1], tmp_path / "out.rrd") if command[0] == "view" else ()
    options = (command[1], tmp_path / "out.csv") if command[0] == "export" else options
    result = call(command[0], bag, *options, *scene)
    assert result.exit_code == 1
    assert (
        "is not a recording of cam_rig, its topics are /gauge [std_msgs/msg/Float64]"
        in result.stderr
    )
    assert f"cam-rig compare {bag} SCENE --topics" in result.stderr


@pytest.mark.parametrize("source", ["quick", GOLDEN, GOLDEN / "golden_0.mcap"])
def test_export_reports_the_number_of_samples(tmp_path, source):
    """`export` of a scene, bag or file prints the number of samples that it writes.

    The samples are those of the selected cam.
    """
    target = tmp_path / "new" / "a.npz"
    result = done("export", source, "--cam", "tm21", "--rpm", "350", "--to", target)
    with np.load(target) as columns:
        assert set(columns["cam"]) == {"tm21"}
        assert f"{columns['force_N'].size} samples" in result.stderr
    assert "gaps" not in result.stderr


def test_command_that_repeats_a_run_has_its_options(monkeypatch, tmp_path):
    """The printed command that repeats a run has all its options except --bag.

    The folder of --bag exists by then.
    """
    commands = []
    monkeypatch.setattr("cam_rig.cli.run._run", lambda *arguments: commands.append(arguments[-1]))
    words = [
        "--pacing",
        "real_time",
        "--discovery",
        "subnet",
        "--namespace",
        "/rig1",
        "--max-bag-size",
        "100MB",
    ]
    done("run", "quick", "--bag", tmp_path / "bag", *words)
    assert commands == [" ".join(["cam-rig run quick", *words])]


def test_run_on_another_rig(tmp_path, monkeypatch):
    """`run --rig` gives the nodes a scene that differs from the file only in its rig.

    The scene of one line of JSON has its cam, with a table of points, and its rig in its folder.
    """
    text = shipped("rigs", "tm21")
    points = shipped("cams", "measured").replace("name: measured", "name: points")
    scene = scene_data(cams=["points"], rig="first", speeds=[200])
    files = {
        "first.yaml": text.replace("name: tm21", "name: first"),
        "second.yaml": text.replace("name: tm21", "name: second").replace(
            "given: 1.3,", "given: 2,"
        ),
        "points.yaml": points,
        "measured.csv": (config_root() / "cams" / "measured.csv").read_text(encoding="utf-8"),
        "small.yaml": json.dumps(scene),
    }
    written(tmp_path, files)
    loaded = []
    monkeypatch.setattr("cam_rig.cli.run._run", lambda path, *_: loaded.append(open_scene(path)))
    path = tmp_path / "small.yaml"
    done("run", path, "--rig", "second", "--bag", tmp_path / "bag")
    (run,) = loaded
    assert (run.rig.name, run.follower.mass, run.scene_file.name) == ("second", 2.0, path.name)
    before = open_scene(path)
    assert run.scene.model_copy(update={"rig": "first"}) == before.scene
    assert np.array_equal(run.laws["points"].ordinates, before.laws["points"].ordinates)
    assert not run.scene_file.exists()


def test_run_ends_with_summary_files_and_next_steps(tmp_path, capsys):
    """After a run with --analyze the summary, the paths and the next commands are printed.

    The table by speed is a CSV file in the bag, which is read again.
    """
    bag = tmp_path / "a bag"
    shutil.copytree(GOLDEN, bag)
    print_analysis(bag)
    lines = capsys.readouterr().err.splitlines()
    run = read_bag(bag)
    (tm21, _) = run.summaries
    assert (tm21.speeds, tm21.lost, tm21.first_lost) == (4, 2, 350.0)
    assert tm21.jump_speed == pytest.approx(318.6, abs=0.05)
    assert (tm21.lowest_level, tm21.highest_level) == pytest.approx((74.3, 96.9), abs=0.05)
    assert lines[-4:] == [
        f"bag: {bag}",
        f"table by speed: {bag / 'by_speed.csv'}",
        f"next: cam-rig view '{bag}'",
        f"      cam-rig analyze '{bag}' --table",
    ]
    assert (bag / "by_speed.csv").read_text(encoding="utf-8") == run.tables()[0].to_csv()
    assert (bag / "noise.png").is_file()


def test_rows_by_speed_are_displayed_on_request():
    """Rows of many speeds and the regressions are displayed with --table only."""
    short, long = (done("analyze", GOLDEN, *words).stderr for words in ((), ("--table",)))
    assert " tm21       200  74.3" in short and "regression" not in short
    assert "regression" in long and "cross at" in long and "cross at" not in short
    sweep, whole = (done("simulate", *words).stderr for words in ((), ("--table",)))
    assert " tm21       200  74.3" not in sweep and " tm21       200  74.3" in whole
    assert "contact" in sweep and "318.6" in sweep

"""Files of a bag that do not agree with its metadata.yaml are reported by name."""

import os
import random
import shutil

import pytest
import yaml

from cam_rig.bag.listing import list_files, mcap_files
from cam_rig.bag.reader import read_counts
from cam_rig.bag.recover import examine, recover, recover_in_place
from cam_rig.errors import BagError
from cam_rig.studies.simulate.recorded import read_recording

from ..foreign_bags import number, write_bag

TIMES = [0.01 * i for i in range(50)]


@pytest.fixture
def bag(tmp_path, split):
    """Copy of a recording of the golden run in several files."""
    return shutil.copytree(split, tmp_path / "bag")


@pytest.mark.parametrize("seed", range(6))
def test_a_missing_file_is_named(bag, seed):
    """If a listed file is missing, each reader raises BagError with its name.

    This applies to any file, including the first and the last.
    """
    chosen = random.Random(seed).choice(mcap_files(bag)) if seed > 1 else mcap_files(bag)[-seed]
    chosen.unlink()
    for command in (read_counts, read_recording, examine):
        with pytest.raises(BagError, match=rf"are missing: {chosen.name}; restore them"):
            command(bag)


@pytest.mark.parametrize("seed", range(6))
def test_two_exchanged_files_are_named(bag, seed):
    """Two files with exchanged names raise BagError with both names."""
    one, other = random.Random(seed).sample(mcap_files(bag), 2)
    aside = one.rename(bag / "aside")
    other.rename(one)
    aside.rename(other)
    for command in (read_counts, read_recording, examine):
        with pytest.raises(BagError) as raised:
            command(bag)
        assert f"{one.name} is {other.name}" in str(raised.value)


@pytest.mark.parametrize("name", ["bag_0 (copy).mcap", "bag_99.mcap", "other.mcap", "a_0.db3"])
def test_a_file_that_is_not_listed_is_ignored_and_named(bag, split, tmp_path, name):
    """A file that metadata.yaml does not list is ignored, and a note gives its name."""
    shutil.copy(mcap_files(bag)[0], bag / name)
    assert read_counts(bag) == read_counts(split)
    note = f"{name} is ignored: metadata.yaml does not list it"
    assert f"{note}." in read_recording(bag).notes
    words = recover(bag, tmp_path / "recovered").text
    assert note in words and "nothing lost" in words


def test_a_copy_is_refused_if_no_metadata_lists_the_files(bag):
    """Without metadata.yaml a copy of a file in the bag is refused.

    Otherwise its turns would be counted twice.
    """
    (bag / "metadata.yaml").unlink()
    shutil.copy(mcap_files(bag)[0], bag / "bag_0 (copy).mcap")
    with pytest.raises(BagError, match=r"bag_0.mcap and bag_0 \(copy\).mcap have the same"):
        read_counts(bag)


def test_a_file_that_is_listed_twice_is_read_once(bag, split):
    """A file that metadata.yaml lists twice is read once, and a note gives its name."""
    file, first = bag / "metadata.yaml", mcap_files(bag)[0].name
    about = yaml.safe_load(file.read_text())
    about["rosbag2_bagfile_information"]["relative_file_paths"].append(first)
    file.write_text(yaml.safe_dump(about))
    assert read_counts(bag) == read_counts(split)
    note = f"{first} is read once: metadata.yaml lists it several times."
    assert note in read_recording(bag).notes


@pytest.mark.parametrize("name", ["bag_1.mcap", "metadata.yaml"])
def test_a_pipe_in_a_bag_is_refused(bag, name):
    """A pipe in place of a file is refused, because a reader would wait forever."""
    (bag / name).unlink()
    os.mkfifo(bag / name)
    for command in (read_counts, read_recording, examine):
        with pytest.raises(BagError, match=f"{name} is a pipe or a device; allowed: files"):
            command(bag)


@pytest.mark.parametrize("ending", ["mcap", "db3"])
def test_a_file_with_other_messages_is_refused(tmp_path, ending):
    """A file is refused if its number of messages differs from metadata.yaml."""
    from rosbags.rosbag2 import StoragePlugin

    plugin = StoragePlugin.MCAP if ending == "mcap" else StoragePlugin.SQLITE3
    for folder, count in (("one", 50), ("two", 40)):
        topics = {"/gauge": (number, TIMES[:count], TIMES[:count])}
        write_bag(tmp_path / folder / "bag", topics, plugin)
    file = f"bag/bag.{ending}"
    shutil.copy(tmp_path / "two" / file, tmp_path / "one" / file)
    with pytest.raises(BagError, match=rf"bag\.{ending} must have 50 messages, got 40"):
        read_counts(tmp_path / "one" / "bag")


def test_recover_counts_the_missing_messages_of_a_listed_file(bag, tmp_path):
    """A recovery reports how many messages a truncated file has lost.

    It compares them with the number in metadata.yaml.
    """
    file = mcap_files(bag)[1]
    listed = list_files(bag).extents[file.name].messages
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    found = recover(bag, tmp_path / "recovered")
    assert 0 < found.fewer[file.name] < listed
    assert f"{file.name} has {found.fewer[file.name]} messages fewer" in found.text


@pytest.mark.parametrize("text", ["", "not: [yaml", "a list", "rosbag2_bagfile_information: 3"])
def test_without_readable_metadata_files_are_read_by_their_numbers(bag, split, text):
    """If metadata.yaml is damaged, the files are read in the order of their numbers."""
    (bag / "metadata.yaml").write_text(text)
    assert read_counts(bag) == read_counts(split)
    assert list_files(bag).notes == (
        "metadata.yaml lists none of the files; they are read in the order of their numbers.",
    )


def test_the_total_is_compared_if_metadata_has_no_counts_per_file(bag):
    """Without counts per file in metadata.yaml, the total number is compared.

    Metadata before version 5 have only a total.
    """
    file = bag / "metadata.yaml"
    about = yaml.safe_load(file.read_text())
    information = about["rosbag2_bagfile_information"]
    del information["files"]
    file.write_text(yaml.safe_dump(about))
    total = sum(read_counts(bag).values())
    information["message_count"] += 1
    file.write_text(yaml.safe_dump(about))
    with pytest.raises(BagError, match=rf"must have {total + 1} messages, got {total}"):
        read_counts(bag)


def test_files_named_as_in_lyrical_are_read_in_the_order_of_their_numbers(bag, split):
    """Without metadata.yaml the leading numbers of names order the files.

    ROS 2 Lyrical names the files of a split bag `{number}_{bag}_{time}.mcap`. A missing number is
    an error, as for the names `{bag}_{number}.mcap`.
    """
    (bag / "metadata.yaml").unlink()
    for k, file in enumerate(mcap_files(bag)):
        file.rename(bag / f"{9 + k}_bag_2026-05-23-10-{59 - k:02}-00.mcap")
    renamed = list_files(bag).files
    assert [int(file.name.partition("_")[0]) for file in renamed] == [*range(9, 9 + len(renamed))]
    assert len(renamed) > 2 and read_counts(bag) == read_counts(split)
    listed = [file.name for file in renamed[:2]]
    about = {"rosbag2_bagfile_information": {"relative_file_paths": listed, "files": [
        {"path": name, "message_count": 0, "starting_time": {"nanoseconds_since_epoch": 0}}
        for name in listed]}}  # fmt: skip
    (bag / "metadata.yaml").write_text(yaml.safe_dump(about))
    assert list_files(bag).files == renamed  # as after the death of the recorder
    (bag / "metadata.yaml").unlink()
    with pytest.raises(BagError, match="cannot be recovered in place; recover the bag with"):
        recover_in_place(bag)
    renamed[1].unlink()
    with pytest.raises(BagError, match=r"10_\*\.mcap is missing, but later files exist"):
        list_files(bag)

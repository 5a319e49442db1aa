"""Damaged bags, by fixed seeds: each is read, or refused in one line; none takes long or much."""

import random
import struct

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from typer.testing import CliRunner

from cam_rig.bag.completeness import require_complete
from cam_rig.bag.files import bag_file
from cam_rig.bag.reader import read_counts, read_recording, read_scene
from cam_rig.bag.recorder import BagRecorder
from cam_rig.bag.records import records_of
from cam_rig.bag.recover import examine, recover, state_words
from cam_rig.bag.replay import compare, played
from cam_rig.cli.main import app
from cam_rig.errors import CamRigError

from .bags import GOLDEN, LOADED, Frugal

LENGTHS = (0, 1, 8, 22, 255, 2**16, 2**20, 2**31, 2**32 - 1, 2**40, 2**63, 2**64 - 1)


def compressed(path, kind):
    """The golden bag as another writer compresses it."""
    with bag_file(GOLDEN).open("rb") as source, path.open("wb") as target:
        reader, writer = make_reader(source), Writer(target, compression=kind, chunk_size=20_000)
        writer.start("ros2", "other")
        for one in reader.iter_attachments():
            writer.add_attachment(0, 0, one.name, one.media_type, one.data)
        known = {}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if channel.topic not in known:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                known[channel.topic] = writer.register_channel(
                    channel.topic, "cdr", number, channel.metadata
                )
            time_ns = message.log_time
            writer.add_message(known[channel.topic], time_ns, message.data, time_ns)
        writer.finish()
    return path


@pytest.fixture(scope="module")
def originals(tmp_path_factory):
    """Bytes, and where a record's length stands, of one bag three ways."""
    folder, found = tmp_path_factory.mktemp("originals"), []
    files = [bag_file(GOLDEN)]
    files += [
        compressed(folder / f"{k.name}.mcap", k)
        for k in (CompressionType.ZSTD, CompressionType.LZ4)
    ]
    for file in files:
        with file.open("rb") as stream:
            found.append((file.read_bytes(), [record.start - 8 for record in records_of(stream)]))
    return found


def truncate(data, _, chance):
    del data[chance.randrange(len(data)) :]


def flip(data, _, chance):
    for _ in range(chance.randint(1, 20)):
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)


def flip_the_head(data, _, chance):
    for _ in range(chance.randint(1, 4)):
        data[chance.randrange(8, 6000)] = chance.randrange(256)


def flip_the_summary(data, _, chance):
    for _ in range(chance.randint(1, 8)):
        data[-chance.randint(1, 14_000)] = chance.randrange(256)


def splice(data, _, chance):
    begin, length = chance.randrange(len(data)), chance.randint(1, 50_000)
    part = bytes(data[begin : begin + length])
    if chance.random() < 0.5:
        del data[begin : begin + length]
    place = chance.randrange(len(data))
    data[place:place] = part


def claim(data, heads, chance):
    for _ in range(chance.randint(1, 3)):
        struct.pack_into("<Q", data, chance.choice(heads), chance.choice(LENGTHS))


def claim_inside(data, heads, chance):
    place = chance.choice(heads) + chance.randint(8, 60)
    if place + 8 < len(data):
        struct.pack_into("<Q", data, place, chance.choice(LENGTHS))


def blank(data, _, chance):
    begin = chance.randrange(len(data))
    length = min(chance.choice((512, 4096, 65536)), len(data) - begin)
    data[begin : begin + length] = bytes(length)


WAYS = (truncate, flip, flip_the_head, flip_the_summary, splice, claim, claim_inside, blank)
CASES = range(8 * 50)


@pytest.mark.variants(3)
@pytest.mark.parametrize("seed", CASES)
def test_a_damaged_bag_is_read_or_refused(tmp_path, originals, seed):
    """Every reader and every recovery: a result or one line, within a gigabyte and ten seconds."""
    chance = random.Random(seed)
    original, heads = originals[seed // len(WAYS) % 3]
    data = bytearray(original)
    WAYS[seed % len(WAYS)](data, heads, chance)
    if chance.random() < 0.2:
        chance.choice(WAYS[:3])(data, heads, chance) if len(data) > 6000 else None
    bag = tmp_path / "bag"
    bag.mkdir()
    (bag / "bag_0.mcap").write_bytes(data)
    readers = (
        read_counts,
        read_scene,
        read_recording,
        examine,
        lambda one: require_complete(one, LOADED.scene),
        lambda one: list(played(one)),
        lambda one: compare(one, GOLDEN),
        lambda one: recover(one, tmp_path / "recovered"),
        lambda one: BagRecorder(one, LOADED, resume=True).close() if seed % 3 else state_words(one),
        read_recording,
    )
    for read in readers:
        with Frugal():
            try:
                read(bag)
            except CamRigError as error:
                assert "\n" not in str(error) and len(str(error)) < 2000
    (bag / "bag_0.mcap").write_bytes(data)
    with Frugal():
        result = CliRunner().invoke(app, ["analyze", str(bag)])
    assert result.exit_code in (0, 1, 2)
    assert isinstance(result.exception, (SystemExit, type(None)))


@pytest.mark.variants(4)
@pytest.mark.parametrize("seed", CASES)
def test_what_is_saved_was_recorded(tmp_path, originals, seed):
    """A cut or a blanked part: what comes back is byte by byte what was written, in its order."""
    chance = random.Random(seed)
    original, heads = originals[seed % 3]
    data = bytearray(original)
    (truncate, blank)[seed % 2](data, heads, chance)
    (tmp_path / "a.mcap").write_bytes(original)
    (tmp_path / "b.mcap").write_bytes(data)
    whole = contents(tmp_path / "a.mcap")
    try:
        saved = recover(tmp_path / "b.mcap", tmp_path / "recovered")
    except CamRigError as error:
        assert "nothing to recover" in str(error) or "does not begin" in str(error)
        return
    found = contents(bag_file(tmp_path / "recovered"))
    wrong = 0
    for topic, part in found.items():
        true = [one for one in part if one in whole[topic]]
        rest = iter(whole[topic])
        assert all(any(one == other for other in rest) for one in true)  # in its order
        wrong += len(part) - len(true)
    assert wrong <= saved.readers[0].doubtful


def contents(file):
    found = {}
    with file.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            found.setdefault(channel.topic, []).append((message.log_time, message.data))
    return found

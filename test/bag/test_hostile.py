"""Malicious bags are refused in one line before they use much memory or time."""

import io
import os
import struct
import zlib
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Chunk, ChunkIndex, DataEnd, Footer, Header, Schema, Statistics
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from cam_rig.bag.files import bag_file, require_new_bag
from cam_rig.bag.partial_reader import MAX_ATTACHED
from cam_rig.bag.reader import messages, raw_messages, read_counts, read_scene
from cam_rig.bag.recover import recover
from cam_rig.bag.writer import BagWriter
from cam_rig.errors import BagError, CamRigError
from cam_rig.messages import topics
from cam_rig.studies.simulate.recorded import read_recording

from .bags import GOLDEN

GIB = 2**30


def packed_zeros(size, compression):
    """Return `size` zeros in compressed form, without all of them in memory."""
    out, zeros = io.BytesIO(), bytes(2**20)
    if compression == "zstd":
        packed = zstandard.ZstdCompressor().stream_writer(out, closefd=False)
    else:
        packed = lz4.frame.LZ4FrameFile(out, "wb")
    with packed as stream:
        for _ in range(size // len(zeros)):
            stream.write(zeros)
    return out.getvalue()


def file_of(path, *records, summary=()):
    """Write a complete MCAP file of these records, and return its path.

    `summary` has the records of the summary section, from which readers find the chunks.
    """
    out = RecordBuilder()
    Header("ros2", "other").write(out)
    for record in (*records, DataEnd(0)):
        record.write(out)
    start = len(MCAP0_MAGIC) + out.count
    for record in summary:
        record.write(out)
    Footer(start if summary else 0, 0, 0).write(out)
    path.write_bytes(MCAP0_MAGIC + out.end() + MCAP0_MAGIC)
    return path


def index_of(chunk, offset, **changes):
    """Return the index record of a chunk at a file offset, for the summary section.

    `changes` replaces fields of the record, so that it is wrong.
    """
    claims = {
        "chunk_length": 9 + 40 + len(chunk.compression) + len(chunk.data),
        "chunk_start_offset": offset,
        "compression": chunk.compression,
        "compressed_size": len(chunk.data),
        "message_end_time": chunk.message_end_time,
        "message_index_length": 0,
        "message_index_offsets": {},
        "message_start_time": chunk.message_start_time,
        "uncompressed_size": chunk.uncompressed_size,
    }
    return ChunkIndex(**{**claims, **changes})


FIRST = len(MCAP0_MAGIC) + 9 + 4 + 4 + 4 + 5  # first record after the header


def chunk(data, compression, claimed, begin=0, end=10):
    return Chunk(compression, data, end, begin, 0, claimed)


def read_all(file):
    """Read a file with each bag reader and the recovery, and return their errors.

    A list of error messages is returned, with an empty text for a reader without an error. Each
    message must be one line below 1000 characters.
    """
    errors = []
    for read in (
        read_counts,
        read_scene,
        read_recording,
        lambda bag: list(messages(bag, topics.RECORDING)),
        lambda bag: list(raw_messages(bag, {"/x"})),
        lambda bag: recover(bag, bag.parent / f"recovered{len(errors)}"),
    ):
        try:
            read(file)
            errors.append("")
        except CamRigError as error:
            errors.append(str(error))
            assert "\n" not in errors[-1] and len(errors[-1]) < 1000
    return errors


PACKED = [("zstd", True), ("lz4", True), ("zstd", False), ("lz4", False)]


@pytest.mark.variants(2)
@pytest.mark.parametrize(("compression", "honest"), PACKED)
def test_a_few_bytes_that_unpack_to_a_gigabyte_are_refused(tmp_path, frugal, compression, honest):
    """A small chunk that unpacks to a gigabyte is refused before it is unpacked.

    The tested chunks state their true size, or falsely claim 1000 bytes.
    """
    data = packed_zeros(GIB, compression)
    one = chunk(data, compression, GIB if honest else 1000)
    file = file_of(tmp_path / "a.mcap", one, summary=[index_of(one, FIRST)])
    errors = read_all(file)
    for words in (errors[0], errors[3], errors[5]) if honest else (errors[0], errors[3]):
        assert ("at most 67108864 bytes" if honest else "unpack to 1000 bytes, got more") in words


def test_many_small_chunks_are_refused_by_their_sum(tmp_path, frugal):
    """A file is refused if all its chunks unpack to more than 100 times its size."""
    one = chunk(packed_zeros(2**20, "zstd"), "zstd", 2**20)
    length = 9 + 40 + 4 + len(one.data)
    index = [index_of(one, FIRST + i * length) for i in range(400)]
    errors = read_all(file_of(tmp_path / "a.mcap", *[one] * 400, summary=index))
    assert "must unpack to at most" in errors[0] and "100 times" in errors[0]


def test_a_wrong_chunk_index_does_not_hide_messages(tmp_path):
    """If the chunk index in the summary is wrong, the chunk itself is read."""
    body = struct.pack("<BQHIQQ", 5, 30, 1, 1, 5, 5) + bytes(8)
    one = chunk(body, "", len(body))
    topic = [Schema(1, b"x", "ros2msg", "a/msg/B"), Channel(1, "/x", "cdr", {}, 1)]
    statistics = Statistics(0, 1, {1: 1}, 1, 5, 0, 5, 0, 1)
    for changes in (
        {"compression": "zstd"},
        {"chunk_start_offset": FIRST + 3},
        {"compressed_size": GIB},
        {"uncompressed_size": GIB},
        {"chunk_length": 2**60},
        {"message_start_time": 2**60},
    ):
        summary = [*topic, statistics, *[index_of(one, FIRST, **changes)] * 2]
        file = file_of(tmp_path / "a.mcap", one, summary=summary)
        assert [time for _, time, _ in raw_messages(file, {"/x"})] == [5]


def test_data_that_cannot_be_unpacked_are_refused(tmp_path):
    """Readers refuse chunks that are empty, random, or of an unknown compression.

    A bag with a damaged SQLite file is refused too.
    """
    for compression in ("zstd", "lz4", "x"):
        for data in (b"", b"garbage", zstandard.compress(b"")[:5]):
            file = file_of(tmp_path / "a.mcap", chunk(data, compression, 100))
            assert all(read_all(file)[:4])
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "bag_0.db3").write_bytes(b"SQLite format 3\0" + os.urandom(5000))
    (tmp_path / "bag" / "metadata.yaml").write_text("x", encoding="utf-8")
    assert all(read_all(tmp_path / "bag"))


@pytest.mark.variants(3)
@pytest.mark.parametrize("length", [2**20, 2**32, 2**62, 2**64 - 1])
@pytest.mark.parametrize("opcode", [1, 3, 4, 5, 6, 7, 8, 9, 11, 12, 200])
def test_a_record_longer_than_its_file_is_not_read(tmp_path, frugal, opcode, length):
    """A record that claims to be longer than its file is refused without being read.

    A recovery skips the record and saves all messages.
    """
    file = bag_file(GOLDEN)
    data = file.read_bytes()
    made = tmp_path / "a.mcap"
    made.write_bytes(data[:FIRST] + struct.pack("<BQ", opcode, length) + data[FIRST:])
    errors = read_all(made)
    assert errors[0] and errors[3]
    assert recover(made, tmp_path / "all").counts == recover(file, tmp_path / "golden").counts


@pytest.mark.variants(2)
@pytest.mark.parametrize("field", [0, 8, 16, 20, 30, 40])
def test_lengths_inside_an_attachment_are_bounded(tmp_path, frugal, field):
    """A wrong length inside an attachment is refused, with bounded memory.

    The lengths are those of its name, its media type and its data.
    """
    data = bytearray(bag_file(GOLDEN).read_bytes())
    at = data.index(b"scenes/") - 4 + field
    data[at : at + 4] = b"\xff\xff\xff\x7f"
    made = tmp_path / "a.mcap"
    made.write_bytes(data)
    assert all(words for words in read_all(made)[1:2])


def attached(path, *names, data=b"x: 1"):
    with BagWriter(path) as bag:
        for name in names:
            bag.attach(name, data)
        bag.write(topics.LEVEL, 0, b"\0\1\0\0" + bytes(8))
    return path


def test_the_name_of_an_attachment_is_checked(tmp_path):
    """An attachment whose name is not a valid relative path is refused.

    No file is written. A name that is used for a file and for a folder is refused.
    """
    names = {
        "scenes/"
        + 300 * "a"
        + ".yaml": "names of 1 to 255 bytes and a path of at most 1000 bytes, got 305",
        "scenes/" + 200 * "ä" + ".yaml": "got 405",
        "/".join(300 * ["scenes"]): "a path of at most 1000 bytes, got 6 and 2099",
        "../../evil.yaml": "must be a relative path",
        "/etc/evil.yaml": "must be a relative path",
        "scenes/../../../evil.yaml": "must be a relative path",
        "scenes/a\0b.yaml": "must be a relative path",
        "": "got 0 and 0",
        ".": "got 1 and 1",
    }
    for number, (name, words) in enumerate(names.items()):
        with pytest.raises(BagError, match="attachment") as refused:
            read_scene(attached(tmp_path / f"bag{number}", name))
        assert words in str(refused.value)
    assert list(tmp_path.rglob("evil*")) == []
    for number, two in enumerate([("a", "a/b"), ("a/b", "a")]):
        with pytest.raises(BagError, match="is the name of a file and of a folder"):
            read_scene(attached(tmp_path / f"two{number}", *two))


def test_the_number_of_attachments_is_limited(tmp_path, frugal):
    """A bag with over 1000 attachments, or with over 64 MiB of them, is refused."""
    names = [f"cams/c{i}.yaml" for i in range(MAX_ATTACHED + 1)]
    with pytest.raises(BagError, match=f"at most 1000 attachments .*got {MAX_ATTACHED + 1} of"):
        read_scene(attached(tmp_path / "many", *names))
    with pytest.raises(BagError, match=r"of together 67108864 bytes, got 1 of"):
        read_scene(attached(tmp_path / "big", "scenes/a.yaml", data=bytes(65 * 2**20)))


def test_an_attachment_that_was_changed_is_not_read(tmp_path):
    """An attachment with a wrong checksum is refused, and a recovery reports it.

    A flipped bit in the numbers of the rig would change every level.
    """
    data = bytearray(bag_file(GOLDEN).read_bytes())
    data[data.index(b"mass")] ^= 1
    (tmp_path / "a.mcap").write_bytes(data)
    with pytest.raises(BagError, match="has a wrong checksum"):
        read_scene(tmp_path / "a.mcap")
    assert recover(tmp_path / "a.mcap", tmp_path / "recovered").reports[0].damaged_records == 1


def test_a_topic_of_another_type_is_refused(tmp_path):
    """A topic with another type than expected raises BagError with both types."""
    with BagWriter(tmp_path / "bag") as bag:
        bag.write(
            topics.Topic("/microphone/level", topics.CAM_RPM.type[:-2] + "32", "any"), 0, b"x"
        )
    with pytest.raises(BagError, match="must be std_msgs/msg/Float64, got std_msgs/msg/Float32"):
        list(messages(tmp_path / "bag", (topics.LEVEL,)))


def test_the_number_of_topics_is_limited(tmp_path, frugal):
    """A recovery of a bag with 2000 topics saves 1000 topics and reports damage."""
    records = [Schema(1, b"", "ros2msg", "a/msg/B")]
    records += [Channel(i + 1, f"/t{i}", "cdr", {}, 1) for i in range(2_000)]
    out = RecordBuilder()
    for i in range(2_000):
        out.write(struct.pack("<BQHIQQ", 5, 22, i + 1, 0, i, i))
    data = out.end()
    records.append(chunk(data, "", len(data), 0, 2_000))
    saved = recover(file_of(tmp_path / "a.mcap", *records), tmp_path / "recovered")
    assert len(saved.counts) == 1000 and "damaged" in saved.text


@pytest.mark.parametrize("kind", [CompressionType.ZSTD, CompressionType.LZ4], ids=lambda k: k.name)
def test_a_valid_compressed_bag_is_read(tmp_path, kind):
    """A zstd or lz4 bag of another writer is read completely.

    If it was cut off, a recovery saves its messages up to the cut.
    """
    bag = tmp_path / "a.mcap"
    noise = [b"\0\1\0\0" + os.urandom(8) for _ in range(10_000)]
    with bag.open("wb") as stream:
        writer = Writer(stream, compression=kind, chunk_size=2**18)
        writer.start("ros2", "other")
        schema = writer.register_schema(topics.LEVEL.type, "ros2msg", b"float64 data")
        channel = writer.register_channel(topics.LEVEL.name, "cdr", schema)
        for time_ns, cdr in enumerate(noise):
            writer.add_message(channel, time_ns, cdr, time_ns)
        writer.finish()
    found = [bytes(data) for _, _, data in raw_messages(bag, {topics.LEVEL.name})]
    assert found == noise
    assert recover(bag, tmp_path / "all").counts == {topics.LEVEL.name: len(noise)}
    bag.write_bytes(bag.read_bytes()[:50_000])
    saved = recover(bag, tmp_path / "part")
    assert saved.reports[0].truncated_messages == saved.counts[topics.LEVEL.name] > 1000
    part = [bytes(data) for _, _, data in raw_messages(tmp_path / "part", {topics.LEVEL.name})]
    assert part == noise[: len(part)]


def test_a_bag_compressed_message_by_message_is_refused(tmp_path):
    """A bag compressed per message or file is refused with a remedy.

    The unpacked size of its messages has no bound. The remedy is `ros2 bag convert`.
    """
    bag = attached(tmp_path / "bag")
    file = bag / "metadata.yaml"
    text = file.read_text(encoding="utf-8")
    for mode in ("FILE", "message"):
        file.write_text(text.replace("compression_mode: ''", f"compression_mode: {mode}"), "utf-8")
        with pytest.raises(
            BagError, match=f"or by chunk, got by {mode.lower()}; .*ros2 bag convert"
        ):
            read_counts(bag)


def test_an_unusable_bag_name_is_refused_before_recording(tmp_path):
    """A bag name that is too long for the disk or not printable is refused.

    The longest possible name is accepted.
    """
    for letters in ("a", "ä", "日"):
        size = len(letters.encode())
        most = (255 - len("_0.mcap.part")) // size
        require_new_bag(tmp_path / (letters * most))
        BagWriter(tmp_path / (letters * most)).close()
        for name in (letters * (most + 1), letters * (250 // size), letters * 300):
            with pytest.raises(BagError, match="too long"):
                require_new_bag(tmp_path / name)
    deep = str(tmp_path) + "/abcdefghi" * 500
    with pytest.raises(BagError, match="path is 1 bytes too long"):
        require_new_bag(Path(deep[: 4096 - len("/ten/ten_0.mcap.part")] + "/ten"))
    for letters in (244, 250, 300):
        with pytest.raises(BagError, match="too long"):
            recover(GOLDEN, tmp_path / ("a" * letters))
        assert all(read_all(tmp_path / ("a" * letters)))
    for name in ("a\nb", "a\x1bb", "a\udcffb"):
        with pytest.raises(BagError, match="must consist of printable characters"):
            require_new_bag(tmp_path / name)


def test_a_wrong_checksum_is_reported(tmp_path):
    """Readers refuse a chunk with a wrong checksum.

    A recovery saves its messages and reports that they are from a damaged chunk.
    """
    body = struct.pack("<BQHIQQ", 5, 30, 1, 1, 5, 5) + bytes(8)
    wrong = Chunk("", body, 5, 5, zlib.crc32(body) ^ 1, len(body))
    records = [Schema(1, b"x", "ros2msg", "a/msg/B"), Channel(1, "/x", "cdr", {}, 1)]
    file = file_of(tmp_path / "a.mcap", *records, wrong)
    with pytest.raises(BagError, match="checksum"):
        list(raw_messages(file, {"/x"}))
    saved = recover(file, tmp_path / "recovered")
    assert saved.counts == {"/x": 1}
    assert "1 saved messages from 5e-09 s to 5e-09 s are from damaged" in saved.text

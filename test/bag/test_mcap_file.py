"""MCAP files of any writer: encodings, checksums, files without chunks or summary."""

import json

import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType, Writer

from cam_rig.bag.mcap_file import McapFile
from cam_rig.bag.reader import raw_messages, read_counts
from cam_rig.bag.recover import examine
from cam_rig.errors import BagError

#: Message definition (schema) that is not text, as for protobuf.
BINARY = bytes(range(256))


def write(path, times, seed=0, **how):
    """Write an MCAP file with a CDR, a JSON and a protobuf topic, and return its path.

    Each topic has a message at each log time (ns). `how` has options of the MCAP writer.
    """
    rng = np.random.default_rng(seed)
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE, **how)
        writer.start("", "another logger")
        channels = {}
        for topic, kind, encoding, schema, data in (
            ("/gauge", "std_msgs/Float64", "cdr", "ros2msg", b"float64 data"),
            ("/note", "Note", "json", "jsonschema", b"{}"),
            ("/picture", "Picture", "protobuf", "protobuf", BINARY),
        ):
            number = writer.register_schema(kind, schema, data)
            channels[topic] = writer.register_channel(topic, encoding, number)
        for time_ns in times:
            cdr = b"\0\1\0\0" + rng.normal(size=1).tobytes()
            payloads = {"/gauge": cdr, "/note": json.dumps({"t": 1}).encode(), "/picture": BINARY}
            for topic, data in payloads.items():
                writer.add_message(channels[topic], int(time_ns), data, int(time_ns))
        writer.finish()
    return path


WAYS = {
    "chunks": {"chunk_size": 2000},
    "one chunk": {},
    "no chunks": {"use_chunking": False},
    "no statistics": {"chunk_size": 2000, "use_statistics": False},
    "no index": {"chunk_size": 2000, "index_types": IndexType.NONE, "use_statistics": False},
    "no summary of topics": {
        "chunk_size": 2000,
        "repeat_channels": False,
        "repeat_schemas": False,
        "use_statistics": False,
    },
}


@pytest.mark.parametrize("way", WAYS)
def test_topics_of_every_encoding_are_listed_and_messages_come_in_time_order(tmp_path, way):
    """All topics of a file are listed, and messages are read in the order of time.

    Overlapping chunks are merged. Messages of equal time keep the order of the file.
    """
    rng = np.random.default_rng(3)
    times = 1000 * rng.integers(0, 400, 300)
    times = np.sort(times) if way == "no chunks" else times
    path = write(tmp_path / "file.mcap", times, **WAYS[way])
    with McapFile(path) as file:
        found = {one.topic: (one.msgtype, one.encoding) for one in file.connections}
        counts = {one.topic: one.msgcount for one in file.connections}
        gauge = [one for one in file.connections if one.topic == "/gauge"]
        stamps = [time_ns for _, time_ns, _ in file.messages(gauge)]
    assert found == {
        "/gauge": ("std_msgs/msg/Float64", "cdr"),
        "/note": ("Note", "json"),
        "/picture": ("Picture", "protobuf"),
    }
    assert counts == dict.fromkeys(found, 300)
    assert stamps == sorted(times.tolist())
    assert read_counts(path) == counts


def test_messages_without_chunks_that_go_back_in_time_are_refused(tmp_path):
    """A file without chunks whose times decrease is refused.

    Its messages cannot be sorted in bounded memory.
    """
    path = write(tmp_path / "file.mcap", [1, 2, 5, 4], use_chunking=False)
    with pytest.raises(BagError, match="order of their log times, got 4 ns after 5 ns"):
        list(raw_messages(path, {"/gauge"}))


@pytest.mark.parametrize("chunked", [False, True])
@pytest.mark.parametrize("seed", range(10))
def test_a_changed_byte_of_a_message_is_an_error(tmp_path, chunked, seed):
    """A changed byte of a message is detected by a checksum, and recover reports it.

    The checksum is that of the data section or of the chunk.
    """
    times = 1000 * np.arange(100)
    path = write(
        tmp_path / "file.mcap", times, seed, use_chunking=chunked, enable_data_crcs=not chunked
    )
    assert read_counts(path)["/gauge"] == 100
    data = bytearray(path.read_bytes())
    rng = np.random.default_rng(seed)
    with McapFile(path) as file:
        messages = [data for _, _, data in file.messages(file.connections)][::3]
    position = data.index(messages[rng.integers(len(messages))]) + rng.integers(4, 12)
    data[position] ^= 1 << rng.integers(8)
    path.write_bytes(data)
    with pytest.raises(BagError, match="checksum"):
        list(raw_messages(path, {"/gauge"}))
    found = examine(path)
    assert not found.is_lossless and "checksum" in found.text

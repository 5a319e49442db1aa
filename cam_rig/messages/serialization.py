"""Serialization (CDR) of messages, one by one or many at once."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from cam_rig.errors import RefusedError
from cam_rig.messages.codec import rig_time
from cam_rig.messages.topics import Topic
from cam_rig.units import NS, FloatArray

#: Message types of the ROS distribution in whose format the rig writes.
TYPES = get_typestore(Stores.ROS2_KILTED)
_INVALID_CONTENT = (LookupError, ValueError, TypeError, OverflowError, MemoryError, AssertionError)
#: Exceptions that rosbags raises for invalid bytes.
MALFORMED = (SerdeError, struct.error, *_INVALID_CONTENT)


def read_message(topic: Topic, cdr: bytes) -> tuple[Any, bytes]:
    """Deserialize a message of a topic, and return it with its bytes.

    The bytes have zeros as padding, because the padding of messages from the middleware is
    undefined.

    Raises
    ------
    RefusedError
        If the bytes are not a message of the topic.
    """
    try:
        message = TYPES.deserialize_cdr(cdr, topic.type)
        return message, bytes(TYPES.serialize_cdr(message, topic.type))
    except MALFORMED as error:
        raise RefusedError(f"{topic.name}: {len(cdr)} bytes are not a message ({error})") from None


def new(kind: str, *fields: Any) -> Any:
    """Create a message of a type such as ``std_msgs/Header`` from its fields."""
    return TYPES.types[kind.replace("/", "/msg/")](*fields)


def serialize(message: Any) -> bytes:
    """Return the serialized bytes of a message."""
    return bytes(TYPES.serialize_cdr(message, message.__msgtype__))


def header(stamp_ns: int, frame: str) -> Any:
    """Return a std_msgs/Header with a rig time in ns and a frame."""
    return new("std_msgs/Header", new("builtin_interfaces/Time", *divmod(stamp_ns, NS)), frame)


def cam_of(message: Any) -> str:
    """Return the name of the cam in a message of a law or profile.

    The result is empty for another message.
    """
    if hasattr(message, "header"):
        return str(message.header.frame_id)
    return str(message.layout.dim[0].label) if message.layout.dim else ""


def diagnosed_node(message: Any) -> str:
    """Return the name of the node whose status a message of /diagnostics contains."""
    return " ".join(str(status.name) for status in message.status)


def stamp_of(cdr: bytes) -> int:
    """Return the rig time (ns) at the start of a serialized message.

    The message starts with a stamp or a clock.
    """
    if len(cdr) < 12:
        raise RefusedError(f"a stamped message has at least 12 bytes, got {len(cdr)}")
    return rig_time(*struct.unpack_from("<iI" if cdr[1] == 1 else ">iI", cdr, 4))


# Many messages at once that differ only in their stamp and some numbers.

#: Seconds and nanoseconds of the stamp in the example message of a template, chosen so that the
#: same bytes do not occur elsewhere in a message.
EXAMPLE_STAMP = (0x5A17C0DE, 0x1B2D4F63)
#: Create the header of the example message of a template. `CdrTemplate.fill` replaces its stamp.
example_header = partial(header, EXAMPLE_STAMP[0] * NS + EXAMPLE_STAMP[1])


class CdrTemplate:
    """Template of messages of one type that all have the same length.

    Texts and array lengths must be constant. The bytes of an example are copied for all messages,
    then stamps and numbers are written into the copies column by column. This is faster than to
    serialize the messages one by one.

    Parameters
    ----------
    kind : str
        Message type.
    example : callable
        Makes a message of `count` numbers (float64 fields), with headers of `example_header`.
    count : int
        Number of numbers.
    """

    def __init__(self, kind: str, example: Callable[..., Any], count: int) -> None:
        numbers = [0.1 + i for i in range(count)]  # the bytes of all numbers are different
        cdr = bytes(TYPES.serialize_cdr(example(*numbers), kind))
        self._example = np.frombuffer(cdr, dtype=np.uint8)
        self._stamp_offsets = _offsets(cdr, struct.pack("<II", *EXAMPLE_STAMP))
        self._number_offsets = [_offsets(cdr, struct.pack("<d", number)) for number in numbers]
        if not all(self._number_offsets):
            raise ValueError(f"an example of {kind} lacks one of its {count} numbers")

    def fill(self, time_ns: NDArray[np.int64], *columns: FloatArray) -> list[bytes]:
        """Return a serialized message for each stamp (ns).

        ``columns`` are the numbers of the messages, one array per number, shape (n,).
        """
        out = np.tile(self._example, (time_ns.size, 1))
        stamps = np.stack(np.divmod(time_ns, NS), axis=1).astype("<u4").view(np.uint8)
        for offset in self._stamp_offsets:
            out[:, offset : offset + 8] = stamps
        for offsets, column in zip(self._number_offsets, columns, strict=True):
            values = np.ascontiguousarray(column, dtype="<f8").view(np.uint8).reshape(-1, 8)
            for offset in offsets:
                out[:, offset : offset + 8] = values
        data, length = out.tobytes(), self._example.size
        return [data[i : i + length] for i in range(0, len(data), length)]


def _offsets(cdr: bytes, part: bytes) -> list[int]:
    return [match.start() for match in re.finditer(re.escape(part), cdr)]

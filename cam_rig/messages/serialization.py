"""Serialized messages: made one by one, or many at once; read, and brought to one form."""

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

#: The message types of the distribution that the rig writes.
TYPES = get_typestore(Stores.ROS2_KILTED)
_CONTENTS = (LookupError, ValueError, TypeError, OverflowError, MemoryError, AssertionError)
#: What rosbags raises on bytes that are not what they should be.
MALFORMED = (SerdeError, struct.error, *_CONTENTS)


def read_message(topic: Topic, cdr: bytes) -> tuple[Any, bytes]:
    """A message, and its bytes with zeros in the gaps, where the middleware leaves anything."""
    try:
        message = TYPES.deserialize_cdr(cdr, topic.type)
        return message, bytes(TYPES.serialize_cdr(message, topic.type))
    except MALFORMED as error:
        raise RefusedError(f"{topic.name}: {len(cdr)} bytes are not a message ({error})") from None


def new(kind: str, *fields: Any) -> Any:
    """A message of a type such as ``std_msgs/Header``, with its fields in their order."""
    return TYPES.types[kind.replace("/", "/msg/")](*fields)


def serialize(message: Any) -> bytes:
    """The message's bytes."""
    return bytes(TYPES.serialize_cdr(message, message.__msgtype__))


def header(stamp_ns: int, frame: str) -> Any:
    """A std_msgs/Header with rig time in ns."""
    return new("std_msgs/Header", new("builtin_interfaces/Time", *divmod(stamp_ns, NS)), frame)


def cam_of(message: Any) -> str:
    """The name of the cam of a law or a profile."""
    if hasattr(message, "header"):
        return str(message.header.frame_id)
    return str(message.layout.dim[0].label) if message.layout.dim else ""


def diagnosed_node(message: Any) -> str:
    """The node that a /diagnostics message is of."""
    return " ".join(str(status.name) for status in message.status)


def stamp_of(cdr: bytes) -> int:
    """Rig time (ns) at the head of a serialized message: a header's stamp, or a clock."""
    if len(cdr) < 12:
        raise RefusedError(f"{len(cdr)} bytes are not a message; allowed: 12 at least")
    return rig_time(*struct.unpack_from("<iI" if cdr[1] == 1 else ">iI", cdr, 4))


# Many messages at once that differ in their stamp and some numbers alone.

#: Looked for in an example's bytes; no message has such a stamp by chance.
EXAMPLE_STAMP = (0x5A17C0DE, 0x1B2D4F63)
#: A header for an example; the stamps of what is made of it replace its own.
example_header = partial(header, EXAMPLE_STAMP[0] * NS + EXAMPLE_STAMP[1])


class CdrTemplate:
    """Messages of one type whose texts and array lengths never change, so all are as long.

    The bytes of an example are copied, and stamps and numbers put in their places by columns,
    instead of one message after the other. The ``example`` makes a message of ``count`` numbers
    (float64 fields), with headers by `example_header`.
    """

    def __init__(self, kind: str, example: Callable[..., Any], count: int) -> None:
        numbers = [0.1 + i for i in range(count)]  # whose bytes are all different
        cdr = bytes(TYPES.serialize_cdr(example(*numbers), kind))
        self._example = np.frombuffer(cdr, dtype=np.uint8)
        self._stamps = _places(cdr, struct.pack("<II", *EXAMPLE_STAMP))
        self._numbers = [_places(cdr, struct.pack("<d", number)) for number in numbers]
        if not all(self._numbers):
            raise ValueError(f"an example of {kind} lacks one of its {count} numbers")

    def fill(self, time_ns: NDArray[np.int64], *columns: FloatArray) -> list[bytes]:
        """A message for each stamp ``(n,)`` in ns, with a number of each column ``(n,)``."""
        out = np.tile(self._example, (time_ns.size, 1))
        stamps = np.stack(np.divmod(time_ns, NS), axis=1).astype("<u4").view(np.uint8)
        for place in self._stamps:
            out[:, place : place + 8] = stamps
        for places, column in zip(self._numbers, columns, strict=True):
            values = np.ascontiguousarray(column, dtype="<f8").view(np.uint8).reshape(-1, 8)
            for place in places:
                out[:, place : place + 8] = values
        data, length = out.tobytes(), self._example.size
        return [data[i : i + length] for i in range(0, len(data), length)]


def _places(cdr: bytes, part: bytes) -> list[int]:
    return [found.start() for found in re.finditer(re.escape(part), cdr)]

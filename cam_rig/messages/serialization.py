"""Serialized messages: read, and brought to one form; what the recorder must know of them."""

from __future__ import annotations

import struct
from typing import Any

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from cam_rig.errors import RefusedError
from cam_rig.messages.topics import Topic
from cam_rig.units import NS

#: What rosbags raises on bytes that are not what they should be.
MALFORMED = (
    SerdeError,
    ValueError,
    IndexError,
    KeyError,
    TypeError,
    OverflowError,
    AssertionError,
    MemoryError,
    struct.error,
)


class RawMessages:
    """Reads serialized messages of the rig's topics."""

    def __init__(self) -> None:
        self._types = get_typestore(Stores.ROS2_KILTED)

    def read(self, topic: Topic, cdr: bytes) -> tuple[Any, bytes]:
        """A message, and its bytes with every gap of the alignment zero.

        The middleware leaves in the gaps what was in its buffer before; two runs would differ.
        """
        try:
            message = self._types.deserialize_cdr(cdr, topic.type)
            return message, bytes(self._types.serialize_cdr(message, topic.type))
        except MALFORMED as error:
            raise RefusedError(
                f"{topic.name}: {len(cdr)} bytes are not a message ({error})"
            ) from None


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
    seconds, nanoseconds = struct.unpack_from("<iI" if cdr[1] == 1 else ">iI", cdr, 4)
    if seconds < 0 or nanoseconds >= NS:
        raise RefusedError(f"a stamp of {seconds} s and {nanoseconds} ns; allowed: from zero on")
    return int(seconds) * NS + int(nanoseconds)

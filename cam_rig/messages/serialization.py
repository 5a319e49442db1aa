"""Serialized messages: what the recorder must know of them, and one form for each."""

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

        Raises
        ------
        RefusedError : the bytes are no message
        """
        try:
            message = self._types.deserialize_cdr(cdr, topic.type)
            return message, bytes(self._types.serialize_cdr(message, topic.type))
        except MALFORMED as error:
            raise RefusedError(f"{topic.name}: {len(cdr)} bytes of no message ({error})") from None


def cam_of(message: Any) -> str:
    """The cam that a law or a profile is of."""
    if hasattr(message, "header"):
        return str(message.header.frame_id)
    return str(message.layout.dim[0].label) if message.layout.dim else ""


def speaker_of(message: Any) -> str:
    """The node that a diagnosis is of."""
    return " ".join(str(status.name) for status in message.status)


def stamp_of(cdr: bytes) -> int:
    """Rig time (ns) at the head of a serialized message: a header's stamp, or a clock.

    Raises
    ------
    RefusedError : the bytes are too few, or the time is none
    """
    if len(cdr) < 12:
        raise RefusedError(f"{len(cdr)} bytes are no message; allowed: 12 at least")
    seconds, nanoseconds = struct.unpack_from("<iI" if cdr[1] == 1 else ">iI", cdr, 4)
    if seconds < 0 or nanoseconds >= NS:
        raise RefusedError(f"a stamp of {seconds} s and {nanoseconds} ns; allowed: from zero on")
    return int(seconds) * NS + int(nanoseconds)

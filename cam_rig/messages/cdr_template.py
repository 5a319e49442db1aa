"""Many serialized messages at once that differ in their stamp and some numbers alone."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore

from cam_rig.units import NS, FloatArray

#: The message types of the distribution that the rig writes.
TYPES = get_typestore(Stores.ROS2_KILTED)
#: Looked for in an example's bytes; no message has such a stamp by chance.
EXAMPLE_STAMP = (0x5A17C0DE, 0x1B2D4F63)


def example_header(frame_id: str) -> Any:
    """A std_msgs/Header for an example; the stamps of what is made of it replace its own."""
    stamp = TYPES.types["builtin_interfaces/msg/Time"](*EXAMPLE_STAMP)
    return TYPES.types["std_msgs/msg/Header"](stamp, frame_id)


class CdrTemplate:
    """Messages of one type whose texts and array lengths never change, so all are as long.

    The bytes of an example are copied, and stamps and numbers put in their places by columns,
    instead of one message after the other.

    Parameters
    ----------
    kind : the type, sensor_msgs/msg/JointState for one
    example : the message with given numbers (float64 fields), and headers by `example_header`
    count : how many numbers

    Raises
    ------
    ValueError : the example lacks one of the numbers
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

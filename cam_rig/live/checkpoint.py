"""What a node knows, kept outside of it, so that its successor can go on where it ended.

Records are written as JSON: floats come back bit for bit, and only numbers, texts, arrays of
numbers and the rig's own immutable records are made from it, so a foreign file can do no more than
be refused.
"""

from __future__ import annotations

import json
import os
import sys
from collections import deque
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cam_rig.errors import CamRigError, RunError
from cam_rig.files import MIB, read_bytes

#: The drive keeps at most this many ticks in flight.
TICKS_IN_FLIGHT = 4
#: States that the recorder writes between flushes, at most: what a kill can take from it.
STATES_UNFLUSHED = 8
_LOST = STATES_UNFLUSHED + TICKS_IN_FLIGHT + 1
_AHEAD = TICKS_IN_FLIGHT + 1
#: Ticks that a successor goes back, by node: it says again what a recorder that died as well may
#: have lost, and what the successor of whoever hears it needs to go back as far. The last node of
#: a chain must still fit into the history of a topic.
TICKS_KEPT = {
    "microphone": _LOST,
    "law_server": _LOST,
    "follower": _LOST + _AHEAD,
    "cam_drive": _LOST + 2 * _AHEAD,
}
#: Bytes of a file, at most; those of the shipped scenes have less than a thousandth of it.
MAX_BYTES = 64 * MIB
#: Kinds of numbers that an array may hold: bool, int, unsigned, float, complex.
NUMBERS = "biufc"


#: What a file that is no handover raises.
UNREADABLE = (
    OSError,
    ValueError,
    KeyError,
    IndexError,
    TypeError,
    AttributeError,
    OverflowError,
    RecursionError,
    CamRigError,
)


class Handover:
    """The memory of one node after each of its last ticks, in a file of the run's own folder.

    Parameters
    ----------
    folder : the run's folder; empty keeps nothing
    node : the node's name
    """

    def __init__(self, folder: str, node: str) -> None:
        self._file = Path(folder) / f"{node}.json" if folder else None
        self._kept: deque[str] = deque(maxlen=TICKS_KEPT.get(node, 1))
        self._until: int | None = None

    @property
    def kept(self) -> bool:
        """Whether anything is kept at all."""
        return self._file is not None

    def keep(self, memory: Any, stamp_ns: int = 0) -> None:
        """Keep one more record, of a rig time, and let go of the oldest.

        While a successor does again what its predecessor did, the records are here already: so
        it may die as well.

        Raises
        ------
        RunError : the folder cannot be written, or the records are too long for a file
        """
        if self._file is None:
            return
        if self._until is not None and stamp_ns < self._until:
            return
        self._until = None
        self._kept.append(json.dumps([stamp_ns, to_plain(memory)]))
        text = f"[{','.join(self._kept)}]"
        if len(text) > MAX_BYTES:  # JSON here is ASCII
            size = len(text) / MIB
            raise RunError(f"{self._file}: has {size:.3g} MiB; allowed: {MAX_BYTES / MIB:g} MiB")
        part = self._file.with_suffix(".part")
        try:
            part.write_text(text, encoding="ascii")
            os.replace(part, self._file)
        except OSError as error:
            raise RunError(f"{self._file}: cannot be written ({error.strerror})") from None

    def oldest(self) -> Any:
        """The oldest record that the predecessor kept, to go on from; None without a predecessor.

        Raises
        ------
        RunError : the file is no handover
        """
        return next(iter(self.all()), None)

    def newest(self) -> Any:
        """The newest record that the predecessor kept; None without a predecessor."""
        return next(reversed(self.all()), None)

    def all(self) -> list[Any]:
        """Every record that the predecessor kept, the oldest first."""
        if self._file is None or not self._file.is_file():
            return []
        try:
            found = json.loads(read_bytes(self._file, MAX_BYTES, follow=False))
            records = [from_plain(memory) for _, memory in found]
            self._until = int(found[-1][0])
        except UNREADABLE as error:
            raise RunError(f"{self._file}: is no handover of a node ({error})") from None
        self._kept.clear()
        self._kept.extend(json.dumps(kept) for kept in found)
        return records


def to_plain(value: Any) -> Any:
    """Records, arrays, tuples, numbers and texts as what JSON can hold."""
    if is_dataclass(value) and not isinstance(value, type):
        kind = type(value)
        inside = {field.name: to_plain(getattr(value, field.name)) for field in fields(value)}
        return {"record": f"{kind.__module__}:{kind.__qualname__}", "fields": inside}
    if isinstance(value, np.ndarray):
        data = np.ascontiguousarray(value)
        return {"array": data.tobytes().hex(), "type": data.dtype.str, "shape": data.shape}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (tuple, list)):
        return {type(value).__name__: [to_plain(item) for item in value]}
    if isinstance(value, dict):
        return {"dict": [[to_plain(k), to_plain(v)] for k, v in value.items()]}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise RunError(f"a node's memory holds {type(value).__name__}; allowed: records and arrays")


def from_plain(data: Any) -> Any:
    """The value that `to_plain` was given.

    Raises
    ------
    UNREADABLE : it was given none such
    """
    if not isinstance(data, dict):
        return data
    if "record" in data:
        inside = {name: from_plain(value) for name, value in data["fields"].items()}
        return _record(data["record"])(**inside)
    if "array" in data:
        return _array(data["array"], data["type"], data["shape"])
    if "dict" in data:
        return {from_plain(key): from_plain(value) for key, value in data["dict"]}
    (name, items), *_ = data.items()
    return {"tuple": tuple, "list": list}[name](from_plain(item) for item in items)


def _array(digits: str, kind: str, shape: list[int]) -> Any:
    dtype = np.dtype(kind)
    if dtype.kind not in NUMBERS or dtype.fields is not None:
        raise RunError(f"an array holds {kind!r}; allowed: numbers")
    return np.frombuffer(bytes.fromhex(digits), dtype=dtype).reshape(shape)


def _record(path: str) -> type[Any]:
    """The immutable record of that name; who hands it over has imported it, so nothing is."""
    module, _, name = path.partition(":")
    found = sys.modules.get(module) if module.startswith("cam_rig.") else None
    kind = getattr(found, name, None)
    if not (isinstance(kind, type) and is_dataclass(kind) and _is_frozen(kind)):
        raise RunError(f"{path} is no record of the rig")
    return kind


def _is_frozen(kind: Any) -> bool:
    return bool(kind.__dataclass_params__.frozen)

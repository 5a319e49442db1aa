"""What a node must know to take the place of a killed one: all that ``--respawn`` needs of it.

The runner names one folder for all nodes of a run. In it, each node counts its starts and keeps
its state after each of its last ticks; without a folder nothing is kept, and nothing costs.
"""

from __future__ import annotations

import json
import os
import sys
from collections import deque
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from cam_rig.errors import CamRigError, RunError
from cam_rig.files import MIB, read_bytes
from cam_rig.live.flow_control import TICKS_KEPT

# Immutable records as JSON and back: floats come back bit for bit, a foreign file makes nothing.

#: Kinds of numbers that an array may hold: bool, int, unsigned, float, complex.
NUMBERS = "biufc"
#: What `from_plain` raises on data that `to_plain` did not make.
_CONTENTS = (ValueError, LookupError, TypeError, AttributeError, OverflowError, RecursionError)
UNREADABLE = (OSError, CamRigError, *_CONTENTS)


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
    raise RunError(f"a node's state holds {type(value).__name__}; allowed: records and arrays")


def from_plain(data: Any) -> Any:
    """The value that `to_plain` was given."""
    if not isinstance(data, dict):
        return data
    if "record" in data:
        inside = {name: from_plain(value) for name, value in data["fields"].items()}
        return _record(data["record"])(**inside)
    if "array" in data:
        dtype = np.dtype(data["type"])
        if dtype.kind not in NUMBERS or dtype.fields is not None:
            raise RunError(f"an array holds {data['type']!r}; allowed: numbers")
        return np.frombuffer(bytes.fromhex(data["array"]), dtype=dtype).reshape(data["shape"])
    if "dict" in data:
        return {from_plain(key): from_plain(value) for key, value in data["dict"]}
    (name, items), *_ = data.items()
    return {"tuple": tuple, "list": list}[name](from_plain(item) for item in items)


def _record(path: str) -> Any:
    """The frozen record of that name, of a module that is imported already."""
    module, _, name = path.partition(":")
    found = sys.modules.get(module) if module.startswith("cam_rig.") else None
    kind = getattr(found, name, None)
    frozen = isinstance(kind, type) and getattr(kind, "__dataclass_params__", None)
    if not (frozen and frozen.frozen):
        raise RunError(f"{path}: is not a frozen record of the rig")
    return kind


#: Bytes of a file, at most; those of the shipped scenes have less than a thousandth of it.
MAX_BYTES = 64 * MIB
#: Bytes of the CRC-32 before them, and its end of line.
HEAD = 9


class Checkpoint:
    """States of a node after each of its last ticks, in a file of ``folder``; empty keeps none."""

    def __init__(self, folder: str, node: str) -> None:
        self._folder = Path(folder) if folder else None
        self._node = node
        self._kept: deque[str] = deque(maxlen=TICKS_KEPT.get(node, 1))
        self._newest_ns: int | None = None

    @property
    def enabled(self) -> bool:
        """Whether anything is kept at all."""
        return self._folder is not None

    def save(self, state: Any, stamp_ns: int = 0) -> None:
        """Keep one more state of a rig time, unless it is kept already, and drop the oldest."""
        if self._folder is None:
            return
        if self._newest_ns is not None and stamp_ns < self._newest_ns:
            return
        self._newest_ns = None
        self._kept.append(json.dumps([stamp_ns, to_plain(state)]))
        text, file = f"[{','.join(self._kept)}]", self._file("json")
        if len(text) > MAX_BYTES:  # JSON here is ASCII
            size = len(text) / MIB
            raise RunError(f"{file}: has {size:.3g} MiB; allowed: {MAX_BYTES / MIB:g} MiB")
        _replace(file, f"{crc32(text.encode()):08x}\n{text}")

    def newest(self) -> Any:
        """The newest state that the predecessor kept; None without a predecessor."""
        return next(reversed(self.all()), None)

    def all(self) -> list[Any]:
        """Every state that the predecessor kept, the oldest first."""
        if self._folder is None or not self._file("json").is_file():
            return []
        file = self._file("json")
        try:
            data = read_bytes(file, HEAD + MAX_BYTES, follow=False)
            if data[:HEAD] != b"%08x\n" % crc32(data[HEAD:]):
                raise ValueError("its checksum is another's")
            found = json.loads(data[HEAD:])
            states = [from_plain(state) for _, state in found]
            self._newest_ns = int(found[-1][0])
        except UNREADABLE as error:
            raise RunError(f"{file}: is not a checkpoint of a node ({error})") from None
        self._kept.clear()
        self._kept.extend(json.dumps(kept) for kept in found)
        return states

    def count_start(self) -> None:
        """Count one more start of this node, before it publishes anything."""
        if self._folder is not None:
            _replace(self._file("starts"), str(self._starts(self._node) + 1))

    def starts(self, node: str) -> int:
        """Starts of a node of the run so far; one where no node is started again."""
        return max(1, self._starts(node)) if self._folder is not None else 1

    def _starts(self, node: str) -> int:
        file = self._file("starts", node)
        try:
            with file.open(encoding="ascii") as stream:
                return int(stream.read(20) or 0)
        except FileNotFoundError:
            return 0
        except (OSError, ValueError) as error:
            raise RunError(f"{file}: is not a count of starts ({error})") from None

    def _file(self, kind: str, node: str = "") -> Path:
        assert self._folder is not None
        return self._folder / f"{node or self._node}.{kind}"


def _replace(file: Path, text: str) -> None:
    """Write a file in one step, so that a kill leaves the old one or the new one."""
    part = file.with_name(file.name + ".part")
    try:
        part.write_text(text, encoding="ascii")
        os.replace(part, file)
    except OSError as error:
        raise RunError(f"{file}: cannot be written ({error.strerror})") from None

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

import numpy as np

from cam_rig.errors import CamRigError, RunError
from cam_rig.live.flow_control import TICKS_KEPT

# Immutable records as JSON and back: floats come back bit for bit, a foreign file makes nothing.

#: What `from_plain` raises on data that `to_plain` did not make.
_CONTENTS = (ValueError, LookupError, TypeError, AttributeError, OverflowError, RecursionError)


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
        numbers = np.frombuffer(bytes.fromhex(data["array"]), dtype=np.dtype(data["type"]))
        return numbers.reshape(data["shape"])
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
        is_kept = self._newest_ns is not None and stamp_ns < self._newest_ns
        if self._folder is None or is_kept:
            return
        self._newest_ns = None
        self._kept.append(json.dumps([stamp_ns, to_plain(state)]))
        _replace(self._file("json"), f"[{','.join(self._kept)}]")

    def newest(self) -> Any:
        """The newest state that the predecessor kept; None without a predecessor."""
        return next(reversed(self.all()), None)

    def all(self) -> list[Any]:
        """Every state that the predecessor kept, the oldest first."""
        if self._folder is None or not self._file("json").is_file():
            return []
        file = self._file("json")
        try:
            found = json.loads(file.read_bytes())
            states = [from_plain(state) for _, state in found]
            self._newest_ns = int(found[-1][0])
        except (OSError, CamRigError, *_CONTENTS) as error:
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
        return int(file.read_text(encoding="ascii")) if file.exists() else 0

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

"""Immutable records as JSON and back: floats come back bit for bit, a foreign file makes nothing.

Only numbers, texts, arrays of numbers and the rig's own frozen records are made from it, so a
foreign file can do no more than be refused.
"""

from __future__ import annotations

import sys
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from cam_rig.errors import CamRigError, RunError

#: Kinds of numbers that an array may hold: bool, int, unsigned, float, complex.
NUMBERS = "biufc"
#: What `from_plain` raises on data that `to_plain` did not make.
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
    """The value that `to_plain` was given.

    Raises
    ------
    UNREADABLE : the data are not what `to_plain` makes
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
    """The frozen record of that name, of a module that is imported already."""
    module, _, name = path.partition(":")
    found = sys.modules.get(module) if module.startswith("cam_rig.") else None
    kind = getattr(found, name, None)
    if not (isinstance(kind, type) and is_dataclass(kind) and _is_frozen(kind)):
        raise RunError(f"{path}: is not a frozen record of the rig")
    return kind


def _is_frozen(kind: Any) -> bool:
    return bool(kind.__dataclass_params__.frozen)

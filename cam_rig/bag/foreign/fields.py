"""Access to numbers in a message by a field's path, such as ``position[0]``."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from cam_rig.errors import did_you_mean

#: Largest number of message fields that an error message lists, and largest number of elements that
#: are listed per array.
MAX_NAMED = 24
#: Pattern of one part of the path of a message field: name of the field, and in brackets the index
#: of an array element or the name of a joint.
PART = re.compile(r"(?P<name>\w+)(?:\[(?P<index>[\w/-]+)\])?")


def number_at(message: Any, path: str) -> float:
    """Return the value of a message's field at a path, such as ``wrench.force.z``.

    The index of an array, as in ``position[0]``, may be the name of a joint. Raises ValueError if
    the field at the path is not a number.
    """
    value = message
    for part in path.split("."):
        match, fields = PART.fullmatch(part), getattr(value, "__dataclass_fields__", {})
        if match is None or match["name"] not in fields or match["name"].startswith("_"):
            raise ValueError(_unknown(message, path))
        owner, value = value, getattr(value, match["name"])
        if match["index"] is not None:
            value = _entry(owner, value, match["name"], match["index"])
    if isinstance(value, np.ndarray | list):
        raise ValueError(f"{path!r} is an array of {len(value)}; name one element, as {path}[0]")
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | float | np.number):
        raise ValueError(_unknown(message, path))
    return float(value)


def _entry(owner: Any, values: Any, name: str, index: str) -> Any:
    """Return the element of an array field at an index, or of a named joint.

    `values` is the array, and `name` is its name. `index` is a number from 0, or an entry of the
    list ``name`` of the message `owner`, as in sensor_msgs/JointState. Raises ValueError for any
    other index.
    """
    if not hasattr(values, "__len__"):
        raise ValueError(f"{name!r} is not an array; remove [{index}]")
    names = list(getattr(owner, "name", []))
    if not index.isdigit():
        if index not in names:
            joints = f" or one of {', '.join(names)}" if names else ""
            raise ValueError(
                f"the index of {name!r} must be a number from 0{joints}, got {index!r}"
                f"{did_you_mean(index, names)}"
            )
        index = str(names.index(index))
    if int(index) >= len(values):
        raise ValueError(f"the index of {name!r} must be less than {len(values)}, got {index}")
    return values[int(index)]


def numeric_fields(message: Any, before: str = "") -> Iterator[str]:
    """Yield the paths of all numeric fields of a message, except header and stamp.

    At most `MAX_NAMED` elements of an array are yielded. `before` is the prefix of each path.
    """
    for name in getattr(message, "__dataclass_fields__", {}):
        value, path = getattr(message, name), f"{before}{name}"
        if name.startswith("_") or path in ("header", "stamp"):
            continue
        if hasattr(value, "__dataclass_fields__"):
            yield from numeric_fields(value, f"{path}.")
        elif isinstance(value, np.ndarray):
            yield from (f"{path}[{i}]" for i in range(min(len(value), MAX_NAMED)))
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield path


def only_field(message: Any) -> str:
    """Return the path of the only number of a message, or of its measured value.

    Raises ValueError if there are several numbers and no measured value. The measured value is the
    field range, fluid_pressure or temperature of a sensor message, which also has limits or a
    variance.
    """
    paths = list(numeric_fields(message))
    if len(paths) == 1:
        return paths[0]
    for name in ("range", "fluid_pressure", "temperature"):  # the others are limits, variances
        if name in paths:
            return name
    raise ValueError(f"the field must be named; the message has {_name_list(paths)}")


def _unknown(message: Any, path: str) -> str:
    paths = list(numeric_fields(message))
    return f"no number {path!r}; allowed: {_name_list(paths)}{did_you_mean(path, paths)}"


def _name_list(paths: list[str]) -> str:
    more = len(paths) - MAX_NAMED
    return ", ".join(paths[:MAX_NAMED]) + (f" and {more} more" if more > 0 else "") or "none"

"""What `rows` is in compiled code: arrays. Imported where numba is at work, and nowhere else."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types as untyped_types
from numba.core import cgutils as untyped_cgutils
from numba.extending import intrinsic

from cam_rig.laws import rows
from cam_rig.units import FloatArray

types: Any = untyped_types
cgutils: Any = untyped_cgutils
PASCAL = np.zeros((len(rows.PASCAL), len(rows.PASCAL)))
for _degree, _row in enumerate(rows.PASCAL):
    PASCAL[_degree, : len(_row)] = _row


def zeros(count: int) -> FloatArray:
    """A row of zeros."""
    return np.zeros(count)


def zero_rows(count: int, size: int) -> FloatArray:
    """``(count, size)`` zeros."""
    return np.zeros((count, size))


def binomials(degree: int) -> FloatArray:
    """C(degree, i), i from 0 to ``degree``."""
    if degree < PASCAL.shape[0]:
        row: FloatArray = _borrowed(PASCAL[degree])
        return row
    out, term = np.zeros(degree + 1), 1.0
    for i in range(degree + 1):
        out[i] = term
        term = term * (degree - i) / (i + 1)
    return out


def borrowed(table: Any) -> Any:
    """A table whose arrays are not counted as used: a third of the time is spent on that."""
    return _borrowed(table)


def _without_owners(_context: Any, table: Any) -> Any:
    def without_owner(context: Any, builder: Any, kind: Any, value: Any) -> Any:
        if isinstance(kind, types.Array):
            array = cgutils.create_struct_proxy(kind)(context, builder, value=value)
            for field in ("meminfo", "parent"):
                empty = cgutils.get_null_value(getattr(array, field).type)
                setattr(array, field, empty)
            return array._getvalue()
        if isinstance(kind, types.BaseTuple):
            for i, inner in enumerate(kind.types):
                part = without_owner(context, builder, inner, builder.extract_value(value, i))
                value = builder.insert_value(value, part, i)
        return value

    def made(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return without_owner(context, builder, table, arguments[0])

    changeable = table.copy(readonly=False) if isinstance(table, types.Array) else table
    return changeable(table), made


_borrowed: Any = intrinsic(_without_owners)

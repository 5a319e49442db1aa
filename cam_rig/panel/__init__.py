"""Panel: the rig in a browser, with drawing board, live bench and lab sheets."""

from __future__ import annotations

import math
from typing import TypeGuard


def is_number(value: object) -> TypeGuard[float]:
    """Return True if a value that a page has sent is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)

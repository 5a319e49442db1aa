"""The rig in a browser: drawing board for motion laws, live bench, lab sheets."""

from __future__ import annotations

import math
from typing import TypeGuard


def is_number(given: object) -> TypeGuard[float]:
    """Whether a page has sent a finite number."""
    return isinstance(given, int | float) and not isinstance(given, bool) and math.isfinite(given)

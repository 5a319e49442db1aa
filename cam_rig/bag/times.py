"""Times and durations as text."""

from __future__ import annotations

from datetime import UTC, datetime

from cam_rig.units import NS

#: Seconds from which on a time is printed as a date: 115 days, longer than any recording.
DATE_FROM_S = 1e7


def time_words(seconds: float, begin_ns: int = 0) -> str:
    """Return a time as seconds from the start of the bag (ns), or as its date if it is far."""
    if abs(seconds) < DATE_FROM_S:
        return f"{seconds:.6g} s"
    date = datetime.fromtimestamp(begin_ns // NS + int(seconds), UTC)
    return f"{date:%Y-%m-%d %H:%M:%S} UTC"


def duration_words(seconds: float) -> str:
    """Return a duration in s, min or h."""
    if seconds < 120.0:
        return f"{seconds:.3g} s"
    return f"{seconds / 60.0:.3g} min" if seconds < 7200.0 else f"{seconds / 3600.0:.3g} h"

"""The timelines of a recording: rig time, and how far the cam has turned, in three ways."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import rerun as rr

from cam_rig.arrays import FloatArray

#: Rig time since the start of the run, a duration.
RIG_TIME = "rig_time"
#: Cam angle in whole degrees, a sequence that runs on from turn to turn.
CAM_DEGREES = "cam_degrees"
#: Whole turns of the cam since the start.
TURN = "turn"
#: Degrees within the turn, 0 to 359: here turns lie over each other.
TURN_DEGREES = "turn_degrees"

#: An angle so little (degrees) below a whole degree is that one: rig time is in whole ns, and half
#: a ns is 1.2e-6° at 400 rpm, 3e-5° at 10 000. Samples lie farther from each other than this.
ROUNDING = 1e-4

#: Gives the time columns of rows at times (s) and unwrapped cam angles (rad).
Times = Callable[[FloatArray, FloatArray], list[rr.TimeColumn]]


def time_columns(time: FloatArray, angle: FloatArray) -> list[rr.TimeColumn]:
    """All timelines for rows at ``time`` (s) and unwrapped cam ``angle`` (rad)."""
    nanoseconds = np.rint(time * 1e9).astype("timedelta64[ns]")
    degrees = _whole_degrees(angle)
    turn = degrees // 360
    return [
        rr.TimeColumn(RIG_TIME, duration=nanoseconds),
        rr.TimeColumn(CAM_DEGREES, sequence=degrees),
        rr.TimeColumn(TURN, sequence=turn),
        rr.TimeColumn(TURN_DEGREES, sequence=degrees - 360 * turn),
    ]


def rig_time_alone(time: FloatArray, _angle: FloatArray) -> list[rr.TimeColumn]:
    """Rig time, for a run that is followed: each timeline more is work for the page that draws."""
    return time_columns(time, np.zeros_like(time))[:1]


def within_turn(_time: FloatArray, angle: FloatArray) -> list[rr.TimeColumn]:
    """The angle within the turn alone, for turns that are to lie over each other."""
    return [rr.TimeColumn(TURN_DEGREES, sequence=_whole_degrees(angle) % 360)]


def _whole_degrees(angle: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.floor(np.degrees(angle) + ROUNDING).astype(np.int64)

"""The two timelines of a picture: rig time, and how far the cam has turned."""

from __future__ import annotations

import numpy as np
import rerun as rr

from cam_rig.dynamics import FloatArray

#: Rig time since the start of the run, a duration.
RIG_TIME = "rig_time"
#: Cam angle in whole degrees, a sequence that runs on from turn to turn.
CAM_DEGREES = "cam_degrees"


def time_columns(time: FloatArray, angle: FloatArray) -> list[rr.TimeColumn]:
    """Both timelines for rows at ``time`` (s) and unwrapped cam ``angle`` (rad)."""
    nanoseconds = np.rint(time * 1e9).astype("timedelta64[ns]")
    degrees = np.floor(np.degrees(angle) + 1e-6).astype(np.int64)
    return [
        rr.TimeColumn(RIG_TIME, duration=nanoseconds),
        rr.TimeColumn(CAM_DEGREES, sequence=degrees),
    ]

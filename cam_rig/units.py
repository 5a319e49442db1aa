"""Units that the rig meets beside SI, as factors to SI: each stands here once."""

from __future__ import annotations

import math

#: rad in one turn of the cam.
TURN = 2.0 * math.pi
#: rad/s in one revolution per minute.
RPM = math.pi / 30.0
#: Revolutions per minute in 1 rad/s.
RPM_PER_RAD_S = 30.0 / math.pi
#: ns in one second; times of messages are whole nanoseconds.
NS = 1_000_000_000

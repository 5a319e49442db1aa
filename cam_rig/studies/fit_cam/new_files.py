"""Rig file and scene file for a new cam that was fitted to readings.

A scene with them can be simulated without changes. The files mark all assumed values.
"""

from __future__ import annotations

import math
from typing import Any

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.schema.load import assumed_numbers, quantity_data, to_yaml
from cam_rig.units import to_rpm

#: Cam speeds of the new scene, as fractions of the jump speed of a rigid follower. The last is
#: above the jump speed, so that contact is lost.
SPEED_FRACTIONS = (0.4, 0.6, 0.8, 0.9, 1.1)
#: Cam speeds (rpm) of the new scene if a rigid follower loses contact at every speed or at no
#: speed: usual speeds of a test bench.
DEFAULT_RPM: tuple[float, ...] = (100.0, 200.0, 300.0)
#: Highest cam speed (rpm) of the new scene, above that of any valve train.
MAX_RPM = 20_000.0
#: Smallest number of samples per turn at the highest speed of the new scene: two per degree.
MIN_SAMPLES_PER_TURN = 720
#: Smallest sample rate of the new scene, Hz.
MIN_SAMPLE_RATE = 10_000


def default_rig(name: str, like: RigConfig) -> str:
    """Return the text of a rig file with the parameters of the rig `like`.

    All values are marked as assumed. ``name`` is the name of the new rig.
    """
    data: dict[str, Any] = {"name": name, "title": f"{name}: mass, spring and sound assumed"}
    source = f"the rig {like.name}'s, not this one's: measure it and put it in as given"
    for key, section in (("follower", like.follower), ("radiation", like.radiation)):
        if section is not None:
            data[key] = assumed_numbers(section, source)
    comment = "# Nothing of this rig was measured: its numbers are those of another, as a start.\n"
    return comment + to_yaml(data)


def default_scene(name: str, law: Law, rig: RigConfig) -> tuple[str, tuple[float, ...]]:
    """Return the text of a scene file, and the speeds of the scene in rpm.

    The scene, its cam and its rig are called `name`. The speeds are fractions of the jump speed of
    a rigid follower, rounded to two significant digits, or `DEFAULT_RPM`.
    """
    jump = to_rpm(rigid_jump_speed(law, FollowerParameters.from_rig(rig)))
    contact = "never leaves the cam" if jump else "leaves the cam at any speed"
    rpm, source = DEFAULT_RPM, f"a rigid follower {contact}"
    if 0.0 < jump < math.inf:
        rpm = tuple(sorted({float(f"{min(f * jump, MAX_RPM):.2g}") for f in SPEED_FRACTIONS}))
        source = (
            f"40 to 110 % of the speed at which a rigid follower leaves the cam, {jump:.4g} rpm"
        )
    rate = max(MIN_SAMPLE_RATE, 1000 * math.ceil(MIN_SAMPLES_PER_TURN * max(rpm) / 60.0 / 1000.0))
    at_least = f"at least {MIN_SAMPLES_PER_TURN} samples a turn"
    turns, settle = "one turn to settle, two to measure", "one turn to settle"
    data = {
        "name": name,
        "title": f"{name}, from readings",
        "cams": [name],
        "rig": name,
        "model": "one_mass",
        "sample_rate": quantity_data("assumed", rate, "Hz", at_least),
        "schedule": {
            "speeds": quantity_data("assumed", list(rpm), "rpm", source),
            "turns": quantity_data("assumed", 3, "turns", turns),
            "transient_turns": quantity_data("assumed", 1, "turns", settle),
        },
    }
    return to_yaml(data), rpm

"""A rig and a scene for a cam of one's own: they run as they are, and say what they assume."""

from __future__ import annotations

import math
from typing import Any

from cam_rig.dynamics import FollowerParameters
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.studies.cam_fit.cam_file import quantity, to_yaml
from cam_rig.studies.jump.rigid import rigid_jump_speed
from cam_rig.units import to_rpm

#: Speeds of the scene in parts of the rigid follower's jump speed: the last is above it.
PARTS = (0.4, 0.6, 0.8, 0.9, 1.1)
#: Speeds (rpm) of a cam that no speed lifts its follower off, and the most of any.
SPEEDS, MOST_RPM = (100.0, 200.0, 300.0), 20_000.0
#: Samples a turn at the highest speed, at least, and of any scene a second.
SAMPLES, LEAST_RATE = 720, 10_000


def own_rig(name: str, like: RigConfig) -> str:
    """A rig file with the numbers of another rig, every one of them assumed."""
    data: dict[str, Any] = {"name": name, "title": f"{name}: mass, spring and sound assumed"}
    source = f"the rig {like.name}'s, not this one's: measure it and put it in as given"
    dumped = like.model_dump(exclude_none=True)
    for section in ("follower", "radiation"):
        if section not in dumped:
            continue
        data[section] = {
            key: quantity(
                "assumed", getattr(getattr(like, section), key).raw, value["unit"], source
            )
            for key, value in dumped[section].items()
            if isinstance(value, dict)
        }
    words = "# Nothing of this rig was measured: its numbers are another's, to begin with.\n"
    return words + to_yaml(data)


def own_scene(name: str, law: Law, rig: RigConfig) -> tuple[str, tuple[float, ...]]:
    """A scene file for a cam and a rig of one name, and its speeds in rpm.

    Raises
    ------
    DynamicsError : the law's velocity jumps
    """
    speeds = own_speeds(law, rig)
    rate = max(LEAST_RATE, 1000 * math.ceil(SAMPLES * max(speeds) / 60.0 / 1000.0))
    jump = to_rpm(rigid_jump_speed(law, FollowerParameters.from_rig(rig)))
    above = (
        f"40 to 110 % of the speed at which a rigid follower leaves the cam, {jump:.4g} rpm"
        if math.isfinite(jump)
        else "a rigid follower never leaves the cam"
    )
    turns, settle = "one turn to settle, two to measure", "one turn to settle"
    data = {
        "name": name,
        "title": f"{name}, from readings",
        "cams": [name],
        "rig": name,
        "model": "one_mass",
        "sample_rate": quantity("assumed", rate, "Hz", f"at least {SAMPLES} samples a turn"),
        "program": {
            "speeds": quantity("assumed", list(speeds), "rpm", above),
            "turns": quantity("assumed", 3, "turns", turns),
            "settle_turns": quantity("assumed", 1, "turns", settle),
        },
    }
    return to_yaml(data), speeds


def own_speeds(law: Law, rig: RigConfig) -> tuple[float, ...]:
    """Rising speeds (rpm) of two digits, about the one at which a rigid follower leaves the cam."""
    jump = to_rpm(rigid_jump_speed(law, FollowerParameters.from_rig(rig)))
    if not math.isfinite(jump):
        return SPEEDS
    rounded = {float(f"{min(part * jump, MOST_RPM):.2g}") for part in PARTS}
    return tuple(sorted(rounded))

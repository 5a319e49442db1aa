"""Vibration of several cams at several speeds, and from which speed on each is left."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.torsional.model import from_rig as shaft_of
from cam_rig.studies.cam_set import CamSet
from cam_rig.studies.jump.contact_limit import leaving_speed
from cam_rig.studies.vibration.steady_state import Vibration, require_speeds, vibration
from cam_rig.units import RPM


@dataclass(frozen=True)
class VibrationTable:
    """Measures by cam, one for each speed (rpm).

    ``leaves`` : by cam the jump speed (rpm), beyond which the model holds on a follower that left
    """

    rpm: tuple[float, ...]
    measures: dict[str, list[Vibration]]
    leaves: dict[str, float]

    def at(self, rpm: float) -> dict[str, Vibration]:
        """The measures at one of the speeds."""
        return {cam: row[self.rpm.index(rpm)] for cam, row in self.measures.items()}

    def left(self, rpm: float) -> list[str]:
        """The cams whose follower has left them at a speed."""
        return [cam for cam, leaves in self.leaves.items() if leaves < rpm]

    @property
    def in_contact(self) -> list[int]:
        """Which of the speeds all followers are on their cams at."""
        return [i for i, rpm in enumerate(self.rpm) if not self.left(rpm)]


def vibration_table(
    cam_set: CamSet, rpm: tuple[float, ...], on_cam: Callable[[str], None] = lambda _: None
) -> VibrationTable:
    """Measure every cam at every speed (rpm), each speed once; twist where the rig has a shaft.

    Raises
    ------
    DynamicsError : a speed out of `require_speeds`' limits, or without a steady state
    """
    follower, rpm = FollowerParameters.from_rig(cam_set.rig), tuple(dict.fromkeys(rpm))
    require_speeds(follower, rpm)
    shaft = None if cam_set.rig.shaft is None else shaft_of(cam_set.rig)
    found: dict[str, list[Vibration]] = {}
    for cam, law in cam_set.laws.items():
        on_cam(cam)
        found[cam] = [vibration(law, follower, shaft, speed * RPM) for speed in rpm]
    leaves = {cam: leaving_speed(law, cam_set.rig) / RPM for cam, law in cam_set.laws.items()}
    return VibrationTable(rpm, found, leaves)

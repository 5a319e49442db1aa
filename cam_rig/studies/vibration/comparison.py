"""Vibration of several cams at several speeds, and from which speed on each is left."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.torsional.model import from_rig as shaft_of
from cam_rig.studies.cam_set import CamSet
from cam_rig.studies.jump.contact_lost_speed import contact_lost_speed
from cam_rig.studies.vibration.steady_state import Vibration, require_speeds, vibration
from cam_rig.units import RPM


@dataclass(frozen=True)
class VibrationTable:
    """Measures by cam, one for each speed (rpm).

    ``contact_lost_rpm`` : by cam the jump speed (rpm), beyond which the model no longer holds
    """

    rpm: tuple[float, ...]
    measures: dict[str, list[Vibration]]
    contact_lost_rpm: dict[str, float]

    def at(self, rpm: float) -> dict[str, Vibration]:
        """The measures at one of the speeds."""
        return {cam: row[self.rpm.index(rpm)] for cam, row in self.measures.items()}

    def lost_contact(self, rpm: float) -> list[str]:
        """The cams on which contact is lost at a speed."""
        return [cam for cam, limit in self.contact_lost_rpm.items() if limit < rpm]

    @property
    def in_contact(self) -> list[int]:
        """Which of the speeds all followers are on their cams at."""
        return [i for i, rpm in enumerate(self.rpm) if not self.lost_contact(rpm)]


#: What is said to need a stem that the rig file leaves out.
BY = "the vibration of a mass on its stem"


def vibration_table(
    cam_set: CamSet, rpm: tuple[float, ...], on_cam: Callable[[str], None] = lambda _: None
) -> VibrationTable:
    """Measure every cam at every speed (rpm), each speed once; twist where the rig has a shaft.

    Raises
    ------
    DynamicsError : a speed out of `require_speeds`' limits, or without a steady state
    """
    follower, rpm = FollowerParameters.on_stem(cam_set.rig, BY), tuple(dict.fromkeys(rpm))
    require_speeds(follower, rpm)
    shaft = None if cam_set.rig.shaft is None else shaft_of(cam_set.rig)
    found: dict[str, list[Vibration]] = {}
    for cam, law in cam_set.laws.items():
        on_cam(cam)
        found[cam] = [vibration(law, follower, shaft, speed * RPM) for speed in rpm]
    contact_lost_rpm = {
        cam: contact_lost_speed(law, cam_set.rig) / RPM for cam, law in cam_set.laws.items()
    }
    return VibrationTable(rpm, found, contact_lost_rpm)

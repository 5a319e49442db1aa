"""Contact of several cams on one rig at one speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.dynamics import FollowerParameters
from cam_rig.laws.peaks import Extreme
from cam_rig.profile.motion import Motion
from cam_rig.studies.cam_set import CamSet
from cam_rig.studies.contact.bounds import BaseBounds, base_bounds
from cam_rig.studies.contact.surfaces import ContactCase, contact_case
from cam_rig.units import RPM, TURN


@dataclass(frozen=True, eq=False)
class ContactRow:
    """What a cam's contact comes to over the turn.

    Parameters
    ----------
    case : the cam, its law, and the surfaces
    pressure : Pa, largest Hertz pressure, and where
    load, width : N and m, normal force and width of the contact there
    relative_radius : m, 1/κ of the pair there; of the follower alone where the cam is straight
    sliding : m/s, largest speed of the cam's surface along the follower's, and where
    lost : whether the cam would have to pull somewhere: there is no contact, nor pressure
    bounds : on the base radius
    """

    case: ContactCase
    pressure: Extreme
    load: float
    width: float
    relative_radius: float
    sliding: Extreme
    lost: bool
    bounds: BaseBounds

    @property
    def roller_speed(self) -> float | None:
        """Greatest speed (rad/s) of a roller about its pin, carried along by the cam."""
        surfaces = self.case.surfaces
        return self.sliding.value / surfaces.radius if surfaces.rolls else None


@dataclass(frozen=True)
class ContactTable:
    """Rows by cam, on a rig of that name at one speed (rpm)."""

    rig: str
    rpm: float
    rows: dict[str, ContactRow]


def compare_contacts(cam_set: CamSet, rpm: float) -> ContactTable:
    """The contact of every cam of a set at one speed.

    Raises
    ------
    ProfileError, ReachError : a cam that cannot exist
    """
    rig = FollowerParameters.from_rig(cam_set.rig)
    rows = {
        name: contact_row(contact_case(cam, cam_set.laws[name], rig, rpm * RPM))
        for name, cam in cam_set.cams.items()
    }
    return ContactTable(cam_set.rig.name, rpm, rows)


def contact_row(case: ContactCase) -> ContactRow:
    """All measures of one cam."""
    surfaces, scan = case.surfaces, case.scan
    pressure = scan.greatest_of(surfaces.pressure)
    lightest = -scan.greatest_of(lambda *at: -surfaces.normal_force(*at)).value
    # At a joint the pressure jumps: both sides of it, and the one that presses harder.
    sides = [Motion.at(case.law, np.array([pressure.angle + d])) for d in (-1e-9 * TURN, 0.0)]
    at = max(sides, key=lambda side: surfaces.pressure(side, scan.element.touch(side))[0])
    touch = scan.element.touch(at)
    return ContactRow(
        case=case,
        pressure=pressure,
        load=float(surfaces.normal_force(at, touch)[0]),
        width=float(surfaces.width(at, touch)[0]),
        relative_radius=float(1.0 / surfaces.curvature(touch)[0]),
        sliding=scan.greatest_of(surfaces.sliding),
        lost=lightest <= 0.0,
        bounds=base_bounds(case),
    )

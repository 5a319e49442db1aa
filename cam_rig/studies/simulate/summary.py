"""Summary of a run: one row per cam with levels, lost contact and jump speed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from cam_rig.dynamics.jump.any_follower import find_jump, follower_of
from cam_rig.errors import CamRigError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.show.result import Column
from cam_rig.simulation.by_speed import SpeedRow
from cam_rig.simulation.regression import NoiseCurve

#: Columns of the table of one row per cam, see `CamSummary`.
SUMMARY = (
    Column("cam"),
    Column("speeds", doc="number of speeds of the cam", hidden=True),
    Column("lowest_level", "dB", ".1f", doc="lowest level over the speeds"),
    Column("highest_level", "dB", ".1f", doc="highest level over the speeds"),
    Column("peak_force", "N", ".1f", "peak force", doc="largest of all speeds"),
    Column("jump_speed", "rpm", ".1f", doc="that of cam-rig jump", missing="–"),
    Column("first_lost", "rpm", ".6g", "contact lost from", missing="–"),
    Column("lost", doc="number of speeds with lost contact", hidden=True),
    Column("longest_flight", "ms", ".1f"),
    Column("rms_difference", "dB r.m.s.", ".2f", "difference to published"),
)


@dataclass(frozen=True)
class CamSummary:
    """Summary of the speeds of one cam.

    Parameters
    ----------
    cam : str
        Name of the cam.
    speeds, lost : int
        Number of speeds, and of those at which contact is lost. A model that keeps contact loses it
        where its force is negative.
    lowest_level, highest_level : float or None
        Levels in dB re 20 µPa, or None without sound.
    peak_force : float
        Largest contact force of all speeds, N.
    jump_speed : float or None
        Jump speed in rpm, or None if the cam has none.
    first_lost : float or None
        Lowest speed (rpm) at which contact is lost, or None.
    longest_flight : float
        Longest time off the cam, s.
    rms_difference : float or None
        R.m.s. difference to the published levels in dB, or None without these.
    """

    cam: str
    speeds: int
    lost: int
    lowest_level: float | None
    highest_level: float | None
    peak_force: float
    jump_speed: float | None
    first_lost: float | None
    longest_flight: float
    rms_difference: float | None


def is_contact_lost(row: SpeedRow) -> bool:
    """Return True if the follower flies, or a model that keeps contact has a negative force."""
    return row.flight > 0.0 or row.min_force < 0.0


def jump_speed_of(law: Law, rig: RigConfig) -> float | None:
    """Return the jump speed (rpm) of a law on a rig, or None if there is none."""
    try:
        return find_jump(law, follower_of(rig)).rpm
    except CamRigError:
        return None


def summarise(
    rows: Iterable[SpeedRow], curve: NoiseCurve | None, law: Law, rig: RigConfig
) -> CamSummary:
    """Return the summary of a cam from its rows by speed, which are not empty."""
    rows = list(rows)
    lost = [row.rpm for row in rows if is_contact_lost(row)]
    return CamSummary(
        cam=rows[0].cam,
        speeds=len(rows),
        lost=len(lost),
        lowest_level=None if curve is None else float(curve.level_db.min()),
        highest_level=None if curve is None else float(curve.level_db.max()),
        peak_force=max(row.peak_force for row in rows),
        jump_speed=jump_speed_of(law, rig),
        first_lost=min(lost, default=None),
        longest_flight=max(row.flight for row in rows),
        rms_difference=None if curve is None else curve.rmse_db,
    )

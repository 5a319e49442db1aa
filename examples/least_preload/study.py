"""Lowest preload at which one rigid mass remains in contact with its cam.

The contact force m s″ω² + c s′ω + k s + F₀ depends on the preload F₀ only by this sum. The lowest
preload is therefore that of the rig minus the minimum of the force, which is found on every piece
of the law.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cam_rig.arguments import check_arguments
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.kinetostatic import force_extremes
from cam_rig.laws.cam import CamSet
from cam_rig.show.result import NULL_PROGRESS, Column, Footnote, Progress, Records, Result
from cam_rig.simulation.inputs import Cams, Rig, Speeds, resolve_cams, resolve_speeds
from cam_rig.units import RPM

DEFAULT_RPM = (300.0, 400.0, 500.0)


@dataclass(frozen=True)
class PreloadRow:
    """Lowest preload (N) of a cam at a speed, and the preload of the rig (N)."""

    cam: str
    rpm: float
    least: float
    rig: float

    @property
    def lost(self) -> bool:
        """True if the preload of the rig is too low."""
        return self.rig < self.least


@dataclass(frozen=True, repr=False)
class PreloadResult(Result):
    """Lowest preload of every cam at every speed."""

    schema = "cam_rig.least_preload.1"
    plot_function = f"{__package__}.figures:figure"
    columns: ClassVar = {
        "preloads": (
            Column("cam"),
            Column("rpm", "rpm", "g"),
            Column("least", "N", ".2f", heading="least preload"),
            Column("rig", "N", ".2f", heading="the rig's"),
            Column("lost", hidden=True, doc="whether contact is lost with the rig's"),
        )
    }

    cam_set: CamSet
    rows: tuple[PreloadRow, ...]

    def tables(self) -> list[Records]:
        """Return a table for each speed, with a row per cam."""
        lost = Footnote("The rig's own preload loses contact.", lambda row: row.lost, "*")
        caption = "Least preload that keeps one rigid mass in contact at {rpm:g} rpm"
        return [self.table("preloads", caption, self.rows, lost, group_by="rpm")]


def least_preloads(cam_set: CamSet, speeds: list[float], progress: Progress) -> PreloadResult:
    """Return the lowest preload of each cam at each speed (rpm)."""
    p = FollowerParameters.from_rig(cam_set.rig)
    cases = [(cam, speed) for speed in speeds for cam in cam_set.laws]
    rows = []
    for cam, speed in progress.track(cases):
        force, _ = force_extremes(cam_set.laws[cam], p, speed * RPM)
        rows.append(PreloadRow(cam, speed, p.preload - force, p.preload))
    return PreloadResult(cam_set, tuple(rows))


@check_arguments
def least_preload(
    cams: Cams = None,
    rig: Rig = None,
    rpm: Speeds = DEFAULT_RPM,
    *,
    progress: Progress = NULL_PROGRESS,
) -> PreloadResult:
    """Return the least preload of each cam at each speed.

    The command is ``cam-rig least-preload``.

    >>> import cam_rig
    >>> found = cam_rig.least_preload("poly345", rpm=300)
    """
    return least_preloads(resolve_cams(cams, rig), resolve_speeds(rpm), progress)

"""Jump speeds beside the published ones, and the refit of the rig: as tables and as plain data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from cam_rig.dynamics.jump.any_follower import JumpRow
from cam_rig.paper.jump.refit import Numbers, Refit
from cam_rig.show.tables import Cell, DataTable, Head, tabulate

#: The four numbers of a refit: heading, unit, factor from SI.
REFITTED = {
    "event": ("event angle", "°", 180.0 / math.pi),
    "stem_stiffness": ("stem stiffness", "N/m", 1.0),
    "roller_share": ("mass split, roller", "", 1.0),
    "preload": ("preload", "N", 1.0),
}


def jump_table(
    rows: list[JumpRow],
    caption: str,
    titles: Mapping[str, str] | None = None,
    rigid_rpm: Mapping[str, float] | None = None,
) -> DataTable:
    """One row per cam.

    Parameters
    ----------
    titles : what each cam is called, where that is not its name
    rigid_rpm : jump speed of a rigid follower on each cam
    """
    called, rigid = titles or {}, rigid_rpm or {}
    fitted = any(row.role and row.ramp is None for row in rows)
    return tabulate(
        caption,
        rows,
        (
            (Head("cam"), lambda row: called.get(row.cam, row.cam)),
            (Head("use"), lambda row: "" if row.ramp else row.role),
            (Head("jump speed", "rpm", ".2f"), lambda row: row.found.rpm),
            (Head("paper", "rpm", "g"), lambda row: row.published_rpm),
            (Head("difference", "%", "+.2f"), lambda row: _percent(row.difference)),
            (
                Head("steady state", "rpm", ".2f"),
                lambda row: None if row.steady is None else row.steady.rpm,
            ),
            (Head("rigid follower", "rpm", ".1f"), lambda row: rigid.get(row.cam)),
            (Head("cam angle", "°", ".1f"), lambda row: math.degrees(row.found.angle)),
            (Head("time", "s", ".3f"), lambda row: row.found.time),
            (Head("paper", "s", ".2f"), lambda row: row.published_time),
        ),
        "Fitted: the rig's four unprinted numbers were identified from it. Test: nothing was "
        "fitted to it."
        if fitted
        else "",
        "Cam angle and time: of the first loss of contact at the jump speed.",
        "Rigid follower: one mass on the same spring." if rigid else "",
    )


def _percent(share: float | None) -> float | None:
    return None if share is None else 100.0 * share


def refit_table(found: Refit) -> DataTable:
    """The rig's numbers, the refitted ones, and how well the rounding of Table 2 lets them be."""
    rows = zip(REFITTED.items(), found.deviation.tolist(), strict=True)
    return tabulate(
        "Refit of four numbers to four jump speeds",
        rows,
        (
            (Head("number"), lambda row: row[0][1][0]),
            (Head("unit"), lambda row: row[0][1][1]),
            (Head("rig", "", ".5g"), lambda row: _shown(found.start, row[0][0])),
            (Head("refitted", "", ".5g"), lambda row: _shown(found.numbers, row[0][0])),
            (Head("standard error", "%", ".1f"), lambda row: 100.0 * row[1]),
        ),
        "Standard error: from the rounding of the paper's Table 2 alone, near this solution.",
    )


def solutions_table(found: Refit) -> DataTable:
    """Where each start of the search ended, the best first."""
    return tabulate(
        "Where the searches ended",
        found.solutions,
        (
            (Head("r.m.s. difference", "%", ".2f"), lambda solution: 100.0 * solution[1]),
            *(
                (
                    Head(heading, unit, ".4g"),
                    lambda solution, key=key: _shown(solution[0], key),
                )
                for key, (heading, unit, _) in REFITTED.items()
            ),
        ),
    )


def _shown(numbers: Numbers, key: str) -> Cell:
    return float(getattr(numbers, key)) * REFITTED[key][2]


def to_json(
    rows: list[JumpRow], rig: str | None = None, follower: str | None = None
) -> dict[str, Any]:
    """The jumps as plain data, by cam; the difference is relative.

    ``rig`` and ``follower`` say on what, where one file has but one.
    """
    return {
        row.cam: {
            "rpm": row.found.rpm,
            "published_rpm": row.published_rpm,
            "angle_deg": math.degrees(row.found.angle),
            "time_s": row.found.time,
            "published_time_s": row.published_time,
            "difference": row.difference,
            "steady_rpm": None if row.steady is None else row.steady.rpm,
            "fitted": row.role == "fitted",
            "role": row.role or None,
            "ramp_rpm_per_s": row.ramp,
            "rig": rig,
            "follower": follower,
        }
        for row in rows
    }


# All findings of a report, and the jobs that compute them.

#: The paper's fifth law, whose degree it does not print.
BY_SEGMENTS = "bezier_segments"

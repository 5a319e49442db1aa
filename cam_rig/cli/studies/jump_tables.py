"""Jump speeds as a table, as JSON and in words; and the refit of the rig."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE
from rich.table import Table

from cam_rig.cli.common.console import console
from cam_rig.errors import ConfigError
from cam_rig.studies.jump.comparison import (
    find_jumps,
    require_run,
    rms_words,
    same_ranking,
    turn_of,
)
from cam_rig.studies.jump.published import Reference

if TYPE_CHECKING:
    from cam_rig.schema import PublishedTables
    from cam_rig.studies.cam_set import CamSet
    from cam_rig.studies.jump.comparison import JumpRow
    from cam_rig.studies.jump.refit import Refit


def to_json(rows: list[JumpRow]) -> dict[str, Any]:
    """The table as plain data, by cam."""
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
        }
        for row in rows
    }


def table(rows: list[JumpRow], rig: str) -> Table:
    """One row a cam."""
    out = Table(title=f"Jump speed on {rig}", box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    out.add_column("cam", no_wrap=True)
    names = ("jump\nrpm", "Table 2\nrpm", "off\n%", "steady\nrpm", "angle\n°", "time\ns")
    for name in (*names, "Table 2\ns"):
        out.add_column(name, justify="right", no_wrap=True)
    out.add_column("", no_wrap=True)
    for row in rows:
        out.add_row(
            row.cam,
            f"{row.found.rpm:.2f}",
            "" if row.published_rpm is None else f"{row.published_rpm:g}",
            "" if row.difference is None else f"{100 * row.difference:+.2f}",
            "" if row.steady is None else f"{row.steady.rpm:.2f}",
            f"{math.degrees(row.found.angle):.1f}",
            f"{row.found.time:.3f}",
            "" if row.published_time is None else f"{row.published_time:.2f}",
            "" if row.ramp else row.role,
        )
    return out


def words(rows: list[JumpRow]) -> str:
    """What the comparison with Table 2 says."""
    if any(row.ramp is not None for row in rows):
        return "along a ramp: the speeds of Table 2 are constant ones, so nothing is compared"
    if not any(row.published_rpm for row in rows):
        return "nothing is published of these cams"
    said = [rms_words(rows)]
    if len(rows) > 1:
        said.append(f"ranking {'as' if same_ranking(rows) else 'not as'} published")
    early = [turn_of(row) for row in rows]
    turns = [turn for turn in early if turn is not None]
    ours, theirs = (f"{min(t):.1f} to {max(t):.1f}" for t in zip(*turns, strict=True))
    said.append(f"first lift-off after {ours} turns, published {theirs}")
    return "; ".join(said)


def show_refit(cam_set: CamSet, published: PublishedTables, duration: float) -> None:
    """Fit event angle, stem, split and preload anew, and print them beside the rig's.

    Then what the refitted rig makes of all cams, those that were not fitted among them.

    Raises
    ------
    ConfigError, DynamicsError : the cams are not those of the table; the run is too long
    """
    from cam_rig.dynamics import TwoMassParameters
    from cam_rig.studies.jump.refit import refit, refitted

    require_run(duration)
    parameters = TwoMassParameters.from_rig(cam_set.rig)
    fitted = {cam: published.table_2_jump[cam].rpm for cam in published.table_2_defined}
    if not set(fitted) <= set(cam_set.cams):
        raise ConfigError(
            f"--refit: cams are {', '.join(cam_set.cams)}; needed: {', '.join(fitted)}"
        )
    with console.status("searching") as status:
        found = refit(
            cam_set.cams,
            fitted,
            parameters,
            duration,
            lambda rms: status.update(f"best {100 * rms:.3f} % RMS"),
        )
    console.print(_refit_table(found))
    before, after = found.rms
    console.print(
        f"rig as it is: {100 * before:.2f} % RMS; refitted: {100 * after:.2f} % RMS; "
        f"Table 2 rounds to 5 rpm, which alone makes {100 * found.rounding:.2f} %. ± is one "
        "standard error from that rounding, close about the refitted numbers: it does not reach "
        "to other solutions. " + _solutions_words(found),
        soft_wrap=True,
    )
    known = {
        cam: Reference(row.rpm, row.time_s, "fitted" if cam in fitted else "test")
        for cam, row in published.table_2_jump.items()
    }
    laws, follower = refitted(cam_set.cams, parameters, found.numbers)
    rows = find_jumps(laws, follower, known, duration)
    console.print(table(rows, "the refitted rig"))
    console.print(words(rows), soft_wrap=True)


def _solutions_words(found: Refit) -> str:
    """Where each start ended, and whether the rig's own numbers are as good as the best."""
    ends = "; ".join(
        f"{100 * rms:.2f} % with {math.degrees(n.event):.1f}°, {n.stem_stiffness:.4g} N/m, "
        f"{n.roller_share:.3f}, {n.preload:.1f} N"
        for n, rms in found.solutions
    )
    before, after = found.rms
    alike = before - after < found.rounding
    return f"The starts ended at {ends}." + (
        " The rig's own numbers and the refitted ones differ by less than the rounding: the table "
        "cannot tell these two solutions apart."
        if alike
        else ""
    )


def _refit_table(found: Refit) -> Table:
    out = Table(title="Refit of four numbers to four jump speeds", box=SIMPLE)
    for name in ("number", "rig", "refitted", "sure to"):
        out.add_column(name, justify="left" if name == "number" else "right")
    units = {
        "event": ("event angle [°]", 180.0 / math.pi),
        "stem_stiffness": ("stem [N/m]", 1.0),
        "roller_share": ("roller's share", 1.0),
        "preload": ("preload [N]", 1.0),
    }
    for (key, (name, factor)), sure in zip(units.items(), found.sure, strict=True):
        start, value = getattr(found.start, key), getattr(found.numbers, key)
        out.add_row(
            name.replace("[", "\\["),
            f"{start * factor:.5g}",
            f"{value * factor:.5g}",
            f"± {100 * sure:.1f} %",
        )
    return out

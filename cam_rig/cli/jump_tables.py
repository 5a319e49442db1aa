"""Jump speeds as a table, as JSON and in words; and the refit of the rig."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE
from rich.table import Table

from cam_rig.cli.console import console
from cam_rig.errors import ConfigError
from cam_rig.experiment.jump_table import rms_difference, same_ranking, turn_of

if TYPE_CHECKING:
    from cam_rig.dynamics import TwoMassParameters
    from cam_rig.experiment.jump_refit import Refit
    from cam_rig.experiment.jump_table import JumpRow
    from cam_rig.experiment.lineup import Lineup
    from cam_rig.schema import PublishedTables


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
            "fitted": row.defined,
        }
        for row in rows
    }


def table(rows: list[JumpRow], lineup: Lineup) -> Table:
    """One row a cam."""
    out = Table(
        title=f"Jump speed on {lineup.rig.name}", box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False
    )
    out.add_column("cam", no_wrap=True)
    names = ("jump\nrpm", "Table 2\nrpm", "off\n%", "steady\nrpm", "angle\n°", "time\ns")
    for name in (*names, "Table 2\ns"):
        out.add_column(name, justify="right", no_wrap=True)
    out.add_column("", no_wrap=True)
    for row in rows:
        role = "" if row.published_rpm is None else "fitted" if row.defined else "test"
        out.add_row(
            row.cam,
            f"{row.found.rpm:.2f}",
            "" if row.published_rpm is None else f"{row.published_rpm:g}",
            "" if row.difference is None else f"{100 * row.difference:+.2f}",
            "" if row.steady is None else f"{row.steady.rpm:.2f}",
            f"{math.degrees(row.found.angle):.1f}",
            f"{row.found.time:.3f}",
            "" if row.published_time is None else f"{row.published_time:.2f}",
            role,
        )
    return out


def words(rows: list[JumpRow]) -> str:
    """What the comparison with Table 2 says."""
    if not any(row.published_rpm for row in rows):
        return "nothing is published of these cams"
    said = []
    if any(row.defined for row in rows):
        said.append(f"{100 * rms_difference(rows):.2f} % RMS on the cams that identified the rig")
    if len(rows) > 1:
        said.append(f"ranking {'as' if same_ranking(rows) else 'not as'} published")
    early = [turn_of(row) for row in rows]
    turns = [turn for turn in early if turn is not None]
    ours, theirs = (f"{min(t):.1f} to {max(t):.1f}" for t in zip(*turns, strict=True))
    said.append(f"first lift-off after {ours} turns, published {theirs}")
    return "; ".join(said)


def show_refit(
    lineup: Lineup, published: PublishedTables, parameters: TwoMassParameters, duration: float
) -> None:
    """Fit event angle, stem, split and preload anew, and print them beside the rig's.

    Raises
    ------
    ConfigError : the cams are not those of the table
    """
    from cam_rig.experiment.jump_refit import refit

    fitted = {cam: published.table_2_jump[cam].rpm for cam in published.table_2_defined}
    if not set(fitted) <= set(lineup.cams):
        raise ConfigError(
            f"--refit: cams are {', '.join(lineup.cams)}; needed: {', '.join(fitted)}"
        )
    with console.status("searching") as status:
        found = refit(
            lineup.cams,
            fitted,
            parameters,
            duration,
            lambda rms: status.update(f"best {100 * rms:.3f} % RMS"),
        )
    console.print(_refit_table(found))
    before, after = found.rms
    console.print(
        f"rig as it is: {100 * before:.2f} % RMS; refitted: {100 * after:.2f} % RMS; "
        f"Table 2 rounds to 5 rpm, which alone makes {100 * found.rounding:.2f} %",
        soft_wrap=True,
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

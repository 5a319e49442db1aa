"""cam-rig laws: every displacement law, side by side."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

from cam_rig.cli.common.console import console, user_errors
from cam_rig.cli.common.options import Json
from cam_rig.cli.common.outputs import write_json

if TYPE_CHECKING:
    from rich.table import Table


def laws(
    json_target: Json = None,
) -> None:
    """List the laws with their peaks per unit rise and unit span, and how smoothly they join.

    Continuity Ck: the highest derivative that goes on without a jump where the rise meets a
    dwell (a half-rise: a dwell and constant velocity).

    Examples
    --------
    cam-rig laws

    cam-rig laws --json -
    """
    with user_errors():
        from cam_rig.laws.catalogue import figures
        from cam_rig.laws.named import NAMED_RISES

        console.print(_table())
        write_json({name: asdict(figures(name)) for name in NAMED_RISES}, json_target)


def _table() -> Table:
    from rich.box import SIMPLE
    from rich.table import Table

    from cam_rig.laws.catalogue import figures, free_laws
    from cam_rig.laws.named import NAMED_RISES

    out = Table(box=SIMPLE, padding=(0, 1, 0, 0), caption="peaks for unit rise and unit span")
    out.add_column("law", no_wrap=True)
    out.add_column("from, or by")
    for heading in ("velocity", "acceleration", "jerk"):
        out.add_column(heading, justify="right", no_wrap=True)
    out.add_column("joins")
    for name, rise in NAMED_RISES.items():
        f = figures(name)
        peaks = (f"{p:.4f}" for p in (f.peak_velocity, f.peak_acceleration, f.peak_jerk))
        out.add_row(name, rise.source, *peaks, f"C{f.continuity}")
    out.add_section()
    for name, keys in free_laws().items():
        out.add_row(name, keys or "the level before", "any", "any", "any", "any")
    return out

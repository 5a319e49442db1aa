"""cam-rig laws: every displacement law, side by side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING

from cam_rig.cli.common.console import show, user_errors
from cam_rig.cli.common.options import Csv, Json
from cam_rig.cli.common.outputs import check_outputs, write_csv, write_json

if TYPE_CHECKING:
    from cam_rig.tables import DataTable


def laws(
    json_target: Json = None,
    csv: Csv = None,
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

        check_outputs(json_target, None, csv)
        shown = _table()
        show(shown)
        write_csv([shown], csv)
        write_json({name: asdict(figures(name)) for name in NAMED_RISES}, json_target)


def _table() -> DataTable:
    from cam_rig.laws.catalogue import Figures, figures, free_laws
    from cam_rig.laws.named import NAMED_RISES
    from cam_rig.tables import Cell, Column, tabulate

    rows: list[tuple[str, str, Figures | None]] = [
        *((name, rise.source, figures(name)) for name, rise in NAMED_RISES.items()),
        *((name, keys or "the level before", None) for name, keys in free_laws().items()),
    ]

    def peak(order: str) -> Callable[[tuple[str, str, Figures | None]], Cell]:
        return lambda row: None if row[2] is None else float(getattr(row[2], f"peak_{order}"))

    return tabulate(
        "Peaks for unit rise and unit span",
        rows,
        (
            (Column("law"), lambda row: row[0]),
            (Column("from, or by"), lambda row: row[1]),
            *(
                (Column(order, "", ".4f", "any"), peak(order))
                for order in ("velocity", "acceleration", "jerk")
            ),
            (Column("joins"), lambda row: "any" if row[2] is None else f"C{row[2].continuity}"),
        ),
    )

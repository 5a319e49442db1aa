"""cam-rig laws: every displacement law, side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.cli.common.console import show, user_errors
from cam_rig.cli.common.options import Csv, Json, Plot
from cam_rig.cli.common.outputs import check_outputs, write_csv, write_json, write_plot

if TYPE_CHECKING:
    from cam_rig.laws.catalogue import Figures, RiseFamily
    from cam_rig.tables import DataTable

    Row = tuple[str, str, Figures | None]


def laws(
    family: Annotated[
        str | None,
        typer.Option(help="Only this family of rises: polynomial, start, end (half), classical."),
    ] = None,
    plot: Plot = None,
    json_target: Json = None,
    csv: Csv = None,
) -> None:
    """List the laws with their peaks per unit rise and unit span, and how smoothly they join.

    Continuity Ck: the highest derivative that goes on without a jump where the rise meets a
    dwell (a half-rise: a dwell and constant velocity).

    The plot lays the rises of each family over each other, s to s''' one below the other.

    Examples
    --------
    cam-rig laws

    cam-rig laws --plot out/laws.png

    cam-rig laws --family start --plot out/half_rises.pdf

    cam-rig laws --json -
    """
    with user_errors():
        from cam_rig.laws.catalogue import figures
        from cam_rig.laws.named import NAMED_RISES

        check_outputs(json_target, plot, csv)
        shown = None if family is None else _family(family)
        names = tuple(NAMED_RISES) if shown is None else shown.rises
        table = rises_table(names, with_free=shown is None)
        show(table)
        write_csv([table], csv)
        write_json({name: asdict(figures(name)) for name in names}, json_target)
        if plot is not None:
            from cam_rig.laws.catalogue import families
            from cam_rig.plots.laws.overlay import draw_rises

            columns = families().values() if shown is None else [shown]
            write_plot(plot, lambda part: draw_rises(columns, part))


def rises_table(names: Iterable[str], with_free: bool = False) -> DataTable:
    """Peaks and continuity of named rises; on demand, below them, the laws without fixed ones."""
    from cam_rig.laws.catalogue import figures, free_laws
    from cam_rig.laws.named import NAMED_RISES
    from cam_rig.tables import Cell, Column, tabulate

    rows: list[Row] = [(name, NAMED_RISES[name].source, figures(name)) for name in names]
    if with_free:
        rows += [(name, keys or "the level before", None) for name, keys in free_laws().items()]

    def peak(order: str) -> Callable[[Row], Cell]:
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


def _family(name: str) -> RiseFamily:
    """A family by its name.

    Raises
    ------
    ConfigError : there is none of that name
    """
    from cam_rig.errors import ConfigError, did_you_mean
    from cam_rig.laws.catalogue import families

    found = families()
    if name not in found:
        hint = did_you_mean(name, found)
        raise ConfigError(f"--family {name!r}: no such family{hint}; allowed: {', '.join(found)}")
    return found[name]

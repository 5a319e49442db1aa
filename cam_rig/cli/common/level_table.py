"""A noise comparison as a table, as JSON, and as a plot."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.table import Table

from cam_rig.cli.common.console import console
from cam_rig.cli.common.outputs import write_json, write_plot

if TYPE_CHECKING:  # a second of imports, which `--help` should not pay
    from cam_rig.simulation.levels import NoiseResult
    from cam_rig.simulation.scene import LoadedScene


def to_json(result: NoiseResult, counts: dict[str, int]) -> dict[str, Any]:
    """The comparison as plain data; what is not a number becomes null."""
    return {
        "cams": {
            curve.cam: {
                "rmse_db": curve.rmse_db,
                "coefficients": [c if math.isfinite(c) else None for c in curve.coefficients],
                "rpm": [round(rpm, 9) for rpm in curve.rpm.tolist()],
                "level_db": curve.level_db.tolist(),
                "role": curve.role,
            }
            for curve in result.curves.values()
        },
        "crossover_rpm": result.crossover_rpm,
        "messages": counts,
    }


def table(result: NoiseResult, loaded: LoadedScene) -> Table:
    """Regression, difference to the published one, and what that difference is worth."""
    out = Table(title=f"{loaded.scene.title}: level in dB over x in rpm")
    out.add_column("cam")
    out.add_column("regression")
    out.add_column("RMS difference\nto published", justify="right")
    out.add_column("which is")
    out.add_column("level at ends", justify="right")
    for curve in result.curves.values():
        c0, c1, c2, c3 = curve.coefficients
        rmse = "" if curve.rmse_db is None else f"{curve.rmse_db:.2f} dB"
        out.add_row(
            curve.cam,
            f"{c0:.5g} {c1:+.5g} x {c2:+.5g} x² {c3:+.5g} x³"
            if math.isfinite(c0)
            else "needs four speeds",
            rmse,
            "" if curve.rmse_db is None else curve.role,
            f"{curve.level_db[0]:.1f} … {curve.level_db[-1]:.1f} dB",
        )
    return out


def show(
    result: NoiseResult,
    loaded: LoadedScene,
    counts: dict[str, int],
    json_target: str | None,
    plot: Path | None,
) -> None:
    """Print the table, draw the plot, write the JSON."""
    console.print(table(result, loaded))
    if loaded.published is not None and set(loaded.published.crossover.between) <= set(
        result.curves
    ):
        found = "none" if result.crossover_rpm is None else f"{result.crossover_rpm:.1f} rpm"
        names = " and ".join(loaded.published.crossover.between)
        console.print(
            f"{names} cross at {found} (published: {loaded.published.crossover.rpm:g} rpm)"
        )
    if plot is not None:
        from cam_rig.plots.noise import draw

        write_plot(plot, lambda part: draw(result, loaded, part))
    write_json(to_json(result, counts), json_target)

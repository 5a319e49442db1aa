"""A run's rows by speed and its noise comparison: as tables, JSON and CSV, and as a plot."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cam_rig.show import terminal as console
from cam_rig.show.command import write_csv, write_json, write_plot
from cam_rig.show.tables import DataTable, Head, tabulate

if TYPE_CHECKING:
    from cam_rig.simulation.regression import NoiseCurve, NoiseResult
    from cam_rig.simulation.scene import LoadedScene
    from cam_rig.simulation.scene_run import SceneRun


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


def table(result: NoiseResult, loaded: LoadedScene) -> DataTable:
    """Regression, difference to the published one, and what that difference is worth."""
    from cam_rig.simulation.scene import RELATIVE_NOTE

    return tabulate(
        f"{loaded.scene.title}: level in dB over x in rpm",
        result.curves.values(),
        (
            (Head("cam"), lambda curve: curve.cam),
            (Head("regression"), _regression),
            (
                Head("difference to published", "dB r.m.s.", ".2f"),
                lambda curve: curve.rmse_db,
            ),
            (Head("role"), _role),
            (Head("first level", "dB", ".1f"), lambda curve: float(curve.level_db[0])),
            (Head("last level", "dB", ".1f"), lambda curve: float(curve.level_db[-1])),
        ),
        "" if loaded.calibrated else RELATIVE_NOTE,
    )


def _role(curve: NoiseCurve) -> str:
    """What the comparison is worth, or that no level is; nothing where nothing is compared."""
    from cam_rig.simulation.scene import RELATIVE

    return "" if curve.rmse_db is None and curve.role != RELATIVE else curve.role


def _regression(curve: NoiseCurve) -> str:
    c0, c1, c2, c3 = curve.coefficients
    if not math.isfinite(c0):
        return "needs four speeds"
    return f"{c0:.5g} {c1:+.5g} x {c2:+.5g} x² {c3:+.5g} x³"


def show(
    run: SceneRun,
    json_target: str | None,
    plot: Path | None,
    csv: Path | None = None,
) -> None:
    """Print the tables, draw the plot, write JSON and CSV."""
    from cam_rig.simulation.by_speed import speed_table

    result, loaded = run.noise, run.loaded
    rate = int(loaded.scene.sample_rate.si)
    by_speed = speed_table(run.by_speed, loaded.scene.title, rate)
    if by_speed.rows:  # a bag may have no samples
        console.show(by_speed)
    console.show(table(result, loaded))
    if loaded.published is not None and set(loaded.published.crossover.between) <= set(
        result.curves
    ):
        found = "none" if result.crossover_rpm is None else f"{result.crossover_rpm:.1f} rpm"
        names = " and ".join(loaded.published.crossover.between)
        console.say(f"{names} cross at {found} (published: {loaded.published.crossover.rpm:g} rpm)")
    if plot is not None:
        from cam_rig.simulation.figures import figure

        write_plot(plot, lambda: figure(result, loaded))
    speeds = {"speeds": [row.plain() for row in run.by_speed]}
    write_json(to_json(result, run.counts) | speeds, json_target)
    write_csv([by_speed], csv)

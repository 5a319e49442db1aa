"""Measured run and model as a Rerun recording over the cam angle, one time step per speed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from cam_rig.show import looks as colours
from cam_rig.show.chart import SPEED, Axes, chart_stream, round_marks
from cam_rig.show.looks import EQUAL, is_rounding, reach, title_of
from cam_rig.studies.compare.comparison import QUANTITIES, SpeedDeparture, group_by_cam
from cam_rig.studies.compare.study import RunComparison

#: Names of the charts of each quantity (lift or force), in the order in which they are placed.
CHARTS = ("measured", "model", "difference")
#: Line width of a curve as a radius in screen points. Rerun uses negative values for screen units.
STROKE = -1.4
#: Width of a chart in units of the Rerun view in which its curves are drawn.
WIDTH = 160.0
#: Height of a chart in units of the Rerun view in which its curves are drawn.
HEIGHT = 120.0
#: Vertical distance of an axis label from its tick, as a fraction of the chart's height.
RAISED = 0.06
#: Ticks of the cam angle axis: label by angle in degrees.
DEGREES = {float(angle): f"{angle}°" for angle in range(0, 361, 90)}
#: Free space at the right of a chart for one half of the last axis label, as a fraction of the
#: width.
RIGHT_MARGIN = 0.1
#: Free space below a chart for its axis labels, as a fraction of its height.
BOTTOM_MARGIN = 0.16


def save_real_run(comparison: RunComparison, path: Path) -> None:
    """Write the last turn at each speed as a Rerun recording (``.rrd``).

    It contains run and model. The time line of the recording is the cam speed.
    """
    tabs = real_run_tabs(comparison)
    title = f"Measured and model: {', '.join(str(tab.name) for tab in tabs)}"
    with chart_stream(path, title, tabs, SPEED) as stream:
        for rows in group_by_cam(comparison.speeds):
            for name in QUANTITIES:
                _draw(stream, rows, name, _axes(rows, name))


def real_run_tabs(comparison: RunComparison) -> list[rrb.Vertical]:
    """Return the tabs of the Rerun recording, one per cam.

    A tab has one row of charts (measured, model, difference) per measured quantity.
    """
    tabs = []
    for rows in group_by_cam(comparison.speeds):
        charts = [
            rrb.Horizontal(*(_view(rows, name, chart, axes) for chart, axes in views.items()))
            for name in QUANTITIES
            if (views := _axes(rows, name))
        ]
        tabs.append(rrb.Vertical(*charts, name=title_of(comparison.loaded.titles, rows[0].cam)))
    return tabs


def real_run_entity(cam: str, quantity: str, chart: str) -> str:
    """Return the Rerun entity path of a chart of one quantity of a cam.

    `chart` is "measured", "model" or "difference".
    """
    return f"real_run/{cam}/{quantity}/{chart}"


def _view(
    rows: Sequence[SpeedDeparture], quantity: str, chart: str, axes: Axes
) -> rrb.Spatial2DView:
    """Return the Rerun view of one chart, with its title.

    ``rows`` are the results of one cam, one per speed. ``chart`` is "measured", "model" or
    "difference", and ``quantity`` is lift or force.
    """
    text, unit, _, difference_unit, *_ = QUANTITIES[quantity]
    title = f"{text} [{unit}]: {chart}"
    if chart == "difference":
        title = f"{text}: difference [{difference_unit}]"
        if is_rounding(_largest(rows, quantity)):
            title = f"{text}: {EQUAL}"
    return axes.view(
        real_run_entity(rows[0].cam, quantity, chart), title, RIGHT_MARGIN, BOTTOM_MARGIN
    )


def _axes(rows: Sequence[SpeedDeparture], quantity: str) -> dict[str, Axes]:
    """Return the axes of each chart of a quantity by chart name.

    Measured and model have equal axes. The result is empty if the quantity was not measured.
    """
    turns = [row.drawn[quantity] for row in rows if quantity in row.drawn]
    if not turns:
        return {}
    factor, limit = QUANTITIES[quantity].factor, reach(_largest(rows, quantity))
    values = np.hstack([np.hstack([turn.measured, turn.model]) for turn in turns]) * factor
    y = float(values.min()), float(max(values.max(), values.min() + 1e-9))
    curve_axes = Axes((0.0, 360.0), y, WIDTH, HEIGHT, RAISED)
    return {
        "measured": curve_axes,
        "model": curve_axes,
        "difference": Axes((0.0, 360.0), (-limit, limit), WIDTH, HEIGHT, RAISED),
    }


def _largest(rows: Sequence[SpeedDeparture], quantity: str) -> float:
    """Return the largest difference of a quantity over all speeds of a cam.

    It is in the displayed unit of differences, and 0 if the quantity was not measured.
    """
    turns = [row.drawn[quantity] for row in rows if quantity in row.drawn]
    differences = [float(np.abs(turn.difference).max()) for turn in turns]
    return QUANTITIES[quantity].difference_factor * max(differences, default=0.0)


def _draw(
    stream: rr.RecordingStream, rows: Sequence[SpeedDeparture], quantity: str, axes: dict[str, Axes]
) -> None:
    """Draw the axes and the curves of a quantity at all speeds of a cam."""
    _, unit, factor, difference_unit, difference_factor, colour = QUANTITIES[quantity]
    for chart, chart_axes in axes.items():
        view = real_run_entity(rows[0].cam, quantity, chart)
        marks = round_marks(*chart_axes.y, difference_unit if chart == "difference" else unit)
        chart_axes.draw(stream, f"{view}/axes", DEGREES, marks)
    for row in rows:
        turn = row.drawn.get(quantity)
        if turn is None:
            continue
        stream.set_time(SPEED, sequence=round(row.rpm))
        curves = {
            "measured": (turn.measured * factor, colour),
            "model": (turn.model * factor, colours.LAW),
            "difference": (turn.difference * difference_factor, colours.LANDING),
        }
        for chart, (values, shade) in curves.items():
            points = axes[chart].place(turn.degrees, values)
            line = rr.LineStrips2D([points], colors=shade, radii=STROKE)
            stream.log(f"{real_run_entity(row.cam, quantity, chart)}/curve", line)

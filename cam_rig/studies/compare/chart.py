"""A run and its model as a Rerun recording: side by side over the cam angle, speed by speed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from cam_rig.show import looks as colours
from cam_rig.show.chart import SPEED, Axes, chart_stream, round_marks
from cam_rig.show.looks import EQUAL, is_rounding, reach, title_of
from cam_rig.studies.compare.comparison import QUANTITIES, SpeedDeparture, by_cam
from cam_rig.studies.compare.study import RunComparison

#: Each is drawn as measured, of the model, and their difference.
CHARTS = ("measured", "model", "difference")
#: Radius on the screen of a curve, size of a chart's plane, and how words stand beside it.
STROKE, WIDTH, HEIGHT, RAISED = -1.4, 160.0, 120.0, 0.06
#: Marks of the cam angle, °; room for half of the last one, and for those below, as shares.
DEGREES = {float(at): f"{at}°" for at in range(0, 361, 90)}
RIGHT, BELOW = 0.1, 0.16


def save_real_run(found: RunComparison, path: Path) -> None:
    """Write a comparison as a ``.rrd`` file: over the cam's speed, the last turn of each."""
    plans = real_run_tabs(found)
    title = f"Measured and model: {', '.join(str(tab.name) for tab in plans)}"
    with chart_stream(path, title, plans, SPEED) as stream:
        for here in by_cam(found.speeds):
            for name in QUANTITIES:
                _draw(stream, here, name, _axes(here, name))


def real_run_tabs(found: RunComparison) -> list[rrb.Vertical]:
    """A tab for each cam: a row for each quantity that was measured."""
    tabs = []
    for here in by_cam(found.speeds):
        charts = [
            rrb.Horizontal(*(_view(here, name, chart, axes) for chart, axes in places.items()))
            for name in QUANTITIES
            if (places := _axes(here, name))
        ]
        tabs.append(rrb.Vertical(*charts, name=title_of(found.loaded.titles, here[0].cam)))
    return tabs


def real_run_entity(cam: str, quantity: str, chart: str) -> str:
    """Where a chart is: "measured", "model" or "difference" of a quantity of a cam."""
    return f"real_run/{cam}/{quantity}/{chart}"


def _view(
    rows: Sequence[SpeedDeparture], quantity: str, chart: str, axes: Axes
) -> rrb.Spatial2DView:
    words, unit, _, small, *_ = QUANTITIES[quantity]
    title = f"{words} [{unit}]: {chart}"
    if chart == "difference":
        title = f"{words}: difference [{small}]"
        if is_rounding(_largest(rows, quantity)):
            title = f"{words}: {EQUAL}"
    return axes.view(real_run_entity(rows[0].cam, quantity, chart), title, RIGHT, BELOW)


def _axes(rows: Sequence[SpeedDeparture], quantity: str) -> dict[str, Axes]:
    """Axes by chart, the same for measured and model; none where it was not measured."""
    turns = [row.drawn[quantity] for row in rows if quantity in row.drawn]
    if not turns:
        return {}
    factor, apart = QUANTITIES[quantity][2], reach(_largest(rows, quantity))
    both = np.hstack([np.hstack([turn.measured, turn.model]) for turn in turns]) * factor
    y = float(both.min()), float(max(both.max(), both.min() + 1e-9))
    same = Axes((0.0, 360.0), y, WIDTH, HEIGHT, RAISED)
    return {
        "measured": same,
        "model": same,
        "difference": Axes((0.0, 360.0), (-apart, apart), WIDTH, HEIGHT, RAISED),
    }


def _largest(rows: Sequence[SpeedDeparture], quantity: str) -> float:
    """The largest difference, in the unit that differences are shown in."""
    turns = [row.drawn[quantity] for row in rows if quantity in row.drawn]
    found = [float(np.abs(turn.difference).max()) for turn in turns]
    return QUANTITIES[quantity][4] * max(found, default=0.0)


def _draw(
    stream: rr.RecordingStream, rows: Sequence[SpeedDeparture], quantity: str, axes: dict[str, Axes]
) -> None:
    _, unit, factor, small, fine, colour = QUANTITIES[quantity]
    for chart, place in axes.items():
        view = real_run_entity(rows[0].cam, quantity, chart)
        words = round_marks(*place.y, small if chart == "difference" else unit)
        place.draw(stream, f"{view}/axes", DEGREES, words)
    for row in rows:
        turn = row.drawn.get(quantity)
        if turn is None:
            continue
        stream.set_time(SPEED, sequence=round(row.rpm))
        curves = {
            "measured": (turn.measured * factor, colour),
            "model": (turn.model * factor, colours.LAW),
            "difference": (turn.difference * fine, colours.LANDING),
        }
        for chart, (values, shade) in curves.items():
            points = axes[chart].place(turn.degrees, values)
            line = rr.LineStrips2D([points], colors=shade, radii=STROKE)
            stream.log(f"{real_run_entity(row.cam, quantity, chart)}/curve", line)

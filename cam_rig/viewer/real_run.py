"""A run and its model as a Rerun recording: side by side over the cam angle, speed by speed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from cam_rig.drawing import colours
from cam_rig.studies.real_run.comparison import OverTurn, SpeedDeparture
from cam_rig.viewer.charts.axes import Axes, round_marks
from cam_rig.viewer.orders import SPEED
from cam_rig.viewer.recording import APPLICATION, name_recording
from cam_rig.viewer.rrd_file import require_free, rrd_stream

#: Quantities with the unit that is shown, factor to it, colour.
QUANTITIES = {
    "lift": ("mm", 1e3, colours.LIFT),
    "force": ("N", 1.0, colours.FORCE),
}
#: Each is drawn as measured, of the model, and their difference.
CHARTS = ("measured", "model", "difference")
#: Radius on the screen of a curve, and size of a chart's plane.
STROKE, WIDTH, HEIGHT = -1.4, 160.0, 120.0
#: Marks of the cam angle, °.
DEGREES = {0.0: "0", 90.0: "90", 180.0: "180", 270.0: "270", 360.0: "360°"}


def save_real_run(rows: Sequence[SpeedDeparture], path: Path) -> None:
    """Write a comparison as a ``.rrd`` file that appears when it is whole.

    The timeline is the cam's speed: each speed shows its last turn.

    Raises
    ------
    CamRigError : the file cannot have this name, or cannot be written
    """
    require_free(path, overwrite=True)
    cams = list(dict.fromkeys(row.cam for row in rows))
    plans = []
    for cam in cams:
        here = [row for row in rows if row.cam == cam]
        charts = [
            rrb.Horizontal(*(_view(cam, name, chart, axes) for chart, axes in found.items()))
            for name in QUANTITIES
            if (found := _axes(here, name))
        ]
        plans.append(rrb.Vertical(*charts, name=cam))
    panels = rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed")
    timeline = rrb.TimePanel(state="collapsed", timeline=SPEED)
    views = rrb.Tabs(*plans) if len(plans) > 1 else plans[0]
    plan = rrb.Blueprint(views, *panels, timeline, auto_views=False, auto_layout=False)
    with rrd_stream(path, APPLICATION, plan) as stream:
        name_recording(stream, f"Measured and model: {', '.join(cams)}")
        for cam in cams:
            here = [row for row in rows if row.cam == cam]
            for name in QUANTITIES:
                _draw(stream, here, name, _axes(here, name))


def real_run_entity(cam: str, quantity: str, chart: str) -> str:
    """Where a chart is: "measured", "model" or "difference" of a quantity of a cam."""
    return f"real_run/{cam}/{quantity}/{chart}"


def _view(cam: str, quantity: str, chart: str, axes: Axes) -> rrb.Spatial2DView:
    x, y = axes.bounds()
    unit = QUANTITIES[quantity][0]
    title = f"{quantity} [{unit}]: {chart}"
    return rrb.Spatial2DView(
        origin=real_run_entity(cam, quantity, chart),
        name=title,
        visual_bounds=rrb.VisualBounds2D(x_range=x, y_range=y),
    )


def _axes(rows: Sequence[SpeedDeparture], quantity: str) -> dict[str, Axes]:
    """Axes by chart, the same for measured and model; none where it was not measured."""
    turns = [turn for row in rows if (turn := _turn(row, quantity)) is not None]
    if not turns:
        return {}
    factor = QUANTITIES[quantity][1]
    both = np.hstack([np.hstack([turn.measured, turn.model]) for turn in turns]) * factor
    apart = float(max(np.abs(turn.difference).max() for turn in turns)) * factor
    apart = max(apart, 1e-9 * float(np.ptp(both)), 1e-12)
    y = float(both.min()), float(max(both.max(), both.min() + 1e-9))
    same = Axes((0.0, 360.0), y, WIDTH, HEIGHT)
    return {
        "measured": same,
        "model": same,
        "difference": Axes((0.0, 360.0), (-apart, apart), WIDTH, HEIGHT),
    }


def _turn(row: SpeedDeparture, quantity: str) -> OverTurn | None:
    return row.lift_turn if quantity == "lift" else row.force_turn


def _draw(
    stream: rr.RecordingStream,
    rows: Sequence[SpeedDeparture],
    quantity: str,
    axes: dict[str, Axes],
) -> None:
    unit, factor, colour = QUANTITIES[quantity]
    for chart, place in axes.items():
        view = real_run_entity(rows[0].cam, quantity, chart)
        place.draw(stream, f"{view}/axes", DEGREES, round_marks(*place.y, unit))
    for row in rows:
        turn = _turn(row, quantity)
        if turn is None:
            continue
        stream.set_time(SPEED, sequence=round(row.rpm))
        curves = {
            "measured": (turn.measured, colour),
            "model": (turn.model, colours.LAW),
            "difference": (turn.difference, colours.LANDING),
        }
        for chart, (values, shade) in curves.items():
            points = axes[chart].place(turn.degrees, values * factor)
            line = rr.LineStrips2D([points], colors=shade, radii=STROKE)
            stream.log(f"{real_run_entity(row.cam, quantity, chart)}/curve", line)

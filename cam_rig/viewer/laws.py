"""Laws over each other as a Rerun recording: s, s', s'' and s''' of cams, or of bare rises."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from cam_rig.drawing.cam_looks import of_cam
from cam_rig.laws.curves import ORDERS, LawCurves
from cam_rig.viewer.charts.axes import Axes, round_marks
from cam_rig.viewer.recording import APPLICATION, name_recording
from cam_rig.viewer.rrd_file import require_free, rrd_stream

#: Charts from the top: names, and what a value is beside its unit of lift.
CHARTS = ("lift", "velocity", "acceleration", "jerk")
#: Radius on the screen, and height of a chart of width 160.
STROKE, HEIGHT = -1.2, 40.0
#: Room above the highest and below the lowest value, as a share of their distance.
ROOM = 0.06


def save_laws(curves: Sequence[LawCurves], along: str, units: Sequence[str], path: Path) -> None:
    """Write the curves as a ``.rrd`` file that appears when it is whole.

    Parameters
    ----------
    along : unit of their x
    units : of s to s''' as the curves have them, four

    Raises
    ------
    CamRigError : the file cannot have this name, or cannot be written
    """
    require_free(path, overwrite=True)
    charts = [_axes(curves, order) for order in ORDERS]
    views = [_view(order, axes, units[order]) for order, axes in enumerate(charts)]
    panels = (
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="hidden"),
    )
    plan = rrb.Blueprint(rrb.Vertical(*views), *panels, auto_views=False, auto_layout=False)
    with rrd_stream(path, APPLICATION, plan) as stream:
        name_recording(stream, f"Laws: {', '.join(curve.name for curve in curves)}")
        for order, axes in enumerate(charts):
            x, y = round_marks(*axes.x, along), round_marks(*axes.y, units[order])
            axes.draw(stream, f"{entity(order)}/axes", x, y)
            for i, curve in enumerate(curves):
                _draw(stream, axes, order, curve, i, len(curves))


def entity(order: int) -> str:
    """Where the chart of a derivative is."""
    return f"laws/{CHARTS[order]}"


def _axes(curves: Sequence[LawCurves], order: int) -> Axes:
    values = np.concatenate([curve.motion[order] for curve in curves])
    low, high = float(values.min()), float(values.max())
    room = ROOM * (high - low) or 1.0
    ends = [(float(curve.x[0]), float(curve.x[-1])) for curve in curves]
    x = min(end[0] for end in ends), max(end[1] for end in ends)
    return Axes(x, (low - room, high + room), height=HEIGHT)


def _view(order: int, axes: Axes, unit: str) -> rrb.Spatial2DView:
    x, y = axes.bounds()
    bounds = rrb.VisualBounds2D(x_range=x, y_range=y)
    name = f"{CHARTS[order].capitalize()} [{unit}]"
    return rrb.Spatial2DView(origin=entity(order), name=name, visual_bounds=bounds)


def _draw(
    stream: rr.RecordingStream, axes: Axes, order: int, curve: LawCurves, i: int, count: int
) -> None:
    """One curve, with its name on it in the first chart, each at another place along x."""
    colour = of_cam(curve.name)
    points = axes.place(curve.x, curve.motion[order])
    where = f"{entity(order)}/{curve.name}"
    stream.log(where, rr.LineStrips2D([points], colors=colour, radii=STROKE), static=True)
    if order == 0:
        at = points[[round((i + 1) / (count + 1) * (len(points) - 1))]]
        name = rr.Points2D(at, labels=[curve.name], show_labels=True, colors=colour, radii=-2.0)
        stream.log(f"{where}/name", name, static=True)

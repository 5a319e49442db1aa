"""Rerun charts of several laws: s, s', s'' and s''' of cams or of rises."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from cam_rig.laws.catalogue import ORDERS, LawCurves
from cam_rig.show.chart import Axes, chart_stream, round_marks
from cam_rig.show.looks import of_cam, title_of

#: Names of the four charts, by the order of the derivative.
CHARTS = ("lift", "velocity", "acceleration", "jerk")
#: Line width of a curve as a radius in screen points. Rerun uses negative values for screen units.
STROKE = -1.2
#: Height of a chart in units of the Rerun view, in which its width is 160.
HEIGHT = 85.0
#: Height of an axis label of y above its tick, as a fraction of a chart's height.
RAISED = 0.07
#: Free space at the right of a chart for half of the last axis label, as a fraction of its width.
LABELS_RIGHT = 0.08
#: Free space below a chart for the axis labels, as a fraction of its height.
LABELS_BELOW = 0.19
#: Ticks of the cam angle axis over one turn: label by angle in degrees.
DEGREES = {float(degrees): f"{degrees}°" for degrees in range(0, 361, 90)}
#: Free space above the largest and below the smallest value, as a fraction of their difference.
VALUE_MARGIN = 0.06


def save_laws(
    curves: Sequence[LawCurves],
    along: str,
    units: Sequence[str],
    path: Path,
    titles: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Write curves of laws as a Rerun recording (``.rrd``).

    The file appears only when it is complete.

    Parameters
    ----------
    curves : sequence of LawCurves
        The curves.
    along : str
        Unit of their x.
    units : sequence of str
        The four units of s to s''' in the curves.
    path : Path
        File to write.
    titles : mapping
        Titles of cams (default: their names as text).
    """
    names = [title_of(titles, curve.name) for curve in curves]
    charts = [_axes(curves, order) for order in ORDERS]
    views = [
        axes.view(
            entity(order),
            f"{CHARTS[order].capitalize()} [{units[order]}]",
            LABELS_RIGHT,
            LABELS_BELOW,
        )
        for order, axes in enumerate(charts)
    ]
    grid = rrb.Grid(*views, grid_columns=2)
    with chart_stream(path, f"Laws: {', '.join(names)}", [grid]) as stream:
        for order, axes in enumerate(charts):
            x = DEGREES if along == "°" else round_marks(*axes.x, along)
            axes.draw(stream, f"{entity(order)}/axes", x, round_marks(*axes.y, ""))
            for i, curve in enumerate(curves):
                curve_path, colour = f"{entity(order)}/{curve.name}", of_cam(curve.name)
                points = axes.place(curve.x, curve.motion[order])
                strips = rr.LineStrips2D([points], colors=colour, radii=STROKE)
                stream.log(curve_path, strips, static=True)
                if order == 0:  # the label is on the curve
                    label_point = points[[round((i + 1) / (len(curves) + 1) * (len(points) - 1))]]
                    style: dict[str, Any] = {"colors": colour, "radii": -2.0, "show_labels": True}
                    label = rr.Points2D(label_point, labels=[names[i]], **style)
                    stream.log(f"{curve_path}/name", label, static=True)


def entity(order: int) -> str:
    """Return the Rerun entity path of the chart of a derivative of the given order."""
    return f"laws/{CHARTS[order]}"


def _axes(curves: Sequence[LawCurves], order: int) -> Axes:
    """Return the axes of the chart of a derivative, common to all curves."""
    values = np.concatenate([curve.motion[order] for curve in curves])
    low, high = float(values.min()), float(values.max())
    margin = VALUE_MARGIN * (high - low) or 1.0
    ends = [(float(curve.x[0]), float(curve.x[-1])) for curve in curves]
    x = min(end[0] for end in ends), max(end[1] for end in ends)
    return Axes(x, (low - margin, high + margin), height=HEIGHT, raised=RAISED)

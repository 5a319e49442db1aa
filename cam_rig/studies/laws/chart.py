"""Laws over each other as a Rerun recording: s, s', s'' and s''' of cams, or of bare rises."""

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

#: Charts from the top: names, and what a value is beside its unit of lift.
CHARTS = ("lift", "velocity", "acceleration", "jerk")
#: Radius on the screen, height of a chart of width 160, and how words stand beside it.
STROKE, HEIGHT, RAISED = -1.2, 85.0, 0.07
#: Room for half of the last word, and for the words below a chart, as shares of its sides.
RIGHT, BELOW = 0.08, 0.19
#: Marks of a turn.
DEGREES = {float(at): f"{at}°" for at in range(0, 361, 90)}
#: Room above the highest and below the lowest value, as a share of their distance.
ROOM = 0.06


def save_laws(
    curves: Sequence[LawCurves],
    along: str,
    units: Sequence[str],
    path: Path,
    titles: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Write the curves as a ``.rrd`` file that appears when it is whole.

    along : unit of their x
    units : of s to s''' as the curves have them, four
    titles : what cams are called, where not by their names in words
    """
    names = [title_of(titles, curve.name) for curve in curves]
    charts = [_axes(curves, order) for order in ORDERS]
    views = [
        axes.view(entity(order), f"{CHARTS[order].capitalize()} [{units[order]}]", RIGHT, BELOW)
        for order, axes in enumerate(charts)
    ]
    grid = rrb.Grid(*views, grid_columns=2)
    with chart_stream(path, f"Laws: {', '.join(names)}", [grid]) as stream:
        for order, axes in enumerate(charts):
            x = DEGREES if along == "°" else round_marks(*axes.x, along)
            axes.draw(stream, f"{entity(order)}/axes", x, round_marks(*axes.y, ""))
            for i, curve in enumerate(curves):
                where, colour = f"{entity(order)}/{curve.name}", of_cam(curve.name)
                points = axes.place(curve.x, curve.motion[order])
                strips = rr.LineStrips2D([points], colors=colour, radii=STROKE)
                stream.log(where, strips, static=True)
                if order == 0:  # the name stands on the curve
                    at = points[[round((i + 1) / (len(curves) + 1) * (len(points) - 1))]]
                    look: dict[str, Any] = {"colors": colour, "radii": -2.0, "show_labels": True}
                    stream.log(
                        f"{where}/name", rr.Points2D(at, labels=[names[i]], **look), static=True
                    )


def entity(order: int) -> str:
    """Where the chart of a derivative is."""
    return f"laws/{CHARTS[order]}"


def _axes(curves: Sequence[LawCurves], order: int) -> Axes:
    values = np.concatenate([curve.motion[order] for curve in curves])
    low, high = float(values.min()), float(values.max())
    room = ROOM * (high - low) or 1.0
    ends = [(float(curve.x[0]), float(curve.x[-1])) for curve in curves]
    x = min(end[0] for end in ends), max(end[1] for end in ends)
    return Axes(x, (low - room, high + room), height=HEIGHT, raised=RAISED)

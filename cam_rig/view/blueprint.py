"""How the picture is laid out: the moving scene left, the curves right, words below."""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb

from cam_rig.view import scene2d
from cam_rig.view.series import LEVEL, SPEED
from cam_rig.view.shapes import MM
from cam_rig.view.timeline import RIG_TIME

ABOUT, EVENTS = "about", "events"
#: Rig time a second of looking: a turn at 300 rpm takes 2 s.
PLAYBACK_SPEED = 0.1
#: Rig time (s) shown on either side of the time cursor.
NEAR = 0.5


def layout(reach: float, duration: float, bucket: int) -> rrb.Blueprint:
    """The blueprint.

    Parameters
    ----------
    reach : greatest height of a roller's centre above the cam shaft, m
    duration : rig time of the whole run, s
    bucket : samples of which the least and the greatest are shown, 1 for all
    """
    side, kept = reach * MM, f", min and max of every {bucket} samples" if bucket > 1 else ""
    bounds = rrb.VisualBounds2D(
        x_range=[-1.3 * side, 1.3 * side], y_range=[-1.5 * side, 1.3 * side]
    )
    scene = rrb.Spatial2DView(origin=scene2d.VIEW, name="Cam and follower", visual_bounds=bounds)
    words = rrb.Tabs(
        rrb.TextDocumentView(origin=ABOUT, name="About"),
        rrb.TextLogView(origin=EVENTS, name="Speeds and landings"),
    )
    left = rrb.Vertical(scene, words, row_shares=[3, 2])
    plots = rrb.Vertical(
        _plot("plots/lift", f"Lift [mm]{kept}", _near()),
        _plot("plots/force", f"Contact force [N]{kept}", _near()),
        _plot(LEVEL.entity, "Sound level [dB], one value a tick, whole run", _whole(duration)),
        _plot(SPEED.entity, "Cam speed [rpm], whole run", _whole(duration)),
        row_shares=[3, 3, 2, 2],
    )
    return rrb.Blueprint(
        rrb.Horizontal(left, plots, column_shares=[2, 3]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=RIG_TIME, playback_speed=PLAYBACK_SPEED),
        auto_views=False,
        auto_layout=False,
    )


def _plot(origin: str, name: str, axis: rrb.TimeAxis) -> rrb.TimeSeriesView:
    alone = origin in (LEVEL.entity, SPEED.entity)
    legend = rrb.PlotLegend(corner=rrb.Corner2D.LeftTop, visible=not alone)
    return rrb.TimeSeriesView(origin=origin, name=name, axis_x=axis, plot_legend=legend)


def _near() -> rrb.TimeAxis:
    """A few turns around the time cursor, where single landings can be seen."""
    ends = [rr.TimeRangeBoundary.cursor_relative(seconds=s) for s in (-NEAR, NEAR)]
    return rrb.TimeAxis(view_range=rr.TimeRange(start=ends[0], end=ends[1]))


def _whole(duration: float) -> rrb.TimeAxis:
    """The run from start to end (s)."""
    ends = [rr.TimeRangeBoundary.absolute(seconds=s) for s in (0.0, duration)]
    return rrb.TimeAxis(view_range=rr.TimeRange(start=ends[0], end=ends[1]))

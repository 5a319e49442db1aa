"""How the picture is laid out: while running, cams side by side, and for a report."""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from cam_rig.errors import ConfigError
from cam_rig.experiment.stage import Stage
from cam_rig.view import noise_chart, overlay, scene2d, series, twist
from cam_rig.view.course import BANDS, EVENTS
from cam_rig.view.drawing import ABOUT, RESULTS
from cam_rig.view.layout import Layout
from cam_rig.view.shapes import MM
from cam_rig.view.timeline import RIG_TIME, TURN_DEGREES

#: Rig time a second of looking: a turn at 300 rpm takes 2 s.
PLAYBACK_SPEED = 0.1
#: Degrees of the cam a second of looking, where turns lie over each other.
DEGREES_A_SECOND = 90.0
#: Rig time (s) shown on either side of the time cursor.
NEAR = 0.5
BANDS_NAME = "Third-octave bands of the last turn [dB] over 10 lg(f/Hz): 20 is 100 Hz, 30 is 1 kHz"


def blueprint(
    layout: Layout,
    stage: Stage,
    duration: float,
    bucket: int,
    compared: float,
    live: bool = False,
) -> rrb.Blueprint:
    """The blueprint of a layout.

    Parameters
    ----------
    duration : rig time of the whole run, s
    bucket : samples of which the least and the greatest are shown, 1 for all
    compared : speed (rpm) at which the cams are put side by side
    live : follow the newest data, rather than play from the start
    """
    if layout is Layout.RUN:
        timeline = rrb.TimePanel(
            state="collapsed",
            timeline=RIG_TIME,
            playback_speed=PLAYBACK_SPEED,
            play_state="following" if live else "playing",
        )
        return _blueprint(_run(stage, duration, bucket), timeline)
    timeline = rrb.TimePanel(
        state="collapsed",
        timeline=TURN_DEGREES,
        fps=DEGREES_A_SECOND,
        play_state="playing",
        loop_mode="all",
    )
    views = _compare if layout is Layout.COMPARE else _report
    return _blueprint(views(stage, compared), timeline)


def compared_rpm(stage: Stage, rpm: float | None) -> float:
    """The speed at which cams are compared: one of the scene's, by default the highest.

    Raises
    ------
    ConfigError : the scene does not run at this speed
    """
    speeds = [round(speed * 30.0 / np.pi, 9) for speed in stage.scene.program.speeds.si_list]
    if rpm is None:
        return max(speeds)
    nearest = min(speeds, key=lambda speed: abs(speed - rpm))
    if abs(nearest - rpm) > 1e-6 * rpm:
        known = ", ".join(f"{speed:g}" for speed in speeds)
        raise ConfigError(f"{rpm:g} rpm: the scene has no such speed; allowed: {known}")
    return nearest


def _blueprint(view: rrb.Container, timeline: rrb.TimePanel) -> rrb.Blueprint:
    panels = rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed")
    return rrb.Blueprint(view, *panels, timeline, auto_views=False, auto_layout=False)


def _run(stage: Stage, duration: float, bucket: int) -> rrb.Container:
    kept = f", min and max of every {bucket} samples" if bucket > 1 else ""
    near, whole = _near(), _whole(duration)
    words = rrb.Tabs(
        rrb.TextDocumentView(origin=RESULTS, name="Results"),
        rrb.TextDocumentView(origin=ABOUT, name="About"),
        rrb.TextLogView(origin=EVENTS, name="Speeds and landings"),
    )
    left = rrb.Vertical(_scene(stage, scene2d.VIEW), _noise(), words, row_shares=[5, 4, 3])
    plots = [
        _plot("plots/lift", f"Lift [mm]{kept}", near, legend=True),
        _plot("plots/velocity", "Velocity [m/s]", near),
        _plot("plots/acceleration", "Acceleration [m/s²]", near),
        _plot("plots/force", "Contact force [N]", near, legend=True),
    ]
    if stage.scene.model == twist.MODEL:
        plots.append(_plot(series.TWIST.entity, "Twist of the shaft [°]", near))
    level = _plot(series.LEVEL.entity, "Sound level [dB], one value a tick", whole)
    speed = _plot(series.SPEED.entity, "Cam speed [rpm]", whole)
    bands = _bars(BANDS, BANDS_NAME)
    right = rrb.Vertical(
        *plots,
        rrb.Horizontal(level, speed),
        bands,
        row_shares=[*[3, 2, 2, 3, 2][: len(plots)], 2, 2],
    )
    return rrb.Horizontal(left, right, column_shares=[2, 3])


def _compare(stage: Stage, rpm: float) -> rrb.Container:
    bars = [_bars(f"{overlay.COMPARE}/{cam}/bands", BANDS_NAME) for cam in stage.cams]
    rows = rrb.Horizontal(*_cams(stage)), rrb.Horizontal(*_turns(rpm)), rrb.Horizontal(*bars)
    return rrb.Vertical(*rows, row_shares=[4, 3, 2])


def _report(stage: Stage, rpm: float) -> rrb.Container:
    words = rrb.Horizontal(
        rrb.TextDocumentView(origin=RESULTS, name="Results"),
        rrb.TextDocumentView(origin=ABOUT, name="About"),
    )
    upper = rrb.Horizontal(_noise(), rrb.Horizontal(*_cams(stage)))
    return rrb.Vertical(upper, rrb.Horizontal(*_turns(rpm)), words, row_shares=[4, 3, 3])


def _cams(stage: Stage) -> list[rrb.Spatial2DView]:
    """The cams side by side, each turning under its follower."""
    return [
        _scene(stage, f"{overlay.COMPARE}/{name}/scene", cam.title)
        for name, cam in stage.cams.items()
    ]


def _turns(rpm: float) -> list[rrb.TimeSeriesView]:
    """Curves of all cams at one speed over each other, from 0 to 360°."""
    ends = [rr.TimeRangeBoundary.absolute(seq=degrees) for degrees in (0, 360)]
    axis = rrb.TimeAxis(view_range=rr.TimeRange(start=ends[0], end=ends[1]))
    return [
        _plot(overlay.at_speed(rpm, quantity), f"{title} over a turn at {rpm:g} rpm", axis, True)
        for quantity, (_, _, title) in overlay.QUANTITIES.items()
    ]


def _scene(stage: Stage, origin: str, name: str = "Cam and follower") -> rrb.Spatial2DView:
    side = scene2d.reach(stage) * MM
    bounds = rrb.VisualBounds2D(
        x_range=[-1.3 * side, 1.3 * side], y_range=[-1.35 * side, 1.45 * side]
    )
    return rrb.Spatial2DView(origin=origin, name=name, visual_bounds=bounds)


def _noise() -> rrb.Spatial2DView:
    wide, high = noise_chart.WIDTH, noise_chart.HEIGHT
    bounds = rrb.VisualBounds2D(
        x_range=[-0.12 * wide, 1.25 * wide], y_range=[-0.08 * high, 1.12 * high]
    )
    name = "Sound level against rpm: published - - -, measured •"
    return rrb.Spatial2DView(origin=noise_chart.VIEW, name=name, visual_bounds=bounds)


def _bars(origin: str, name: str) -> rrb.BarChartView:
    return rrb.BarChartView(origin=origin, name=name, plot_legend=rrb.PlotLegend(visible=False))


def _plot(origin: str, name: str, axis: rrb.TimeAxis, legend: bool = False) -> rrb.TimeSeriesView:
    corner = rrb.PlotLegend(corner=rrb.Corner2D.LeftTop, visible=legend)
    return rrb.TimeSeriesView(origin=origin, name=name, axis_x=axis, plot_legend=corner)


def _near() -> rrb.TimeAxis:
    """A few turns around the time cursor, where single landings can be seen."""
    ends = [rr.TimeRangeBoundary.cursor_relative(seconds=s) for s in (-NEAR, NEAR)]
    return rrb.TimeAxis(view_range=rr.TimeRange(start=ends[0], end=ends[1]))


def _whole(duration: float) -> rrb.TimeAxis:
    """The run from start to end (s)."""
    ends = [rr.TimeRangeBoundary.absolute(seconds=s) for s in (0.0, duration)]
    return rrb.TimeAxis(view_range=rr.TimeRange(start=ends[0], end=ends[1]))

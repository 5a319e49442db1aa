"""How the picture is laid out: while running, cams side by side, and for a report."""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb

from cam_rig.drawing.outlines import MM
from cam_rig.errors import ConfigError
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.units import to_rpm
from cam_rig.viewer import scene2d
from cam_rig.viewer.charts import level_chart, overlay, series
from cam_rig.viewer.charts.band_chart import band_axes
from cam_rig.viewer.charts.run_view import BANDS, EVENTS
from cam_rig.viewer.charts.time_series import TORSIONAL
from cam_rig.viewer.options import Layout
from cam_rig.viewer.run_recorder import ABOUT, RESULTS
from cam_rig.viewer.timeline import RIG_TIME, TURN_DEGREES

#: Rig time per wall time: a turn at 300 rpm takes 2 s.
PLAYBACK_SPEED = 0.1
#: Degrees of the cam per second, where turns lie over each other.
DEGREES_PER_SECOND = 90.0
#: Rig time (s) of a finished run shown on either side of the time cursor.
AROUND_CURSOR_S = 0.5
BANDS_NAME = "Third-octave bands of the last turn [dB re 20 µPa]"
#: A legend would lie over the curves, so the titles name the colours of `cam_rig.drawing.colours`.
LIFT_NAME = "Lift [mm]: follower light blue, law dark blue; lift-offs purple, landings orange"
FORCE_NAME = "Contact force [N]: orange, dark red line at 0"


def blueprint(
    layout: Layout,
    loaded: LoadedScene,
    duration: float,
    bucket: int,
    compared: float,
    window: float | None = None,
) -> rrb.Blueprint:
    """The blueprint of a layout.

    Parameters
    ----------
    duration : rig time of the whole run, s
    bucket : samples of which the minimum and the maximum are shown, 1 for all
    compared : speed (rpm) at which the cams are put side by side
    window : follow a live run, and show so much rig time (s) before its newest; else play from
        the start
    """
    if layout is Layout.RUN:
        timeline = rrb.TimePanel(
            state="collapsed",
            timeline=RIG_TIME,
            playback_speed=PLAYBACK_SPEED,
            play_state="playing" if window is None else "following",
        )
        return _blueprint(_run(loaded, duration, bucket, window), timeline)
    timeline = rrb.TimePanel(
        state="collapsed",
        timeline=TURN_DEGREES,
        fps=DEGREES_PER_SECOND,
        play_state="playing",
        loop_mode="all",
    )
    views = _compare if layout is Layout.COMPARE else _report
    return _blueprint(views(loaded, compared), timeline)


def compared_rpm(loaded: LoadedScene, rpm: float | None) -> float:
    """The speed at which cams are compared: one of the scene's, by default the highest.

    Raises
    ------
    ConfigError : the scene does not run at this speed
    """
    speeds = [round(to_rpm(speed), 9) for speed in loaded.scene.program.speeds.si_list]
    if rpm is None:
        return max(speeds)
    nearest = min(speeds, key=lambda speed: abs(speed - rpm))
    if not abs(nearest - rpm) <= 1e-6 * nearest:  # nor is nan
        known = ", ".join(f"{speed:g}" for speed in speeds)
        raise ConfigError(f"{rpm:g} rpm: the scene has no such speed; allowed: {known}")
    return nearest


def _blueprint(view: rrb.Container, timeline: rrb.TimePanel) -> rrb.Blueprint:
    panels = rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed")
    return rrb.Blueprint(view, *panels, timeline, auto_views=False, auto_layout=False)


def _run(loaded: LoadedScene, duration: float, bucket: int, window: float | None) -> rrb.Container:
    kept = f"; minimum, maximum of every {bucket} samples" if bucket > 1 else ""
    near, whole = _near(window), _whole(duration)
    words = rrb.Tabs(
        rrb.TextDocumentView(origin=RESULTS, name="Results"),
        rrb.TextDocumentView(origin=ABOUT, name="About"),
        rrb.TextLogView(origin=EVENTS, name="Events"),
    )
    left = rrb.Vertical(_scene(loaded, scene2d.VIEW), _noise(loaded), words, row_shares=[5, 4, 3])
    slopes = [
        _plot("plots/velocity", "Velocity [m/s]", near),
        _plot("plots/acceleration", "Acceleration [m/s²]", near),
    ]
    if loaded.scene.model == TORSIONAL:
        slopes.append(_plot(series.TWIST.entity, "Twist of the shaft [°]", near))
    level = _plot(series.LEVEL.entity, "Sound pressure level [dB]", whole)
    speed = _plot(series.SPEED.entity, "Cam speed [rpm]", whole)
    right = rrb.Vertical(
        _plot("plots/lift", LIFT_NAME + kept, near),
        rrb.Horizontal(*slopes),
        _plot("plots/force", FORCE_NAME, near),
        rrb.Horizontal(level, speed, _bands(loaded, BANDS), column_shares=[3, 3, 4]),
    )
    return rrb.Horizontal(left, right, column_shares=[2, 3])


def _compare(loaded: LoadedScene, rpm: float) -> rrb.Container:
    bars = [_bands(loaded, f"{overlay.COMPARE}/{cam}/bands") for cam in loaded.cams]
    rows = rrb.Horizontal(*_cams(loaded)), rrb.Horizontal(*_turns(rpm)), rrb.Horizontal(*bars)
    return rrb.Vertical(*rows, row_shares=[4, 3, 3])


def _report(loaded: LoadedScene, rpm: float) -> rrb.Container:
    words = rrb.Horizontal(
        rrb.TextDocumentView(origin=RESULTS, name="Results"),
        rrb.TextDocumentView(origin=ABOUT, name="About"),
    )
    upper = rrb.Horizontal(_noise(loaded), rrb.Horizontal(*_cams(loaded)))
    return rrb.Vertical(upper, rrb.Horizontal(*_turns(rpm)), words, row_shares=[4, 3, 3])


def _cams(loaded: LoadedScene) -> list[rrb.Spatial2DView]:
    """The cams side by side, each turning under its follower."""
    return [
        _scene(loaded, f"{overlay.COMPARE}/{name}/scene", cam.title)
        for name, cam in loaded.cams.items()
    ]


def _turns(rpm: float) -> list[rrb.TimeSeriesView]:
    """Curves of all cams at one speed over each other, from 0 to 360°."""
    ends = [rr.TimeRangeBoundary.absolute(seq=degrees) for degrees in (0, 360)]
    axis = rrb.TimeAxis(view_range=rr.TimeRange(start=ends[0], end=ends[1]))
    return [
        _plot(
            overlay.at_speed(rpm, quantity), f"{title} at {rpm:g} rpm, coloured as the cams", axis
        )
        for quantity, (_, title) in overlay.QUANTITIES.items()
    ]


def _scene(loaded: LoadedScene, origin: str, name: str = "Cam and follower") -> rrb.Spatial2DView:
    side = scene2d.reach(loaded) * MM
    bounds = rrb.VisualBounds2D(
        x_range=[-1.3 * side, 1.3 * side], y_range=[-1.55 * side, 1.5 * side]
    )
    return rrb.Spatial2DView(origin=origin, name=name, visual_bounds=bounds)


def _noise(loaded: LoadedScene) -> rrb.Spatial2DView:
    name = "Sound pressure level against cam speed: published - - -, simulated •"
    return _chart(level_chart.VIEW, name, *level_chart.level_axes(loaded).bounds(right=0.32))


def _bands(loaded: LoadedScene, view: str) -> rrb.Spatial2DView:
    return _chart(view, BANDS_NAME, *band_axes(loaded.scene.sample_rate.si).bounds())


def _chart(
    view: str, name: str, x: tuple[float, float], y: tuple[float, float]
) -> rrb.Spatial2DView:
    bounds = rrb.VisualBounds2D(x_range=x, y_range=y)
    return rrb.Spatial2DView(origin=view, name=name, visual_bounds=bounds)


def _plot(origin: str, name: str, axis: rrb.TimeAxis) -> rrb.TimeSeriesView:
    legend = rrb.PlotLegend(visible=False)
    return rrb.TimeSeriesView(origin=origin, name=name, axis_x=axis, plot_legend=legend)


def _near(window: float | None) -> rrb.TimeAxis:
    """A few turns around the time cursor, or before it, where single landings can be seen."""
    around = (-AROUND_CURSOR_S, AROUND_CURSOR_S) if window is None else (-window, 0.0)
    ends = [rr.TimeRangeBoundary.cursor_relative(seconds=s) for s in around]
    return rrb.TimeAxis(view_range=rr.TimeRange(start=ends[0], end=ends[1]))


def _whole(duration: float) -> rrb.TimeAxis:
    """The run from start to end (s)."""
    ends = [rr.TimeRangeBoundary.absolute(seconds=s) for s in (0.0, duration)]
    return rrb.TimeAxis(view_range=rr.TimeRange(start=ends[0], end=ends[1]))

"""Blueprints, which define the views of a recording: run, comparison, report."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.components import AbsoluteTimeRange

from cam_rig.errors import ConfigError
from cam_rig.messages.frames import Robot
from cam_rig.show.chart import plane_view, tens_range
from cam_rig.show.looks import shortened
from cam_rig.simulation.scene import LoadedScene
from cam_rig.units import NS, TURN, to_rpm
from cam_rig.viewer import Layout, Tab, bounce_chart, level_chart, quantities, scene2d, turn_chart
from cam_rig.viewer.bounce_chart import ROW, bounce_axes, can_rebound
from cam_rig.viewer.level_chart import band_axes
from cam_rig.viewer.quantities import CLOSE_GAP, GAP, Range, Ranges, plot_rows
from cam_rig.viewer.robot_view import CONTACT, ROBOT, SOUND, robot_root
from cam_rig.viewer.run_recorder import ABOUT, RESULTS
from cam_rig.viewer.run_view import BANDS, EVENTS
from cam_rig.viewer.timeline import CAM_DEGREES, RIG_TIME, TURN_DEGREES
from cam_rig.viewer.turn_chart import MAX_TITLE, TurnAxes

#: Ratio of rig time to wall-clock time in the playback of a recording: a turn at 300 rpm takes 2 s
#: of wall-clock time.
PLAYBACK_SPEED = 0.1
#: Options of a time panel that plays the recording in a loop.
PLAYING: dict[str, Any] = {"state": "collapsed", "play_state": "playing"}
#: Playback speed of layouts that overlay turns of the cam, in degrees of the cam per second of
#: wall-clock time.
DEGREES_PER_SECOND = 90.0
#: Position of the eye of the 3D view: forward, left and up, in sizes of the rig.
EYE = (3.4, 1.2, 1.3)
#: Height above the shaft at which the eye of the 3D view looks, in sizes of the rig.
LOOK_HEIGHT = 0.35
#: Rig time (s) of a finished run that the curves show before and after the time cursor.
AROUND_CURSOR_S = 0.5


def blueprint(
    layout: Layout,
    loaded: LoadedScene,
    duration: float,
    bucket: int,
    compared: float,
    ranges: Ranges,
    window: float | None = None,
    tab: Tab = Tab.TURN,
) -> rrb.Blueprint:
    """Return Rerun's blueprint (definition of the views) of a layout.

    Parameters
    ----------
    layout : Layout
        Layout of the views.
    loaded : LoadedScene
        Scene of the run.
    duration : float
        Rig time of the run in s.
    bucket : int
        Number of samples of which the curves show the minimum and the maximum.
    compared : float
        Speed in rpm at which cams are compared.
    ranges : mapping
        Axis range of each quantity.
    window : float, optional
        Rig time in s that a live run shows before its newest sample. The time panel then follows
        the run. None for a recorded run, which is played in a loop.
    tab : Tab
        Tab that is open at first in the layout of a run.
    """
    if layout is Layout.RUN:
        view = _run(loaded, duration, bucket, ranges, window, tab)
        timeline = _time_panel(loaded, duration, window)
    else:
        view = (_compare if layout is Layout.COMPARE else _report)(loaded, compared, ranges)
        turns: dict[str, Any] = {
            "timeline": TURN_DEGREES,
            "fps": DEGREES_PER_SECOND,
            "loop_mode": "all",
        }
        timeline = rrb.TimePanel(**turns, **PLAYING)
    panels = rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed")
    return rrb.Blueprint(view, *panels, timeline, auto_views=False, auto_layout=False)


def compared_rpm(speeds: Iterable[float], rpm: float | None) -> float:
    """Return the speed in rpm at which cams are compared.

    Parameters
    ----------
    speeds : iterable of float
        Speeds of the run in rad/s.
    rpm : float, optional
        Requested speed in rpm (default: the highest of `speeds`).

    Raises
    ------
    ConfigError
        If no speed of the run is within a relative 1e-6 of `rpm`.
    """
    available = sorted({round(to_rpm(speed), 9) for speed in speeds})
    if rpm is None:
        return available[-1]
    nearest = min(available, key=lambda speed: abs(speed - rpm))
    if not abs(nearest - rpm) <= 1e-6 * nearest:  # also raises for NaN
        options = ", ".join(f"{speed:g}" for speed in available)
        raise ConfigError(f"rpm must be a speed of the run, {options}, got {rpm:g}")
    return nearest


def playback_start(loaded: LoadedScene, duration: float) -> float:
    """Return the rig time (s) at which playback of a run of `duration` s starts.

    It is the end of the scene's transient turns (at least one turn) at its first speed, but at most
    half of the duration.
    """
    schedule = loaded.scene.schedule
    settled = max(1.0, schedule.transient_turns.si) * TURN / schedule.speeds.si_list[0]
    return min(settled, 0.5 * duration)


def _time_panel(loaded: LoadedScene, duration: float, window: float | None) -> rrb.TimePanel:
    """Return the time panel of a recording.

    In a live run it follows the newest time. A recorded run of `duration` s is played in a loop,
    from the end of its transient turns on. `window` is None for a recorded run.
    """
    if window is not None:
        return rrb.TimePanel(state="collapsed", timeline=RIG_TIME, play_state="following")
    ends = [round(time * NS) for time in (playback_start(loaded, duration), duration)]
    loop: dict[str, Any] = {"loop_mode": "selection", "time_selection": AbsoluteTimeRange(*ends)}
    return rrb.TimePanel(timeline=RIG_TIME, playback_speed=PLAYBACK_SPEED, **loop, **PLAYING)


def _run(
    loaded: LoadedScene,
    duration: float,
    bucket: int,
    ranges: Ranges,
    window: float | None,
    tab: Tab,
) -> rrb.Container:
    turn_bounds = TurnAxes(plot_rows(loaded.scene.model), ranges).bounds()
    bounces = [_bounces(loaded, ranges)] if can_rebound(loaded) else []
    recorded = rrb.StateTimelineView(origin=CONTACT, name=Tab.CONTACT), _robot(loaded)
    views = (
        *bounces,
        plane_view(turn_chart.VIEW, Tab.TURN, *turn_bounds),
        _over_time(loaded, bucket, ranges, _axis_around_cursor(window)),
        _sound(loaded, duration, window is None and not loaded.missing_for_sound),
        *(recorded if window is None else []),
        _texts(),
    )
    # Rerun finds a tab by its name only if it is a single view.
    tabs = rrb.Tabs(*views, active_tab=[view.name for view in views].index(tab))
    return rrb.Horizontal(_scene(loaded, scene2d.VIEW), tabs, column_shares=[3, 5])


def _robot(loaded: LoadedScene) -> rrb.Spatial3DView:
    """Return the view of the rig from the front, where the cam turns counterclockwise."""
    size = max(Robot.of(loaded, cam).size for cam in loaded.cams)
    return rrb.Spatial3DView(
        contents=[f"/{robot_root(cam)}/cam_rig/visual_geometries/**" for cam in loaded.cams],
        name=Tab.ROBOT,
        spatial_information=rrb.SpatialInformation(target_frame=ROBOT),
        eye_controls=rrb.EyeControls3D(
            position=np.multiply(size, EYE), look_target=(0, 0, LOOK_HEIGHT * size)
        ),
        line_grid=rrb.LineGrid3D(visible=False),
        defaults=[shape.from_fields(fill_mode="solid") for shape in (rr.Boxes3D, rr.Cylinders3D)],
    )


def _bounces(loaded: LoadedScene, ranges: Ranges) -> rrb.Spatial2DView:
    """Return the view of the bounce chart, with all points up to the time cursor."""
    gap, landing = bounce_axes(loaded, ranges)
    x, _ = gap.bounds()
    first, cursor = rr.TimeRangeBoundary.infinite(), rr.TimeRangeBoundary.cursor_relative()
    visible = [
        rr.VisibleTimeRange(name, start=first, end=cursor) for name in (RIG_TIME, CAM_DEGREES)
    ]
    y = 0.0, landing.top + 1.12 * ROW
    return plane_view(bounce_chart.VIEW, "Bounces", x, y, time_ranges=visible)


def _texts() -> rrb.Container:
    columns = rrb.TextLogColumns(text_log_columns=["body"])
    return rrb.Vertical(
        rrb.TextDocumentView(origin=RESULTS, name="Results"),
        rrb.Horizontal(
            rrb.TextLogView(origin=EVENTS, name="Events", columns=columns),
            rrb.TextDocumentView(origin=ABOUT, name="About"),
            column_shares=[3, 2],
        ),
        name=Tab.RESULTS,
    )


def _over_time(
    loaded: LoadedScene, bucket: int, ranges: Ranges, time_axis: rrb.TimeAxis
) -> rrb.Container:
    """Return the plots of all quantities over rig time.

    At most two plots are above each other, because Rerun labels only high axes with numbers. Each
    curve shows the minimum and the maximum of every `bucket` samples. `ranges` contains the axis
    range of each quantity, and `time_axis` is the common time axis.
    """
    name = f"Time, extremes of {bucket} samples" if bucket > 1 else "Time"
    lift, velocity, acceleration, force, *others = [
        _plot(f"plots/{row.key}", row.title, time_axis, ranges[row.key])
        for row in plot_rows(loaded.scene.model)
    ]
    if (close := ranges.get(CLOSE_GAP)) is not None:
        others.append(_plot(f"plots/{GAP.key}", f"Cut at {close[1]:g} µm", time_axis, close))
    left = rrb.Vertical(rrb.Tabs(lift, velocity, active_tab=0), acceleration)
    right = rrb.Vertical(force, *([rrb.Tabs(*others, active_tab=0)] if others else []))
    return rrb.Horizontal(left, right, name=name)


def _sound(loaded: LoadedScene, duration: float, has_audio: bool) -> rrb.Container:
    ends = [rr.TimeRangeBoundary.absolute(seconds=s) for s in (0.0, duration)]
    time_axis = rrb.TimeAxis(view_range=rr.TimeRange(start=ends[0], end=ends[1]))
    over_run = rrb.Vertical(
        _plot(quantities.LEVEL.entity, "Sound pressure level [dB]", time_axis),
        _plot(quantities.SPEED.entity, "Cam speed [rpm]", time_axis),
    )
    lower = rrb.Horizontal(_bands(loaded, BANDS), over_run, column_shares=[3, 2])
    audio = [rrb.AudioView(origin=SOUND, name="Sound of the run")] if has_audio else []
    return rrb.Vertical(
        _noise(loaded), lower, *audio, name=Tab.SOUND, row_shares=[3, 3, 1][: 2 + len(audio)]
    )


def _compare(loaded: LoadedScene, rpm: float, ranges: Ranges) -> rrb.Container:
    bars = [_bands(loaded, f"{level_chart.COMPARE}/{cam}/bands") for cam in loaded.cams]
    below = rrb.Tabs(
        rrb.Horizontal(*_turns(loaded, rpm, ranges), name="One turn"),
        rrb.Horizontal(*bars, name="Sound of the turn"),
    )
    return rrb.Vertical(rrb.Horizontal(*_cams(loaded)), below, row_shares=[3, 2])


def _report(loaded: LoadedScene, rpm: float, ranges: Ranges) -> rrb.Container:
    texts = rrb.Horizontal(
        rrb.TextDocumentView(origin=RESULTS, name="Results"),
        rrb.TextDocumentView(origin=ABOUT, name="About"),
    )
    upper = rrb.Horizontal(_noise(loaded), rrb.Horizontal(*_cams(loaded)))
    turns = rrb.Horizontal(*_turns(loaded, rpm, ranges))
    return rrb.Vertical(upper, turns, texts, row_shares=[4, 3, 3])


def _cams(loaded: LoadedScene) -> list[rrb.Container]:
    titles = {name: shortened(cam.title, MAX_TITLE) for name, cam in loaded.cams.items()}
    compare = level_chart.COMPARE
    return [_scene(loaded, f"{compare}/{name}/scene", titles[name], 4.0) for name in titles]


def _turns(loaded: LoadedScene, rpm: float, ranges: Ranges) -> list[rrb.Spatial2DView]:
    return [
        plane_view(
            level_chart.at_speed(rpm, row.key),
            f"{row.title} at {rpm:g} rpm",
            *level_chart.turn_axes(row, ranges).bounds(14.0, level_chart.names_height(loaded)),
        )
        for row in level_chart.compared_of(loaded)
    ]


def _scene(
    loaded: LoadedScene, view: str, name: str = "Cam and follower", share: float = 7.0
) -> rrb.Container:
    """Return the view of cam and follower above the view of the readings.

    The upper view is `share` times as high as the readings.
    """
    return rrb.Vertical(
        plane_view(view, name, *scene2d.bounds(scene2d.framings(loaded))),
        rrb.TextDocumentView(origin=f"{view}_readings", name="Readings", titlebar=False),
        row_shares=[share, 1.0],
    )


def _noise(loaded: LoadedScene) -> rrb.Spatial2DView:
    bounds = level_chart.level_axes(loaded).bounds(right=level_chart.names_width(loaded))
    dashed = ": published dashed" if loaded.published is not None else ""
    return plane_view(level_chart.VIEW, f"Level over speed{dashed}", *bounds)


def _bands(loaded: LoadedScene, view: str) -> rrb.Spatial2DView:
    return plane_view(view, "Third-octave bands", *band_axes(loaded.scene.sample_rate.si).bounds())


def _plot(
    origin: str, name: str, axis: rrb.TimeAxis, limits: Range | None = None
) -> rrb.TimeSeriesView:
    """Return the view of one curve over time.

    `limits` are those of the y axis (default: fitted to the data).
    """
    legend = rrb.PlotLegend(visible=False)
    y = rrb.ScalarAxis(range=tens_range(*limits[:2])) if limits is not None else None
    return rrb.TimeSeriesView(origin=origin, name=name, axis_x=axis, axis_y=y, plot_legend=legend)


def _axis_around_cursor(window: float | None) -> rrb.TimeAxis:
    """Return a time axis that shows a short time around or before the time cursor.

    It is short enough to resolve single landings. `window` is the time (s) that a live run shows
    before its newest sample, None for a recorded run.
    """
    around = (-AROUND_CURSOR_S, AROUND_CURSOR_S) if window is None else (-window, 0.0)
    ends = [rr.TimeRangeBoundary.cursor_relative(seconds=s) for s in around]
    return rrb.TimeAxis(view_range=rr.TimeRange(start=ends[0], end=ends[1]))

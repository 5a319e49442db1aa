"""A law over the cam angle as the theses draw it: s, s', s'', s''' in four stacked panels.

A law that was fitted is drawn with its readings instead, and what is between them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.drawing.colours import DERIVATIVES, web
from cam_rig.drawing.outlines import MM
from cam_rig.drawing.words import in_words
from cam_rig.laws import Law
from cam_rig.laws.cam import segment_angles
from cam_rig.laws.continuity import SMOOTHEST, Joint, joints
from cam_rig.laws.control_polygon import control_polygons
from cam_rig.laws.curves import sampled_pieces
from cam_rig.laws.peaks import extremes
from cam_rig.plots.figures import CAM_ANGLE, empty, series, styled, turn_axis, wrapped, write
from cam_rig.schema import CamConfig
from cam_rig.schema.segments import Table
from cam_rig.studies.cam_fit.arcs_fit import ArcsFit
from cam_rig.studies.cam_fit.spline_fit import SplineFit
from cam_rig.tables import printed
from cam_rig.units import TURN

#: One a panel.
COLOURS = tuple(map(web, DERIVATIVES))
NAMES = ("lift s", "velocity s′", "acceleration s″", "jerk s‴")
PER = ("", "/rad", "/rad²", "/rad³")
#: Joints nearer than this are one, deg.
SAME_DEG = 1e-6
#: Segments narrower than this have no name in the plot, or an upright one, deg.
NAMELESS_DEG, UPRIGHT_DEG = 12.0, 60.0
GREY = "0.45"
#: Points of a fitted curve over the turn, and what is behind it.
FIT_POINTS, SHADE = 3601, "0.8"


def draw(cam: CamConfig, law: Law, path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    write(figure(cam, law), path)


@styled
def figure(cam: CamConfig, law: Law) -> Figure:
    """Lift, velocity, acceleration and jerk over a turn, with extremes and continuity classes."""
    out = empty(8.2)
    panels = out.subplots(4, 1, sharex=True)
    marked = _marked(cam, law)
    for order, axes in enumerate(panels):
        _curve(axes, law, order)
        for joint in marked:
            axes.axvline(np.degrees(joint.angle), color=GREY, lw=0.7, ls=(0, (4, 3)), zorder=0)
    _control_points(panels[0], cam)
    _names(panels[0], cam)
    _infinite(panels[2], marked)
    _classes(panels[0], marked)
    turn_axis(panels[3], 30)
    panels[3].set_xlabel(CAM_ANGLE)
    out.suptitle(wrapped(cam.title))
    return out


def _marked(cam: CamConfig, law: Law) -> list[Joint]:
    """Where a segment begins, and where the law is not smooth inside one."""
    starts = np.degrees(segment_angles(cam))
    return [
        joint
        for joint in joints(law)
        if joint.continuity < SMOOTHEST or np.abs(starts - np.degrees(joint.angle)).min() < SAME_DEG
    ]


def _curve(axes: Axes, law: Law, order: int) -> None:
    """One derivative, piece by piece: a jump is a dotted line."""
    ordinates, colour = law.derivative_ordinates(order) * MM, COLOURS[order]
    angles, values = sampled_pieces(law, order)
    values = values * MM
    gap = np.full((1, law.spans.size), np.nan)  # lifts the pen between pieces
    line = (np.concatenate([part, gap]).T.ravel() for part in (np.degrees(angles), values))
    axes.plot(*line, color=colour)
    before = np.roll(ordinates[-1], 1)
    starts = np.degrees(law.breaks[:-1])
    axes.vlines(starts, before, ordinates[0], color=colour, lw=1.0, ls=":")
    _peaks(axes, law, order)
    axes.set_ylabel(f"{NAMES[order]} [mm{PER[order]}]")
    axes.margins(y=0.2)


def _peaks(axes: Axes, law: Law, order: int) -> None:
    """Largest and smallest value with the angle, written away from the nearer edge."""
    low, high = extremes(law, order)
    for extreme, above in ((low, False), (high, True)) if high.value > low.value else ():
        value, at = extreme.value * MM, float(np.degrees(extreme.angle))
        axes.plot(at, value, "o", color=COLOURS[order], ms=4)
        axes.annotate(
            f"{printed(value, '.4g')} at {at:.4g}°",
            (at, value),
            xytext=(-6 if at > 180.0 else 6, 6 if above else -6),
            textcoords="offset points",
            ha="right" if at > 180.0 else "left",
            va="bottom" if above else "top",
            bbox={"boxstyle": "square,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8},
        )


def _control_points(axes: Axes, cam: CamConfig) -> None:
    """What the law is shaped by: control polygons, measured points."""
    for angles, ordinates in control_polygons(cam):
        axes.plot(
            np.degrees(angles),
            ordinates * MM,
            "s--",
            color=GREY,
            ms=3,
            lw=0.8,
            zorder=1,
        )
    for segment in cam.segments:
        if isinstance(segment, Table):
            lifts = np.array(segment.file.lifts) * MM
            axes.plot(np.degrees(segment.file.angles), lifts, "o", color=GREY, ms=2.5, zorder=1)


def _names(axes: Axes, cam: CamConfig) -> None:
    """Each segment's law, where there is room for it."""
    for segment, start in zip(cam.segments, np.degrees(segment_angles(cam)), strict=True):
        span = np.degrees(segment.span.si)
        if span >= NAMELESS_DEG:
            axes.text(
                start + 0.5 * span,
                0.25,
                in_words(segment.law),
                transform=axes.get_xaxis_transform(),
                ha="center",
                va="center",
                rotation=90 if span < UPRIGHT_DEG else 0,
                color=GREY,
                zorder=0,
            )


def _infinite(axes: Axes, marked: list[Joint]) -> None:
    """Where the velocity jumps the acceleration is infinite: an arrow at the panel's edge."""
    for joint in marked:
        if joint.continuity == 0:
            up = joint.jump > 0.0
            axes.text(
                np.degrees(joint.angle),
                0.97 if up else 0.03,
                "↑∞" if up else "↓∞",
                transform=axes.get_xaxis_transform(),
                ha="left",
                va="top" if up else "bottom",
            )


def _classes(axes: Axes, marked: list[Joint]) -> None:
    """The class of each marked joint, above the first panel."""
    at = [float(np.degrees(joint.angle)) for joint in marked]
    labels = [f"C{joint.continuity}" for joint in marked]
    top = axes.secondary_xaxis("top")
    top.set_xticks(at, labels)
    top.set_xlabel("continuity class at each knot", color=GREY)


def draw_fit(fit: SplineFit | ArcsFit, path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    write(_arcs_fit(fit) if isinstance(fit, ArcsFit) else _spline_fit(fit), path)


@styled
def _spline_fit(fit: SplineFit) -> Figure:
    """Lift, distance and acceleration; dwells are shaded."""
    out = empty(6.7)
    lift, away, bend = out.subplots(3, 1, sharex=True)
    angles, colour = np.linspace(0.0, TURN, FIT_POINTS), series(0)["color"]
    degrees, readings = np.degrees(angles), fit.readings
    lift.plot(degrees, fit.law(angles) * 1e3, color=colour)
    lift.plot(np.degrees(readings.angles), readings.lifts * 1e3, ".", color="k", ms=3)
    for outlier in readings.outliers:
        lift.plot(np.degrees(outlier.angle), (outlier.lift - fit.zero) * 1e3, "x", color="r")
    distance = (readings.lifts - fit.law(readings.angles)) * 1e3
    away.plot(np.degrees(readings.angles), distance, ".", color="k", ms=3)
    away.axhspan(-fit.tolerance * 1e3, fit.tolerance * 1e3, color=SHADE, lw=0)
    bend.plot(degrees, fit.law(angles, 2) * 1e3, color=colour)
    for axes in (lift, bend):
        for dwell in fit.dwells:
            start, stop = np.degrees([dwell.rest.start, dwell.rest.start + dwell.rest.span])
            axes.axvspan(start, min(stop, 360.0), color=SHADE, lw=0, zorder=0)
            axes.axvspan(0.0, max(stop - 360.0, 0.0), color=SHADE, lw=0, zorder=0)
    _label((lift, "lift [mm]"), (away, "reading − law [mm]"), (bend, "acceleration s″ [mm/rad²]"))
    lift.set_title(wrapped(f"{readings.name}: dwells shaded; below, the distance allowed"))
    turn_axis(bend, 30)
    bend.set_xlabel(CAM_ANGLE)
    return out


@styled
def _arcs_fit(fit: ArcsFit) -> Figure:
    """Lift of each follower, and distance of its readings; the nose is at 180°."""
    out = empty(5.4)
    lift, away = out.subplots(2, 1, sharex=True)
    angles = np.linspace(0.0, TURN, FIT_POINTS)
    for i, column in enumerate(fit.columns):
        colour, readings = series(i)["color"], column.readings
        own = -readings.angles if column.reverse else readings.angles
        from_nose = np.degrees((own - fit.arcs.nose_angle + 0.5 * TURN) % TURN)
        curve = fit.arcs.lifts(column.follower, angles + fit.arcs.nose_angle - 0.5 * TURN)
        lift.plot(np.degrees(angles), curve * 1e3, color=colour, label=column.kind)
        lift.plot(from_nose, readings.lifts * 1e3, ".", color=colour, ms=4)
        away.plot(from_nose, -column.away * 1e3, ".", color=colour, label=readings.name)
    away.axhline(0.0, color=SHADE, zorder=0)
    _label((lift, "lift [mm]"), (away, "reading − arcs [mm]"))
    for axes in (lift, away):
        axes.legend(frameon=False)
    turn_axis(away, 30)
    away.set_xlabel(CAM_ANGLE)
    return out


def _label(*panels: tuple[Axes, str]) -> None:
    for axes, label in panels:
        axes.set_ylabel(label)

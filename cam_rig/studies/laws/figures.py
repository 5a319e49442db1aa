"""Figures of laws: s, s', s'' and s''' in four stacked panels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.arguments import check_arguments
from cam_rig.laws import catalogue
from cam_rig.laws.cam import control_polygons, segment_angles
from cam_rig.laws.law import MAX_CONTINUITY, Joint, Law, extremes, joints
from cam_rig.schema import CamConfig
from cam_rig.schema.segment_base import Table
from cam_rig.show.figure import CAM_ANGLE, draw_into, empty, line, styled, turn_axis, wrapped
from cam_rig.show.looks import DERIVATIVE_NAMES, DERIVATIVES, MM, PER_RADIAN, in_words, short, web
from cam_rig.show.result import enable_notebook_display
from cam_rig.show.tables import typeset_number
from cam_rig.simulation.inputs import LawOrCam, build_law
from cam_rig.studies.laws.rises import LawsResult, RisesResult
from cam_rig.studies.laws.study import CamLawsResult

#: Colours of the curves of s, s', s'' and s''', one per panel.
COLOURS = tuple(map(web, DERIVATIVES))
#: Absolute tolerance (deg) of a joint's cam angle from the start of a segment at which they are
#: taken as equal.
JOINT_ATOL_DEG = 1e-6
#: Smallest span (deg) of a segment at which the name of its law is written in the figure.
MIN_NAME_DEG = 12.0
#: Largest span (deg) of a segment whose name is vertical. Longer segments have horizontal names.
MAX_VERTICAL_DEG = 60.0
#: Height of the middle of a horizontal name, as a fraction of the panel.
NAME_HEIGHT = 0.25
#: Height of the start of a vertical name, as a fraction of the panel.
VERTICAL_NAME_HEIGHT = 0.18
#: Colour of annotations.
GREY = "0.45"
Style = dict[str, Any]
#: Matplotlib options of the background of a label.
BOX = {"boxstyle": "square,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8}
#: Matplotlib options of a label at a distance in points from its data point.
LABEL_STYLE: Style = {"textcoords": "offset points", "bbox": BOX}


@styled
def figure(cam: CamConfig, law: Law) -> Figure:
    """Return the figure of a cam's law with the names of its segments.

    Control points and measured points are drawn if the cam has any.
    """
    out = _draw_panels(law, _visible_joints(cam, law), cam.title)
    _control_points(out.axes[0], cam)
    _names(out.axes[0], cam)
    return out


@styled
@check_arguments
def plot_law(law: LawOrCam, ax: Axes | None = None) -> Figure:
    """Return a figure of lift, velocity, acceleration and jerk over a turn.

    Extremes and joints that are not smooth are marked. `cam_rig.law_summary` plots several laws in
    one figure.

    Parameters
    ----------
    law : Law, Cam, str or Path
        Motion law, or a cam: its name in ``config/cams``, its path, or the object.
    ax : matplotlib.axes.Axes, optional
        Axes of a figure that are replaced by the panels (default: a new figure).

    Returns
    -------
    matplotlib.figure.Figure
        Four panels over the cam angle in degrees.

    Raises
    ------
    ConfigError
        If the cam is unknown, or its file cannot be read.
    LawError
        If the law cannot be built.

    Examples
    --------
    >>> import cam_rig
    >>> figure = cam_rig.plot_law("poly345")
    >>> len(figure.axes)
    4
    """
    law = law if isinstance(law, Law) else build_law(law)
    rough = [joint for joint in joints(law) if joint.continuity < MAX_CONTINUITY]
    return enable_notebook_display(draw_into(ax, lambda: _draw_panels(law, rough, law.name)))


def _draw_panels(law: Law, marked: list[Joint], title: str) -> Figure:
    """Return a figure of s, s', s'' and s''' of a law over the cam angle.

    It has four panels. Extremes are labelled. Each joint in ``marked`` has a line and its
    continuity class.
    """
    out = empty(FIGURE_HEIGHT)
    panels = out.subplots(4, 1, sharex=True)
    for order, axes in enumerate(panels):
        _curve(axes, law, order)
        for joint in marked:
            axes.axvline(np.degrees(joint.angle), color=GREY, lw=0.7, ls=(0, (4, 3)), zorder=0)
    for joint in (joint for joint in marked if joint.continuity == 0):
        _arrow(panels[2], float(np.degrees(joint.angle)), joint.jump, "left")
    _classes(panels[0], marked)
    turn_axis(panels[3], 30)
    panels[3].set_xlabel(CAM_ANGLE)
    out.suptitle(wrapped(title))
    return out


def _visible_joints(cam: CamConfig, law: Law) -> list[Joint]:
    """Return the joints to mark: those between segments, and others not smooth."""
    starts = np.degrees(segment_angles(cam))
    return [
        joint
        for joint in joints(law)
        if joint.continuity < MAX_CONTINUITY
        or np.abs(starts - np.degrees(joint.angle)).min() < JOINT_ATOL_DEG
    ]


def _curve(axes: Axes, law: Law, order: int) -> None:
    """Draw one derivative of a law, with a dotted line at each jump.

    ``order`` is that of the derivative, 0 for the lift.
    """
    ordinates, colour = law.derivative_ordinates(order) * MM, COLOURS[order]
    angles, values = catalogue.sample_pieces(law, order)
    values = values * MM
    gap = np.full((1, law.spans.size), np.nan)  # interrupts the line between pieces
    line = (np.concatenate([part, gap]).T.ravel() for part in (np.degrees(angles), values))
    axes.plot(*line, color=colour)
    before = np.roll(ordinates[-1], 1)
    starts = np.degrees(law.breaks[:-1])
    axes.vlines(starts, before, ordinates[0], color=colour, lw=1.0, ls=":")
    _peaks(axes, law, order)
    axes.set_ylabel(f"{DERIVATIVE_NAMES[order]} [mm{PER_RADIAN[order]}]")
    axes.margins(y=0.2)


def _peaks(axes: Axes, law: Law, order: int) -> None:
    """Label the largest and the smallest value of a derivative with its cam angle."""
    low, high = extremes(law, order)
    for extreme, above in ((low, False), (high, True)) if high.value > low.value else ():
        value, degrees = extreme.value * MM, float(np.degrees(extreme.angle))
        axes.plot(degrees, value, "o", color=COLOURS[order], ms=4)
        x, side = (-6, "right") if degrees > 180.0 else (6, "left")
        y, end = (6, "bottom") if above else (-6, "top")
        text = f"{typeset_number(value, '.4g')} at {degrees:.4g}°"
        axes.annotate(text, (degrees, value), (x, y), ha=side, va=end, **LABEL_STYLE)


def _control_points(axes: Axes, cam: CamConfig) -> None:
    """Draw the control polygons and the measured points of a cam's segments, if any."""
    for angles, ordinates in control_polygons(cam):
        axes.plot(np.degrees(angles), ordinates * MM, "s--", color=GREY, ms=3, lw=0.8, zorder=1)
    for segment in cam.segments:
        if isinstance(segment, Table):
            lifts = np.array(segment.file.lifts) * MM
            axes.plot(np.degrees(segment.file.angles), lifts, "o", color=GREY, ms=2.5, zorder=1)


def _names(axes: Axes, cam: CamConfig) -> None:
    """Write the name of each segment's law into the lift panel, if there is room."""
    for segment, start in zip(cam.segments, np.degrees(segment_angles(cam)), strict=True):
        span = np.degrees(segment.span.si)
        if span >= MIN_NAME_DEG:
            style: Style = {"ha": "center", "va": "center", "color": GREY, "zorder": 0}
            style |= {"transform": axes.get_xaxis_transform()}
            height = NAME_HEIGHT
            if span <= MAX_VERTICAL_DEG:
                style |= {"va": "bottom", "rotation": 90}
                height = VERTICAL_NAME_HEIGHT
            axes.text(start + 0.5 * span, height, in_words(segment.law), **style)


def _arrow(axes: Axes, x: float, jump: float, side: str, colour: str | None = None) -> None:
    """Draw an arrow for the infinite acceleration at a jump of the velocity.

    It is at ``x`` in the unit of the axis, at the upper edge of the panel for a jump upwards, else
    at the lower edge. ``side`` is its horizontal alignment.
    """
    y, text, end = (0.97, "↑∞", "top") if jump > 0.0 else (0.03, "↓∞", "bottom")
    foot = axes.get_xaxis_transform()
    axes.text(x, y, text, ha=side, va=end, color=colour, transform=foot)


def _classes(axes: Axes, marked: list[Joint]) -> None:
    """Write the continuity class of each marked joint above the first panel."""
    degrees = [float(np.degrees(joint.angle)) for joint in marked]
    labels = [f"C{joint.continuity}" for joint in marked]
    top = axes.secondary_xaxis("top")
    top.set_xticks(degrees, labels)
    top.set_xlabel("continuity class at each knot", color=GREY)


# Several laws in one figure: s, s', s'', s''' of cams over the turn, or of rises over u in [0, 1].
#: Height of a figure with four rows of panels, in inches.
FIGURE_HEIGHT = 8.2
#: Number of entries per row in the legend of a figure with one column of panels.
LEGEND_COLUMNS = 3
#: Units of s, s', s'' and s''' of a rise h over a span β.
RISE_UNITS = ("h", "h/β", "h/β²", "h/β³")


@styled
def cams_figure(cams: Sequence[tuple[CamConfig, Law]]) -> Figure:
    """Return a figure of the laws of several cams over the cam angle, in mm."""
    curves = [(catalogue.cam_curves(short(cam.title), law), line(cam.name)) for cam, law in cams]
    out = empty(FIGURE_HEIGHT)
    panels = out.subplots(len(catalogue.ORDERS), 1, sharex=True)
    for order, axes in enumerate(panels):
        _panel(axes, curves, order, MM)
        axes.set_ylabel(f"{DERIVATIVE_NAMES[order]} [mm{PER_RADIAN[order]}]")
        turn_axis(axes, 30)
    panels[-1].set_xlabel(CAM_ANGLE)
    _legend(panels[0], LEGEND_COLUMNS)
    return out


@styled
def rises_figure(families: Iterable[catalogue.RiseFamily]) -> Figure:
    """Return a figure of rises of unit lift over a unit span, one column per family."""
    columns = list(families)
    out = empty(FIGURE_HEIGHT)
    panels = out.subplots(len(catalogue.ORDERS), len(columns), sharex=True, squeeze=False)
    for name, unit, axes in zip(DERIVATIVE_NAMES, RISE_UNITS, panels[:, 0], strict=True):
        axes.set_ylabel(f"{name} [{unit}]")
    for column, family in zip(panels.T, columns, strict=True):
        curves = [(catalogue.rise_curves(name), line(name)) for name in family.rises]
        for order, axes in enumerate(column):
            _panel(axes, _distinct(curves), order, 1.0)
            axes.set_xlim(0.0, 1.0)
        column[-1].set_xlabel("fraction of the span, u [1]")
        _legend(column[0], LEGEND_COLUMNS if len(columns) == 1 else 1, family.title)
    return out


def laws_figure(result: LawsResult) -> Figure:
    """Return a figure with one column per family of the sources, or with one other family."""
    return rises_figure(result.families[: len(catalogue.FAMILY_TITLES)])


def rises_result_figure(result: RisesResult) -> Figure:
    """Return the figure of named rises, all in one column."""
    return rises_figure([catalogue.RiseFamily("Rises of h over the span β", result.names)])


def cam_laws_figure(result: CamLawsResult) -> Figure:
    """Return the figure of the laws of one or several cams.

    For one cam, joints and extremes are marked. Several cams share the panels.
    """
    return figure(*result.cams[0]) if len(result.cams) == 1 else cams_figure(result.cams)


def _distinct(
    curves: list[tuple[catalogue.LawCurves, Style]],
) -> list[tuple[catalogue.LawCurves, Style]]:
    """Return the curves, with equal curves merged into one that has all their names."""
    by_motion: dict[bytes, tuple[catalogue.LawCurves, Style]] = {}
    for curve, style in curves:
        key = curve.motion.tobytes()
        name = in_words(curve.name)
        if key in by_motion:
            name = f"{by_motion[key][0].name}\n= {name}"
        by_motion[key] = (catalogue.LawCurves(name, curve.x, curve.motion, curve.infinite), style)
    return list(by_motion.values())


def _panel(
    axes: Axes, curves: list[tuple[catalogue.LawCurves, Style]], order: int, factor: float
) -> None:
    """Draw one derivative of several laws.

    Arrows mark where the acceleration is infinite. ``factor`` converts the values of the curves to
    the displayed unit.
    """
    for curve, style in curves:
        axes.plot(curve.x, curve.motion[order] * factor, label=curve.name, **style)
        for x, jump in curve.infinite if order == 2 else ():
            _arrow(axes, x, jump, "left" if x < 0.5 * curve.x[-1] else "right", style["color"])


def _legend(axes: Axes, columns: int, title: str | None = None) -> None:
    """Draw the legend of a column above its first panel, where it covers no curve."""
    axes.legend(
        loc="lower center", bbox_to_anchor=(0.5, 1.02), ncols=columns, title=title, frameon=False
    )

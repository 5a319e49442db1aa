"""A law over the cam angle as the theses draw it: s, s', s'', s''' in four stacked panels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.arguments import checked
from cam_rig.laws import catalogue
from cam_rig.laws.cam import control_polygons, segment_angles
from cam_rig.laws.law import SMOOTHEST, Joint, Law, extremes, joints
from cam_rig.schema import CamConfig
from cam_rig.schema.segment_base import Table
from cam_rig.show.figure import CAM_ANGLE, empty, line, styled, turn_axis, wrapped
from cam_rig.show.looks import DERIVATIVE_NAMES, DERIVATIVES, MM, PER_RADIAN, in_words, short, web
from cam_rig.show.result import enable_notebook_display
from cam_rig.show.tables import typeset_number
from cam_rig.studies.laws.study import CamLawsResult, LawsResult, RisesResult

#: One a panel.
COLOURS = tuple(map(web, DERIVATIVES))
#: Joints nearer than this are one, deg.
SAME_DEG = 1e-6
#: Segments narrower than this have no name in the plot, or an upright one, deg.
NAMELESS_DEG, UPRIGHT_DEG = 12.0, 60.0
GREY = "0.45"
Style = dict[str, Any]
#: Words beside a point, in points from it, on a ground of their own.
BOX = {"boxstyle": "square,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8}
WORDS: Style = {"textcoords": "offset points", "bbox": BOX}


@styled
def figure(cam: CamConfig, law: Law) -> Figure:
    """A cam's law as `plot_law` has it, with the names of its segments and what shapes them."""
    out = _stacked(law, _marked(cam, law), cam.title)
    _control_points(out.axes[0], cam)
    _names(out.axes[0], cam)
    return out


@styled
@checked
def plot_law(law: Law) -> Figure:
    """Return a figure of lift, velocity, acceleration and jerk over a turn.

    Extremes and joints that are not smooth are marked. `law` draws cams by name, and several laws
    over each other.

    Parameters
    ----------
    law : Law
        Law of `build_law`, or any other `Law`.

    Returns
    -------
    matplotlib.figure.Figure
        Four panels over the cam angle in degrees.

    Examples
    --------
    >>> import cam_rig
    >>> figure = cam_rig.plot_law(cam_rig.build_law(cam_rig.load_cam("poly345")))
    >>> len(figure.axes)
    4
    """
    rough = [joint for joint in joints(law) if joint.continuity < SMOOTHEST]
    return enable_notebook_display(_stacked(law, rough, law.name))


def _stacked(law: Law, marked: list[Joint], title: str) -> Figure:
    """Four panels with extremes and continuity classes."""
    out = empty(8.2)
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
    angles, values = catalogue.sampled_pieces(law, order)
    values = values * MM
    gap = np.full((1, law.spans.size), np.nan)  # lifts the pen between pieces
    line = (np.concatenate([part, gap]).T.ravel() for part in (np.degrees(angles), values))
    axes.plot(*line, color=colour)
    before = np.roll(ordinates[-1], 1)
    starts = np.degrees(law.breaks[:-1])
    axes.vlines(starts, before, ordinates[0], color=colour, lw=1.0, ls=":")
    _peaks(axes, law, order)
    axes.set_ylabel(f"{DERIVATIVE_NAMES[order]} [mm{PER_RADIAN[order]}]")
    axes.margins(y=0.2)


def _peaks(axes: Axes, law: Law, order: int) -> None:
    """Largest and smallest value with the angle, written away from the nearer edge."""
    low, high = extremes(law, order)
    for extreme, above in ((low, False), (high, True)) if high.value > low.value else ():
        value, at = extreme.value * MM, float(np.degrees(extreme.angle))
        axes.plot(at, value, "o", color=COLOURS[order], ms=4)
        x, side = (-6, "right") if at > 180.0 else (6, "left")
        y, end = (6, "bottom") if above else (-6, "top")
        words = f"{typeset_number(value, '.4g')} at {at:.4g}°"
        axes.annotate(words, (at, value), (x, y), ha=side, va=end, **WORDS)


def _control_points(axes: Axes, cam: CamConfig) -> None:
    """What the law is shaped by: control polygons, measured points."""
    for angles, ordinates in control_polygons(cam):
        axes.plot(np.degrees(angles), ordinates * MM, "s--", color=GREY, ms=3, lw=0.8, zorder=1)
    for segment in cam.segments:
        if isinstance(segment, Table):
            lifts = np.array(segment.file.lifts) * MM
            axes.plot(np.degrees(segment.file.angles), lifts, "o", color=GREY, ms=2.5, zorder=1)


def _names(axes: Axes, cam: CamConfig) -> None:
    """Each segment's law, where there is room for it."""
    for segment, start in zip(cam.segments, np.degrees(segment_angles(cam)), strict=True):
        span = np.degrees(segment.span.si)
        if span >= NAMELESS_DEG:
            style: Style = {"ha": "center", "va": "center", "color": GREY, "zorder": 0}
            style |= {"transform": axes.get_xaxis_transform()}
            turned = 90 if span < UPRIGHT_DEG else 0
            axes.text(start + 0.5 * span, 0.25, in_words(segment.law), rotation=turned, **style)


def _arrow(axes: Axes, x: float, jump: float, side: str, colour: str | None = None) -> None:
    """Where the velocity jumps the acceleration is infinite: an arrow at the panel's edge."""
    y, words, end = (0.97, "↑∞", "top") if jump > 0.0 else (0.03, "↓∞", "bottom")
    foot = axes.get_xaxis_transform()
    axes.text(x, y, words, ha=side, va=end, color=colour, transform=foot)


def _classes(axes: Axes, marked: list[Joint]) -> None:
    """The class of each marked joint, above the first panel."""
    at = [float(np.degrees(joint.angle)) for joint in marked]
    labels = [f"C{joint.continuity}" for joint in marked]
    top = axes.secondary_xaxis("top")
    top.set_xticks(at, labels)
    top.set_xlabel("continuity class at each knot", color=GREY)


# Laws laid over each other: s, s', s'', s''' of cams over the turn, or of bare rises over u.

#: Of the four rows, in inches.
HEIGHT = 8.2
#: Entries in a line of a legend above a figure of one column.
LEGEND_COLUMNS = 3
#: A rise's values are in parts of its rise h and span β.
RISE_UNITS = ("h", "h/β", "h/β²", "h/β³")


@styled
def cams_figure(cams: Sequence[tuple[CamConfig, Law]]) -> Figure:
    """The laws of cams over the cam angle, in mm."""
    curves = [(catalogue.cam_curves(short(cam.title), law), line(cam.name)) for cam, law in cams]
    out = empty(HEIGHT)
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
    """Bare rises of unit lift over a unit span, one column a family."""
    shown = list(families)
    alone = len(shown) == 1
    out = empty(HEIGHT)
    panels = out.subplots(len(catalogue.ORDERS), len(shown), sharex=True, squeeze=False)
    for name, unit, axes in zip(DERIVATIVE_NAMES, RISE_UNITS, panels[:, 0], strict=True):
        axes.set_ylabel(f"{name} [{unit}]")
    for column, family in zip(panels.T, shown, strict=True):
        curves = [(catalogue.rise_curves(name), line(name)) for name in family.rises]
        for order, axes in enumerate(column):
            _panel(axes, _distinct(curves), order, 1.0)
            axes.set_xlim(0.0, 1.0)
        column[-1].set_xlabel("part of the span, u [1]")
        _legend(column[0], LEGEND_COLUMNS if alone else 1, family.title)
    return out


def laws_figure(found: LawsResult) -> Figure:
    """A column for each family."""
    return rises_figure(found.families)


def rises_result_figure(found: RisesResult) -> Figure:
    """All in one column."""
    return rises_figure([catalogue.RiseFamily("Rises of h over the span β", found.names)])


def cam_laws_figure(found: CamLawsResult) -> Figure:
    """One cam with its joints and extremes, or several over each other."""
    return figure(*found.cams[0]) if len(found.cams) == 1 else cams_figure(found.cams)


def _distinct(
    curves: list[tuple[catalogue.LawCurves, Style]],
) -> list[tuple[catalogue.LawCurves, Style]]:
    """Curves that are the same one as a single curve with all their names."""
    found: dict[bytes, tuple[catalogue.LawCurves, Style]] = {}
    for one, drawn in curves:
        key = one.motion.tobytes()
        name = in_words(one.name)
        if key in found:
            name = f"{found[key][0].name}\n= {name}"
        found[key] = (catalogue.LawCurves(name, one.x, one.motion, one.infinite), drawn)
    return list(found.values())


def _panel(
    axes: Axes, curves: list[tuple[catalogue.LawCurves, Style]], order: int, factor: float
) -> None:
    """One derivative of every law; where the velocity jumps, s'' has an arrow at the edge."""
    for one, drawn in curves:
        axes.plot(one.x, one.motion[order] * factor, label=one.name, **drawn)
        for x, jump in one.infinite if order == 2 else ():
            _arrow(axes, x, jump, "left" if x < 0.5 * one.x[-1] else "right", drawn["color"])


def _legend(axes: Axes, columns: int, title: str | None = None) -> None:
    """Above the first panel, where it hides no curve."""
    axes.legend(
        loc="lower center", bbox_to_anchor=(0.5, 1.02), ncols=columns, title=title, frameon=False
    )

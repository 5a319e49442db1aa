"""Laws laid over each other: s, s', s'', s''' of cams over the turn, or of bare rises over u."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.drawing.outlines import MM
from cam_rig.drawing.words import in_words, short
from cam_rig.laws import Law
from cam_rig.laws.catalogue import RiseFamily
from cam_rig.laws.curves import ORDERS, LawCurves, cam_curves, rise_curves
from cam_rig.plots.figures import CAM_ANGLE, empty, line, styled, turn_axis, write
from cam_rig.plots.laws.one_law import NAMES, PER
from cam_rig.schema import CamConfig

#: Of the four rows, in inches.
HEIGHT = 8.2
#: Entries in a line of a legend above a figure of one column.
LEGEND_COLUMNS = 3
#: A rise's values are in parts of its rise h and span β.
RISE_UNITS = ("h", "h/β", "h/β²", "h/β³")
Style = dict[str, Any]


def draw_cams(cams: Sequence[tuple[CamConfig, Law]], path: Path) -> None:
    """Write cams over one turn to a file, of any kind that matplotlib knows by the suffix."""
    write(cams_figure(cams), path)


def draw_rises(families: Iterable[RiseFamily], path: Path) -> None:
    """Write bare rises, one column a family, to a file of any kind that matplotlib knows."""
    write(rises_figure(families), path)


@styled
def cams_figure(cams: Sequence[tuple[CamConfig, Law]]) -> Figure:
    """The laws of cams over the cam angle, in mm."""
    curves = [(cam_curves(short(cam.title), law), line(cam.name)) for cam, law in cams]
    out = empty(HEIGHT)
    panels = out.subplots(len(ORDERS), 1, sharex=True)
    for order, axes in enumerate(panels):
        _panel(axes, curves, order, MM)
        axes.set_ylabel(f"{NAMES[order]} [mm{PER[order]}]")
        turn_axis(axes, 30)
    panels[-1].set_xlabel(CAM_ANGLE)
    _legend(panels[0], LEGEND_COLUMNS)
    return out


@styled
def rises_figure(families: Iterable[RiseFamily]) -> Figure:
    """Bare rises of unit lift over a unit span, one column a family."""
    shown = list(families)
    alone = len(shown) == 1
    out = empty(HEIGHT)
    panels = out.subplots(len(ORDERS), len(shown), sharex=True, squeeze=False)
    for name, unit, axes in zip(NAMES, RISE_UNITS, panels[:, 0], strict=True):
        axes.set_ylabel(f"{name} [{unit}]")
    for column, family in zip(panels.T, shown, strict=True):
        curves = [(rise_curves(name), line(name)) for name in family.rises]
        for order, axes in enumerate(column):
            _panel(axes, _distinct(curves), order, 1.0)
            axes.set_xlim(0.0, 1.0)
        column[-1].set_xlabel("part of the span, u [1]")
        _legend(column[0], LEGEND_COLUMNS if alone else 1, family.title)
    return out


def _distinct(curves: list[tuple[LawCurves, Style]]) -> list[tuple[LawCurves, Style]]:
    """Curves that are the same one as a single curve with all their names."""
    found: dict[bytes, tuple[LawCurves, Style]] = {}
    for one, drawn in curves:
        key = one.motion.tobytes()
        name = (
            f"{found[key][0].name}\n= {in_words(one.name)}" if key in found else in_words(one.name)
        )
        found[key] = (LawCurves(name, one.x, one.motion, one.infinite), drawn)
    return list(found.values())


def _panel(axes: Axes, curves: list[tuple[LawCurves, Style]], order: int, factor: float) -> None:
    """One derivative of every law; where the velocity jumps, s'' has an arrow at the edge."""
    for one, drawn in curves:
        axes.plot(one.x, one.motion[order] * factor, label=one.name, **drawn)
        for x, jump in one.infinite if order == 2 else ():
            axes.text(
                x,
                0.97 if jump > 0.0 else 0.03,
                "↑∞" if jump > 0.0 else "↓∞",
                transform=axes.get_xaxis_transform(),
                ha="left" if x < 0.5 * one.x[-1] else "right",
                va="top" if jump > 0.0 else "bottom",
                color=drawn["color"],
            )


def _legend(axes: Axes, columns: int, title: str | None = None) -> None:
    """Above the first panel, where it hides no curve."""
    axes.legend(
        loc="lower center",
        bbox_to_anchor=(0.5, 1.02),
        ncols=columns,
        title=title,
        frameon=False,
    )

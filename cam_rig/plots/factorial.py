"""A factorial study drawn: each effect against the angle by law, and the shares of variance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from numpy.typing import NDArray

from cam_rig.drawing.colours import BLUE, LIGHT_GREY, ORANGE, SKY_BLUE, web
from cam_rig.plots.figures import empty, line, marker, write
from cam_rig.studies.factorial.design import EFFECTS, Design, Effect, Factorial
from cam_rig.studies.factorial.in_contact import contact_lost

#: Effects that have a panel.
SHOWN = tuple(e for e in EFFECTS if e.key != "noise_in_contact")
#: Parts of the variance: name, colour, hatch.
PARTS = (
    ("law, between continuity classes", BLUE, ""),
    ("law, within a class", SKY_BLUE, "//"),
    ("event angle", ORANGE, ".."),
    ("interaction of law and angle", LIGHT_GREY, "xx"),
)


def draw(found: Factorial, path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    write(figure(found), path, dpi=110)


def figure(found: Factorial) -> Figure:
    """Above each effect against the event angle by law, below the shares of its variance."""
    out = empty(13.0, 10.6)
    parts = out.subfigures(2, 1, height_ratios=[2.0, 1.0], squeeze=False)
    _effects(parts[0, 0], found)
    _shares(parts[1, 0], found)
    return out


def _effects(out: FigureBase, found: Factorial) -> None:
    designs = (found.same_angles, found.same_acceleration)
    panels = out.subplots(2, len(SHOWN))
    for row, design in zip(panels, designs, strict=True):
        for axes, effect in zip(row, SHOWN, strict=True):
            _curves(axes, design, effect, contact_lost(design, effect, found.config))
            axes.axhline(
                effect.factor * getattr(found.cams[found.config.proposed], effect.key),
                color="0.35",
                lw=1.2,
                ls=(0, (1, 2)),
                label=f"{found.config.proposed} as published",
            )
    for axes, effect in zip(panels[0], SHOWN, strict=True):
        axes.set_title(f"{effect.name} [{effect.unit}]", fontsize=11)
    panels[0, 0].set_ylabel("equal event angles")
    panels[1, 0].set_ylabel("equal peak acceleration")
    for axes in panels[0]:
        axes.set_xlabel("rise and fall, each [°]")
    for axes in panels[1]:
        axes.set_xlabel(f"rise and fall of {found.config.reference} [°]")
    handles, _ = panels[0, 0].get_legend_handles_labels()
    lost = Line2D([], [], ls="", marker="o", ms=4, color="0.35", mfc="white", label="contact lost")
    out.legend(
        handles=[*handles, lost],
        loc="outside lower center",
        ncols=4,
        frameon=False,
        handlelength=3.4,
    )


def _curves(axes: Axes, design: Design, effect: Effect, lost: NDArray[np.bool_]) -> None:
    """One curve a law; where contact is lost the marker is hollow."""
    degrees, values = np.degrees(design.angles), effect.values(design.cells)
    for i, (rise, order) in enumerate(zip(design.rises, design.classes, strict=True)):
        style = line(rise) | marker(rise) | {"ms": 4, "markevery": 1}
        label = f"{rise.replace('_', ' ')}, C{order}"
        axes.plot(degrees, values[i], lw=1.4, label=label, **style)
        hollow = style | {"ls": "", "markerfacecolor": "white", "zorder": 3}
        axes.plot(degrees[lost[i]], values[i][lost[i]], **hollow)
    if effect.decibels:
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0)))
        axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(alpha=0.25, which="both")


def _shares(out: FigureBase, found: Factorial) -> None:
    smooth = found.designs[-1]
    designs = [found.same_angles, found.same_acceleration]
    designs += [] if smooth is found.same_acceleration else [smooth]
    panels = out.subplots(1, len(designs), sharey=True)
    for axes, design in zip(panels, designs, strict=True):
        _bars(axes, design)
        axes.set(title=design.name, xlim=(0.0, 100.0), xlabel="share of the sum of squares [%]")
    panels[0].invert_yaxis()
    handles, labels = panels[0].get_legend_handles_labels()
    out.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)


def _bars(axes: Axes, design: Design) -> None:
    names = [effect.name for effect in EFFECTS]
    shares = []
    for effect in EFFECTS:
        found = design.analysis(effect)
        parts = (found.classes, found.rows - found.classes, found.columns, found.interaction)
        shares.append([100.0 * part / (found.total or 1.0) for part in parts])
    left = np.zeros(len(names))
    for (name, colour, hatch), widths in zip(PARTS, np.transpose(shares), strict=True):
        axes.barh(
            names, widths, left=left, color=web(colour), hatch=hatch, ec="white", lw=0.6, label=name
        )
        for i, (start, width) in enumerate(zip(left, widths, strict=True)):
            if width > 9.0:
                box = {"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.85}
                axes.text(
                    start + 0.5 * width, i, f"{width:.0f}", ha="center", va="center", bbox=box
                )
        left = left + widths

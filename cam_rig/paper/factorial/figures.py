"""A factorial study drawn: each effect against the angle by law, and the shares of variance."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from cam_rig.paper.factorial.study import EFFECTS, Design, Effect, FactorialResult
from cam_rig.show.figure import empty, line, logarithmic, marker, styled
from cam_rig.show.looks import BLUE, LIGHT_GREY, ORANGE, SKY_BLUE, in_words, web

#: Effects that have a panel.
SHOWN = tuple(e for e in EFFECTS if e.key != "noise_in_contact")
#: Of the two designs whose effects are shown.
TITLES = ("equal event angles", "equal peak acceleration")
#: Parts of the variance: name, colour, hatch.
PARTS = (
    ("law, between continuity classes", BLUE, ""),
    ("law, within a class", SKY_BLUE, "//"),
    ("event angle", ORANGE, ".."),
    ("interaction of law and angle", LIGHT_GREY, "xx"),
)


@styled
def figure(found: FactorialResult) -> Figure:
    """Above each effect against the event angle by law, below the shares of its variance."""
    out = empty(9.6)
    parts = out.subfigures(2, 1, height_ratios=[2.6, 1.0], squeeze=False)
    _effects(parts[0, 0], found)
    _shares(parts[1, 0], found)
    return out


def _effects(out: FigureBase, found: FactorialResult) -> None:
    designs, proposed = (found.same_angles, found.same_acceleration), found.config.proposed
    panels = out.subplots(len(SHOWN), len(designs), sharey="row")
    for row, effect in zip(panels, SHOWN, strict=True):
        for axes, design in zip(row, designs, strict=True):
            _curves(axes, design, effect, design.lost(effect, found.config))
            level = effect.factor * getattr(found.cams[proposed], effect.key)
            label = f"{in_words(proposed)} as published"
            axes.axhline(level, color="0.35", ls=(0, (1, 2)), label=label)
        row[0].set_ylabel(f"{effect.name}\n[{effect.unit}]")
    for axes, title in zip(panels[0], TITLES, strict=True):
        axes.set_title(title)
    panels[-1, 0].set_xlabel("rise and fall, each [°]")
    panels[-1, 1].set_xlabel(f"rise and fall of {in_words(found.config.reference)} [°]")
    handles, _ = panels[0, 0].get_legend_handles_labels()
    lost = Line2D([], [], ls="", marker="o", ms=4, color="0.35", mfc="white", label="contact lost")
    out.legend(handles=[*handles, lost], loc="outside lower center", ncols=3, frameon=False)


def _curves(axes: Axes, design: Design, effect: Effect, lost: NDArray[np.bool_]) -> None:
    """One curve a law; where contact is lost the marker is hollow."""
    degrees, values = np.degrees(design.angles), effect.factor * design.values(effect.key)
    for i, (rise, order) in enumerate(zip(design.rises, design.classes, strict=True)):
        style = line(rise) | marker(rise) | {"ms": 4, "markevery": 1}
        label = f"{in_words(rise)}, C{order}"
        axes.plot(degrees, values[i], label=label, **style)
        hollow = style | {"ls": "", "markerfacecolor": "white", "zorder": 3}
        axes.plot(degrees[lost[i]], values[i][lost[i]], **hollow)
    if effect.decibels:
        axes.set_yscale("log")
        logarithmic(axes.yaxis)


def _shares(out: FigureBase, found: FactorialResult) -> None:
    smooth = found.designs[-1]
    designs = [found.same_angles, found.same_acceleration]
    designs += [] if smooth is found.same_acceleration else [smooth]
    panels = out.subplots(1, len(designs), sharey=True)
    for axes, design in zip(panels, designs, strict=True):
        _bars(axes, design)
        axes.set(title=design.name.replace(", ", ",\n"), xlabel="share of the sum of squares [%]")
        axes.set(xlim=(0.0, 100.0), xticks=range(20, 81, 20))
    panels[0].invert_yaxis()
    words = panels[0].get_legend_handles_labels()
    out.legend(*words, loc="outside lower center", ncols=2, frameon=False)


def _bars(axes: Axes, design: Design) -> None:
    names = [effect.name for effect in EFFECTS]
    shares = []
    for effect in EFFECTS:
        of = design.shares(effect)
        shares.append(100.0 * np.array([of.classes, of.law - of.classes, of.angle, of.interaction]))
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

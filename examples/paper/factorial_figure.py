"""Figure of the factorial study: effects by event angle, shares of the variance."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D

from cam_rig.show.figure import empty, line, logarithmic, marker, styled
from cam_rig.show.looks import BLUE, LIGHT_GREY, ORANGE, SKY_BLUE, in_words, web
from examples.paper.factorial import EFFECTS, PROPOSED, REFERENCE, RISES, Design, Study


@styled
def figure(result: Study) -> Figure:
    """Draw each effect against the event angle by law, and the shares of its variance."""
    out = empty(9.6)
    parts = out.subfigures(2, 1, height_ratios=[2.6, 1.0], squeeze=False)
    _effects(parts[0, 0], result)
    _shares(parts[1, 0], result)
    return out


def _effects(out: FigureBase, result: Study) -> None:
    """Draw the curves of both designs, with a hollow marker where contact is lost."""
    keys = [key for key in EFFECTS if key != "noise_in_contact"]
    panels = out.subplots(len(keys), 2, sharey="row")
    for row, key in zip(panels, keys, strict=True):
        effect = EFFECTS[key]
        for axes, design in zip(row, result[:2], strict=True):
            values, lost = effect.factor * design.values(key), design.lost(key)
            for i, (rise, order) in enumerate(zip(RISES, design.classes, strict=True)):
                style = line(rise) | marker(rise) | {"ms": 4, "markevery": 1}
                axes.plot(design.angles, values[i], label=f"{in_words(rise)}, C{order}", **style)
                hollow = style | {"ls": "", "markerfacecolor": "white", "zorder": 3}
                axes.plot(np.array(design.angles)[lost[i]], values[i][lost[i]], **hollow)
            level = effect.factor * getattr(result.cams[PROPOSED], key)
            label = f"{in_words(PROPOSED)} as published"
            axes.axhline(level, color="0.35", ls=(0, (1, 2)), label=label)
            if effect.decibels:
                axes.set_yscale("log")
                logarithmic(axes.yaxis)
        row[0].set_ylabel(f"{effect.name}\n[{effect.unit}]")
    for axes, title in zip(panels[0], ("event angles", "peak acceleration"), strict=True):
        axes.set_title(f"equal {title}")
    panels[-1, 0].set_xlabel("rise and fall, each [°]")
    panels[-1, 1].set_xlabel(f"rise and fall of {in_words(REFERENCE)} [°]")
    handles, _ = panels[0, 0].get_legend_handles_labels()
    lost_style = Line2D([], [], ls="", marker="o", ms=4, color="0.35", mfc="white")
    lost_style.set_label("contact lost")
    out.legend(handles=[*handles, lost_style], loc="outside lower center", ncols=3, frameon=False)


def _shares(out: FigureBase, result: Study) -> None:
    """Draw the shares of the sum of squares as bars."""
    smooth = result.same_acceleration.smooth
    designs = [design for design in (*result[:2], smooth) if design is not None]
    panels = out.subplots(1, len(designs), sharey=True)
    for axes, design in zip(panels, designs, strict=True):
        _bars(axes, design)
        axes.set(title=design.name.replace(", ", ",\n"), xlabel="share of the sum of squares [%]")
        axes.set(xlim=(0.0, 100.0), xticks=range(20, 81, 20))
    panels[0].invert_yaxis()
    legend = panels[0].get_legend_handles_labels()
    out.legend(*legend, loc="outside lower center", ncols=2, frameon=False)


def _bars(axes: Axes, design: Design) -> None:
    """Draw a bar per effect, with the numbers of shares above 9 %."""
    parts = {
        "law, between continuity classes": (BLUE, ""),
        "law, within a class": (SKY_BLUE, "//"),
        "event angle": (ORANGE, ".."),
        "interaction of law and angle": (LIGHT_GREY, "xx"),
    }
    box = {"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.85}
    names, shares = [effect.name for effect in EFFECTS.values()], map(design.shares, EFFECTS)
    widths = [(s.classes, s.law - s.classes, s.angle, s.interaction) for s in shares]
    left = np.zeros(len(names))
    for (label, (colour, hatch)), part in zip(
        parts.items(), 100.0 * np.transpose(widths), strict=True
    ):
        bars = axes.barh(names, part, left=left, color=web(colour), label=label)
        for bar in bars:
            bar.set(hatch=hatch, edgecolor="white", linewidth=0.6)
        for i, (start, width) in enumerate(zip(left, part, strict=True)):
            if width > 9.0:
                position = start + 0.5 * width, i
                axes.text(*position, f"{width:.0f}", ha="center", va="center", bbox=box)
        left = left + part

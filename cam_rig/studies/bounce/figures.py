"""The bifurcation diagram over exponent and level; at one speed basins and phase portraits."""

from __future__ import annotations

from itertools import groupby
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from cam_rig.show.figure import CAM_SPEED, empty, series_marker, styled, wrapped
from cam_rig.show.looks import in_words
from cam_rig.studies.bounce.basins import Basins
from cam_rig.studies.bounce.motion import IN_CONTACT, IRREGULAR, NOT_TOLD, PERIODIC
from cam_rig.studies.bounce.result import BounceMap
from cam_rig.studies.bounce.sweep import SPEED, SWEPT

#: Of the axes' height, where what has the exponent −∞ is marked.
FOOT = 0.04
#: Motions that have a colour and a portrait.
MOST = 6


@styled
def figure(found: BounceMap) -> Figure:
    """A dot a turn for its hardest landing; the exponent with its error; the level with its span.

    Branches that were followed are lines, dotted where the motion is unstable. The first lift-off
    is marked where it is within what is swept.
    """
    heard = found.rows[0].level_db is not None
    out = empty(5.6 if heard else 4.2)
    panels = out.subplots(3 if heard else 2, 1, sharex=True, squeeze=False)[:, 0]
    _diagram(panels[0], found)
    _exponents(panels[1], found)
    if heard:
        _levels(panels[2], found)
    swept = found.swept(found.rows)
    name, unit, one = SWEPT[found.sweep.over]
    for axes in panels:
        if swept[0] <= found.lift_off / one <= swept[-1]:
            axes.axvline(found.lift_off / one, color="0.3", ls=":", lw=0.9)
    label = f"{name} [{unit}]" if unit else name
    panels[-1].set(xlabel=CAM_SPEED if found.sweep.over == SPEED else label)
    out.suptitle(wrapped(f"{in_words(found.law.name)} on {found.rig.title}, {found.held}"))
    out.legend(*panels[1].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return out


def _diagram(axes: Axes, found: BounceMap) -> None:
    swept = found.per_turn(found.swept(found.rows))
    hardest = np.concatenate([row.hardest for row in found.rows])
    axes.plot(swept, hardest, ls="", marker=".", ms=2.0, mew=0.0, color="0.1", rasterized=True)
    for branch in found.branches:
        for stable, run in groupby(branch.motions, lambda one: one.stable):
            motions = list(run)
            y = [one.hardest for one in motions]
            axes.plot(
                found.swept(motions), y, "-" if stable else ":", color="0.45", lw=0.8, zorder=1.5
            )
    axes.set(ylabel="hardest landing\nof each turn [m/s]")
    axes.set_ylim(bottom=0.0)


def _exponents(axes: Axes, found: BounceMap) -> None:
    axes.axhline(0.0, color="0.3", lw=0.8)
    for i, kind in enumerate((IRREGULAR, NOT_TOLD, PERIODIC, IN_CONTACT)):
        rows = [r for r in found.rows if r.motion == kind and np.isfinite(r.exponent)]
        if rows:
            y, errors = [r.exponent for r in rows], [r.exponent_error for r in rows]
            axes.errorbar(
                found.swept(rows), y, errors, ls="", ms=2.4, lw=0.8, label=kind, **series_marker(i)
            )
    rests = [r for r in found.rows if r.exponent == -np.inf]
    if rests:
        foot, at = axes.get_xaxis_transform(), np.full(len(rests), FOOT)
        axes.plot(
            found.swept(rests), at, "|", ms=4.0, color="0.3", transform=foot, label="−∞, on the cam"
        )
    axes.set(ylabel="exponent\n[1/turn]")


def _levels(axes: Axes, found: BounceMap) -> None:
    level = np.array([row.level_db for row in found.rows], dtype=float)
    half = 0.5 * np.array([row.level_spread_db for row in found.rows], dtype=float)
    swept = found.swept(found.rows)
    axes.fill_between(swept, level - half, level + half, color="0.75", lw=0.0)
    axes.plot(swept, level, color="0.1", lw=0.9)
    axes.set(ylabel="level, spread of\nturns [dB re 20 µPa]")


@styled
def basin_figure(found: Basins) -> Figure:
    """Left the starts by what they end in, right the phase portrait with its states at angle 0."""
    out = empty(3.9)
    left, right = out.subplots(1, 2)
    looks = [series_marker(i) for i in range(min(MOST, len(found.motions)))]
    colours = [look["color"] for look in looks]
    mapped = ListedColormap([*colours, "0.8"])
    shown = np.minimum(found.ends, len(colours))
    extent: Any = [found.gap[0] * 1e3, found.gap[-1] * 1e3, found.opening[0], found.opening[-1]]
    how: dict[str, Any] = {"origin": "lower", "aspect": "auto", "interpolation": "nearest"}
    left.imshow(shown, cmap=mapped, vmin=-0.5, vmax=len(colours) + 0.5, extent=extent, **how)
    left.set(xlabel="gap at cam angle 0 [mm]", ylabel="rate of the gap there [m/s]")
    left.grid(False)
    for motion, look in zip(found.motions, looks, strict=False):
        gap, rate = found.portrait(motion)
        period = f", period {motion.period}" if motion.period else ""
        label = f"{motion.name}: {motion.motion}{period}, {100.0 * motion.share:.0f} %"
        right.plot(gap * 1e3, rate, color=look["color"], lw=0.6, label=label)
        at = motion.states
        right.plot(at[:, 0] * 1e3, at[:, 1], ls="", ms=4.0, mec="0.1", mew=0.5, **look)
    right.set(xlabel="gap [mm]", ylabel="rate of the gap [m/s]")
    e = found.parameters.restitution
    words = (
        f"{in_words(found.law.name)} on {found.rig.title} at {found.rpm:g} rpm, restitution {e:g}"
    )
    out.suptitle(wrapped(words))
    out.legend(loc="outside lower center", ncols=2, frameon=False)
    return out

"""Figures of a bounce map, of basins of attraction and of phase portraits."""

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
from cam_rig.studies.bounce.motion import IN_CONTACT, IRREGULAR, PERIODIC, UNDETERMINED
from cam_rig.studies.bounce.result import BounceMap
from cam_rig.studies.bounce.sweep import SPEED, SWEPT

#: Height at which a Lyapunov exponent of −∞ is marked, as a fraction of the height of the axes.
MARK_HEIGHT = 0.04
#: Largest number of final motions that get a colour and a phase portrait.
MAX_MOTIONS = 6


@styled
def figure(result: BounceMap) -> Figure:
    """Draw fastest landing per turn, Lyapunov exponent and sound level.

    The horizontal axis is the swept quantity. Branches of periodic motions are lines, dotted where
    the motion is unstable. A dotted vertical line marks the first lift-off if it is within the
    swept range.
    """
    has_level = result.rows[0].level_db is not None
    out = empty(5.6 if has_level else 4.2)
    panels = out.subplots(3 if has_level else 2, 1, sharex=True, squeeze=False)[:, 0]
    _diagram(panels[0], result)
    _exponents(panels[1], result)
    if has_level:
        _levels(panels[2], result)
    swept = result.swept(result.rows)
    name, unit, factor = SWEPT[result.sweep.parameter]
    for axes in panels:
        if swept[0] <= result.lift_off / factor <= swept[-1]:
            axes.axvline(result.lift_off / factor, color="0.3", ls=":", lw=0.9)
    label = f"{name} [{unit}]" if unit else name
    panels[-1].set(xlabel=CAM_SPEED if result.sweep.parameter == SPEED else label)
    out.suptitle(wrapped(f"{in_words(result.law.name)} on {result.rig.title}, {result.fixed_text}"))
    out.legend(*panels[1].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return out


def _diagram(axes: Axes, result: BounceMap) -> None:
    swept = result.per_turn(result.swept(result.rows))
    max_landing_speed = np.concatenate([row.max_landing_speed for row in result.rows])
    axes.plot(
        swept, max_landing_speed, ls="", marker=".", ms=2.0, mew=0.0, color="0.1", rasterized=True
    )
    for branch in result.branches:
        for stable, run in groupby(branch.motions, lambda motion: motion.stable):
            motions = list(run)
            y = [motion.max_landing_speed for motion in motions]
            axes.plot(
                result.swept(motions), y, "-" if stable else ":", color="0.45", lw=0.8, zorder=1.5
            )
    axes.set(ylabel="fastest landing\nof each turn [m/s]")
    axes.set_ylim(bottom=0.0)


def _exponents(axes: Axes, result: BounceMap) -> None:
    axes.axhline(0.0, color="0.3", lw=0.8)
    for i, kind in enumerate((IRREGULAR, UNDETERMINED, PERIODIC, IN_CONTACT)):
        rows = [r for r in result.rows if r.motion == kind and np.isfinite(r.lyapunov_exponent)]
        if rows:
            y, errors = [r.lyapunov_exponent for r in rows], [r.exponent_error for r in rows]
            axes.errorbar(
                result.swept(rows), y, errors, ls="", ms=2.4, lw=0.8, label=kind, **series_marker(i)
            )
    rests = [r for r in result.rows if r.lyapunov_exponent == -np.inf]
    if rests:
        transform, heights = axes.get_xaxis_transform(), np.full(len(rests), MARK_HEIGHT)
        axes.plot(
            result.swept(rests),
            heights,
            "|",
            ms=4.0,
            color="0.3",
            transform=transform,
            label="−∞, on the cam",
        )
    axes.set(ylabel="exponent\n[1/turn]")


def _levels(axes: Axes, result: BounceMap) -> None:
    level = np.array([row.level_db for row in result.rows], dtype=float)
    half = 0.5 * np.array([row.level_spread_db for row in result.rows], dtype=float)
    swept = result.swept(result.rows)
    axes.fill_between(swept, level - half, level + half, color="0.75", lw=0.0)
    axes.plot(swept, level, color="0.1", lw=0.9)
    axes.set(ylabel="level, spread of\nturns [dB re 20 µPa]")


@styled
def basin_figure(result: Basins) -> Figure:
    """Draw the final motion of each initial state, and its phase portrait."""
    out = empty(3.9)
    left, right = out.subplots(1, 2)
    looks = [series_marker(i) for i in range(min(MAX_MOTIONS, len(result.motions)))]
    colours = [look["color"] for look in looks]
    mapped = ListedColormap([*colours, "0.8"])
    colour_indices = np.minimum(result.ends, len(colours))
    extent: Any = [
        result.gap[0] * 1e3,
        result.gap[-1] * 1e3,
        result.gap_rate[0],
        result.gap_rate[-1],
    ]
    options: dict[str, Any] = {"origin": "lower", "aspect": "auto", "interpolation": "nearest"}
    left.imshow(
        colour_indices, cmap=mapped, vmin=-0.5, vmax=len(colours) + 0.5, extent=extent, **options
    )
    left.set(xlabel="gap at cam angle 0 [mm]", ylabel="rate of the gap there [m/s]")
    left.grid(False)
    for motion, look in zip(result.motions, looks, strict=False):
        gap, rate = result.portrait(motion)
        period = f", period {motion.period}" if motion.period else ""
        label = f"{motion.name}: {motion.motion}{period}, {100.0 * motion.share:.0f} %"
        right.plot(gap * 1e3, rate, color=look["color"], lw=0.6, label=label)
        states = motion.states
        right.plot(states[:, 0] * 1e3, states[:, 1], ls="", ms=4.0, mec="0.1", mew=0.5, **look)
    right.set(xlabel="gap [mm]", ylabel="rate of the gap [m/s]")
    e = result.parameters.restitution
    subject = f"{in_words(result.law.name)} on {result.rig.title}"
    out.suptitle(wrapped(f"{subject} at {result.rpm:g} rpm, restitution {e:g}"))
    out.legend(loc="outside lower center", ncols=2, frameon=False)
    return out

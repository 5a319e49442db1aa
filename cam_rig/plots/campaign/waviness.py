"""The largest waviness over its wavelength."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from cam_rig.drawing.colours import BLUE, GREEN, SKY_BLUE, VERMILION, web
from cam_rig.plots.figures import empty, logarithmic, styled, wrapped, write
from cam_rig.studies.campaign.largest_waviness import (
    DECADES,
    LargestWaviness,
    WavinessSearch,
    resonances,
)
from cam_rig.tables import typeset

HEIGHT = 3.4
#: Of the axis above the largest amplitude and below the least.
ROOM = 1.5
#: What the wavelengths of each kind are drawn with.
FOUND: dict[str, Any] = {"color": web(BLUE), "marker": "o", "ms": 4.0}
WHOLE: dict[str, Any] = {"color": web(BLUE), "marker": "o", "ms": 4.0, "mfc": "white", "ls": "none"}


def draw(search: WavinessSearch, found: Sequence[LargestWaviness], path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    write(figure(search, found), path)


@styled
def figure(search: WavinessSearch, found: Sequence[LargestWaviness]) -> Figure:
    """Amplitude with its interval over wavelength; where waves meet the stem's resonance."""
    out = empty(HEIGHT)
    axes = out.subplots()
    angle = np.degrees([one.wavelength for one in found])
    floor = float(search.amplitudes[1]) * 1e6
    top = floor * 10.0**DECADES
    value, low, high = (
        np.array([limit_um(getattr(one, name), end, floor) for one in found])
        for name, end in (("amplitude", floor), ("low", floor), ("high", top))
    )
    axes.set_yscale("log")
    axes.fill_between(
        angle, low, high, color=web(SKY_BLUE), alpha=0.4, lw=0.0, label="interval of 95 %"
    )
    axes.plot(angle, value, **FOUND, label="does not divide the turn")
    whole = np.array([abs(one.waves - round(one.waves)) < 1e-9 for one in found])
    if whole.any():
        axes.plot(angle[whole], value[whole], **WHOLE, label="divides the turn")
    for one in resonances(search.campaign):
        if angle.min() <= np.degrees(one) <= angle.max():
            axes.axvline(
                np.degrees(one), color=web(VERMILION), ls="--", label="resonance at the limit"
            )
    outcome = np.array([one.outcome != "found" for one in found])
    if outcome.any():
        axes.plot(angle[outcome], value[outcome], "x", color=web(GREEN), label="at the end tried")
    known = np.concatenate([value, low[low > floor], high[high < top]])
    axes.set_ylim(known.min() / ROOM, known.max() * ROOM)
    logarithmic(axes.yaxis)
    axes.set_xlabel("wavelength [° of cam angle]")
    axes.set_ylabel("amplitude of waviness [µm]")
    words = " and ".join(limit.words for limit in search.campaign.limits)
    out.suptitle(wrapped(typeset(f"{search.campaign.config.title}: 99 % keep {words}")))
    out.legend(loc="outside lower center", ncols=3, frameon=False)
    return out


def limit_um(value: float | None, end: float, floor: float) -> float:
    """An amplitude (m) in µm on the axis: what is not told is the end, and 0 the floor (µm)."""
    return end if value is None else max(floor, value * 1e6)

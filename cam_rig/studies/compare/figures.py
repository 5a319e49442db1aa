"""A run and its model over one turn, on top of each other, and the difference below."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.show import looks as colours
from cam_rig.show.figure import CAM_ANGLE, empty, styled, turn_axis
from cam_rig.show.looks import EQUAL, is_rounding, reach, title_of, web
from cam_rig.studies.compare.comparison import QUANTITIES, SpeedDeparture, by_cam
from cam_rig.studies.compare.deviation import PairedSignal
from cam_rig.studies.compare.study import RunComparison

#: More readings a turn than this are drawn as a line.
MANY = 600
#: What its grey points are.
BESIDE = "beside a jump of the force: not counted"


def _chosen(here: Sequence[SpeedDeparture]) -> list[SpeedDeparture]:
    """Of one cam the lowest speed, the first with lift-offs, and the highest."""
    here = sorted(here, key=lambda row: row.rpm)
    leaving = [row for row in here if row.contact and row.contact.measured >= 0.5]
    some = {id(row): row for row in (*here[:1], *leaving[:1], *here[-1:])}
    return sorted(some.values(), key=lambda row: row.rpm)


@styled
def figure(found: RunComparison) -> Figure:
    """For each cam a column for each chosen speed: the curves, and below them their difference."""
    rows, titles = found.speeds, found.loaded.titles
    cams = [_chosen(here) for here in by_cam(row for row in rows if row.drawn)]
    shown = [name for name in QUANTITIES if any(name in row.drawn for row in rows)]
    across, down = max(map(len, cams), default=1), len(shown) * len(cams)
    if not down:
        return empty(1.0)
    out = empty(0.6 + 2.8 * down)
    ratios = [2.0, 1.0] * down
    panels = out.subplots(
        2 * down, across, sharex=True, sharey="row", squeeze=False, height_ratios=ratios
    )
    for i, columns in enumerate(cams):
        block = panels[2 * i * len(shown) : 2 * (i + 1) * len(shown)]
        _block(block, title_of(titles, columns[0].cam), columns, shown)
        for unused in block[:, len(columns) :].flat:
            unused.set_visible(False)
    for column in panels.T:
        lowest = [axes for axes in column if axes.get_visible()][-1]
        lowest.set_xlabel(CAM_ANGLE)
        lowest.tick_params(labelbottom=True)
    named = [axes.get_legend_handles_labels() for axes in panels.flat]
    handles = {
        name: line for lines, names in named for line, name in zip(lines, names, strict=True)
    }
    out.legend(handles.values(), handles, loc="outside lower center", ncols=2, markerscale=2.0)
    return out


def _block(
    panels: Any, title: str, columns: Sequence[SpeedDeparture], shown: Sequence[str]
) -> None:
    for j, row in enumerate(columns):
        panels[0, j].set_title(f"{title}\n{row.rpm:.6g} rpm")
    for i, name in enumerate(shown):
        words, unit, factor, small, fine, colour = QUANTITIES[name]
        turns = {j: row.drawn[name] for j, row in enumerate(columns) if name in row.drawn}
        for j, turn in turns.items():
            _curves(panels[2 * i, j], turn, factor, web(colour), name)
            _difference(panels[2 * i + 1, j], turn, fine)
        panels[2 * i, 0].set_ylabel(f"{words} [{unit}]")
        panels[2 * i + 1, 0].set_ylabel(f"difference [{small}]")
        # what is beside a landing does not set the scale
        largest = [np.abs(t.difference[t.calm]).max(initial=0.0) for t in turns.values()]
        apart = fine * max(largest, default=0.0)
        panels[2 * i + 1, 0].set_ylim(-reach(apart), reach(apart))
        if is_rounding(apart):
            panels[2 * i + 1, 0].set_title(EQUAL, loc="left", fontsize="medium")


def _curves(axes: Axes, turn: PairedSignal, factor: float, colour: str, name: str) -> None:
    many = turn.degrees.size > MANY
    style = {"lw": 3.0} if many else {"lw": 0.0, "marker": ".", "ms": 4.0}
    axes.plot(
        turn.degrees, turn.measured * factor, color=colour, label=f"{name}, measured", **style
    )
    axes.plot(turn.degrees, turn.model * factor, color="0.1", lw=1.0, label="model")
    turn_axis(axes)


def _difference(axes: Axes, turn: PairedSignal, factor: float) -> None:
    axes.axhline(0.0, color="0.1", lw=0.8)
    difference = turn.difference * factor
    dots: dict[str, Any] = {"lw": 0.0, "marker": ".", "ms": 2.5}
    if not turn.calm.all():
        beside = ~turn.calm
        axes.plot(turn.degrees[beside], difference[beside], color="0.7", label=BESIDE, **dots)
    axes.plot(turn.degrees[turn.calm], difference[turn.calm], color=web(colours.LIMIT), **dots)
    turn_axis(axes)

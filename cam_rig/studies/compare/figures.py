"""Figure of a measured run and its model over one turn, with their difference below."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.show import looks as colours
from cam_rig.show.figure import CAM_ANGLE, empty, styled, turn_axis
from cam_rig.show.looks import EQUAL, is_rounding, reach, title_of, web
from cam_rig.studies.compare.comparison import QUANTITIES, SpeedDeparture, group_by_cam
from cam_rig.studies.compare.deviation import PairedSignal
from cam_rig.studies.compare.study import RunComparison

#: Largest number of readings per turn that are drawn as points. More readings are drawn as a line.
MAX_POINTS = 600
#: Legend of the readings near a jump of the model's force. They are drawn as grey points.
NEAR_JUMP_LABEL = "near a jump of the force: not counted"


def _choose_speeds(rows: Sequence[SpeedDeparture]) -> list[SpeedDeparture]:
    """Choose up to three speeds of a cam for the figure, in rising order.

    They are the lowest speed, the first speed with lift-offs, and the highest speed. ``rows`` are
    the deviations of the cam, one per speed.
    """
    rows = sorted(rows, key=lambda row: row.rpm)
    with_lift_offs = [row for row in rows if row.contact and row.contact.measured >= 0.5]
    chosen = {id(row): row for row in (*rows[:1], *with_lift_offs[:1], *rows[-1:])}
    return sorted(chosen.values(), key=lambda row: row.rpm)


@styled
def figure(comparison: RunComparison) -> Figure:
    """Draw measured and modelled lift and force over one turn, with differences below.

    The figure has one column per chosen speed of each cam. It is empty if neither lift nor force
    was measured.
    """
    rows, titles = comparison.speeds, comparison.loaded.titles
    cams = [_choose_speeds(cam_rows) for cam_rows in group_by_cam(row for row in rows if row.drawn)]
    quantities = [name for name in QUANTITIES if any(name in row.drawn for row in rows)]
    column_count, block_count = max(map(len, cams), default=1), len(quantities) * len(cams)
    if not block_count:
        return empty(1.0)
    drawing = empty(0.6 + 2.8 * block_count)
    ratios = [2.0, 1.0] * block_count
    panels = drawing.subplots(
        2 * block_count,
        column_count,
        sharex=True,
        sharey="row",
        squeeze=False,
        height_ratios=ratios,
    )
    for i, columns in enumerate(cams):
        block = panels[2 * i * len(quantities) : 2 * (i + 1) * len(quantities)]
        _block(block, title_of(titles, columns[0].cam), columns, quantities)
        for unused in block[:, len(columns) :].flat:
            unused.set_visible(False)
    for column in panels.T:
        lowest = [axes for axes in column if axes.get_visible()][-1]
        lowest.set_xlabel(CAM_ANGLE)
        lowest.tick_params(labelbottom=True)
    legends = [axes.get_legend_handles_labels() for axes in panels.flat]
    handles = {
        name: line for lines, names in legends for line, name in zip(lines, names, strict=True)
    }
    drawing.legend(handles.values(), handles, loc="outside lower center", ncols=2, markerscale=2.0)
    return drawing


def _block(
    panels: Any, title: str, columns: Sequence[SpeedDeparture], quantities: Sequence[str]
) -> None:
    """Draw lift and force of one cam, in one column per speed.

    ``panels`` are the axes of the cam, two rows per quantity: the curves of run and model, and
    below them their difference. ``columns`` are the results at the drawn speeds.
    """
    for j, row in enumerate(columns):
        panels[0, j].set_title(f"{title}\n{row.rpm:.6g} rpm")
    for i, name in enumerate(quantities):
        text, unit, factor, difference_unit, difference_factor, colour = QUANTITIES[name]
        turns = {j: row.drawn[name] for j, row in enumerate(columns) if name in row.drawn}
        for j, turn in turns.items():
            _curves(panels[2 * i, j], turn, factor, web(colour), name)
            _difference(panels[2 * i + 1, j], turn, difference_factor)
        panels[2 * i, 0].set_ylabel(f"{text} [{unit}]")
        panels[2 * i + 1, 0].set_ylabel(f"difference [{difference_unit}]")
        # The scale is set by the differences away from landings, which are much smaller.
        largest = [np.abs(t.difference[t.away_from_jumps]).max(initial=0.0) for t in turns.values()]
        limit = difference_factor * max(largest, default=0.0)
        panels[2 * i + 1, 0].set_ylim(-reach(limit), reach(limit))
        if is_rounding(limit):
            panels[2 * i + 1, 0].set_title(EQUAL, loc="left", fontsize="medium")


def _curves(axes: Axes, turn: PairedSignal, factor: float, colour: str, name: str) -> None:
    is_dense = turn.degrees.size > MAX_POINTS
    style = {"lw": 3.0} if is_dense else {"lw": 0.0, "marker": ".", "ms": 4.0}
    axes.plot(
        turn.degrees, turn.measured * factor, color=colour, label=f"{name}, measured", **style
    )
    axes.plot(turn.degrees, turn.model * factor, color="0.1", lw=1.0, label="model")
    turn_axis(axes)


def _difference(axes: Axes, turn: PairedSignal, factor: float) -> None:
    counted = turn.away_from_jumps
    axes.axhline(0.0, color="0.1", lw=0.8)
    difference = turn.difference * factor
    dots: dict[str, Any] = {"lw": 0.0, "marker": ".", "ms": 2.5}
    if not counted.all():
        near = ~counted
        axes.plot(turn.degrees[near], difference[near], color="0.7", label=NEAR_JUMP_LABEL, **dots)
    axes.plot(turn.degrees[counted], difference[counted], color=web(colours.LIMIT), **dots)
    turn_axis(axes)

"""Measures of a grid as maps over two inputs, a panel for each step of the others."""

from __future__ import annotations

from itertools import product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase

from cam_rig.arrays import FloatArray
from cam_rig.drawing.colours import VERMILION, web
from cam_rig.plots.campaign.words import (
    input_name,
    input_title,
    input_unit,
    measure_title,
    measure_unit,
)
from cam_rig.plots.figures import empty, styled, wrapped
from cam_rig.studies.campaign.draws import steps_of
from cam_rig.studies.campaign.inputs import CampaignInput
from cam_rig.studies.campaign.measures import CampaignMeasure
from cam_rig.studies.campaign.results import CampaignResults
from cam_rig.tables import printed

#: Panels beside each other, and in all for one measure: the steps between are left out.
COLUMNS, PANELS = 3, 6
PANEL_HEIGHT = 2.3
#: Of a line over a panel, at most.
LETTERS = 26
#: Of a line along one row of panels, at most.
WORDS = 36


def varied(results: CampaignResults) -> list[CampaignInput]:
    """The inputs of a grid that have more than one step."""
    return [one for one, steps in _grid(results) if steps.size > 1]


def _grid(results: CampaignResults) -> list[tuple[CampaignInput, FloatArray]]:
    return [(one, steps_of(one)) for one in results.campaign.inputs]


@styled
def measure_map(results: CampaignResults) -> Figure:
    """Every measure over the two inputs with the most steps; limits are lines."""
    grid = _grid(results)
    order = sorted(range(len(grid)), key=lambda i: -grid[i][1].size)
    across, up = sorted(order[:2])
    cells = list(product(*(_few(steps, i in (across, up)) for i, (_, steps) in enumerate(grid))))
    columns = min(COLUMNS, len(cells))
    rows = -(-len(cells) // columns)
    measures = results.campaign.measures
    out = empty(len(measures) * (rows * PANEL_HEIGHT + 0.3))
    parts = out.subfigures(len(measures), 1, squeeze=False)
    for part, measure in zip(parts[:, 0], measures, strict=True):
        panels = part.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        _panels(part, panels.ravel().tolist(), results, measure, (across, up), cells)
    return out


def _few(steps: FloatArray, on_axis: bool) -> list[int | None]:
    """Which steps of an input have panels; None for one that is an axis."""
    if on_axis:
        return [None]
    return sorted({round(x) for x in np.linspace(0, steps.size - 1, min(PANELS, steps.size))})


def _panels(
    part: FigureBase,
    panels: list[Axes],
    results: CampaignResults,
    measure: CampaignMeasure,
    axis: tuple[int, int],
    cells: list[tuple[int | None, ...]],
) -> None:
    grid = _grid(results)
    values = (results.values(measure) / measure_unit(measure)[1]).reshape(
        [steps.size for _, steps in grid]
    )
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    levels = [
        limit.value / measure.term.quantity.shown
        for limit in results.campaign.limits
        if limit.term == measure.term and limit.value is not None
    ]
    mesh = None
    for axes, cell in zip(panels, cells, strict=False):
        plane = values[tuple(slice(None) if i is None else i for i in cell)].T
        sides = []
        for i in axis:
            one, steps = grid[i]
            sides.append(steps / input_unit(one)[1])
        mesh = axes.pcolormesh(
            *sides, plane, vmin=low, vmax=high, shading="nearest", rasterized=True
        )
        if levels and np.isfinite(plane).all() and min(plane.shape) > 1:
            axes.contour(*sides, plane, levels=sorted(levels), colors=web(VERMILION))
        axes.grid(visible=False)
        axes.set_title(_cell_title(grid, cell))
    for axes in panels[len(cells) :]:
        axes.set_visible(False)
    part.supxlabel(input_title(grid[axis[0]][0]), fontsize="medium")
    part.supylabel(input_title(grid[axis[1]][0]), fontsize="medium")
    if mesh is not None:
        part.colorbar(mesh, ax=panels, label=wrapped(measure_title(measure), WORDS))


def _cell_title(grid: list[tuple[CampaignInput, FloatArray]], cell: tuple[int | None, ...]) -> str:
    """The inputs that are no axis, with their step of the panel."""
    words = []
    for (one, steps), i in zip(grid, cell, strict=True):
        if i is not None and steps.size > 1:
            unit, factor = input_unit(one)
            words.append(f"{input_name(one)} {printed(float(steps[i]) / factor, '.4g')} {unit}")
    return wrapped("\n".join(words), LETTERS)

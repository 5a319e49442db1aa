"""Measures of drawn points: their distribution with its limits, and what each input does."""

from __future__ import annotations

import re
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from cam_rig.schema.quantity import UNITS
from cam_rig.show.figure import empty, styled, wrapped
from cam_rig.show.looks import BLUE, SKY_BLUE, VERMILION, web
from cam_rig.show.tables import typeset_number
from cam_rig.studies.campaign.campaign import CampaignMeasure
from cam_rig.studies.campaign.draws import steps_of
from cam_rig.studies.campaign.inputs import CampaignInput
from cam_rig.studies.campaign.results import FOR_MEDIAN, CampaignResult
from cam_rig.studies.campaign.schema import PERCENT
from cam_rig.units import FloatArray

#: Parts of a path that say where a number stands and not what it is.
_PLACES = re.compile(r"^(?:(?:rig|cam)\.(?:follower\.)?|profile\.|scene\.(?:program\.)?)")
_UNITS = {"um": "µm", "deg": "°"}


def _input_name(one: CampaignInput) -> str:
    """Such as ``spring stiffness``."""
    return _PLACES.sub("", one.path).replace(".", " ").replace("_", " ")


def _input_unit(one: CampaignInput) -> tuple[str, float]:
    """The unit an input is shown in and one of it in SI; SI where the study has percents."""
    unit = one.si_unit if one.variation.unit == PERCENT else one.variation.unit
    return _UNITS.get(unit, unit), UNITS[one.dimension][unit]


def _input_title(one: CampaignInput) -> str:
    unit = _input_unit(one)[0]
    return _input_name(one) if unit == "1" else f"{_input_name(one)} [{unit}]"


def _shown(results: CampaignResult, measure: CampaignMeasure) -> tuple[FloatArray, FloatArray]:
    """A measure of all points, and the finite ones, in the unit that is shown."""
    values = results.values(measure) / (measure.term.quantity.factor / measure.factor)
    return values, values[np.isfinite(values)]


def _measure_title(measure: CampaignMeasure) -> str:
    unit = measure.term.quantity.typeset
    return f"{measure.term.words} [{unit}]" if unit else measure.term.words


#: Bars of a histogram, and inputs of a tornado, at most.
BARS, INPUTS = 60, 12
#: Of a line under half the figure, at most.
LETTERS = 40
#: The part of the points at either end of an input that a bar of a tornado is of.
TENTH = 0.1
#: Height and look of the bars of the lowest tenth and of the highest.
LOOKS: tuple[tuple[float, dict[str, Any]], ...] = (
    (0.7, {"facecolor": web(SKY_BLUE), "edgecolor": "white"}),
    (0.4, {"facecolor": web(BLUE), "edgecolor": "white", "hatch": "///"}),
)

ENDS = ("lowest tenth of the input", "highest tenth")


@styled
def distributions(results: CampaignResult) -> Figure:
    """A row for each measure: histogram on the left, tornado on the right."""
    measures = results.campaign.measures
    count = min(INPUTS, len(results.campaign.inputs))
    height = max(2.2, 0.9 + 0.22 * count)
    out = empty(height * len(measures))
    panels = out.subplots(len(measures), 2, squeeze=False)
    for (left, right), measure in zip(panels, measures, strict=True):
        _histogram(left, results, measure)
        _tornado(right, results, measure)
    handles = [Patch(label=words, **look) for words, (_, look) in zip(ENDS, LOOKS, strict=True)]
    out.legend(handles=handles, loc="outside lower right", ncols=2, frameon=False)
    return out


def _histogram(axes: Axes, results: CampaignResult, measure: CampaignMeasure) -> None:
    """How often a measure is what; limits are lines, with the part that keeps them."""
    values, finite = _shown(results, measure)
    axes.set_xlabel(wrapped(_measure_title(measure), LETTERS))
    axes.set_ylabel("points")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    if finite.size:
        axes.hist(finite, bins=min(BARS, 5 + int(np.sqrt(finite.size))), color=web(SKY_BLUE))
    words = []
    if finite.size < values.size:
        words.append(f"{values.size - finite.size} points of {values.size} have no finite value")
    for found in results.yields():
        if found.limit.term == measure.term and found.limit.value is not None:
            bound = found.limit.value / found.limit.term.quantity.factor
            axes.axvline(bound, color=web(VERMILION), ls="--")
            sign = "≤" if found.limit.sense == "<=" else "≥"
            limit = f"{sign} {typeset_number(bound)} {measure.term.quantity.typeset}"
            words.append(f"{100.0 * found.share:.3g} % keep {limit}")
    axes.set_title("\n".join(words))


def _tornado(axes: Axes, results: CampaignResult, measure: CampaignMeasure) -> None:
    """The median of a measure where an input is in its lowest tenth, and in its highest."""
    values, finite = _shown(results, measure)
    rows = [
        (_input_name(one), *_ends(results.input_values(one.path), values))
        for one in results.campaign.inputs
    ]
    rows = [row for row in rows if np.isfinite(row[1:]).all()]
    rows = sorted(rows, key=lambda row: abs(row[2] - row[1]))[-INPUTS:]
    middle = float(np.median(finite)) if finite.size else 0.0
    for i, (_, low, high) in enumerate(rows):
        for end, (height, look) in zip((low, high), LOOKS, strict=True):
            axes.barh(i, end - middle, height, middle, **look)
    axes.set_title(_doubts(results, finite.size))
    axes.axvline(middle, color="0.2", lw=0.8)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.set_yticks(range(len(rows)), [row[0] for row in rows])
    axes.set_xlabel(wrapped(f"median {_measure_title(measure)}", LETTERS))
    axes.grid(visible=False, axis="y")


def _doubts(results: CampaignResult, points: int) -> str:
    """Why bars do not say what each input does; empty where they do."""
    needed, words = round(FOR_MEDIAN / TENTH), []
    if points < needed:
        words.append(f"too few points ({points}) for tenths: needs {needed}")
    if results.campaign.config.correlated:
        words.append("correlated inputs: no bar is of one alone")
    return "\n".join(wrapped(line, LETTERS) for line in words)


def _ends(inputs: FloatArray, values: FloatArray) -> tuple[float, float]:
    """The median of values at the lowest tenth of an input and at the highest; NaN of one value."""
    known = np.isfinite(values)
    inputs, values = inputs[known], values[known]
    if values.size == 0 or np.ptp(inputs) == 0.0:
        return np.nan, np.nan
    low, high = np.quantile(inputs, [TENTH, 1.0 - TENTH])
    return float(np.median(values[inputs <= low])), float(np.median(values[inputs >= high]))


# Measures of a grid as maps over two inputs, a panel for each step of the others.

#: Panels beside each other, and in all for one measure: the steps between are left out.
COLUMNS, PANELS = 3, 6
PANEL_HEIGHT = 2.3
#: Of a line over a panel, at most.
MAP_LETTERS = 26
#: Of a line along one row of panels, at most.
WORDS = 36


def _grid(results: CampaignResult) -> list[tuple[CampaignInput, FloatArray]]:
    return [(one, steps_of(one)) for one in results.campaign.inputs]


@styled
def measure_map(results: CampaignResult) -> Figure:
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
    results: CampaignResult,
    measure: CampaignMeasure,
    axis: tuple[int, int],
    cells: list[tuple[int | None, ...]],
) -> None:
    grid = _grid(results)
    values, finite = _shown(results, measure)
    values = values.reshape([steps.size for _, steps in grid])
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    levels = [
        limit.value / measure.term.quantity.factor
        for limit in results.campaign.limits
        if limit.term == measure.term and limit.value is not None
    ]
    mesh = None
    for axes, cell in zip(panels, cells, strict=False):
        plane = values[tuple(slice(None) if i is None else i for i in cell)].T
        sides = [grid[i][1] / _input_unit(grid[i][0])[1] for i in axis]
        look: dict[str, Any] = {"vmin": low, "vmax": high, "shading": "nearest"}
        mesh = axes.pcolormesh(*sides, plane, rasterized=True, **look)
        if levels and np.isfinite(plane).all() and min(plane.shape) > 1:
            axes.contour(*sides, plane, levels=sorted(levels), colors=web(VERMILION))
        axes.grid(visible=False)
        axes.set_title(_cell_title(grid, cell))
    for axes in panels[len(cells) :]:
        axes.set_visible(False)
    part.supxlabel(_input_title(grid[axis[0]][0]), fontsize="medium")
    part.supylabel(_input_title(grid[axis[1]][0]), fontsize="medium")
    if mesh is not None:
        part.colorbar(mesh, ax=panels, label=wrapped(_measure_title(measure), WORDS))


def _cell_title(grid: list[tuple[CampaignInput, FloatArray]], cell: tuple[int | None, ...]) -> str:
    """The inputs that are no axis, with their step of the panel."""
    words = []
    for (one, steps), i in zip(grid, cell, strict=True):
        if i is not None and steps.size > 1:
            unit, factor = _input_unit(one)
            words.append(
                f"{_input_name(one)} {typeset_number(float(steps[i]) / factor, '.4g')} {unit}"
            )
    return wrapped("\n".join(words), MAP_LETTERS)


def figure(results: CampaignResult) -> Figure:
    """A map where a grid varies two inputs or more, else distributions."""
    grid = results.campaign.config.plan.kind == "grid"
    if grid and sum(steps.size > 1 for _, steps in _grid(results)) > 1:
        return measure_map(results)
    return distributions(results)

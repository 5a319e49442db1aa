"""Figures of a campaign: distributions, effects of inputs, and maps of a grid."""

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

#: Pattern of the first part of an input's path, which is omitted from its displayed name.
_PREFIXES = re.compile(r"^(?:(?:rig|cam)\.(?:follower\.)?|profile\.|scene\.(?:schedule\.)?)")
#: Displayed symbols of units that differ from those in files.
_UNITS = {"um": "µm", "deg": "°"}


def _input_name(item: CampaignInput) -> str:
    """Return the displayed name of an input, such as ``spring stiffness``."""
    return _PREFIXES.sub("", item.path).replace(".", " ").replace("_", " ")


def _input_unit(item: CampaignInput) -> tuple[str, float]:
    """Return the displayed unit of an input, and the size of this unit in SI.

    For a variation in percent it is the SI unit.
    """
    unit = item.si_unit if item.variation.unit == PERCENT else item.variation.unit
    return _UNITS.get(unit, unit), UNITS[item.dimension][unit]


def _input_title(item: CampaignInput) -> str:
    unit = _input_unit(item)[0]
    return _input_name(item) if unit == "1" else f"{_input_name(item)} [{unit}]"


def _display_values(
    results: CampaignResult, measure: CampaignMeasure
) -> tuple[FloatArray, FloatArray]:
    """Return the values of a measure for all points, and those that are finite.

    Both arrays are in the displayed unit of the measure.
    """
    values = results.values(measure) / (measure.term.quantity.factor / measure.factor)
    return values, values[np.isfinite(values)]


def _measure_title(measure: CampaignMeasure) -> str:
    unit = measure.term.quantity.typeset
    return f"{measure.term.words} [{unit}]" if unit else measure.term.words


#: Largest number of bars of a histogram.
MAX_BARS = 60
#: Largest number of inputs in a tornado chart (bars that compare the effects of the inputs).
MAX_INPUTS = 12
#: Largest number of letters per line in a panel of half the figure's width.
LETTERS = 40
#: Fraction of the points (rigs) that one bar of a tornado chart represents: those with the lowest,
#: or with the highest, values of an input.
TENTH = 0.1
#: Height and plot options of the bars of a tornado chart: first for the lowest tenth of an input,
#: then for the highest.
LOOKS: tuple[tuple[float, dict[str, Any]], ...] = (
    (0.7, {"facecolor": web(SKY_BLUE), "edgecolor": "white"}),
    (0.4, {"facecolor": web(BLUE), "edgecolor": "white", "hatch": "///"}),
)

ENDS = ("lowest tenth of the input", "highest tenth")


@styled
def distributions(results: CampaignResult) -> Figure:
    """Draw a histogram and a tornado chart of each measure.

    A tornado chart compares the effects of the inputs on the measure.
    """
    measures = results.campaign.measures
    count = min(MAX_INPUTS, len(results.campaign.inputs))
    height = max(2.2, 0.9 + 0.22 * count)
    out = empty(height * len(measures))
    panels = out.subplots(len(measures), 2, squeeze=False)
    for (left, right), measure in zip(panels, measures, strict=True):
        _histogram(left, results, measure)
        _tornado(right, results, measure)
    handles = [Patch(label=text, **look) for text, (_, look) in zip(ENDS, LOOKS, strict=True)]
    out.legend(handles=handles, loc="outside lower right", ncols=2, frameon=False)
    return out


def _histogram(axes: Axes, results: CampaignResult, measure: CampaignMeasure) -> None:
    """Draw the histogram of a measure, its limits, and the share within each limit."""
    values, finite = _display_values(results, measure)
    axes.set_xlabel(wrapped(_measure_title(measure), LETTERS))
    axes.set_ylabel("points")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    if finite.size:
        axes.hist(finite, bins=min(MAX_BARS, 5 + int(np.sqrt(finite.size))), color=web(SKY_BLUE))
    lines = []
    if finite.size < values.size:
        lines.append(f"{values.size - finite.size} points of {values.size} have no finite value")
    for limit_yield in results.yields():
        if limit_yield.limit.term == measure.term and limit_yield.limit.value is not None:
            bound = limit_yield.limit.value / limit_yield.limit.term.quantity.factor
            axes.axvline(bound, color=web(VERMILION), ls="--")
            sign = "≤" if limit_yield.limit.sense == "<=" else "≥"
            limit = f"{sign} {typeset_number(bound)} {measure.term.quantity.typeset}"
            lines.append(f"{100.0 * limit_yield.share:.3g} % keep {limit}")
    axes.set_title("\n".join(lines))


def _tornado(axes: Axes, results: CampaignResult, measure: CampaignMeasure) -> None:
    """Draw the tornado chart of a measure: two bars per input.

    Each bar leads from the median of all points to the median of the points in the lowest, or
    highest, tenth of the input. The inputs with the largest effects are drawn.
    """
    values, finite = _display_values(results, measure)
    rows = [
        (_input_name(item), *_tenth_medians(results.input_values(item.path), values))
        for item in results.campaign.inputs
    ]
    rows = [row for row in rows if np.isfinite(row[1:]).all()]
    rows = sorted(rows, key=lambda row: abs(row[2] - row[1]))[-MAX_INPUTS:]
    median = float(np.median(finite)) if finite.size else 0.0
    for i, (_, low, high) in enumerate(rows):
        for end, (height, look) in zip((low, high), LOOKS, strict=True):
            axes.barh(i, end - median, height, median, **look)
    axes.set_title(_warnings(results, finite.size))
    axes.axvline(median, color="0.2", lw=0.8)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.set_yticks(range(len(rows)), [row[0] for row in rows])
    axes.set_xlabel(wrapped(f"median {_measure_title(measure)}", LETTERS))
    axes.grid(visible=False, axis="y")


def _warnings(results: CampaignResult, points: int) -> str:
    """Return warnings for the title of a tornado chart, or an empty text.

    There may be too few points for the tenths. With correlated inputs, a bar is not the effect of
    one input alone.
    """
    needed, reasons = round(FOR_MEDIAN / TENTH), []
    if points < needed:
        reasons.append(f"too few points ({points}) for tenths: needs {needed}")
    if results.campaign.config.correlated:
        reasons.append("correlated inputs: no bar is of one alone")
    return "\n".join(wrapped(line, LETTERS) for line in reasons)


def _tenth_medians(inputs: FloatArray, values: FloatArray) -> tuple[float, float]:
    """Return the medians of a measure in the lowest and the highest tenth of an input.

    ``inputs`` and ``values`` are those of all points. The medians are NaN for a constant input, and
    if no value is finite.
    """
    finite = np.isfinite(values)
    inputs, values = inputs[finite], values[finite]
    if values.size == 0 or np.ptp(inputs) == 0.0:
        return np.nan, np.nan
    low, high = np.quantile(inputs, [TENTH, 1.0 - TENTH])
    return float(np.median(values[inputs <= low])), float(np.median(values[inputs >= high]))


# Maps of the measures of a grid over two inputs, with one panel per value of the other inputs.

#: Largest number of map panels (maps of a measure over two inputs) next to each other.
MAX_COLUMNS = 3
#: Largest number of map panels for the values of an input that is not on an axis. Of more values,
#: evenly spaced ones are displayed.
MAX_PANELS = 6
#: Height of a map panel (map of a measure over two inputs), inches.
PANEL_HEIGHT = 2.3
#: Largest number of letters per line in the title of a map panel, a map of a measure over two
#: inputs.
MAP_LETTERS = 26
#: Largest number of letters per line in the label of the colour bar of a row of maps.
ROW_LETTERS = 36


def _grid(results: CampaignResult) -> list[tuple[CampaignInput, FloatArray]]:
    return [(item, steps_of(item)) for item in results.campaign.inputs]


@styled
def measure_map(results: CampaignResult) -> Figure:
    """Draw maps of every measure over the two inputs with the most values on the grid.

    The limits of a measure are drawn as lines in its maps.
    """
    grid = _grid(results)
    order = sorted(range(len(grid)), key=lambda i: -grid[i][1].size)
    x, y = sorted(order[:2])
    cells = list(product(*(_panel_steps(steps, i in (x, y)) for i, (_, steps) in enumerate(grid))))
    columns = min(MAX_COLUMNS, len(cells))
    rows = -(-len(cells) // columns)
    measures = results.campaign.measures
    out = empty(len(measures) * (rows * PANEL_HEIGHT + 0.3))
    parts = out.subfigures(len(measures), 1, squeeze=False)
    for part, measure in zip(parts[:, 0], measures, strict=True):
        panels = part.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        _panels(part, panels.ravel().tolist(), results, measure, (x, y), cells)
    return out


def _panel_steps(steps: FloatArray, on_axis: bool) -> list[int | None]:
    """Return the indices of the values of one input that get a map panel each.

    ``steps`` are the values of the input on the grid. The result is [None] for an input that is on
    an axis of the maps (``on_axis``).
    """
    if on_axis:
        return [None]
    return sorted({round(x) for x in np.linspace(0, steps.size - 1, min(MAX_PANELS, steps.size))})


def _panels(
    part: FigureBase,
    panels: list[Axes],
    results: CampaignResult,
    measure: CampaignMeasure,
    axis: tuple[int, int],
    cells: list[tuple[int | None, ...]],
) -> None:
    grid = _grid(results)
    values, finite = _display_values(results, measure)
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
        part.colorbar(mesh, ax=panels, label=wrapped(_measure_title(measure), ROW_LETTERS))


def _cell_title(grid: list[tuple[CampaignInput, FloatArray]], cell: tuple[int | None, ...]) -> str:
    """Return the title of a map panel.

    It names the values of the inputs that are not on an axis of the map. ``grid`` contains each
    input with its values. ``cell`` contains the index of the value per input, None for an input on
    an axis.
    """
    lines = []
    for (item, steps), i in zip(grid, cell, strict=True):
        if i is not None and steps.size > 1:
            unit, factor = _input_unit(item)
            lines.append(
                f"{_input_name(item)} {typeset_number(float(steps[i]) / factor, '.4g')} {unit}"
            )
    return wrapped("\n".join(lines), MAP_LETTERS)


def figure(results: CampaignResult) -> Figure:
    """Draw the figure that suits the plan of a campaign.

    It is maps if a grid varies two inputs or more, otherwise the distributions of the measures.
    """
    grid = results.campaign.config.plan.kind == "grid"
    if grid and sum(steps.size > 1 for _, steps in _grid(results)) > 1:
        return measure_map(results)
    return distributions(results)

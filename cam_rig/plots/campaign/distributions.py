"""Measures of drawn points: their distribution with its limits, and what each input does."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from cam_rig.arrays import FloatArray
from cam_rig.drawing.colours import BLUE, SKY_BLUE, VERMILION, web
from cam_rig.plots.campaign.words import input_name, measure_title, measure_unit
from cam_rig.plots.figures import empty, styled, wrapped
from cam_rig.studies.campaign.measures import CampaignMeasure
from cam_rig.studies.campaign.results import FOR_MEDIAN, CampaignResults
from cam_rig.tables import printed

#: Bars of a histogram, and inputs of a tornado, at most.
BARS, INPUTS = 60, 12
#: Of a line under half the figure, at most.
LETTERS = 40
#: The part of the points at either end of an input that a bar of a tornado is of.
TENTH = 0.1
#: What the bars of the lowest tenth and of the highest are drawn with.
LOOKS: tuple[dict[str, Any], ...] = (
    {"height": 0.7, "facecolor": web(SKY_BLUE), "edgecolor": "white"},
    {"height": 0.4, "facecolor": web(BLUE), "edgecolor": "white", "hatch": "///"},
)
ENDS = ("lowest tenth of the input", "highest tenth")


@styled
def distributions(results: CampaignResults) -> Figure:
    """A row for each measure: histogram on the left, tornado on the right."""
    measures = results.campaign.measures
    count = min(INPUTS, len(results.campaign.inputs))
    height = max(2.2, 0.9 + 0.22 * count)
    out = empty(height * len(measures))
    panels = out.subplots(len(measures), 2, squeeze=False)
    for (left, right), measure in zip(panels, measures, strict=True):
        values = results.values(measure) / measure_unit(measure)[1]
        _histogram(left, results, measure, values)
        _tornado(right, results, measure, values)
    handles = [Patch(label=words, **_patch(look)) for words, look in zip(ENDS, LOOKS, strict=True)]
    out.legend(handles=handles, loc="outside lower right", ncols=2, frameon=False)
    return out


def _patch(look: dict[str, Any]) -> dict[str, Any]:
    """The same look of a key."""
    return {key: value for key, value in look.items() if key != "height"}


def _histogram(
    axes: Axes, results: CampaignResults, measure: CampaignMeasure, values: FloatArray
) -> None:
    """How often a measure is what; limits are lines, with the part that keeps them."""
    finite = values[np.isfinite(values)]
    axes.set_xlabel(wrapped(measure_title(measure), LETTERS))
    axes.set_ylabel("points")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    if finite.size:
        axes.hist(finite, bins=min(BARS, 5 + int(np.sqrt(finite.size))), color=web(SKY_BLUE))
    words = []
    if finite.size < values.size:
        words.append(f"{values.size - finite.size} points of {values.size} have no finite value")
    for found in results.yields():
        if found.limit.term == measure.term and found.limit.value is not None:
            bound = found.limit.value / found.limit.term.quantity.shown
            axes.axvline(bound, color=web(VERMILION), ls="--")
            sign = "≤" if found.limit.sense == "<=" else "≥"
            limit = f"{sign} {printed(bound)} {measure_unit(measure)[0]}"
            words.append(f"{100.0 * found.share:.3g} % keep {limit}")
    axes.set_title("\n".join(words))


def _tornado(
    axes: Axes, results: CampaignResults, measure: CampaignMeasure, values: FloatArray
) -> None:
    """The median of a measure where an input is in its lowest tenth, and in its highest."""
    rows = [
        (input_name(one), *_ends(results.input_values(one.path), values))
        for one in results.campaign.inputs
    ]
    rows = [row for row in rows if np.isfinite(row[1:]).all()]
    rows = sorted(rows, key=lambda row: abs(row[2] - row[1]))[-INPUTS:]
    finite = values[np.isfinite(values)]
    middle = float(np.median(finite)) if finite.size else 0.0
    for i, (_, low, high) in enumerate(rows):
        for end, look in zip((low, high), LOOKS, strict=True):
            axes.barh(i, end - middle, left=middle, **look)
    axes.set_title(_doubts(results, finite.size))
    axes.axvline(middle, color="0.2", lw=0.8)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.set_yticks(range(len(rows)), [row[0] for row in rows])
    axes.set_xlabel(wrapped(f"median {measure_title(measure)}", LETTERS))
    axes.grid(visible=False, axis="y")


def _doubts(results: CampaignResults, points: int) -> str:
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

"""A campaign's results as tables and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from cam_rig.campaigns.largest_waviness import LOST, LargestWaviness, WavinessSearch, resonances
from cam_rig.campaigns.measures import CampaignMeasure
from cam_rig.campaigns.point import UNSETTLED
from cam_rig.campaigns.results import SHARE_ERROR, CampaignResults, Quantile, points_needed
from cam_rig.campaigns.sensitivities import FirstOrder, JumpSensitivity, first_orders
from cam_rig.show.tables import DataTable, Head, counted, number, tabulate
from cam_rig.units import RPM

#: Points from which on a standard deviation is known to about 10 % (1/√(2n)).
FOR_SPREAD = 50

INTERVALS = (
    "Intervals are of 95 %, for independent draws; of a Latin hypercube or Sobol's sequence they "
    "are on the safe side."
)


def result_tables(results: CampaignResults) -> list[DataTable]:
    """Quantiles of each measure, yields, and shares where the plan gives them."""
    campaign = results.campaign
    random = campaign.config.plan.kind != "grid"
    tables = [quantile_table(results)] if random else [extreme_table(results)]
    if campaign.limits:
        tables.append(yield_table(results))
    if campaign.config.plan.kind == "shares":
        tables += [share_table(results, measure) for measure in campaign.measures]
    if random:
        tables += [derivative_table(one) for one in first_orders(results)]
    return tables


def derivative_table(found: FirstOrder) -> DataTable:
    """A row each input, and whether first order says what the points do."""
    predicted, real = found.predicted / RPM, found.found / RPM
    without = [one.path for one in found.inputs if one.derivative is None]
    left = f", without {', '.join(without)}" if without else ""
    words = (
        f"First order predicts a standard deviation of {number(predicted, '.3g')} rpm{left}; the "
        f"points have {number(real, '.3g')} rpm"
    )
    words += ": do not rely on it here." if found.lies else "."
    if found.correlated:
        words += " Inputs are correlated: the prediction counts their covariances."
    if found.points < FOR_SPREAD:
        words += f" Of {counted(found.points, 'point')} a spread is not told: needs {FOR_SPREAD}."

    def rpm(one: JumpSensitivity, factor: float) -> float | None:
        return None if one.derivative is None else one.derivative * factor / RPM

    return tabulate(
        f"Local derivatives of {found.measure.term.words}, in the middle of the inputs",
        found.inputs,
        (
            (Head("input"), lambda one: one.path),
            (Head("there", "SI", ".6g"), lambda one: one.value),
            (Head("rpm each SI unit", "", ".6g", "none"), lambda one: rpm(one, 1.0)),
            (
                Head("rpm each percent", "", ".4g", "none"),
                lambda one: rpm(one, 0.01 * one.value),
            ),
        ),
        words,
    )


def quantile_table(results: CampaignResults) -> DataTable:
    """A row each measure and probability."""
    rows = [(m, q) for m in results.campaign.measures for q in results.quantiles(m)]

    def at(name: str) -> Any:
        return lambda row: _known(getattr(row[1], name))

    return tabulate(
        f"{results.campaign.config.title}: {counted(results.points, 'point')}",
        rows,
        (
            (Head("measure"), lambda row: row[0].term.words),
            (Head("quantile", "%", "g"), lambda row: 100.0 * row[1].probability),
            (Head("value", "", ".6g"), at("value")),
            (Head("from", "", ".6g"), at("low")),
            (Head("to", "", ".6g"), at("high")),
            (Head("unit"), lambda row: row[0].unit),
            (Head("outcome"), lambda row: "not found" if np.isnan(row[1].value) else None),
        ),
        _not_found(rows),
        INTERVALS,
        results.failures,
        results.unsettled,
    )


def _not_found(rows: Iterable[tuple[CampaignMeasure, Quantile]]) -> str:
    """How many draws the quantiles need that are not found; empty where all are."""
    needed: dict[int, list[str]] = {}
    for _, one in rows:
        probability = f"{100.0 * one.probability:g} %"
        if np.isnan(one.value) and probability not in needed.setdefault(one.needed, []):
            needed[one.needed].append(probability)
    if not needed:
        return ""
    words = [f"{n} draws for {' and '.join(which)}" for n, which in needed.items()]
    return f"Not found: needs at least {', '.join(words)}."


def _known(value: float) -> float | None:
    """Nothing for what the sample does not tell."""
    return None if np.isnan(value) else value


def extreme_table(results: CampaignResults) -> DataTable:
    """Of a grid, which is no sample: the least and the largest of each measure."""

    def row_of(measure: CampaignMeasure) -> tuple[CampaignMeasure, float, float]:
        values = results.values(measure)
        values = values[~np.isnan(values)]
        if values.size == 0:
            return measure, float("nan"), float("nan")
        return measure, float(values.min()), float(values.max())

    return tabulate(
        f"{results.campaign.config.title}: {counted(results.points, 'point')}",
        [row_of(measure) for measure in results.campaign.measures],
        (
            (Head("measure"), lambda row: row[0].term.words),
            (Head("least", "", ".6g"), lambda row: _known(row[1])),
            (Head("largest", "", ".6g"), lambda row: _known(row[2])),
            (Head("unit"), lambda row: row[0].unit),
        ),
        results.failures,
        results.unsettled,
    )


def yield_table(results: CampaignResults) -> DataTable:
    """A row each limit."""
    grid = results.campaign.config.plan.kind == "grid"
    columns: list[Any] = [
        (Head("limit"), lambda row: row.limit.words),
        (Head("kept by", "%", ".4g"), lambda row: 100.0 * row.share),
    ]
    if not grid:
        columns += [
            (Head("from", "%", ".4g"), lambda row: 100.0 * row.low),
            (Head("to", "%", ".4g"), lambda row: 100.0 * row.high),
        ]
    return tabulate("Limits", results.yields(), columns)


def share_table(results: CampaignResults, measure: CampaignMeasure) -> DataTable:
    """A row each input."""
    shares, points = results.shares(measure), results.campaign.config.plan.points
    assert points is not None  # the schema's
    needed = points_needed(shares, points)
    return tabulate(
        f"Shares of the variance of {measure.term.words}",
        shares,
        (
            (Head("input"), lambda row: row.path),
            (Head("alone", "1", ".3f"), lambda row: row.first),
            (Head("±", "1", ".3f"), lambda row: row.first_error),
            (Head("in all", "1", ".3f"), lambda row: row.total),
            (Head("± ", "1", ".3f"), lambda row: row.total_error),
        ),
        "Alone: of the first order. In all: with interactions. ± of 95 %, bootstrapped.",
        ""
        if needed == points
        else f"Too few points to tell shares to ±{SHARE_ERROR:g}: plan.points is {points}, about "
        f"{needed} are needed.",
    )


def _plain(found: Quantile) -> dict[str, float | None]:
    """JSON has neither NaN nor ∞: null for both."""
    plain = {key: value if np.isfinite(value) else None for key, value in vars(found).items()}
    return plain | {"needed_draws": found.needed}


def to_json(results: CampaignResults) -> dict[str, Any]:
    """The same as plain data, in the units of the rows."""
    campaign = results.campaign
    random = campaign.config.plan.kind != "grid"
    shares = campaign.config.plan.kind == "shares"
    return {
        "study": campaign.config.name,
        "points": results.points,
        "seed": campaign.seed,
        "failed": results.failed,
        "unsettled": sum(n for _, n in results.dataset.reasons(UNSETTLED)),
        "reasons": [{"reason": text, "points": n} for text, n in results.dataset.reasons()],
        "fingerprint": campaign.fingerprint,
        "measures": {
            m.column: {
                "unit": m.unit,
                **({"quantiles": [_plain(q) for q in results.quantiles(m)]} if random else {}),
                **({"shares": [vars(s) for s in results.shares(m)]} if shares else {}),
            }
            for m in campaign.measures
        },
        "local_derivatives": {
            one.measure.column: {x.path: x.derivative for x in one.inputs}
            for one in (first_orders(results) if random else [])
        },
        "limits": [
            {"limit": y.limit.words, "share": y.share, "low": y.low, "high": y.high}
            for y in results.yields()
        ],
    }


def waviness_table(search: WavinessSearch, found: Sequence[LargestWaviness]) -> DataTable:
    """A row each wavelength."""
    limits = " and ".join(limit.words for limit in search.campaign.limits)
    near = resonances(search.campaign)
    words = [
        f"The same {search.campaign.total} draws for all; from and to are the interval of 95 % "
        "that so many draws give."
    ]
    if near:
        angles = " and ".join(f"{number(math.degrees(one), '.4g')}°" for one in near)
        words.append(f"Waves of {angles} meet the stem's resonance at the limit's speed.")

    def um(value: float | None) -> float | None:
        return None if value is None else value * 1e6

    return tabulate(
        f"Largest waviness with which 99 % keep: {limits}",
        found,
        (
            (Head("wavelength", "deg", ".4g"), lambda one: math.degrees(one.wavelength)),
            (Head("waves a turn", "1", ".5g"), lambda one: one.waves),
            (Head("amplitude", "µm", ".3g"), lambda one: um(one.amplitude)),
            (Head("from", "µm", ".3g", "not told"), lambda one: um(one.low)),
            (Head("to", "µm", ".3g", "not told"), lambda one: um(one.high)),
            (Head("outcome"), lambda one: one.outcome),
        ),
        *words,
    )


def waviness_json(search: WavinessSearch, found: Sequence[LargestWaviness]) -> dict[str, Any]:
    """The same as plain data, SI; null where so few draws do not tell."""
    campaign = search.campaign
    return {
        "study": campaign.config.name,
        "draws": campaign.total,
        "seed": campaign.seed,
        "limits": [limit.words for limit in campaign.limits],
        "kept_by": 1.0 - LOST,
        "resonance_wavelengths_rad": resonances(campaign),
        "wavelengths": [
            {
                "wavelength_rad": one.wavelength,
                "waves": one.waves,
                "amplitude_m": one.amplitude,
                "low_m": one.low,
                "high_m": one.high,
                "outcome": one.outcome,
                "evaluations": one.evaluations,
            }
            for one in found
        ],
    }

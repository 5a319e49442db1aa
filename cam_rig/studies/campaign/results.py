"""What a campaign's rows come to: quantiles, yields and shares, each with its own error.

Columns are read one at a time. Intervals are of 95 %, for independent draws: on a Latin hypercube
or Sobol's sequence the true error is smaller, and they are on the safe side.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from scipy.stats import beta, binom

from cam_rig.errors import ConfigError
from cam_rig.extras import libraries_named
from cam_rig.quantities.terms import Limit
from cam_rig.show.result import Column, Footnote, Records, Result
from cam_rig.show.tables import pluralize
from cam_rig.studies.campaign.campaign import UNSETTLED, Campaign, CampaignMeasure, kept
from cam_rig.studies.campaign.dataset import CampaignDataset
from cam_rig.studies.campaign.sensitivities import JumpSensitivity, first_orders
from cam_rig.units import RPM, FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

#: Probabilities of the quantiles.
PROBABILITIES = (0.01, 0.05, 0.5, 0.95, 0.99)
#: Reasons of failed points that are named.
REASONS = 3
#: Probability that an interval does not hold the number.
MISSED = 0.05
#: Draws from which on the median of a sample has an interval.
FOR_MEDIAN = 6
#: Shares are told whose interval is no wider than ± so much.
SHARE_ERROR = 0.1

INTERVALS = (
    "Intervals are of 95 %, for independent draws; of a Latin hypercube or Sobol's sequence they "
    "are on the safe side."
)


@dataclass(frozen=True)
class Quantile:
    """A quantile of a measure and its interval, in the measure's unit; NaN beyond the sample.

    The value is NaN too where an end of its interval is, with fewer than ``needed`` draws.
    """

    probability: float
    value: float
    low: float
    high: float

    @property
    def needed(self) -> int:
        """Draws from which on the sample has both ends of its interval."""
        outside = max(self.probability, 1.0 - self.probability)
        return math.ceil(math.log(0.5 * MISSED) / math.log(outside))


@dataclass(frozen=True)
class LimitYield:
    """The part of all points that keeps a limit, with its interval (not of a grid)."""

    limit: Limit
    share: float
    low: float
    high: float
    grid: bool = False


@dataclass(frozen=True)
class InputShare:
    """What an input contributes to a measure's variance: alone, and with all its interactions."""

    path: str
    first: float
    first_error: float
    total: float
    total_error: float


@dataclass(frozen=True)
class OfMeasure:
    """What there is of a measure: a quantile, a share, a derivative; of a grid its ends."""

    measure: CampaignMeasure
    own: Any


def _of(key: str, unit: str = "", shown: str = ".6g", heading: str = "") -> Column:
    return Column(key, unit, shown, heading, f"own.{key}")


MEASURE = Column("measure", of="measure.column", cell=lambda one: one.measure.term.words)
UNIT = Column("unit", of="measure.unit")
#: What a table is of, of which there is one for each measure.
OF = (
    Column("measure", of="measure.column", hidden=True),
    Column("title", of="measure.term.words"),
    Column("input", of="own.path"),
)


def _rpm(factor: Callable[[JumpSensitivity], float]) -> Callable[[OfMeasure], float | None]:
    def cell(one: OfMeasure) -> float | None:
        own: JumpSensitivity = one.own
        return None if own.derivative is None else own.derivative * factor(own) / RPM

    return cell


@dataclass(frozen=True, eq=False, repr=False)
class CampaignResult(Result):
    """The rows of a finished campaign: ``quantiles(measure)``, ``yields()``, ``shares(measure)``.

    Columns are read one at a time.
    """

    schema = "cam_rig.campaign.1"
    plot_function = "cam_rig.studies.campaign.figures:figure"
    columns: ClassVar = {
        "quantiles": (
            MEASURE,
            Column("probability", "%", "g", "quantile", of="own.probability"),
            Column("value", "", ".6g", of="own.value", missing="–"),
            _of("low", heading="from"),
            _of("high", heading="to"),
            UNIT,
            Column("needed_draws", "", "d", "needs draws", "own.needed"),
            Column("found", of=lambda one: not math.isnan(one.own.value), hidden=True),
        ),
        "extremes": (
            MEASURE,
            Column("least", "", ".6g", of="own.0"),
            Column("largest", "", ".6g", of="own.1"),
            UNIT,
        ),
        "limits": (
            Column("limit", of="limit.words"),
            Column("share", "%", ".4g", "kept by"),
            Column("low", "%", ".4g", "from", cell=lambda y: None if y.grid else 100.0 * y.low),
            Column("high", "%", ".4g", "to", cell=lambda y: None if y.grid else 100.0 * y.high),
        ),
        "shares": (
            *OF,
            _of("first", "1", ".3f", "alone"),
            _of("first_error", "1", ".3f", "±"),
            _of("total", "1", ".3f", "in all"),
            _of("total_error", "1", ".3f", "± "),
        ),
        "local_derivatives": (
            *OF,
            _of("value", "SI", heading="there"),
            Column(
                "derivative", "", ".6g", "rpm each SI unit", "own.derivative",
                _rpm(lambda _: 1.0), "none", doc="in data rad/s each SI unit",
            ),
            Column(
                "each_percent", "", ".4g", "rpm each percent",
                lambda one: one.own.derivative and 0.01 * one.own.value * one.own.derivative,
                _rpm(lambda own: 0.01 * own.value), "none", doc="in data rad/s",
            ),
        ),
        "first_order": (
            Column("measure", of="measure.column", cell=lambda one: one.measure.term.words),
            Column("predicted", "rpm", ".3g", "predicted", lambda one: one.predicted / RPM),
            Column("found", "rpm", ".3g", "of the points", lambda one: one.found / RPM),
            Column("points", "", "d", hidden=True),
            Column("correlated", heading="covariances"),
            Column(
                "left_out",
                heading="without",
                of=lambda one: [i.path for i in one.inputs if i.derivative is None],
                cell=lambda one: ", ".join(i.path for i in one.inputs if i.derivative is None),
            ),
        ),
        "reasons": (
            Column("reason", of="0"),
            Column("points", of="1"),
        ),
        "campaign": (
            Column("study", of="campaign.config.name"),
            Column("points"),
            Column("seed", of="campaign.seed"),
            Column("failed", doc="points without a measure"),
            Column("unsettled", of=lambda one: sum(n for _, n in one.dataset.reasons(UNSETTLED))),
            Column("fingerprint", of="campaign.fingerprint"),
        ),
    }  # fmt: skip

    dataset: CampaignDataset

    @property
    def campaign(self) -> Campaign:
        """Whose rows they are."""
        return self.dataset.campaign

    @cached_property
    def failed(self) -> int:
        """Points without a measure."""
        bad = np.zeros(1, dtype=bool)
        for measure in self.campaign.measures:
            bad = bad | np.isnan(self.values(measure))
        return int(bad.sum())

    @property
    def points(self) -> int:
        """Points that there are rows of."""
        return sum(last - first for first, last, _ in self.dataset.batches())

    @cached_property
    def failures(self) -> str:
        """How many points failed and the most frequent reasons, in a line; empty where none did."""
        if not self.failed:
            return ""
        reasons = self.dataset.reasons()
        named = [f"{reason} ({count})" for reason, count in reasons[:REASONS]]
        if len(reasons) > REASONS:
            rest = sum(count for _, count in reasons[REASONS:])
            named.append(f"{pluralize(len(reasons) - REASONS, 'other reason')} ({rest})")
        return (
            f"{self.failed} of {pluralize(self.points, 'point')} could not be made: "
            f"{', '.join(named)}"
        )

    @property
    def unsettled(self) -> str:
        """How many points never settled, and of which turns their measures are; empty for none."""
        reasons = self.dataset.reasons(UNSETTLED)
        count = sum(points for _, points in reasons)
        points = pluralize(self.points, "point")
        return f"{count} of {points}, such as {reasons[0][0]}" if reasons else ""

    def values(self, measure: CampaignMeasure) -> FloatArray:
        """A measure of every point, in its unit in rows, NaN where a point has none."""
        return self.dataset.column(measure.column)

    def input_values(self, path: str) -> FloatArray:
        """An input of every point, SI."""
        one = next(one for one in self.campaign.inputs if one.path == path)
        return self.dataset.column(one.column)

    def quantiles(self, measure: CampaignMeasure) -> tuple[Quantile, ...]:
        """`PROBABILITIES` of a measure; 0 and ∞ are values as any other."""
        values = np.sort(self.values(measure))
        return tuple(quantile(values[~np.isnan(values)], p) for p in PROBABILITIES)

    def yields(self) -> tuple[LimitYield, ...]:
        """One for each limit, by the binomial's exact interval (Clopper and Pearson)."""
        grid, found = self.campaign.config.plan.kind == "grid", []
        for limit in self.campaign.limits:
            values = self.values(CampaignMeasure(limit.term))
            share = proportion(int(kept(limit, values).sum()), values.size)
            found.append(LimitYield(limit, *share, grid))
        return tuple(found)

    def shares(self, measure: CampaignMeasure) -> tuple[InputShare, ...]:
        """First-order and total shares by SALib, of a plan of that kind."""
        plan = self.campaign.config.plan
        values = self.values(measure)
        if plan.kind != "shares" or values.size != self.campaign.total:
            raise ConfigError(
                f"shares: of a finished campaign whose plan is shares; this one's is {plan.kind}"
            )
        bad = int((~np.isfinite(values)).sum())
        if bad:
            raise ConfigError(
                f"shares of {measure.term.key}: {pluralize(bad, 'point')} without a finite value"
                f"{f' ({self.failures})' if self.failures else ''}; allowed: inputs that vary less"
            )
        paths = [one.path for one in self.campaign.inputs]
        return saltelli_shares(values, paths, self.campaign.seed)

    def tables(self) -> list[Records]:
        """``quantiles``, of a grid ``extremes``, then yields, shares and local derivatives."""
        return self._tables

    @cached_property
    def _tables(self) -> list[Records]:
        kind, title = self.campaign.config.plan.kind, self.campaign.config.title
        caption = f"{title}: {pluralize(self.points, 'point')}"
        found = [
            self._extremes(caption) if kind == "grid" else self._quantiles(caption),
            self.table("limits", "Limits", self.yields()),
        ]
        if kind == "shares":
            found.append(self._shares())
        if kind != "grid":
            orders = first_orders(self)
            rows = [OfMeasure(order.measure, one) for order in orders for one in order.inputs]
            caption = "Local derivatives of {title}, in the middle of the inputs"
            spread = "Standard deviation of the jump speed: by first order, and of the points"
            found.append(self.table("local_derivatives", caption, rows, group_by="title"))
            found.append(self.table("first_order", spread, orders))
        reasons = self.dataset.reasons()
        return [
            *found,
            self.table("reasons", "Why points failed", reasons, hidden=True),
            self.table("campaign", "Campaign", [self], single=True, hidden=True),
        ]

    def _quantiles(self, caption: str) -> Records:
        rows = [OfMeasure(m, q) for m in self.campaign.measures for q in self.quantiles(m)]
        return self.table("quantiles", caption, rows, INTERVALS, self.failures, self.unsettled)

    def _extremes(self, caption: str) -> Records:
        rows = []
        for measure in self.campaign.measures:
            values = self.values(measure)
            values = values[~np.isnan(values)]
            ends = (float(values.min()), float(values.max())) if values.size else (None, None)
            rows.append(OfMeasure(measure, ends))
        return self.table("extremes", caption, rows, self.failures, self.unsettled)

    def _shares(self) -> Records:
        points, rows, notes = self.campaign.config.plan.points, [], []
        assert points is not None  # the schema's
        for measure in self.campaign.measures:
            shares = self.shares(measure)
            rows += [OfMeasure(measure, one) for one in shares]
            if (needed := points_needed(shares, points)) != points:
                words = f"For shares within ±{SHARE_ERROR:g} plan.points must be about {needed}."
                notes.append(Footnote(words, partial(_is_of, measure)))
        first = "Alone: of the first order. In all: with interactions. ± of 95 %, bootstrapped."
        caption = "Shares of the variance of {title}"
        return self.table("shares", caption, rows, first, *notes, group_by="title")

    def summary(self) -> list[str]:
        """Where the rows are."""
        return [f"dataset: {self.dataset.folder}/*.parquet"]

    def to_pandas(self, key: str = "") -> DataFrame:
        """A row each point in the order of the plan, as in the dataset; or a table by its key."""
        if key:
            return super().to_pandas(key)
        with libraries_named():
            from pandas import concat
        return concat([table.to_pandas() for table in self.dataset.tables()], ignore_index=True)


def _is_of(measure: CampaignMeasure, row: OfMeasure) -> bool:
    return row.measure == measure


def points_needed(shares: Sequence[InputShare], points: int) -> int:
    """Points of a base sample, a power of 2, with which shares would be within `SHARE_ERROR`."""
    errors = [error for one in shares for error in (one.first_error, one.total_error)]
    ratio = (max(errors) / SHARE_ERROR) ** 2
    return points if ratio <= 1.0 else 1 << math.ceil(math.log2(points * ratio))


def quantile(values: FloatArray, probability: float) -> Quantile:
    """A quantile of sorted numbers, with the order statistics that hold it with 95 %."""
    count = values.size
    if count == 0:
        return Quantile(probability, np.nan, np.nan, np.nan)
    low, high = order_interval(count, probability)
    told = 0 <= low <= high < count
    return Quantile(
        probability,
        float(np.quantile(values, probability, method="inverted_cdf")) if told else np.nan,
        float(values[low]) if low >= 0 else np.nan,
        float(values[high]) if high < count else np.nan,
    )


def order_interval(count: int, probability: float) -> tuple[int, int]:
    """Places, from 0, of the sorted numbers between which a quantile is; outside: beyond them."""
    low = int(binom.ppf(0.5 * MISSED, count, probability)) - 1
    return low, int(binom.ppf(1.0 - 0.5 * MISSED, count, probability))


def proportion(kept: int, count: int) -> tuple[float, float, float]:
    """The part kept of independent draws, and its interval."""
    low = float(beta.ppf(0.5 * MISSED, kept, count - kept + 1)) if kept else 0.0
    high = float(beta.ppf(1.0 - 0.5 * MISSED, kept + 1, count - kept)) if kept < count else 1.0
    return (kept / count if count else np.nan), low, high


def saltelli_shares(values: FloatArray, paths: list[str], seed: int) -> tuple[InputShare, ...]:
    """Shares from rows in the order of `unit_points`; zeros of a measure that does not vary."""
    with libraries_named():
        from SALib.analyze import sobol
    if np.ptp(values) == 0.0:
        return tuple(InputShare(path, 0.0, 0.0, 0.0, 0.0) for path in paths)
    problem = {"num_vars": len(paths), "names": paths, "bounds": [[0.0, 1.0]] * len(paths)}
    found = sobol.analyze(problem, values, calc_second_order=False, seed=seed)
    keys = ("S1", "S1_conf", "ST", "ST_conf")
    columns = zip(paths, *(found[key].tolist() for key in keys), strict=True)
    return tuple(InputShare(*column) for column in columns)

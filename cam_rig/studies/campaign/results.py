"""Results of a campaign: quantiles, yields and variance shares, with their errors.

A yield is the fraction of points that satisfy a limit. Columns of the dataset are read one at a
time. Intervals of 95 % assume independent draws. A Latin hypercube or a Sobol sequence has smaller
errors, so its intervals are conservative.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from scipy.special import bdtr, bdtrik, betaincinv

from cam_rig.errors import ConfigError
from cam_rig.extras import friendly_import_errors
from cam_rig.quantities.terms import Limit
from cam_rig.show.result import Column, Footnote, Records, Result
from cam_rig.show.tables import pluralize
from cam_rig.studies.campaign.campaign import UNSETTLED, Campaign, CampaignMeasure, satisfies
from cam_rig.studies.campaign.dataset import CampaignDataset
from cam_rig.studies.campaign.sensitivities import JumpSensitivity, first_orders
from cam_rig.units import RPM, FloatArray

if TYPE_CHECKING:
    from pandas import DataFrame

#: Probabilities of the quantiles in the table of results.
PROBABILITIES = (0.01, 0.05, 0.5, 0.95, 0.99)
#: Largest number of different reasons that a note on failed points lists.
MAX_REASONS = 3
#: Probability that the true value is outside of a 95 % interval.
MISSED = 0.05
#: Smallest number of random points (rigs) for which a 95 % interval of the median exists.
FOR_MEDIAN = 6
#: Half-width of the 95 % interval of a variance share (Sobol index) above which a note suggests
#: more points.
SHARE_ERROR = 0.1

#: Note below the table of quantiles that explains their 95 % intervals.

INTERVALS = (
    "Intervals of 95 % assume independent draws; they are conservative for a Latin hypercube or a "
    "Sobol sequence."
)


@dataclass(frozen=True)
class Quantile:
    """Quantile of a measure with its 95 % interval, in the unit of the measure.

    ``low`` or ``high`` is NaN if that end of the interval is beyond the sample, which happens with
    fewer than ``needed`` draws. ``value`` is then NaN too.
    """

    probability: float
    value: float
    low: float
    high: float

    @property
    def needed(self) -> int:
        """Smallest number of draws for which both ends of the interval are in the sample."""
        outside = max(self.probability, 1.0 - self.probability)
        return math.ceil(math.log(0.5 * MISSED) / math.log(outside))


@dataclass(frozen=True)
class LimitYield:
    """Fraction of all points (rigs) that satisfy a limit, with its 95 % interval.

    If ``grid`` is True, the points are not random, and the interval has no meaning.
    """

    limit: Limit
    share: float
    low: float
    high: float
    grid: bool = False


@dataclass(frozen=True)
class InputShare:
    """Sobol indices of an input: its shares in the variance of a measure.

    ``first`` is the share of the input alone, and ``total`` includes its interactions with other
    inputs. The errors are half-widths of 95 % intervals.
    """

    path: str
    first: float
    first_error: float
    total: float
    total_error: float


@dataclass(frozen=True)
class MeasureRow:
    """Row of a results table: a measure, and one result for this measure.

    ``item`` is a `Quantile`, an `InputShare`, a `JumpSensitivity`, or the pair of extreme values.
    """

    measure: CampaignMeasure
    item: Any


def _item_column(key: str, unit: str = "", spec: str = ".6g", heading: str = "") -> Column:
    return Column(key, unit, spec, heading, f"item.{key}")


#: Table column with the name of the measure.
MEASURE = Column("measure", of="measure.column", cell=lambda row: row.measure.term.words)
#: Table column with the unit of the measure in the dataset.
UNIT = Column("unit", of="measure.unit")
#: First columns of a results table that is displayed separately for each measure.
MEASURE_COLUMNS = (
    Column("measure", of="measure.column", hidden=True),
    Column("title", of="measure.term.words"),
    Column("input", of="item.path"),
)


def _rpm(factor: Callable[[JumpSensitivity], float]) -> Callable[[MeasureRow], float | None]:
    def cell(row: MeasureRow) -> float | None:
        item: JumpSensitivity = row.item
        return None if item.derivative is None else item.derivative * factor(item) / RPM

    return cell


@dataclass(frozen=True, eq=False, repr=False)
class CampaignResult(Result):
    """Result of a finished campaign: dataset, quantiles, yields and variance shares."""

    schema = "cam_rig.campaign.1"
    plot_function = "cam_rig.studies.campaign.figures:figure"
    columns: ClassVar = {
        "quantiles": (
            MEASURE,
            Column("probability", "%", "g", "quantile", of="item.probability"),
            Column("value", "", ".6g", of="item.value", missing="–"),
            _item_column("low", heading="from"),
            _item_column("high", heading="to"),
            UNIT,
            Column("needed_draws", "", "d", "needs draws", "item.needed"),
            Column("found", of=lambda row: not math.isnan(row.item.value), hidden=True),
        ),
        "extremes": (
            MEASURE,
            Column("least", "", ".6g", of="item.0"),
            Column("largest", "", ".6g", of="item.1"),
            UNIT,
        ),
        "limits": (
            Column("limit", of="limit.words"),
            Column("share", "%", ".4g", "kept by"),
            Column("low", "%", ".4g", "from", cell=lambda y: None if y.grid else 100.0 * y.low),
            Column("high", "%", ".4g", "to", cell=lambda y: None if y.grid else 100.0 * y.high),
        ),
        "shares": (
            *MEASURE_COLUMNS,
            _item_column("first", "1", ".3f", "alone"),
            _item_column("first_error", "1", ".3f", "±"),
            _item_column("total", "1", ".3f", "in all"),
            _item_column("total_error", "1", ".3f", "± "),
        ),
        "local_derivatives": (
            *MEASURE_COLUMNS,
            _item_column("value", "SI", heading="there"),
            Column(
                "derivative", "", ".6g", "rpm each SI unit", "item.derivative",
                _rpm(lambda _: 1.0), "none", doc="in data rad/s each SI unit",
            ),
            Column(
                "each_percent", "", ".4g", "rpm each percent",
                lambda row: row.item.derivative and 0.01 * row.item.value * row.item.derivative,
                _rpm(lambda item: 0.01 * item.value), "none", doc="in data rad/s",
            ),
        ),
        "first_order": (
            Column("measure", of="measure.column", cell=lambda row: row.measure.term.words),
            Column("predicted", "rpm", ".3g", "predicted", lambda row: row.predicted / RPM),
            Column("found", "rpm", ".3g", "of the points", lambda row: row.observed / RPM),
            Column("points", "", "d", hidden=True),
            Column("correlated", heading="covariances"),
            Column(
                "excluded",
                heading="without",
                of=lambda row: [i.path for i in row.inputs if i.derivative is None],
                cell=lambda row: ", ".join(i.path for i in row.inputs if i.derivative is None),
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
            Column("unsettled", of=lambda row: sum(n for _, n in row.dataset.reasons(UNSETTLED))),
            Column("fingerprint", of="campaign.fingerprint"),
        ),
    }  # fmt: skip

    dataset: CampaignDataset

    @property
    def campaign(self) -> Campaign:
        """Campaign whose rows the dataset contains."""
        return self.dataset.campaign

    @cached_property
    def failed(self) -> int:
        """Number of points (rigs) for which at least one measure failed."""
        bad = np.zeros(1, dtype=bool)
        for measure in self.campaign.measures:
            bad = bad | np.isnan(self.values(measure))
        return int(bad.sum())

    @property
    def points(self) -> int:
        """Number of points (rigs) in the dataset."""
        return sum(last - first for first, last, _ in self.dataset.batches())

    @cached_property
    def failures(self) -> str:
        """Text on failed points: their number and the most frequent reasons.

        It is empty if no point failed.
        """
        if not self.failed:
            return ""
        reasons = self.dataset.reasons()
        named = [f"{reason} ({count})" for reason, count in reasons[:MAX_REASONS]]
        if len(reasons) > MAX_REASONS:
            remaining = sum(count for _, count in reasons[MAX_REASONS:])
            named.append(f"{pluralize(len(reasons) - MAX_REASONS, 'other reason')} ({remaining})")
        return (
            f"{self.failed} of {pluralize(self.points, 'point')} could not be computed: "
            f"{', '.join(named)}"
        )

    @property
    def unsettled(self) -> str:
        """Text on points without a steady motion: their number and an example of a reason.

        It is empty if there are no such points.
        """
        reasons = self.dataset.reasons(UNSETTLED)
        count = sum(points for _, points in reasons)
        points = pluralize(self.points, "point")
        return f"{count} of {points}, such as {reasons[0][0]}" if reasons else ""

    def values(self, measure: CampaignMeasure) -> FloatArray:
        """Return the values of a measure, one per point (rig), in the unit of the dataset.

        The value is NaN if the measure failed.
        """
        return self.dataset.column(measure.column)

    def input_values(self, path: str) -> FloatArray:
        """Return the values (SI) of an input, one per point (rig).

        ``path`` is the path of the input, such as ``rig.follower.mass``.
        """
        item = next(item for item in self.campaign.inputs if item.path == path)
        return self.dataset.column(item.column)

    def quantiles(self, measure: CampaignMeasure) -> tuple[Quantile, ...]:
        """Return the quantiles of a measure at the probabilities `PROBABILITIES`.

        Points (rigs) for which the measure failed are ignored. 0 and ∞ are included as values.
        """
        values = np.sort(self.values(measure))
        return tuple(quantile(values[~np.isnan(values)], p) for p in PROBABILITIES)

    def yields(self) -> tuple[LimitYield, ...]:
        """Return the yield of each limit: the fraction of points that satisfy it.

        The intervals are the exact binomial intervals of Clopper and Pearson.
        """
        grid, limit_yields = self.campaign.config.plan.kind == "grid", []
        for limit in self.campaign.limits:
            values = self.values(CampaignMeasure(limit.term))
            share = proportion(int(satisfies(limit, values).sum()), values.size)
            limit_yields.append(LimitYield(limit, *share, grid))
        return tuple(limit_yields)

    def shares(self, measure: CampaignMeasure) -> tuple[InputShare, ...]:
        """Return the shares of the inputs in the variance of a measure, computed by SALib.

        They are Sobol indices of first order and in total.

        Raises
        ------
        ConfigError
            If the plan is not ``shares``, the campaign is not finished, or a value is not finite.
        """
        plan = self.campaign.config.plan
        values = self.values(measure)
        if plan.kind != "shares" or values.size != self.campaign.total:
            raise ConfigError(
                f"shares require a finished campaign whose plan is shares, got {plan.kind}"
            )
        invalid = int((~np.isfinite(values)).sum())
        if invalid:
            raise ConfigError(
                f"shares of {measure.term.key} require a finite value of every point, got "
                f"{pluralize(invalid, 'point')} without one"
                f"{f' ({self.failures})' if self.failures else ''}; let the inputs vary less"
            )
        paths = [item.path for item in self.campaign.inputs]
        return saltelli_shares(values, paths, self.campaign.seed)

    def tables(self) -> list[Records]:
        """Return the tables of quantiles, limits, variance shares and local derivatives.

        A grid has ``extremes`` (smallest and largest values) instead of ``quantiles``. Variance
        shares exist for the plan ``shares`` only. Failures and the plan are in hidden tables.
        """
        return self._tables

    @cached_property
    def _tables(self) -> list[Records]:
        kind, title = self.campaign.config.plan.kind, self.campaign.config.title
        caption = f"{title}: {pluralize(self.points, 'point')}"
        tables = [
            self._extremes(caption) if kind == "grid" else self._quantiles(caption),
            self.table("limits", "Limits", self.yields()),
        ]
        if kind == "shares":
            tables.append(self._shares())
        if kind != "grid":
            orders = first_orders(self)
            rows = [MeasureRow(order.measure, row) for order in orders for row in order.inputs]
            caption = "Local derivatives of {title}, in the middle of the inputs"
            spread = "Standard deviation of the jump speed: by first order, and of the points"
            tables.append(self.table("local_derivatives", caption, rows, group_by="title"))
            tables.append(self.table("first_order", spread, orders))
        reasons = self.dataset.reasons()
        return [
            *tables,
            self.table("reasons", "Why points failed", reasons, hidden=True),
            self.table("campaign", "Campaign", [self], single=True, hidden=True),
        ]

    def _quantiles(self, caption: str) -> Records:
        rows = [MeasureRow(m, q) for m in self.campaign.measures for q in self.quantiles(m)]
        return self.table("quantiles", caption, rows, INTERVALS, self.failures, self.unsettled)

    def _extremes(self, caption: str) -> Records:
        rows = []
        for measure in self.campaign.measures:
            values = self.values(measure)
            values = values[~np.isnan(values)]
            ends = (float(values.min()), float(values.max())) if values.size else (None, None)
            rows.append(MeasureRow(measure, ends))
        return self.table("extremes", caption, rows, self.failures, self.unsettled)

    def _shares(self) -> Records:
        points, rows, notes = self.campaign.config.plan.points, [], []
        assert points is not None  # ensured by the schema
        for measure in self.campaign.measures:
            shares = self.shares(measure)
            rows += [MeasureRow(measure, row) for row in shares]
            if (needed := points_needed(shares, points)) != points:
                text = f"For shares within ±{SHARE_ERROR:g} plan.points must be about {needed}."
                notes.append(Footnote(text, partial(_has_measure, measure)))
        first = "Alone: first order. In all: with interactions. ±: 95 %, bootstrapped."
        caption = "Shares of the variance of {title}"
        return self.table("shares", caption, rows, first, *notes, group_by="title")

    def summary(self) -> list[str]:
        """Return one line with the path of the dataset."""
        return [f"dataset: {self.dataset.folder}/*.parquet"]

    def to_pandas(self, key: str = "") -> DataFrame:
        """Return a DataFrame of all points in the order of the plan.

        If the key of a table is given, that table is returned instead.
        """
        if key:
            return super().to_pandas(key)
        with friendly_import_errors():
            from pandas import concat
        return concat([table.to_pandas() for table in self.dataset.tables()], ignore_index=True)


def _has_measure(measure: CampaignMeasure, row: MeasureRow) -> bool:
    return row.measure == measure


def points_needed(shares: Sequence[InputShare], points: int) -> int:
    """Return the number of base points that makes all variance shares accurate.

    The errors of the ``shares`` are then below `SHARE_ERROR`. The result is a power of 2, or the
    present number ``points`` if that is sufficient.
    """
    errors = [error for share in shares for error in (share.first_error, share.total_error)]
    ratio = (max(errors) / SHARE_ERROR) ** 2
    return points if ratio <= 1.0 else 1 << math.ceil(math.log2(points * ratio))


def quantile(values: FloatArray, probability: float) -> Quantile:
    """Return a quantile of sorted values, with its 95 % interval.

    The ends of the interval are values of the sample (order statistics), so no distribution is
    assumed.
    """
    count = values.size
    if count == 0:
        return Quantile(probability, np.nan, np.nan, np.nan)
    low, high = order_interval(count, probability)
    is_determined = 0 <= low <= high < count
    return Quantile(
        probability,
        float(np.quantile(values, probability, method="inverted_cdf")) if is_determined else np.nan,
        float(values[low]) if low >= 0 else np.nan,
        float(values[high]) if high < count else np.nan,
    )


def order_interval(count: int, probability: float) -> tuple[int, int]:
    """Return the indices of the ends of a quantile's 95 % interval in a sorted sample.

    ``count`` is the size of the sample. An index outside of 0 to count − 1 is beyond the sample.
    """
    low = _binomial_quantile(0.5 * MISSED, count, probability)
    return low - 1, _binomial_quantile(1.0 - 0.5 * MISSED, count, probability)


def _binomial_quantile(fraction: float, count: int, probability: float) -> int:
    """Return the smallest number of successes in ``count`` draws that is not exceeded so often.

    That is the smallest k whose cumulative probability is at least ``fraction``.
    """
    k = math.ceil(bdtrik(fraction, count, probability))
    return k - 1 if k > 0 and bdtr(k - 1, count, probability) >= fraction else k


def proportion(successes: int, count: int) -> tuple[float, float, float]:
    """Return the share of successes in independent draws, and its 95 % interval.

    ``successes`` of ``count`` draws succeeded. The results are share, lower end and upper end.
    """
    low = float(betaincinv(successes, count - successes + 1, 0.5 * MISSED)) if successes else 0.0
    high = (
        float(betaincinv(successes + 1, count - successes, 1.0 - 0.5 * MISSED))
        if successes < count
        else 1.0
    )
    return (successes / count if count else np.nan), low, high


def saltelli_shares(values: FloatArray, paths: list[str], seed: int) -> tuple[InputShare, ...]:
    """Return the shares of the inputs in the variance of a measure.

    ``values`` are the measure at all points, in the row order of `unit_points` for the kind
    ``shares``. ``paths`` are those of the inputs. The shares are zero for a constant measure.
    """
    with friendly_import_errors():
        from SALib.analyze import sobol
    if np.ptp(values) == 0.0:
        return tuple(InputShare(path, 0.0, 0.0, 0.0, 0.0) for path in paths)
    problem = {"num_vars": len(paths), "names": paths, "bounds": [[0.0, 1.0]] * len(paths)}
    indices = sobol.analyze(problem, values, calc_second_order=False, seed=seed)
    keys = ("S1", "S1_conf", "ST", "ST_conf")
    columns = zip(paths, *(indices[key].tolist() for key in keys), strict=True)
    return tuple(InputShare(*column) for column in columns)

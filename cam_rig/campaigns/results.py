"""What a campaign's rows come to: quantiles, yields and shares, each with its own error.

Columns are read one at a time. Intervals are of 95 %, for independent draws: on a Latin hypercube
or Sobol's sequence the true error is smaller, and they are on the safe side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import beta, binom

from cam_rig.campaigns.campaign import Campaign
from cam_rig.campaigns.dataset import CampaignDataset
from cam_rig.campaigns.measures import CampaignMeasure, kept
from cam_rig.campaigns.point import UNSETTLED
from cam_rig.errors import ConfigError
from cam_rig.extras import libraries_named
from cam_rig.law_design.terms import Limit
from cam_rig.show.tables import counted
from cam_rig.units import FloatArray

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
    """The part of all points that keeps a limit, with its interval; a failed point does not."""

    limit: Limit
    share: float
    low: float
    high: float


@dataclass(frozen=True)
class InputShare:
    """What an input contributes to a measure's variance: alone, and with all its interactions."""

    path: str
    first: float
    first_error: float
    total: float
    total_error: float


@dataclass(frozen=True, eq=False)
class CampaignResults:
    """The rows of a finished campaign, a column at a time."""

    dataset: CampaignDataset

    @property
    def campaign(self) -> Campaign:
        """Whose rows they are."""
        return self.dataset.campaign

    @cached_property
    def failed(self) -> int:
        """Points without a measure."""
        bad: FloatArray | None = None
        for measure in self.campaign.measures:
            missing = np.isnan(self.values(measure))
            bad = missing if bad is None else bad | missing
        return 0 if bad is None else int(bad.sum())

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
            named.append(f"{counted(len(reasons) - REASONS, 'other reason')} ({rest})")
        return (
            f"{self.failed} of {counted(self.points, 'point')} could not be made: "
            f"{', '.join(named)}"
        )

    @cached_property
    def unsettled(self) -> str:
        """How many points never settled, and of which turns their measures are; empty for none."""
        reasons = self.dataset.reasons(UNSETTLED)
        if not reasons:
            return ""
        count = sum(points for _, points in reasons)
        return f"{count} of {counted(self.points, 'point')}, such as {reasons[0][0]}"

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
        found = []
        for limit in self.campaign.limits:
            values = self.values(CampaignMeasure(limit.term))
            found.append(
                LimitYield(limit, *proportion(int(kept(limit, values).sum()), values.size))
            )
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
                f"shares of {measure.term.key}: {counted(bad, 'point')} without a finite value"
                f"{f' ({self.failures})' if self.failures else ''}; allowed: inputs that vary less"
            )
        paths = [one.path for one in self.campaign.inputs]
        return saltelli_shares(values, paths, self.campaign.seed)


def points_needed(shares: Sequence[InputShare], points: int) -> int:
    """Points of a base sample, a power of 2, with which shares would be within `SHARE_ERROR`.

    From the widest interval that so many points gave: it narrows as their square root.
    """
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
    """Shares from the rows of Saltelli's design, in the order of `plan.unit_points`.

    A measure that does not vary has none: zeros.
    """
    with libraries_named():
        from SALib.analyze import sobol
    if np.ptp(values) == 0.0:
        return tuple(InputShare(path, 0.0, 0.0, 0.0, 0.0) for path in paths)
    problem = {"num_vars": len(paths), "names": paths, "bounds": [[0.0, 1.0]] * len(paths)}
    found = sobol.analyze(problem, values, calc_second_order=False, seed=seed)
    keys = ("S1", "S1_conf", "ST", "ST_conf")
    columns = zip(paths, *(found[key].tolist() for key in keys), strict=True)
    return tuple(InputShare(*column) for column in columns)

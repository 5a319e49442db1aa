"""The inputs of points: from the unit cube to numbers, correlated where the study says so."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError
from cam_rig.schema.studies.campaign import CampaignConfig, Variation
from cam_rig.studies.campaign.inputs import CampaignInput
from cam_rig.studies.campaign.plan import grid_places, rows_of, unit_points


@dataclass(frozen=True, eq=False)
class InputDraws:
    """The inputs of every point of a plan, ``(n, d)`` SI, a batch at a time.

    Parameters
    ----------
    mixing : ``(d, d)`` lower triangle whose rows mix independent normal numbers into correlated
        ones (a Gaussian copula); None where all are independent
    """

    config: CampaignConfig
    inputs: tuple[CampaignInput, ...]
    mixing: FloatArray | None

    @classmethod
    def of(cls, config: CampaignConfig, inputs: tuple[CampaignInput, ...]) -> InputDraws:
        """The draws of a study.

        Raises
        ------
        ConfigError : correlations that no random numbers have
        """
        if not config.correlated:
            return cls(config, inputs, None)
        order = [one.path for one in inputs]
        matrix = np.eye(len(order))
        for pair in config.correlated:
            i, j = (order.index(path) for path in pair.inputs)
            matrix[i, j] = matrix[j, i] = pair.coefficient
        try:
            mixing = np.asarray(np.linalg.cholesky(matrix), dtype=np.float64)
        except np.linalg.LinAlgError:
            raise ConfigError(
                "correlated: no numbers have these correlations together (their matrix is not "
                "positive definite); allowed: smaller coefficients"
            ) from None
        return cls(config, inputs, mixing)

    @property
    def total(self) -> int:
        """Rows of the plan."""
        return rows_of(self.config.plan.kind, self.config.plan.points, self._counts)

    @property
    def _counts(self) -> list[int]:
        """Steps of each input on a grid."""
        return [len(v.values) if v.values else v.count or 1 for v in self._variations]

    @property
    def _variations(self) -> list[Variation]:
        return [one.variation for one in self.inputs]

    def rows(self, first: int, last: int) -> FloatArray:
        """Points ``first`` to ``last`` (exclusive); a row depends on its index and the study."""
        plan = self.config.plan
        if plan.kind == "grid":
            places = grid_places(self._counts, first, last)
            columns = [steps_of(one)[places[:, i]] for i, one in enumerate(self.inputs)]
        else:
            points = rows_of(plan.kind, plan.points, self._counts)
            unit = unit_points(plan.kind, plan.seed, points, len(self.inputs), first, last)
            unit = self._correlated(unit)
            columns = [drawn(one, unit[:, i]) for i, one in enumerate(self.inputs)]
        return np.stack(columns, axis=1)

    def middle(self) -> FloatArray:
        """Each input in the middle of its distribution, ``(d,)``; a list's number there."""
        half = np.array([0.5])
        return np.concatenate([drawn(one, half) for one in self.inputs])

    def _correlated(self, unit: FloatArray) -> FloatArray:
        """Term by term: a matrix product may round otherwise in a batch of another length."""
        if self.mixing is None:
            return unit
        normal, found = ndtri(unit), np.zeros_like(unit)
        for i, row in enumerate(self.mixing.tolist()):
            for k, weight in enumerate(row[: i + 1]):
                found[:, i] += weight * normal[:, k]
        return np.asarray(ndtr(found))


def steps_of(one: CampaignInput) -> FloatArray:
    """The numbers that an input takes on a grid."""
    variation = one.variation
    if variation.values is not None:
        steps = np.array(variation.values)
    else:
        assert variation.range is not None and variation.count is not None  # the schema's
        steps = np.linspace(*variation.range, variation.count)
    return np.asarray(one.origin + one.factor * steps)


def ends_of(one: CampaignInput) -> FloatArray:
    """The least and the largest that an input can be; the middle of what has no ends."""
    variation = one.variation
    if variation.values is not None:
        steps = steps_of(one)
        return np.array([steps.min(), steps.max()])
    endless = variation.normal is not None and variation.within is None
    return drawn(one, np.array([0.5] if endless else [0.0, 1.0]))


def drawn(one: CampaignInput, unit: FloatArray) -> FloatArray:
    """What an input is at places of its distribution, each in (0, 1)."""
    variation = one.variation
    if variation.values is not None:
        steps = steps_of(one)
        return np.asarray(steps[np.minimum(unit * steps.size, steps.size - 1).astype(int)])
    if variation.range is not None:
        low, high = variation.range
        return np.asarray(one.origin + one.factor * (low + (high - low) * unit))
    if variation.uniform is not None:
        return np.asarray(one.mean + one.factor * variation.uniform * (2.0 * unit - 1.0))
    spread, within = variation.normal or 0.0, variation.within
    if spread == 0.0:
        return np.full(unit.size, one.mean)
    if within is not None:
        below = ndtr(-within / spread)
        unit = below + (1.0 - 2.0 * below) * unit
    return np.asarray(one.mean + one.factor * spread * ndtri(unit))

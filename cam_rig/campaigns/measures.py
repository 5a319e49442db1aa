"""What is measured of every point, and what its limits are."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cam_rig.errors import ConfigError
from cam_rig.quantities.catalogue import QUANTITIES, measured_in
from cam_rig.quantities.steady import scene_at
from cam_rig.quantities.terms import Limit, Term, parse_limit, parse_term
from cam_rig.quantities.values import Subject
from cam_rig.schema import SceneConfig
from cam_rig.schema.scene import MAX_SPEED, MIN_SPEED
from cam_rig.show.tables import number
from cam_rig.units import RPM, FloatArray


@dataclass(frozen=True)
class CampaignMeasure:
    """One measure of a study, and where it stands in rows."""

    term: Term

    @property
    def column(self) -> str:
        """A plain name, ``lift_offs_at_450rpm``; with the unit where that is not SI."""
        words = re.sub(r"\W+", "_", self.term.key.replace("@", "_at_"))
        return words + {"rpm": "_rpm", "dB": "_db"}.get(self.unit, "")

    @property
    def unit(self) -> str:
        """Unit in rows: SI, but for speeds in rpm and levels in dB."""
        quantity = self.term.quantity
        return quantity.unit if quantity.unit in ("rpm", "dB") else quantity.si

    @property
    def factor(self) -> float:
        """One of that unit in SI."""
        return self.term.quantity.units[self.unit]

    def of(self, point: Subject) -> float:
        """The measure of a point, in its unit in rows."""
        return self.term.quantity.value(point, self.term, "<=") / self.factor


def parse_measures(texts: Iterable[str], model: str) -> tuple[CampaignMeasure, ...]:
    """The measures of a study whose scene has a model."""
    found = tuple(CampaignMeasure(_single(parse_term(text, measured_in(model)))) for text in texts)
    for i, one in enumerate(found):
        if one in found[:i]:
            raise ConfigError(f"measures: {one.term.key} stands twice; allowed: each once")
    return found


def _single(term: Term) -> Term:
    if term.low < term.high and not term.quantity.ranges:
        over = ", ".join(name for name, one in QUANTITIES.items() if one.ranges)
        raise ConfigError(
            f"{term.key}: is a range; allowed: one speed, a measure for each (a range for {over})"
        )
    if term.quantity.where == "rpm" and not MIN_SPEED <= term.low <= term.high <= MAX_SPEED:
        raise ConfigError(
            f"{term.key}: no model takes this speed; allowed: {MIN_SPEED / RPM:g} to "
            f"{number(MAX_SPEED / RPM)} rpm"
        )
    return term


def require_runs(measures: Iterable[CampaignMeasure], scene: SceneConfig) -> None:
    """Refuse a measure whose speed the scene cannot turn at, whatever the point."""
    for one in measures:
        if one.term.quantity.of_run:
            try:
                scene_at(scene, one.term.low)
            except ConfigError as error:
                raise ConfigError(f"{one.term.key}: {error}") from None


def kept(limit: Limit, values: FloatArray) -> NDArray[np.bool_]:
    """Which values of its measure, in its unit in rows, keep a limit; NaN does not."""
    assert limit.value is not None  # checked as the study was opened
    bound = limit.value / CampaignMeasure(limit.term).factor
    return values <= bound if limit.sense == "<=" else values >= bound


def parse_limits(
    texts: Iterable[str], measures: tuple[CampaignMeasure, ...], model: str
) -> tuple[Limit, ...]:
    """The limits of a study, on its measures."""
    terms = {one.term for one in measures}
    found = tuple(parse_limit(text, measured_in(model)) for text in texts)
    for limit in found:
        if limit.value is None:
            raise ConfigError(f"limit on {limit.term.key}: start; allowed: a number and its unit")
        if limit.term not in terms:
            raise ConfigError(
                f"limit on {limit.term.key}: is not measured; allowed: a limit on "
                f"{', '.join(one.term.key for one in measures)}"
            )
    return found

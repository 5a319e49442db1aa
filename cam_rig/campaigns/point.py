"""One point of a campaign: its cam and rig made, then measured; what fails is a row too."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from cam_rig.campaigns.campaign import Campaign
from cam_rig.campaigns.inputs import ProfileErrors, with_numbers
from cam_rig.campaigns.measures import CampaignMeasure, MeasuredPoint, kept
from cam_rig.errors import CamRigError
from cam_rig.laws import build_law
from cam_rig.units import FloatArray

#: Status of a point: all measures are there, or a reason says why not, or of which turns they are.
OK, FAILED, UNSETTLED = "ok", "failed", "unsettled"


@dataclass(frozen=True, eq=False)
class BatchRows:
    """The rows of points ``first`` to ``first + n`` (exclusive).

    Parameters
    ----------
    inputs, measures : ``(n, d)`` SI and ``(n, k)`` in their columns' units; NaN for a measure that
        the point has not. A jump speed is 0 where contact is lost at every speed, ∞ where at none
    reasons : one a row, empty where nothing failed and all has settled
    seconds : processor time of the batch
    """

    first: int
    inputs: FloatArray
    measures: FloatArray
    reasons: tuple[str, ...]
    seconds: float

    @property
    def status(self) -> list[str]:
        """One a row."""
        failed = np.asarray(np.isnan(self.measures).any(axis=1))
        return [
            FAILED if bad else UNSETTLED if reason else OK
            for bad, reason in zip(failed, self.reasons, strict=True)
        ]

    @property
    def last(self) -> int:
        """The first point after the batch."""
        return self.first + len(self.reasons)


def measure_batch(campaign: Campaign, first: int, last: int) -> BatchRows:
    """The rows of points ``first`` to ``last`` (exclusive), each from its index and the study."""
    start = time.process_time()
    inputs = campaign.draws.rows(first, last)
    rows = [measure_point(campaign, row) for row in inputs]
    measures = np.array([values for values, _ in rows]).reshape(len(rows), -1)
    reasons = tuple(reason for _, reason in rows)
    return BatchRows(first, inputs, measures, reasons, time.process_time() - start)


def measure_point(campaign: Campaign, inputs: FloatArray) -> tuple[list[float], str]:
    """The measures of one point, and why some are missing."""
    try:
        point = make_point(campaign, inputs)
    except CamRigError as error:
        return [math.nan] * len(campaign.measures), str(error)
    found, reasons = [], []
    for measure in campaign.measures:
        try:
            found.append(measure.of(point))
            if unsettled := point.unsettled(measure.term):
                reasons.append(unsettled)
        except CamRigError as error:
            found.append(math.nan)
            reasons.append(f"{measure.term.key}: {error}")
    return found, "; ".join(dict.fromkeys(reasons))


def keeps_limits(campaign: Campaign, inputs: FloatArray) -> bool:
    """Whether a point ``(d,)``, SI, keeps all limits; one without a measure does not."""
    try:
        point = make_point(campaign, inputs)
        return all(
            kept(limit, np.array(CampaignMeasure(limit.term).of(point))).all()
            for limit in campaign.limits
        )
    except CamRigError:
        return False


def make_point(campaign: Campaign, inputs: FloatArray) -> MeasuredPoint:
    """The cam, the rig and the scene with a point's numbers ``(d,)``, SI."""
    numbers: dict[str, dict[str, float]] = {"cam": {}, "rig": {}, "scene": {}, "profile": {}}
    for one, value in zip(campaign.inputs, inputs.tolist(), strict=True):
        root, _, path = one.path.partition(".")
        numbers[root][path] = value
    law = campaign.law
    if numbers["cam"]:
        law = build_law(with_numbers(campaign.cam, numbers["cam"]))
    if numbers["profile"]:
        law = ProfileErrors.of(numbers["profile"]).added_to(law)
    rig = with_numbers(campaign.rig, numbers["rig"])
    return MeasuredPoint(law, rig, with_numbers(campaign.scene, numbers["scene"]))

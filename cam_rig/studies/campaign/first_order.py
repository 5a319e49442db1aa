"""What local derivatives say of a campaign's jump speed, beside what its points say."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cam_rig.dynamics import TwoMassParameters
from cam_rig.errors import CamRigError
from cam_rig.studies.campaign.measures import CampaignMeasure
from cam_rig.studies.campaign.point import make_point
from cam_rig.studies.campaign.profile_errors import ProfileErrors
from cam_rig.studies.campaign.results import CampaignResults
from cam_rig.studies.campaign.sensitivities import JumpSensitivity, jump_sensitivities
from cam_rig.studies.jump.any_rig import follower_of
from cam_rig.studies.jump.contact_lost_speed import FROM_REST
from cam_rig.units import RPM

#: Measures that have derivatives, and how the follower runs.
RUNS = {"jump_speed": FROM_REST, "jump_speed_steady": None}
#: First order lies where its spread is so many times the points', or so small a part of it.
LIES = 1.25


@dataclass(frozen=True)
class FirstOrder:
    """Derivatives of a jump speed in the middle of every input, and the spread they predict.

    Parameters
    ----------
    speed : rad/s, there
    predicted, found : standard deviations, rad/s: √Σ(dΩ/dp · σ_p)² of independent inputs, with the
        covariances of ``correlated`` ones; and of the points
    points : those with a finite jump speed
    """

    measure: CampaignMeasure
    inputs: tuple[JumpSensitivity, ...]
    predicted: float
    found: float
    correlated: bool
    points: int

    @property
    def lies(self) -> bool:
        """Whether the points spread otherwise than first order says."""
        return not self.found / LIES <= self.predicted <= self.found * LIES


def first_orders(results: CampaignResults) -> list[FirstOrder]:
    """One for each jump speed of two masses that the middle of the inputs has."""
    campaign = results.campaign
    middle = campaign.draws.middle()
    try:
        point = make_point(campaign, middle)
        if not isinstance(follower_of(point.rig), TwoMassParameters):
            return []
        numbers = dict(zip((one.path for one in campaign.inputs), middle.tolist(), strict=True))
        below = {
            path.removeprefix("profile."): value
            for path, value in numbers.items()
            if path.startswith("profile.")
        }
        errors = ProfileErrors.of(below)
        found = []
        for measure in campaign.measures:
            if measure.term.name in RUNS:
                duration = RUNS[measure.term.name]
                inputs = jump_sensitivities(point, errors, numbers, duration)
                found.append(_compared(results, measure, inputs))
    except CamRigError:  # no such cam or rig, or no jump speed: no derivative either
        return []
    return found


def _compared(
    results: CampaignResults, measure: CampaignMeasure, inputs: tuple[JumpSensitivity, ...]
) -> FirstOrder:
    values = results.values(measure)
    values = values[np.isfinite(values)]
    spread = float(np.std(values)) * RPM
    correlated = bool(results.campaign.config.correlated)
    predicted = _predicted(results, inputs, correlated)
    return FirstOrder(measure, inputs, predicted, spread, correlated, values.size)


def _predicted(
    results: CampaignResults, inputs: tuple[JumpSensitivity, ...], correlated: bool
) -> float:
    """The standard deviation (rad/s) that the derivatives and the drawn inputs predict."""
    parts = [
        one.derivative * results.input_values(one.path)
        for one in inputs
        if one.derivative is not None
    ]
    if correlated and parts:
        return float(np.std(np.sum(parts, axis=0)))
    return math.sqrt(sum(float(np.var(part)) for part in parts))

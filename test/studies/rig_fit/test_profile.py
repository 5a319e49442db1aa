"""A restitution's interval, where its likelihood is level on one side and steep on the other."""

import numpy as np
import pytest

from cam_rig.studies.rig_fit.likelihood import Likelihood
from cam_rig.studies.rig_fit.measured_turns import measured_holds
from cam_rig.studies.rig_fit.numbers import ONE_MASS
from cam_rig.studies.rig_fit.search import MOST_OFF, Candidate, search
from cam_rig.studies.rig_fit.start import rough_start

from .machines import kind_of, machine_of, scores_of

#: A normal error is beyond so many standard errors once in 15 000 machines.
FAR_OFF = 4.0


@pytest.mark.parametrize(
    "seed", [3, *(pytest.param(k, marks=pytest.mark.long) for k in (7, 17, 23, 27, 33, 37))]
)
def test_a_restitution_of_several_speeds_with_landings(seed):
    """Samples come into bounces and leave them: a curvature there was 7 standard errors off."""
    assert kind_of(seed)[:2] == ("one_mass", "landings")
    off = {score.name: score.off for score in scores_of(seed)}
    assert abs(off["restitution"]) < FAR_OFF


@pytest.mark.parametrize(
    "seed", [47, *(pytest.param(k, marks=pytest.mark.long) for k in (7, 17, 57, 77))]
)
def test_a_search_passes_landings_over_samples(seed):
    """Where it ends, its slopes promise less than one force on the wrong side of a landing counts.

    With all of its square such a force stopped it, with more than twice as much to go.
    """
    law, rig, run = machine_of(seed)
    holds = measured_holds(run)
    values = {name: getattr(rig.follower, name).si for name in ONE_MASS}
    _, phase, zero = rough_start(law, holds, values)
    start = Likelihood(law, holds, (), values, None, force_noise=0.01 * run.force.value.max())
    aligned = search(Candidate(start, start.start(values, phase, zero)))
    like = Likelihood(law, holds, ONE_MASS, {}, None, force_noise=start.force_noise)
    begin = like.start(values, phase, zero)
    begin[like.instruments.phases] = aligned.x[start.instruments.phases]
    found = search(Candidate(like, begin))
    step, *_ = np.linalg.lstsq(found.slopes, found.residuals, rcond=None)
    assert np.sum((found.slopes @ step) ** 2) < MOST_OFF**2

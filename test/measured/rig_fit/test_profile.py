"""A restitution's interval, where its likelihood is level on one side and steep on the other."""

import numpy as np
import pytest

from cam_rig.measured.rig_fit.residuals import Likelihood
from cam_rig.measured.rig_fit.turns import measured_holds
from cam_rig.simulation.instruments import InstrumentErrors, measured_run

from .machines import kind_of, scores_of

#: A normal error is beyond so many standard errors once in 15 000 machines.
FAR_OFF = 4.0


@pytest.mark.long
@pytest.mark.parametrize(
    "seed", [3, *(pytest.param(k, marks=pytest.mark.long) for k in (7, 17, 23, 27, 33, 37))]
)
def test_a_restitution_of_several_speeds_with_landings(seed):
    """Samples come into bounces and leave them: a curvature there was 7 standard errors off."""
    assert kind_of(seed)[:2] == ("one_mass", "landings")
    off = {score.name: score.off for score in scores_of(seed)}
    assert abs(off.get("restitution", 0.0)) < FAR_OFF  # of seed 27 it is not identified
    assert "restitution" in off or seed == 27


@pytest.mark.parametrize("bounce", [0.2, 0.35, 0.5])
def test_what_no_bounce_reaches_knows_no_restitution(law, rig, bounce):
    """From lift-off to the first landing, and settled on the cam, a motion depends on none."""
    names = ("mass", "spring_stiffness", "preload", "damping")
    values = {name: getattr(rig.follower, name).si for name in names}
    errors = InstrumentErrors(rate=800, encoder_rate=800)
    other = rig.with_follower(restitution=bounce)
    run = measured_run(law, other, "one_mass", (440.0, 460.0, 480.0), errors, 1)
    likelihoods = [
        Likelihood(law, measured_holds(run), (), values | {"restitution": e}, None)
        for e in (bounce, 1.05 * bounce)
    ]
    x = likelihoods[0].start({}, 0.0, 0.0)
    settled = likelihoods[0].settled(x, 0.05)
    bouncing = [likelihood.residuals(x) for likelihood in likelihoods]
    assert np.abs(bouncing[1] - bouncing[0]).max() > 0.5
    assert 0.3 * likelihoods[0].count < settled.count < likelihoods[0].count
    beside = Likelihood(law, settled.holds, (), likelihoods[1].given, None)
    assert settled.residuals(x) == pytest.approx(beside.residuals(x), abs=1e-6)

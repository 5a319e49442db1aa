"""A restitution's interval, where its likelihood is level on one side and steep on the other."""

import pytest

from .machines import kind_of, scores_of

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

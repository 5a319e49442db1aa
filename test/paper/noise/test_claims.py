"""The paper's claims of noise, on levels whose answer is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from cam_rig.paper.noise.roles import StudyRoles
from cam_rig.paper.noise.study import TESTED_ON, noise_claims

RPM = np.arange(200.0, 401.0, 10.0)
ROLES = StudyRoles(reference="conventional", predicted="proposed", arcs="arcs")


def study(**levels):
    """Curves of these levels by whatever they are tested on."""
    curves = {
        cam: SimpleNamespace(published_db=level, regression_db=level, level_db=level)
        for cam, level in levels.items()
    }
    return SimpleNamespace(roles=ROLES, rpm=RPM, best=SimpleNamespace(curves=curves))


def test_what_holds_everywhere_has_no_speed_against_it():
    """The arcs rise through both others at 335 rpm."""
    found = noise_claims(
        study(arcs=(RPM - 335.0) / 10.0, conventional=0.0 * RPM + 0.5, proposed=0.0 * RPM), 335.0
    )
    assert [claim.cases for claim in found] == [14, 7, 7]
    for claim in found:
        assert claim.holds == dict.fromkeys(TESTED_ON, claim.cases)
        assert claim.fails_rpm == dict.fromkeys(TESTED_ON)


def test_what_fails_says_at_which_speeds():
    """The arcs cross at 355 rpm instead: two speeds above 335 rpm are against the paper."""
    found = noise_claims(
        study(arcs=(RPM - 355.0) / 10.0, conventional=0.0 * RPM - 1.0, proposed=0.0 * RPM), 335.0
    )
    quietest, against_arcs, against_conventional = found
    assert quietest.fails_rpm["points"] is None
    assert against_arcs.holds["points"] == 5
    assert against_arcs.fails_rpm["points"] == (340.0, 350.0)
    assert against_conventional.holds["points"] == 0
    assert against_conventional.fails_rpm["points"] == (340.0, 400.0)


@pytest.mark.variants(8)
@pytest.mark.parametrize("seed", range(20))
def test_counts_and_speeds_agree(seed):
    """Random levels: where all cases hold nothing is against, else something is."""
    random = np.random.default_rng(seed)
    levels = {cam: random.normal(size=RPM.size) for cam in ("arcs", "conventional", "proposed")}
    for claim in noise_claims(study(**levels), float(random.uniform(210, 390))):
        for name in TESTED_ON:
            assert (claim.holds[name] == claim.cases) == (claim.fails_rpm[name] is None)

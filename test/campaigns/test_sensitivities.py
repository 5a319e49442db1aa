"""Exact local derivatives of the jump speed against central differences."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

import cam_rig
from cam_rig.campaigns.inputs import ProfileErrors
from cam_rig.campaigns.point import make_point
from cam_rig.campaigns.sensitivities import jump_sensitivities, touch_of
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.search import force_run, sought

VARY = {
    "rig.follower.mass": {"uniform": 1, "unit": "%"},
    "rig.follower.roller_share": {"uniform": 1, "unit": "%"},
    "rig.follower.spring_stiffness": {"uniform": 1, "unit": "%"},
    "rig.follower.stem_stiffness": {"uniform": 1, "unit": "%"},
    "rig.follower.damping": {"uniform": 1, "unit": "%"},
    "rig.follower.stem_damping": {"uniform": 1, "unit": "%"},
    "rig.follower.preload": {"uniform": 1, "unit": "%"},
    "profile.size": {"values": [1e-5], "unit": "m"},
    "profile.eccentricity.amplitude": {"values": [2e-5], "unit": "m"},
    "profile.eccentricity.phase": {"values": [0.3], "unit": "rad"},
    "profile.waviness.amplitude": {"values": [1e-6], "unit": "m"},
    "profile.waviness.wavelength": {"values": [17.7], "unit": "deg"},
    "profile.waviness.phase": {"values": [1.1], "unit": "rad"},
}
#: Steps of central differences, SI; of the follower's numbers 2e-4 of each.
STEPS = {
    "profile.size": 5e-5,
    "profile.eccentricity.amplitude": 5e-6,
    "profile.eccentricity.phase": 0.03,
    "profile.waviness.amplitude": 1e-8,
    "profile.waviness.phase": 1e-3,
}
NO_DERIVATIVE = "profile.waviness.wavelength"


def exact_speed(point, duration):
    """The jump speed (rad/s) to the last digits that the least force has."""
    follower = TwoMassParameters.from_rig(point.rig)
    found, run = sought(point.law, follower, duration), force_run(point.law, follower, duration)
    return brentq(run.lowest, found.low, found.high, xtol=1e-300, rtol=1e-14)


@pytest.mark.variants(1)
@pytest.mark.parametrize("duration", [1.7, None])
def test_they_are_the_central_differences(study, duration):
    """To 1e-6, by Richardson's step of two differences; a wavelength moves joints and has none."""
    campaign = study(vary=VARY, measures=["jump_speed"])
    inputs = campaign.draws.middle()
    point = make_point(campaign, inputs)
    numbers = dict(zip(VARY, inputs.tolist(), strict=True))
    errors = ProfileErrors.of({k[8:]: v for k, v in numbers.items() if k.startswith("profile.")})
    found = {one.path: one for one in jump_sensitivities(point, errors, numbers, duration)}
    assert found[NO_DERIVATIVE].derivative is None
    assert found[NO_DERIVATIVE].reason
    for i, path in enumerate(VARY):
        if path == NO_DERIVATIVE:
            continue

        def difference(step, i=i):
            moved = []
            for sign in (1.0, -1.0):
                other = inputs.copy()
                other[i] += sign * step
                moved.append(exact_speed(make_point(campaign, other), duration))
            return (moved[0] - moved[1]) / (2.0 * step)

        h = STEPS.get(path, 2e-4 * inputs[i])
        expected = (4.0 * difference(h) - difference(2.0 * h)) / 3.0
        assert found[path].derivative == pytest.approx(expected, rel=1e-6), path


def test_the_touch_is_where_contact_is_lost():
    """The angle of `cam-rig jump` on the shipped cams, and a force of zero there."""
    rig = cam_rig.load_rig("paper_table2")
    for name in ("poly345", "bezier15", "cycloidal"):
        law = cam_rig.build_law(cam_rig.load_cam(name))
        touch = touch_of(law, TwoMassParameters.from_rig(rig), 1.7)
        jump = cam_rig.jump_speed(law, rig)
        assert touch.speed == pytest.approx(jump.speed, rel=1e-5)
        assert math.degrees(abs(touch.angle - jump.angle)) < 1.0
        assert touch.turn == int(np.floor(jump.time * jump.speed / (2.0 * math.pi)))

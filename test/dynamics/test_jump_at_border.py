"""Tests of a velocity jump of the cam at the border of two time intervals.

The jump is within rounding of the border.
"""

from dataclasses import replace

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import MODELS, Interval
from cam_rig.units import NS, TURN

from ..conftest import dwell, rise
from .helpers import ONE, TWO


@pytest.mark.parametrize("model", ["one_mass", "two_mass"])
@pytest.mark.parametrize("overshoot", [-2e-9, -6e-10, 0.0, 6e-10, 2e-9])
@pytest.mark.parametrize("speeds", [(64.7, 56.9), (64.7, 64.7), (50.0, 70.0)])
def test_a_flight_passes_a_jump_at_the_border_once(make_cam, model, overshoot, speeds):
    """A flight over the border of two intervals has a velocity jump there once.

    The fall ends at 360°, and the first interval ends up to 2e-9 rad before or after it. If the
    jump were counted twice or not at all, the gap at the next landing would not be zero.
    """
    segments = (
        dwell(49.7),
        rise(171.8, 1, "constant_velocity"),
        dwell(98.0),
        rise(40.5, 0, "constant_velocity"),
    )
    law = cam_rig.build_law(make_cam(*segments, lift=0.0269))
    parameters = replace(ONE if model == "one_mass" else TWO, restitution=0.0)
    # The first angle is chosen so that the interval ends at the overshoot despite the rounding to
    # ns.
    middle = round(NS * TURN / speeds[0])
    stop = middle + round(NS * 0.9 * TURN / speeds[1])
    first = Interval(0, middle, TURN + overshoot - speeds[0] * middle / NS, speeds[0])
    second = Interval(middle, stop, overshoot, speeds[1])
    advance = MODELS[model].advance
    border, _ = advance(law, parameters, None, first, 50_000)
    assert not border.in_contact
    _, block = advance(law, parameters, border, second, 50_000)
    landing = next(event for event in block.events if event.kind == "landing")
    since = landing.time - middle / NS
    before = block.motion[0][: int(since * 50_000)][-1]
    step = 1.5 / 50_000 * np.abs(block.motion[1]).max()
    assert abs(before - law.at(second.angle + speeds[1] * since)[0]) < step

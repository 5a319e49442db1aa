"""Bouncing: Newton's restitution, an endless series of ever lower jumps that ends."""

import dataclasses

import numpy as np
import pytest

from cam_rig.dynamics import FollowerState
from cam_rig.laws import build_law
from cam_rig.units import NS


@pytest.fixture(scope="module")
def dwell_law(make_cam):
    """Rest for 300°, then a small hump."""
    return build_law(
        make_cam(
            {"law": "dwell", "span": 300},
            {"law": "poly345", "span": 30, "to": 1},
            {"law": "poly345", "span": 30, "to": 0},
        )
    )


@pytest.mark.parametrize("e", [0.5, 0.8, 0.9])
def test_bounce_series_on_a_dwell(dwell_law, follower, run, e):
    """Thrown up at v, a follower on its spring lands after 2 atan(vΩm/P)/Ω, then at e·v, e²·v …

    Ω² = k/m and P the preload; without a damper each jump returns the velocity it began with.
    """
    v = 0.2
    p = dataclasses.replace(follower, damping=0.0, restitution=e)
    rate = np.sqrt(p.spring_stiffness / p.mass)
    lifted_off = FollowerState(0.0, v, 0.0, in_contact=False)
    # a turn of 10 s, of which the dwell lasts 8.3 s
    result = run(dwell_law, p, 6.0, [0, 2 * NS], state=lifted_off)
    landings = [event for event in result.events if event.kind == "landing"]
    velocities = v * e ** np.arange(len(landings))
    times = np.cumsum(2.0 / rate * np.arctan(velocities * rate * p.mass / p.preload))
    # a gap is known to some 1e-15 m; that is 2 % of the last jumps, which last 1e-6 s
    np.testing.assert_allclose([event.time for event in landings], times, rtol=0, atol=1e-7)
    impulses = np.array([event.impulse for event in landings])
    expected = p.mass * (1.0 + e) * velocities
    np.testing.assert_allclose(impulses[:10], expected[:10], rtol=1e-7)
    assert 10 < len(landings) < 400
    assert result.state.in_contact
    lost = sum(event.energy_lost for event in landings)
    assert lost == pytest.approx(0.5 * p.mass * v**2, rel=1e-9)


@pytest.mark.parametrize("e", [0.8, 0.9])
def test_bouncing_cam_goes_on(laws, follower, run, e):
    """Five turns of a jumping cam with a lively follower: finite, and never below the cam."""
    p = dataclasses.replace(follower, restitution=e)
    result = run(laws["poly345"], p, 600.0, [0, NS // 2])
    assert np.isfinite(result.rows).all()
    assert len(result.events) < 5000
    cam = laws["poly345"](20.0 * np.pi * result.rows[0])
    assert np.all(result.rows[1] - cam > -1e-13)


def test_livelier_is_longer_in_the_air(laws, follower, run):
    """The time in the air grows with restitution."""
    air = []
    for e in (0.0, 0.5):
        p = dataclasses.replace(follower, restitution=e)
        air.append(int((run(laws["poly345"], p, 600.0, [0, NS // 2]).rows[4] == 0.0).sum()))
    assert air[0] < air[1]

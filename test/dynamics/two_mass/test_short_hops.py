"""Hops from a tenth of a millimetre down to nanometres, against 50 digits."""

import itertools
from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest

from benchmark.speed.exact import polynomial, powers
from cam_rig.dynamics import FollowerParameters, FollowerState, Interval
from cam_rig.dynamics.kinetostatic import force_weights
from cam_rig.dynamics.one_mass import OneMassTrajectory, lifted_off
from cam_rig.units import NS, TURN

from ..one_flight import land

P = FollowerParameters(1.3, 4030.0, 8.642, 30.0, 3.3e8)
SPEED = 300.0 * np.pi / 30.0
EPS = float(np.finfo(float).eps)
#: m
HEIGHTS = (1.5e-4, 1e-6, 6e-9, 1e-11, 1e-13)


class Exact:
    """Law and flight with 50 digits; the rig's doubles are taken as exact."""

    def __init__(self, law, p, speed):
        self.law, self.p, self.speed = law, p, mp.mpf(speed)
        self.pieces = [powers(column) for column in law.ordinates.T.tolist()]

    def cam(self, angle):
        """s, ṡ and s̈."""
        inside = angle - mp.floor(angle / mp.mpf(TURN)) * mp.mpf(TURN)
        i = int(np.searchsorted(self.law.breaks[1:-1], float(inside), side="right"))
        low = mp.mpf(self.law.breaks[i])
        span, row = mp.mpf(self.law.breaks[i + 1]) - low, self.pieces[i]
        out = []
        for order in range(3):
            out.append(polynomial(row, (inside - low) / span) * (self.speed / span) ** order)
            row = [k * a for k, a in enumerate(row)][1:] or [mp.mpf(0)]
        return out

    def hop(self, angle, opening, guess):
        """Time and approach speed of the landing near ``guess`` (s)."""
        m, k, c, load = (
            mp.mpf(x)
            for x in (self.p.mass, self.p.spring_stiffness, self.p.damping, self.p.preload)
        )
        s, v, _ = self.cam(angle)
        matrix = mp.matrix([[0, 1, 0], [-k / m, -c / m, -load / m], [0, 0, 0]])
        start = mp.matrix([s, v + opening, 1])

        def gap(time):
            return (mp.expm(matrix * time) * start)[0] - self.cam(angle + self.speed * time)[0]

        time = mp.findroot(gap, (mp.mpf(guess) * (1 + mp.mpf(10) ** -9), mp.mpf(guess)))
        velocity = (mp.expm(matrix * time) * start)[1]
        return time, self.cam(angle + self.speed * time)[1] - velocity


def pull(law, angle):
    """Acceleration with which the spring brings the follower back to the cam, and its parts."""
    parts = force_weights(P, SPEED) * np.array(law.at(angle)) / P.mass
    return float(parts.sum()) + P.preload / P.mass, float(np.abs(parts).sum() + P.preload / P.mass)


@pytest.mark.parametrize("height", HEIGHTS)
@pytest.mark.parametrize(
    ("cam", "degrees"), [("poly345", 75.0), ("tm21", 80.0), ("bezier15", 95.0)]
)
def test_a_hop_is_known_to_its_last_digits(laws, cam, degrees, height):
    """Its length and the speed it ends with, to rounding of the accelerations that bring it back.

    The difference of two places would be wrong by 1e-17 m: that is 1e-11 s of the shortest.
    """
    law, angle = laws[cam], np.radians(degrees)
    back, parts = pull(law, angle)
    assert back > 1.0
    opening = np.sqrt(2.0 * back * height)
    s, slope, _ = law.at(angle)
    flight = lifted_off(P, s, slope * SPEED + opening, 0.0, opening)
    found = land(flight, law, angle, SPEED, 0.1)
    with mp.workdps(50):
        exact = Exact(law, P, SPEED)
        time, approach = exact.hop(mp.mpf(angle), mp.mpf(opening), found.time)
        limit = 8.0 * EPS * (1.0 + parts / back)
        assert found.landed
        assert abs(float(found.time / time - 1)) < limit
        assert abs(float(-found.rate / approach - 1)) < limit


@pytest.mark.parametrize("part", [0.2, 0.9])
@pytest.mark.parametrize("height", HEIGHTS[:4])
def test_a_hop_over_a_joint(laws, height, part):
    """From one piece of the law to the next, where its s'' jumps: as exact."""
    law = laws["tm21"]
    joint = float(law.breaks[np.argmax(np.abs(law.jumps(2)) * (law.breaks[:-1] > 0.1))])
    back, parts = pull(law, joint - 1e-9)
    after, more = pull(law, joint + 1e-9)
    back = max(back, 1.0)
    opening = np.sqrt(2.0 * back * height)
    angle = joint - part * SPEED * opening / back
    s, slope, _ = law.at(angle)
    flight = lifted_off(P, s, slope * SPEED + opening, 0.0, opening)
    found = land(flight, law, angle, SPEED, 0.1)
    with mp.workdps(50):
        time, _ = Exact(law, P, SPEED).hop(mp.mpf(angle), mp.mpf(opening), found.time)
    assert angle < joint < angle + SPEED * found.time
    # The joint is at an angle, known to its own last digit, and there s has a step of rounding.
    limit = 8.0 * EPS * (1.0 + max(parts, more) / min(back, abs(after)))
    own = 2.0 * EPS * joint / SPEED + 2.0 * law.largest_step / abs(found.rate)
    assert abs(float(found.time - time)) < limit * found.time + own


@pytest.mark.parametrize("milliseconds", [400, 20, 1])
def test_a_series_of_bounces(laws, milliseconds):
    """Bounce after bounce down to nanometres, each from where the last ended, whatever the tick.

    A landing is a float: its own last digit, and that of the angle, are all that is lost.
    """
    law, p = laws["poly345"], replace(P, restitution=0.6)
    events, total = [], 400 * NS // 1000
    state = FollowerState(float(law(0.0)), 0.3, 0.0, in_contact=False)
    edges = [*range(0, total, milliseconds * NS // 1000), total]
    for a, b in itertools.pairwise(edges):
        course = OneMassTrajectory(law, p, Interval(a, b, 2.0 * a / NS, 2.0))
        course.run(state)
        events += [(a / NS + e.time, e) for e in course.events if e.kind == "landing"]
        state = course.end
    with mp.workdps(50):
        exact, time, opening = Exact(law, p, 2.0), mp.mpf(0), mp.mpf(0.3)
        for found, event in events[:16]:
            hop, approach = exact.hop(2 * time, opening, found - float(time))
            time, opening = time + hop, approach * mp.mpf(p.restitution)
            assert abs(float(found - time)) < 4.0 * np.spacing(0.5)
            impulse = p.mass * 1.6 * float(approach)
            assert event.impulse == pytest.approx(impulse, rel=1e-12)
    assert events[15][1].impulse < 1e-3 * events[0][1].impulse

"""From rest means one thing, also on a law that rises where a turn begins."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import cam_rig
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.any_follower import find_jump, follower_of
from cam_rig.dynamics.jump.search import force_run, sought_speed
from cam_rig.laws import Law, bernstein
from cam_rig.paper.readings.readings import Rigs, ShapeTable, turn_minima
from cam_rig.units import RPM, TURN

#: Duration of the runs, s.
RUN = 0.4


@pytest.fixture(scope="module")
def rig():
    return cam_rig.load_rig("paper_table2")


def risen(law, away):
    """A law whose turn begins ``away`` rad later."""
    at = int(np.searchsorted(law.breaks, away))
    assert law.breaks[at] == pytest.approx(away)
    breaks = np.append(law.breaks[at:], law.breaks[1 : at + 1] + TURN) - law.breaks[at]
    ordinates = np.concatenate([law.ordinates[:, at:], law.ordinates[:, :at]], axis=1)
    breaks[0], breaks[-1] = 0.0, TURN
    return Law(f"{law.name} from {away:.3g}", breaks, ordinates)


@pytest.fixture(scope="module")
def steep(laws):
    """Laws with s′(0) ≠ 0, rising and falling: a straight part first, or half of a curve."""
    found = []
    for name in ("bezier_segments", "poly345", "cycloidal"):
        law = laws[name]
        slopes = law(law.breaks[:-1], 1)
        joints = law.breaks[1:-1][np.abs(slopes[1:]) > 1e-3]
        if joints.size == 0:  # cut a rise in two: the same law with one joint more
            law = halved(law)
            slopes = law(law.breaks[:-1], 1)
            joints = law.breaks[1:-1][np.abs(slopes[1:]) > 1e-3]
        found += [risen(law, float(joint)) for joint in joints[[0, -1]]]
    assert {np.sign(law(np.zeros(1), 1)[0]) for law in found} == {-1.0, 1.0}
    return found


def halved(law):
    """The same law with a joint in the middle of each piece."""
    breaks, columns = [0.0], []
    for i, span in enumerate(law.spans):
        for low, high in ((0.0, 0.5), (0.5, 1.0)):
            columns.append(bernstein.restrict(law.ordinates[:, i], low, high))
            breaks.append(float(law.breaks[i] + high * span))
    breaks[-1] = TURN
    return Law(law.name, np.array(breaks), np.array(columns).T)


def integrated(law, p, speed, times):
    """Contact force (N) by the equations of motion alone, the end mass going with the cam."""

    def rate(time, state):
        s, slope, _ = law.at(speed * time % TURN)
        y, v = state
        force = p.stem_damping * (slope * speed - v) + p.stem_stiffness * (s - y)
        return [v, (force - p.spring_stiffness * y - p.damping * v - p.preload) / p.end_mass]

    s, slope, _ = law.at(0.0)
    share = p.stem_stiffness / (p.stem_stiffness + p.spring_stiffness)
    start = [share * s - p.preload / p.stiffness, share * slope * speed]
    options = {"rtol": 1e-10, "atol": 1e-13, "max_step": 1e-3}
    y, v = solve_ivp(rate, (0.0, times[-1]), start, "DOP853", times, **options).y
    s, slope, bend = law.motion_at(np.mod(speed * times, TURN))
    force = p.stem_damping * (slope * speed - v) + p.stem_stiffness * (s - y)
    return force + p.roller_mass * bend * speed**2


def test_every_place_that_starts_from_rest_means_the_same(steep, rig):
    """A simulation, the search for the jump speed, a search over rigs, and plain integration."""
    p = TwoMassParameters.from_rig(rig)
    for law in steep:
        speed = 0.8 * sought_speed(law, p, RUN)
        turns = int(speed * RUN / TURN)
        motion = cam_rig.simulate(law, rig, model="two_mass", rpm=speed / RPM, turns=turns)
        times = motion.time[:: max(1, motion.time.size // 4000)]
        force = motion.force[:: max(1, motion.time.size // 4000)]
        assert force == pytest.approx(integrated(law, p, speed, times), abs=1e-5 * force.max())
        least = force_run(law, p, turns * TURN / speed).lowest(speed)
        assert least <= motion.force.min() <= least + 0.01 * motion.force.max()
        spans = law.spans[None]
        table = turn_minima(ShapeTable.of(law, 20_000), spans, Rigs.of(p, 1), speed, turns)
        assert table.force.min() == pytest.approx(least, abs=1e-3 * motion.force.max())


def test_the_jump_speed_of_such_a_law_is_the_exact_models(steep, rig):
    """Found by the search, proved by the exact model: both begin alike."""
    for law in steep:
        found = find_jump(law, follower_of(rig), RUN)
        p = TwoMassParameters.from_rig(rig)
        assert found.speed == pytest.approx(sought_speed(law, p, RUN), rel=1e-5)
        least = force_run(law, p, RUN).lowest
        assert least(found.speed * (1 - 1e-4)) > 0.0 > least(found.speed * (1 + 1e-4))

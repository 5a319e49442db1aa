"""Segments of no width to speak of, events at their very ends, and a segment that is the turn."""

from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, FollowerParameters, Interval
from cam_rig.dynamics.elastic_stem import motion
from cam_rig.laws import Law, bernstein, build_law
from cam_rig.schema import load_rig
from cam_rig.units import NS, TURN

SPEED = 600.0 * np.pi / 30.0
TURN_NS = 60 * NS // 600


@pytest.fixture(scope="module")
def parameters(config_dir):
    """Every model's numbers, from one rig."""
    rig = load_rig(config_dir / "rigs" / "paper_table2.yaml")
    return {name: model.parameters(rig) for name, model in MODELS.items()}


def cut(law, angle):
    """The same law with one more joint, at ``angle`` (rad)."""
    i = int(np.searchsorted(law.breaks, angle, side="right")) - 1
    u = (angle - law.breaks[i]) / law.spans[i]
    columns = list(law.ordinates.T)
    columns[i : i + 1] = bernstein.split(law.ordinates[:, i], u)
    return Law(law.name, np.insert(law.breaks, i + 1, angle), np.stack(columns, axis=1))


def one_turn(law, name, parameters, turns=1):
    interval = Interval(0, turns * TURN_NS, 0.0, SPEED)
    return MODELS[name].advance(law, parameters[name], None, interval, 4000)


@pytest.mark.parametrize("name", ["one_mass", "two_mass"])
@pytest.mark.parametrize("before", [1e-12, 1e-13, 4e-16, 0.0, -1e-13])
def test_lift_off_in_the_last_of_a_segment(laws, parameters, name, before):
    """A joint where nothing happens is put ``before`` rad behind the lift-off: nothing changes.

    The event is found in the last 1e-12 of its segment, or in the first of the next, once; its
    angle is known to the rounding of a force of 1e3 N over its slope.
    """
    law = laws["poly345"]
    first = one_turn(law, name, parameters)[1].events
    joint = first[0].angle + before
    found = one_turn(cut(law, joint), name, parameters)[1].events
    assert [event.kind for event in found[:2]] == ["lift-off", "landing"]
    for one, other in zip(found[:2], first[:2], strict=True):
        assert one.angle == pytest.approx(other.angle, abs=1e-11)
        assert one.impulse == pytest.approx(other.impulse, rel=1e-7)


@pytest.mark.parametrize("name", list(MODELS))
def test_a_dwell_of_a_nanoradian(make_cam, parameters, name):
    """A high dwell of 1e-9 rad is as good as none: its follower moves a billionth as far ahead."""
    tiny = float(np.degrees(1e-9))
    rise, fall = {"law": "poly345", "span": 120, "to": 1}, {"law": "poly345", "span": 120, "to": 0}
    rest = {"law": "dwell", "span": 120}
    without = build_law(make_cam(rise, fall, rest))
    thin = build_law(
        make_cam(rise, {"law": "dwell", "span": tiny}, fall, {**rest, "span": 120 - tiny})
    )
    assert thin.spans.min() == pytest.approx(1e-9, rel=1e-6)
    _, wanted = one_turn(without, name, parameters)
    _, found = one_turn(thin, name, parameters)
    assert len(found.events) == len(wanted.events)
    sizes = np.abs(wanted.rows).max(axis=1, keepdims=True) + 1e-300
    assert (np.abs(found.rows - wanted.rows) / sizes)[:3].max() < 1e-6


@pytest.mark.parametrize("name", list(MODELS))
def test_rest_in_slices_of_a_nanoradian(parameters, name):
    """Twenty dwells of 1e-9 rad in a row: at rest is at rest, to the last digit."""
    breaks = np.concatenate([[0.0], 1.0 + 1e-9 * np.arange(20), [TURN]])
    law = Law("slices", breaks, np.zeros((6, breaks.size - 1)))
    _, block = one_turn(law, name, parameters)
    preload = block.rows[4, 0]
    assert block.events == ()
    assert preload > 0.0
    np.testing.assert_array_equal(block.rows[1:4], 0.0)
    np.testing.assert_allclose(block.rows[4], preload, rtol=1e-12)


def test_a_rise_of_a_nanoradian_is_a_step(laws):
    """A stem cannot tell 1e-9 rad from a step: x = h (1 − cos Ωt), whatever the rise is made of.

    The rise takes 1e-9/ω s, in which the stem turns by 2e-8 rad: that is the difference, and
    velocities of 1e9 m/s and accelerations of 1e19 m/s² in between must leave no trace.
    """
    follower, speed = FollowerParameters(1.3, 4030.0, 0.0, 0.0, 1e5), 10.0
    rise = 0.01 * np.repeat([0.0, 1.0], 3)
    columns = [0.0 * rise, rise, 0.0 * rise + 0.01, rise[::-1]]
    law = Law("cliff", np.array([0.0, 1.0, 1.0 + 1e-9, 5.0, TURN]), np.stack(columns, axis=1))
    since = np.linspace(1e-6, 0.39, 200)
    x, v, _, _ = motion(law, follower, speed, 0.0, np.zeros(2), 0.1 + since)
    total = follower.spring_stiffness + follower.stem_stiffness
    rate, rest = np.sqrt(total / follower.mass), 0.01 * follower.stem_stiffness / total
    np.testing.assert_allclose(x, rest * (1.0 - np.cos(rate * since)), rtol=0, atol=1e-7 * rest)
    np.testing.assert_allclose(v, rest * rate * np.sin(rate * since), atol=1e-7 * rest * rate)


@pytest.mark.parametrize("name", ["two_mass", "torsional"])
def test_a_dwell_of_a_whole_turn(make_cam, parameters, name):
    """A disc: nothing lifts, nothing twists, and the force is the preload at any speed."""
    law = build_law(make_cam({"law": "dwell", "span": 360}))
    for speed in (0.001, 40.0, 10_000.0):
        interval = Interval(0, NS // 10, 0.0, speed)
        _, block = MODELS[name].advance(law, parameters[name], None, interval, 4000)
        p = parameters[name]
        wanted = p.share * p.preload if name == "two_mass" else p.follower.preload
        np.testing.assert_allclose(block.rows[4], wanted, rtol=1e-12)
        np.testing.assert_array_equal(block.rows[1:4], 0.0)
        assert block.events == ()


def test_a_disc_under_a_thrown_follower(make_cam, parameters):
    """It comes down once, plastically, with the impulse of its fall."""
    from cam_rig.dynamics import FollowerState

    law = build_law(make_cam({"law": "dwell", "span": 360}))
    p = replace(parameters["one_mass"], damping=0.0)
    lifted_off = FollowerState(0.0, 0.3, 0.0, in_contact=False)
    state, block = MODELS["one_mass"].advance(law, p, lifted_off, Interval(0, NS, 0.0, 40.0), 1000)
    assert [event.kind for event in block.events] == ["landing"]
    assert block.events[0].impulse == pytest.approx(0.3 * p.mass, rel=1e-9)
    assert state.in_contact

"""The cam's whole turns are counted apart: late turns are like the first, to the last digit."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, FollowerParameters, FollowerState, Interval, wrap
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.schema import load_rig
from cam_rig.units import NS, TURN

#: 480 rpm: a turn is 125 ms, and so many turns are whole seconds: the grid of samples is the same.
RPM, PERIOD, RATE = 480.0, NS // 8, 12_007
SPEED = RPM * np.pi / 30.0
MS = NS // 1000
TURNS = (0, 1_000, 100_000, 10_000_000)
TICKS = {"1 ms": MS, "7 ms": 7 * MS, "50 ms": 50 * MS, "a turn": PERIOD}
CASES = {
    "kinetostatic": ("kinetostatic", {}),
    "elastic_stem": ("elastic_stem", {}),
    "torsional": ("torsional", {}),
    "one_mass": ("one_mass", {"preload": 12.753}),
    "one_mass, bouncing": ("one_mass", {"preload": 12.753, "restitution": 0.4}),
    "two_mass": ("two_mass", {}),
    "two_mass, bouncing": ("two_mass", {"restitution": 0.3}),
}


@pytest.fixture(scope="module")
def paper_rig(config_dir):
    return load_rig(config_dir / "rigs" / "paper_table2.yaml")


def ticked(law, model, p, total, tick, turns=0, acceleration=0.0):
    """Rows, events since the start, and last state, begun ``turns`` turns late."""
    start = turns * PERIOD
    whole = Interval(start, start + total, 0.0, SPEED, acceleration, turns)
    state, rows, events = None, [], []
    for a, b in itertools.pairwise([*range(0, total, tick), total]):
        at = a / NS
        part = Interval(
            start + a, start + b, whole.angle_at(at), whole.speed_at(at), acceleration, turns
        )
        state, block = MODELS[model].advance(law, p, state, part, RATE)
        rows.append(block.rows)
        events += block.events
    rows = np.hstack(rows)
    rows[0] -= start / NS
    late = start / NS, turns * TURN
    return rows, [(e.kind, e.time - late[0], e.angle - late[1], e) for e in events], state


def known_until(law, model, p, total, acceleration, wanted):
    """Time (s) up to which the last digit of a number moves no event by more than 1e-14 s.

    Bounce after bounce enlarges it, in some series a billion times: no tick can be better.
    """
    until = np.inf
    for last in (-1e-15, 1e-15):
        for name in ("preload", "spring_stiffness"):
            nudged = replace(p, **{name: getattr(p, name) * (1.0 + last)})
            events = ticked(law, model, nudged, total, PERIOD, 0, acceleration)[1]
            for one, other in itertools.zip_longest(events, wanted[1]):
                if one is None or other is None or abs(one[1] - other[1]) > 1e-14:
                    until = min(until, *(event[1] for event in (one, other) if event))
                    break
    return until


def same(found, wanted, turns, until=np.inf):
    """Events and samples to 1e-10 of each row's size; a late clock has few digits after its dot."""
    rows, events, state = found
    size, early = np.abs(wanted[0]).max(axis=1), wanted[0][0] < until
    clock = 1e-12 + np.spacing(turns * PERIOD / NS)
    assert (np.abs(rows - wanted[0])[1:, early].max(axis=1) <= 1e-10 * size[1:]).all()
    assert np.abs(rows[0] - wanted[0][0]).max() <= clock
    if until < np.inf:
        events = [event for event in events if event[1] < until - clock]
        wanted = wanted[0], wanted[1][: len(events)], state
    assert [kind for kind, *_ in events] == [kind for kind, *_ in wanted[1]]
    for one, other in zip(events, wanted[1], strict=True):
        assert one[1] == pytest.approx(other[1], abs=clock)
        assert one[2] == pytest.approx(other[2], abs=1e-10 + 2.0 * np.spacing(turns * TURN))
        impulse = 1e-10 * max(e.impulse for *_, e in wanted[1])
        assert one[3].impulse == pytest.approx(other[3].impulse, abs=impulse)
    assert state.in_contact == wanted[2].in_contact


@pytest.fixture(scope="module")
def parameters(paper_rig):
    def of(name):
        model, changes = CASES[name]
        return model, replace(MODELS[model].parameters(paper_rig), **changes)

    return of


@pytest.mark.variants(7)
@pytest.mark.parametrize("acceleration", [0.0, 40.0])
@pytest.mark.parametrize("name", CASES)
def test_late_turns_are_like_the_first(laws, parameters, name, acceleration):
    """Every model, ticks of 1, 7 and 50 ms and of a turn, begun after up to 1e7 turns; and ramps.

    1e7 turns in one number leave 7e-9 rad of phase.
    """
    model, p = parameters(name)
    total = 250 * MS
    wanted = ticked(laws["poly345"], model, p, total, PERIOD, 0, acceleration)
    if model in ("one_mass", "two_mass"):
        assert len(wanted[1]) > 3
    for tick, turns in zip(TICKS.values(), itertools.cycle(TURNS[1:])):
        same(ticked(laws["poly345"], model, p, total, tick, turns, acceleration), wanted, turns)


@pytest.mark.long
@pytest.mark.parametrize("cam", ["poly345", "tm21", "bezier15"])
@pytest.mark.parametrize("acceleration", [0.0, 40.0])
@pytest.mark.parametrize("name", CASES)
def test_all_late_turns_in_all_ticks(laws, parameters, name, acceleration, cam):
    """The same for more cams, and each length of a tick after each number of turns."""
    model, p = parameters(name)
    law, total = laws[cam], 500 * MS
    wanted, until = ticked(law, model, p, total, PERIOD, 0, acceleration), np.inf
    if model in ("one_mass", "two_mass"):
        until = known_until(law, model, p, total, acceleration, wanted)
    for tick, turns in itertools.product(TICKS.values(), TURNS):
        found = ticked(law, model, p, total, tick, turns, acceleration)
        same(found, wanted, turns, until)


@pytest.mark.parametrize("apart", [True, False])
@pytest.mark.parametrize("tick", [PERIOD // 3, PERIOD // 8, 10 * MS])
def test_contact_is_kept_over_late_borders(laws, tick, apart):
    """300 rpm and 30 N: the force never falls to zero, so there is no event, after 1e4 turns too.

    So it is where the angle is one number, of which 1e-11 rad are rounding.
    """
    p, speed = FollowerParameters(1.3, 4030.0, 8.642, 30.0, 3.3e8), 300.0 * np.pi / 30.0
    state = None
    for i in range(60):
        a, b = i * tick, (i + 1) * tick
        angle = speed * a / NS
        part = Interval(a, b, angle if apart else angle + 1e4 * TURN, speed, 0.0, 10_000 * apart)
        state, block = MODELS["one_mass"].advance(laws["poly345"], p, state, part, 1000)
        assert block.events == ()
        assert block.rows[4].min() > 0.0


@pytest.mark.parametrize("model", MODELS)
def test_an_angle_that_jumped_is_refused(laws, parameters, model):
    """What goes on from a state begins where that ended, to 2e-6 rad, whatever the turn."""
    name = next(name for name, (of, _) in CASES.items() if of == model)
    p, law, advance = parameters(name)[1], laws["poly345"], MODELS[model].advance
    state, _ = advance(law, p, None, Interval(0, 7 * MS, 1.0, SPEED), RATE)
    reached = 1.0 + SPEED * 0.007
    for off, turns in ((1e-6, 0), (-1e-6, 5), (0.0, 10**9)):
        advance(law, p, state, Interval(7 * MS, 14 * MS, reached + off, SPEED, 0.0, turns), RATE)
    for off in (0.5, -1e-5, np.pi):
        jumped = Interval(7 * MS, 14 * MS, reached + off, SPEED)
        told = rf"from {jumped.angle:.9g} rad on, .* ended at {reached:.9g} rad .*; allowed: 2e-06"
        with pytest.raises(DynamicsError, match=told):
            advance(law, p, state, jumped, RATE)
        advance(law, p, replace(state, cam_angle=None), jumped, RATE)  # nobody said where it ended


def test_a_turn_ends_where_the_next_begins(laws, parameters):
    """Just below 2π and at 0 of the next turn is one place."""
    p, law = parameters("one_mass")[1], laws["poly345"]
    state = replace(FollowerState(0.0, 0.0, 10.0, True), cam_angle=TURN - 1e-13, cam_speed=SPEED)
    MODELS["one_mass"].advance(law, p, state, Interval(0, MS, 0.0, SPEED), RATE)
    assert wrap(-1e-17) == (0, 0.0)
    assert wrap(7.0 * TURN + 1.0, 5) == (12, pytest.approx(1.0, abs=1e-14))
    assert wrap(-1.0) == (-1, TURN - 1.0)
    for huge in (2.2495818320978993e18, -1e300, 1e16):
        assert 0.0 <= wrap(huge)[1] < TURN
    for turns, angle in ((3, 1.0), (-7, 0.5), (10_000_000, 6.2)):
        assert wrap(turns * TURN + angle) == (turns, pytest.approx(angle, abs=np.spacing(1e8)))


@pytest.mark.parametrize("faster", [0.8, 1.25])
@pytest.mark.parametrize("model", ["one_mass", "elastic_stem", "two_mass"])
@pytest.mark.parametrize("degrees", [90.0, 270.0])
def test_a_step_of_the_speed_moves_the_cam_alone(laws, parameters, model, faster, degrees):
    """No mass changes its velocity by itself, whatever the cam does under it.

    Where the cam gets faster it strikes: J = m Δv for the mass that touches it; where it gets
    slower the follower goes on with the velocity it had.
    """
    p, law = parameters(model)[1], laws["poly345"]
    p = replace(p, preload=200.0)
    angle, slow, advance = np.radians(degrees), 20.0, MODELS[model].advance
    state, block = advance(law, p, None, Interval(0, MS, angle - slow * 1e-3, slow), RATE)
    assert block.events == ()
    change = float(law(angle, 1)) * slow * (faster - 1.0)
    _, block = advance(law, p, state, Interval(MS, 2 * MS, angle, slow * faster), RATE)
    if model == "elastic_stem":
        assert block.rows[2, 0] == pytest.approx(state.velocity, abs=0.02 * abs(change))
        return  # its acceleration is the stem's
    first = block.events[0]
    assert first.kind == ("landing" if change > 0.0 else "lift-off")
    assert first.time == pytest.approx(1e-3, abs=1e-15)
    mass = p.mass if model == "one_mass" else p.roller_mass
    if change > 0.0:
        assert first.impulse == pytest.approx(mass * change, rel=1e-9)
    else:
        since = block.rows[0, 0] - first.time
        begun = block.rows[2, 0] - block.rows[3, 0] * since
        assert begun == pytest.approx(state.velocity, abs=3e-3 * abs(change))


def test_a_disc_knows_no_turns():
    """Nothing happens on a disc, however late and however it is cut."""
    disc = Law("disc", np.array([0.0, TURN]), np.full((2, 1), 0.01))
    p = FollowerParameters(1.3, 4030.0, 8.642, 30.0, 3.3e8)
    state, block = MODELS["one_mass"].advance(disc, p, None, Interval(0, NS, 6.28e11, 50.0), 100)
    assert block.events == ()
    assert state.in_contact

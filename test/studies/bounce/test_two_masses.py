"""Tests of bounce maps of two masses: derivatives, exponents, kinds of motion.

The exponents are Lyapunov exponents. The roller mass and the end mass are connected by an elastic
stem.
"""

import csv
import math
from dataclasses import replace
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.linear.exponential import Flight
from cam_rig.dynamics.turn_map import StroboscopicMap
from cam_rig.dynamics.two_mass import Separation
from cam_rig.studies.bounce.branches import FOLD, Family, MotionNotFoundError
from cam_rig.studies.bounce.motion import IN_CONTACT, IRREGULAR, PERIODIC
from cam_rig.studies.bounce.result import START_ABOVE
from cam_rig.studies.bounce.sweep import MASS, PRELOAD, OperatingPoint, Sweep
from cam_rig.units import RPM

from ...dynamics.test_turn_map import random_two
from .table import BOUNCES, LEAVES, LIFTS_OFF, STAYS, TwoInManyDigits, as_array, table_law

LAW = table_law()
#: Roller mass 0.4 kg, end mass 0.6 kg, soft stem, soft spring, both damped, restitution 0.6.
SOFT = TwoMassParameters(0.4, 0.6, 2000.0, 5.0, 0.8, 0.3, 9.81, 0.6)


def events_of(turn_map, numbers):
    """Return (time in s, kind) of each lift-off and landing in a simulated turn.

    `numbers` is the state at the start of the turn. The model of cam_rig is used. A landing that is
    followed at once by a lift-off has the kind LEAVES.
    """
    trajectory = Separation(turn_map.law, turn_map.parameters, turn_map.speed)
    follower = turn_map.follower(tuple(numbers))
    inner = np.array(follower.inner)
    state = (
        inner if follower.in_contact else Flight(trajectory.system, inner[:4], *inner[4:].tolist())
    )
    trajectory.run_from(turn_map.duration, state)
    events, next_events = [], [*trajectory.events, None][1:]
    for event, following in zip(trajectory.events, next_events, strict=True):
        kind, ends = LIFTS_OFF, following is None
        if event.kind == "landing":
            stays = (
                not isinstance(trajectory.last, Flight) if ends else following.kind == "lift-off"
            )
            kind = STAYS if stays else BOUNCES
        elif events and events[-1][0] == event.time:
            events[-1] = (event.time, LEAVES)
            continue
        events.append((event.time, kind))
    return events


@pytest.mark.parametrize(
    ("changed", "speed", "turns", "kinds"),
    [
        ({}, 62.0, 4, {BOUNCES}),
        ({"restitution": 0.0}, 45.0, 4, {LIFTS_OFF, STAYS, LEAVES}),
        ({"restitution": 0.0, "stem_stiffness": 1e5}, 37.0, 2, {LIFTS_OFF, STAYS, LEAVES}),
        ({"stem_stiffness": 1e7, "restitution": 0.3}, 60.0, 2, {LIFTS_OFF, STAYS, BOUNCES}),
        ({"stem_damping": 0.0, "damping": 0.0}, 70.0, 2, {BOUNCES}),
    ],
)
def test_derivatives_and_exponents_in_many_digits(changed, speed, turns, kinds):
    """The derivative of the motion over one turn agrees with differences in 60 digits.

    The tolerance is 1e-10 of the largest entry. The cases start in flight and in contact. The
    Lyapunov exponents agree within 1e-9 per turn with a QR decomposition of these differences.
    """
    p = replace(SOFT, **changed)
    turn_map = StroboscopicMap(LAW, p, speed)
    state = turn_map.run(30).states[-1]
    run = turn_map.run(turns, tuple(state))
    units = mp.diag([mp.mpf(speed), 1, mp.mpf(math.sqrt(p.stiffness / p.end_mass)), 1])
    shear = mp.matrix([[1, 0, 0, 0], [0, 1, 0, 0], [1, 0, 1, 0], [0, 1, 0, 1]])  # to (z, y)
    frame = mp.matrix([[0, 0, 1, 0], [0, 0, 0, 1], [1, 0, 0, 0], [0, 1, 0, 0]])
    growth, kinds_met = np.zeros(4), set()
    with mp.workdps(60):
        exact = TwoInManyDigits(p, speed)
        for turn in range(turns):
            events = events_of(turn_map, state)
            kinds_met |= {kind for _, kind in events}
            expected = exact.derivative(state, events)
            sizes = turn_map.scale / turn_map.scale[:, None]
            difference = np.abs((run.derivatives[turn] - as_array(expected)) * sizes).max()
            assert difference < 1e-10 * max(1.0, np.abs(as_array(expected) * sizes).max())
            if run.contact_times[turn] == 0.0:
                moved = units * shear * expected * shear**-1 * units**-1
                frame, upper = mp.qr(moved * frame)
                growth += [float(mp.log(abs(upper[i, i]))) for i in range(4)]
            state = run.states[turn]
    assert kinds_met == kinds
    if kinds == {BOUNCES}:
        np.testing.assert_allclose(run.growth.sum(axis=0), growth, rtol=0, atol=1e-9 * turns)


@pytest.mark.variants(8)
@pytest.mark.parametrize("seed", range(80))
def test_a_turn_of_the_map_equals_the_models_run(laws, seed):
    """A turn of the bounce map has the landings and the end state of a simulation.

    The rig is random. The states agree within a relative 1e-9, because both add rounding errors in
    a different order.
    """
    turn_map, _ = random_two(laws, seed)
    trajectory = Separation(turn_map.law, turn_map.parameters, turn_map.speed)
    trajectory.run(turn_map.duration)
    run = turn_map.run(1)
    assert run.landings[0] == sum(event.kind == "landing" for event in trajectory.events)
    end, state = trajectory.end(turn_map.duration), turn_map.follower(tuple(run.states[0]))
    assert end.in_contact == state.in_contact
    np.testing.assert_allclose(state.inner, end.inner, rtol=1e-9, atol=1e-12)


def test_classes_and_exponents(law, paper_rig, two_mass):
    """The motions at 400, 445 and 580 rpm are in contact, periodic and irregular.

    In contact only the end mass moves freely, so two exponents are its decay per turn, −(c₁ + c₂)
    T/(2 m₂), and the other two are −∞.
    """
    how = {"model": "two_mass", "restitution": 0.5, "turns": 60, "transient_turns": 200}
    result = cam_rig.bounce_map(law, paper_rig, rpm=[400, 445, 580], **how)
    assert [row.motion for row in result.rows] == [IN_CONTACT, PERIODIC, IRREGULAR]
    decay = 0.5 * (two_mass.stem_damping + two_mass.damping) / two_mass.end_mass * 60.0 / 400.0
    np.testing.assert_allclose(result.rows[0].exponents[:2], -decay, rtol=1e-9)
    assert result.rows[0].exponents[2:] == (-math.inf, -math.inf)
    assert result.rows[2].lyapunov_exponent > result.rows[2].exponent_error > 0.0
    rows = result.data()["speeds"]
    assert rows[0]["exponent_2"] == pytest.approx(-decay)
    assert rows[0]["exponent_3"] is None
    assert result.lift_off == pytest.approx(find_jump(law, two_mass, None).speed)
    turns = result.to_pandas("turns")
    assert np.isfinite(turns.stretch).all()
    assert "two masses" in result.title


@pytest.mark.parametrize(
    "last", [598.0, pytest.param(565.0, marks=[pytest.mark.long, pytest.mark.slow])]
)
def test_a_branch_of_two_masses(laws, last):
    """Each motion on a branch of two masses repeats after one turn.

    The tolerance is 1e-9 of its scale. A branch is a family of periodic motions over speed. The
    product of the motion's multipliers is the known contraction by damping and landings. No motion
    exists 1e-6 below the speed of a fold.
    """
    p = TwoMassParameters(1.04, 0.26, 1e5, 4030.0, 50.0, 8.642, 12.753, 0.85)
    law, sweep, speed = laws["tm21"], Sweep(OperatingPoint(p, 1.0)), 600.0 * RPM
    run = StroboscopicMap(law, p, speed).run(300, (0.03, 0.2))
    family = Family(law, sweep, 1)
    motion = family.at(speed, tuple(run.states[-1]))
    assert motion.stable
    motions, found = family.follow(motion, last * RPM, speed, up=False)
    decay = p.stem_damping / p.roller_mass + (p.stem_damping + p.damping) / p.end_mass
    for item in motions[::6]:
        turn_map = StroboscopicMap(law, p, item.point.speed)
        repeated = turn_map.run(1, item.state)
        assert np.abs((repeated.states[0] - item.state) / turn_map.scale).max() < 1e-9
        expected = 2.0 * item.landings * math.log(0.85) - decay * turn_map.duration
        assert np.linalg.slogdet(item.derivative)[1] == pytest.approx(expected, abs=1e-6)
    if last > 575.0:
        assert found == []
        return
    (fold,) = (item.point.speed for item in found if item.kind == FOLD)
    nearest_motion = min(motions, key=lambda item: abs(item.point.speed - fold))
    multipliers = family.at(fold * (1.0 + 1e-6), nearest_motion.state).multipliers
    assert multipliers.real.max() == pytest.approx(1.0, abs=0.01)
    with pytest.raises(MotionNotFoundError):
        family.at(fold * (1.0 - 1e-6), nearest_motion.state)


def test_two_masses_over_a_number(law, paper_rig):
    """In a sweep over the mass, the ratio of roller mass and end mass is constant.

    In a sweep over the preload, contact is lost where the smallest steady contact force is zero.
    """
    how = {"model": "two_mass", "restitution": 0.3, "turns": 20, "transient_turns": 40, "rpm": 410}
    result = cam_rig.bounce_map(law, paper_rig, parameter=MASS, values=[0.9, 1.6], **how)
    assert result.swept(result.rows) == pytest.approx([0.9, 1.6])
    p = result.rows[0].point.parameters
    assert p.roller_mass / (p.roller_mass + p.end_mass) == pytest.approx(0.4)
    result = cam_rig.bounce_map(law, paper_rig, parameter=PRELOAD, values=[10, 15, 20, 50], **how)
    assert 15.0 < result.lift_off < 20.0
    assert [row.motion == IN_CONTACT for row in result.rows] == [False, False, True, True]


def test_rows_from_above_start_in_the_state_above(law, paper_rig):
    """With `start="above"` each speed starts in the end state of the speed above.

    The state includes the stretch of the stem and its rate.
    """
    how = {
        "model": "two_mass",
        "restitution": 0.5,
        "turns": 20,
        "transient_turns": 20,
        "start": START_ABOVE,
    }
    slow, fast = cam_rig.bounce_map(law, paper_rig, rpm=[400, 450], **how).rows
    end = StroboscopicMap(law, slow.point.parameters, 400 * RPM).run(40, fast.end).states[-1]
    np.testing.assert_allclose(end, slow.end, rtol=1e-6, atol=1e-12)


# -- the same cam computed with Siconos, whose Moreau-Jean scheme uses time steps without events


TABLE = Path(__file__).with_name("siconos.csv")
#: Number of turns that the program Siconos, the reference, simulated at each speed.
TURNS = 130
#: Number of turns at the end of a run from which its kind of motion was determined.
KEPT = 30
#: Largest allowed difference from Siconos' gaps, mm. A landing of its first-order scheme is up to
#: one time step late, which limits its accuracy to about this value.
STEPS_APART = 0.025


@pytest.fixture(scope="module")
def stepped():
    """Stored results of the program Siconos, one row per speed, in rising order."""
    return list(csv.DictReader(TABLE.read_text(encoding="utf-8").splitlines()))


@pytest.fixture(scope="module")
def exact(stepped, laws, rig):
    """Rows of `bounce_map` at the speeds of the Siconos table.

    They are computed from roots and closed forms instead of time steps.
    """
    rpm, how = (
        [float(row["rpm"]) for row in stepped],
        {"turns": KEPT, "transient_turns": TURNS - KEPT},
    )
    return cam_rig.bounce_map(laws["tm21"], rig, rpm=rpm, restitution=0.7, **how).rows


def test_motions_are_those_of_time_stepping(stepped, exact):
    """Kind of motion and period equal those from Siconos' time stepping at 50 speeds."""
    assert len(stepped) == 50
    found = [(row.rpm, row.motion, str(row.period or "")) for row in exact]
    assert found == [(float(row["rpm"]), row["motion"], row["period"]) for row in stepped]
    assert {motion for _, motion, _ in found} == {IN_CONTACT, PERIODIC, IRREGULAR}


def test_gaps_at_the_section_are_those_of_time_stepping(stepped, exact):
    """The smallest and largest gap at angle 0 equal those of Siconos within 0.025 mm.

    Siconos simulates by time steps. Irregular motions are sensitive to errors, so there the two
    ranges only have to overlap.
    """
    for row, exact_row in zip(stepped, exact, strict=True):
        gaps = 1e3 * exact_row.states[:, 0]
        ends = np.array([float(row["least_gap_mm"]), float(row["greatest_gap_mm"])])
        if exact_row.motion == IRREGULAR:
            assert gaps.min() < ends[1] and ends[0] < gaps.max()
        else:
            np.testing.assert_allclose([gaps.min(), gaps.max()], ends, atol=STEPS_APART)

"""Two masses with an elastic stem: their map's derivative, its exponents, and its classes."""

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
from cam_rig.studies.bounce.branches import FOLD, Family, UnfoundMotionError
from cam_rig.studies.bounce.motion import IN_CONTACT, IRREGULAR, PERIODIC
from cam_rig.studies.bounce.result import ABOVE
from cam_rig.studies.bounce.sweep import MASS, PRELOAD, OperatingPoint, Sweep
from cam_rig.units import RPM

from ...dynamics.test_turn_map import random_two
from .table import BOUNCES, LEAVES, LIFTS_OFF, STAYS, TwoInManyDigits, as_array, table_law

LAW = table_law()
#: 0.4 and 0.6 kg on a soft stem and a soft spring, with dampers in both.
SOFT = TwoMassParameters(0.4, 0.6, 2000.0, 5.0, 0.8, 0.3, 9.81, 0.6)


def events_of(turn_map, numbers):
    """When (s) the events of the package's own run of a turn are, and what becomes of each."""
    course = Separation(turn_map.law, turn_map.parameters, turn_map.speed)
    follower = turn_map.follower(tuple(numbers))
    inner = np.array(follower.inner)
    state = inner if follower.in_contact else Flight(course.system, inner[:4], *inner[4:].tolist())
    course.run_from(turn_map.duration, state)
    found, after = [], [*course.events, None][1:]
    for event, following in zip(course.events, after, strict=True):
        kind, ends = LIFTS_OFF, following is None
        if event.kind == "landing":
            stays = not isinstance(course.last, Flight) if ends else following.kind == "lift-off"
            kind = STAYS if stays else BOUNCES
        elif found and found[-1][0] == event.time:
            found[-1] = (event.time, LEAVES)
            continue
        found.append((event.time, kind))
    return found


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
    """Turn by turn: differences in 60 digits, from flight and from the table, and QR of these."""
    p = replace(SOFT, **changed)
    turn_map = StroboscopicMap(LAW, p, speed)
    begin = turn_map.run(30).states[-1]
    run = turn_map.run(turns, tuple(begin))
    units = mp.diag([mp.mpf(speed), 1, mp.mpf(math.sqrt(p.stiffness / p.end_mass)), 1])
    shear = mp.matrix([[1, 0, 0, 0], [0, 1, 0, 0], [1, 0, 1, 0], [0, 1, 0, 1]])  # to (z, y)
    frame = mp.matrix([[0, 0, 1, 0], [0, 0, 0, 1], [1, 0, 0, 0], [0, 1, 0, 0]])
    growth, met = np.zeros(4), set()
    with mp.workdps(60):
        exact = TwoInManyDigits(p, speed)
        for turn in range(turns):
            events = events_of(turn_map, begin)
            met |= {kind for _, kind in events}
            wanted = exact.derivative(begin, events)
            sizes = turn_map.scale / turn_map.scale[:, None]
            far = np.abs((run.derivatives[turn] - as_array(wanted)) * sizes).max()
            assert far < 1e-10 * max(1.0, np.abs(as_array(wanted) * sizes).max())
            if run.contact_times[turn] == 0.0:
                moved = units * shear * wanted * shear**-1 * units**-1
                frame, upper = mp.qr(moved * frame)
                growth += [float(mp.log(abs(upper[i, i]))) for i in range(4)]
            begin = run.states[turn]
    assert met == kinds
    if kinds == {BOUNCES}:
        np.testing.assert_allclose(run.growth.sum(axis=0), growth, rtol=0, atol=1e-9 * turns)


@pytest.mark.variants(8)
@pytest.mark.parametrize("seed", range(80))
def test_it_goes_on_as_the_model_does(laws, seed):
    """A turn has the landings of the model's own run over it, and ends where that ends."""
    turn_map, _ = random_two(laws, seed)
    course = Separation(turn_map.law, turn_map.parameters, turn_map.speed)
    course.run(turn_map.duration)
    run = turn_map.run(1)
    assert run.landings[0] == sum(event.kind == "landing" for event in course.events)
    end, here = course.end(turn_map.duration), turn_map.follower(tuple(run.states[0]))
    assert end.in_contact == here.in_contact
    np.testing.assert_allclose(here.inner, end.inner, rtol=1e-9, atol=1e-12)


def test_classes_and_exponents(law, paper_rig, two_mass):
    """On the cam two exponents are the end mass's own, (c₁ + c₂) T/(2 m₂); above irregular."""
    how = {"model": "two_mass", "restitution": 0.5, "turns": 60, "settle": 200}
    found = cam_rig.bounce_map(law, paper_rig, rpm=[400, 445, 580], **how)
    assert [row.motion for row in found.rows] == [IN_CONTACT, PERIODIC, IRREGULAR]
    decay = 0.5 * (two_mass.stem_damping + two_mass.damping) / two_mass.end_mass * 60.0 / 400.0
    np.testing.assert_allclose(found.rows[0].exponents[:2], -decay, rtol=1e-9)
    assert found.rows[0].exponents[2:] == (-math.inf, -math.inf)
    assert found.rows[2].exponent > found.rows[2].exponent_error > 0.0
    rows = found.data()["speeds"]
    assert rows[0]["exponent_2"] == pytest.approx(-decay)
    assert rows[0]["exponent_3"] is None
    assert found.lift_off == pytest.approx(find_jump(law, two_mass, None).speed)
    turns = found.to_pandas("turns")
    assert np.isfinite(turns.stretch).all()
    assert "two masses" in found.title


@pytest.mark.parametrize(
    "last", [598.0, pytest.param(565.0, marks=[pytest.mark.long, pytest.mark.slow])]
)
def test_a_branch_of_two_masses(laws, last):
    """Its motions repeat, their multipliers have the known product; a fold is told to 1e-6."""
    p = TwoMassParameters(1.04, 0.26, 1e5, 4030.0, 50.0, 8.642, 12.753, 0.85)
    law, sweep, speed = laws["tm21"], Sweep(OperatingPoint(p, 1.0)), 600.0 * RPM
    run = StroboscopicMap(law, p, speed).run(300, (0.03, 0.2))
    family = Family(law, sweep, 1)
    motion = family.at(speed, tuple(run.states[-1]))
    assert motion.stable
    motions, found = family.followed(motion, last * RPM, speed, up=False)
    fades = p.stem_damping / p.roller_mass + (p.stem_damping + p.damping) / p.end_mass
    for one in motions[::6]:
        turn_map = StroboscopicMap(law, p, one.point.speed)
        again = turn_map.run(1, one.state)
        assert np.abs((again.states[0] - one.state) / turn_map.scale).max() < 1e-9
        wanted = 2.0 * one.landings * math.log(0.85) - fades * turn_map.duration
        assert np.linalg.slogdet(one.derivative)[1] == pytest.approx(wanted, abs=1e-6)
    if last > 575.0:
        assert found == []
        return
    (fold,) = (one.point.speed for one in found if one.kind == FOLD)
    near = min(motions, key=lambda one: abs(one.point.speed - fold))
    multipliers = family.at(fold * (1.0 + 1e-6), near.state).multipliers
    assert multipliers.real.max() == pytest.approx(1.0, abs=0.01)
    with pytest.raises(UnfoundMotionError):
        family.at(fold * (1.0 - 1e-6), near.state)


def test_two_masses_over_a_number(law, paper_rig):
    """A mass is split as it was; contact is lost where the settled force falls to zero."""
    how = {"model": "two_mass", "restitution": 0.3, "turns": 20, "settle": 40, "rpm": 410}
    found = cam_rig.bounce_map(law, paper_rig, over=MASS, values=[0.9, 1.6], **how)
    assert found.swept(found.rows) == pytest.approx([0.9, 1.6])
    p = found.rows[0].point.parameters
    assert p.roller_mass / (p.roller_mass + p.end_mass) == pytest.approx(0.4)
    found = cam_rig.bounce_map(law, paper_rig, over=PRELOAD, values=[10, 15, 20, 50], **how)
    assert 15.0 < found.lift_off < 20.0
    assert [row.motion == IN_CONTACT for row in found.rows] == [False, False, True, True]


def test_from_above(law, paper_rig):
    """A row begins where the one above has ended, with the stem as it was."""
    how = {"model": "two_mass", "restitution": 0.5, "turns": 20, "settle": 20, "start": ABOVE}
    slow, fast = cam_rig.bounce_map(law, paper_rig, rpm=[400, 450], **how).rows
    end = StroboscopicMap(law, slow.point.parameters, 400 * RPM).run(40, fast.end).states[-1]
    np.testing.assert_allclose(end, slow.end, rtol=1e-6, atol=1e-12)


# -- the same cam, stepped by Siconos: Moreau and Jean's scheme knows no events and no closed form


TABLE = Path(__file__).with_name("siconos.csv")
#: Turns that were stepped at each speed, and those of them at the end that were classed.
TURNS, KEPT = 130, 30
#: mm: so far apart are two turns that its steps cannot tell to differ, as a landing is up to a step
#: late; a motion is told by a scheme of first order to about as much.
STEPS_APART = 0.025


@pytest.fixture(scope="module")
def stepped():
    """Rows of the table, in order of speed."""
    return list(csv.DictReader(TABLE.read_text(encoding="utf-8").splitlines()))


@pytest.fixture(scope="module")
def exact(stepped, laws, rig):
    """The same speeds by roots and closed forms."""
    rpm, how = [float(row["rpm"]) for row in stepped], {"turns": KEPT, "settle": TURNS - KEPT}
    return cam_rig.bounce_map(laws["tm21"], rig, rpm=rpm, restitution=0.7, **how).rows


def test_motions_are_those_of_time_stepping(stepped, exact):
    """In contact, periodic with its period, irregular: the same at each of 50 speeds."""
    assert len(stepped) == 50
    found = [(row.rpm, row.motion, str(row.period or "")) for row in exact]
    assert found == [(float(row["rpm"]), row["motion"], row["period"]) for row in stepped]
    assert {motion for _, motion, _ in found} == {IN_CONTACT, PERIODIC, IRREGULAR}


def test_gaps_at_the_section_are_those_of_time_stepping(stepped, exact):
    """Least and greatest of a period's turns, as near as its steps tell; the irregular overlap."""
    for row, own in zip(stepped, exact, strict=True):
        gaps = 1e3 * own.states[:, 0]
        ends = np.array([float(row["least_gap_mm"]), float(row["greatest_gap_mm"])])
        if own.motion == IRREGULAR:
            assert gaps.min() < ends[1] and ends[0] < gaps.max()
        else:
            np.testing.assert_allclose([gaps.min(), gaps.max()], ends, atol=STEPS_APART)

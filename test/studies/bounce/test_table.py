"""A ball on a table that moves up and down, whose windows have closed forms (Holmes 1982)."""

import math
from dataclasses import replace

import numpy as np
import pytest

import cam_rig
from cam_rig.studies.bounce.branches import FLIP, FOLD, Family
from cam_rig.studies.bounce.sweep import MASS, PRELOAD, RESTITUTION, SPEED, OperatingPoint, Sweep
from cam_rig.units import RPM

from .table import (
    AMPLITUDE,
    GRAVITY,
    ball,
    by_speed,
    one_landing,
    speed_at,
    table_law,
    window,
)

LAW = table_law()


@pytest.mark.parametrize("restitution", [0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99])
def test_the_period_doubles_at_its_closed_form(restitution):
    """One landing a turn loses its stability at s̈/g = −2 (1 + r²)/(1 + r)², to 1e-10."""
    _, doubling = window(restitution)
    speed, state = one_landing(restitution, 0.99 * doubling)
    family = Family(LAW, by_speed(ball(restitution)), 1)
    begin = family.at(speed, state)
    assert begin.stable
    motions, found = family.followed(begin, speed, speed_at(1.02 * doubling), up=True)
    assert [one.kind for one in found] == [FLIP]
    assert found[0].point.rpm == pytest.approx(speed_at(doubling) / RPM, rel=1e-10)
    assert not motions[-1].stable


@pytest.mark.parametrize("restitution", [0.1, 0.3, 0.5, 0.7, 0.9, 0.99])
def test_the_window_begins_at_its_closed_form(restitution):
    """One landing a turn is there from A ω²/g = π (1 − r)/(1 + r) on: a fold, to 1e-10."""
    least, _ = window(restitution)
    speed, state = one_landing(restitution, 1.05 * least)
    family = Family(LAW, by_speed(ball(restitution)), 1)
    motions, found = family.followed(family.at(speed, state), 0.9 * speed_at(least), speed, False)
    assert [one.kind for one in found] == [FOLD]
    assert found[0].point.rpm == pytest.approx(speed_at(least) / RPM, rel=1e-10)
    assert motions[0].stable
    assert motions[-1].multipliers.real.max() > 1.0  # it has gone round, and back up


@pytest.mark.parametrize("restitution", [0.2, 0.5, 0.8])
def test_multipliers_are_those_of_the_closed_form(restitution):
    """The trace is (1 + r)² (1 + s̈/g) − 2 r and the determinant r², to 1e-10."""
    least, doubling = window(restitution)
    ratio = least + 0.6 * (doubling - least)
    speed, state = one_landing(restitution, ratio)
    motion = Family(LAW, by_speed(ball(restitution)), 1).at(speed, state)
    np.testing.assert_allclose(motion.state, state, rtol=1e-10)
    bend = -math.sqrt(ratio**2 - least**2)
    trace = (1.0 + restitution) ** 2 * (1.0 + bend) - 2.0 * restitution
    assert np.trace(motion.derivative) == pytest.approx(trace, abs=1e-10)
    assert np.linalg.det(motion.derivative) == pytest.approx(restitution**2, rel=1e-11)


# -- over restitution, preload or mass at one speed: the rows of such rigs, and known places


@pytest.mark.parametrize(
    ("over", "values"),
    [(RESTITUTION, [0.3, 0.62, 0.9]), (PRELOAD, [6.0, 20.0, 50.0]), (MASS, [0.8, 1.0, 1.7])],
)
def test_a_row_is_that_of_such_a_rig(laws, rig, over, values):
    """What is swept is the follower's number, and nothing else changes; its column says which."""
    given = {} if over == RESTITUTION else {"restitution": 0.7}
    how = {"turns": 20, "settle": 80}
    found = cam_rig.bounce_map(laws["tm21"], rig, rpm=450, over=over, values=values, **given, **how)
    rows = found.data()["speeds"]
    assert [row[over] for row in rows] == values
    assert [row["rpm"] for row in rows] == [450.0] * 3
    shown = [c.key for c in found.tables()[0].columns if c.key in (SPEED, over) and not c.hidden]
    assert shown == [over]
    for row, value in zip(rows, values, strict=True):
        alone = rig.with_follower(**({"restitution": 0.7} | {over: value}))
        assert row == cam_rig.bounce_map(laws["tm21"], alone, rpm=450, **how).data()["speeds"][0]


@pytest.mark.slow
@pytest.mark.parametrize("over", [PRELOAD, pytest.param(MASS, marks=pytest.mark.long)])
@pytest.mark.parametrize(
    "restitution", [0.2, *(pytest.param(e, marks=pytest.mark.long) for e in (0.6, 0.9))]
)
def test_windows_over_preload_and_mass(over, restitution):
    """A ω² m/P is what a ball knows of both: its fold and its doubling are at the closed forms."""
    least, doubling = window(restitution)
    speed, state = one_landing(restitution, 0.5 * (least + doubling))
    base = OperatingPoint(ball(restitution), speed)
    sweep = Sweep(base, over)
    begin = Family(LAW, sweep, 1).at(getattr(base, over), state)
    places = {}
    for up in (False, True):
        ends = 0.1 * getattr(base, over), 10.0 * getattr(base, over)
        for one in Family(LAW, sweep, 1).followed(begin, *ends, up)[1]:
            places.setdefault(one.kind, AMPLITUDE * speed**2 * one.point.mass / one.point.preload)
    assert places[FOLD] == pytest.approx(least, rel=1e-10)
    assert places[FLIP] == pytest.approx(doubling, rel=1e-10)


def test_where_contact_is_lost():
    """At P = m A ω², whichever of both is swept; a restitution loses none."""
    base = OperatingPoint(ball(0.5), 30.0)
    values = np.linspace(0.5, 20.0, 40).tolist()
    assert Sweep(base, PRELOAD).lift_off(LAW, values) == pytest.approx(9.0, rel=1e-10)
    assert Sweep(base, MASS).lift_off(LAW, values) == pytest.approx(GRAVITY / 9.0, rel=1e-10)
    assert math.isnan(Sweep(base, RESTITUTION).lift_off(LAW, [0.1, 0.9]))
    heavy = replace(base, parameters=replace(base.parameters, preload=100.0))
    assert math.isnan(Sweep(heavy, MASS).lift_off(LAW, [0.1, 1.0]))


def test_bifurcations_of_a_map_over_preload(laws, rig):
    """In order, the first lift-off among them; the figure's axis is the preload's."""
    how = {"restitution": 0.7, "turns": 20, "settle": 100, "follow": True}
    values = np.arange(14.0, 34.0, 2.0)
    found = cam_rig.bounce_map(laws["tm21"], rig, rpm=450, over=PRELOAD, values=values, **how)
    places = [one["preload"] for one in found.data()["bifurcations"]]
    assert places == sorted(places)
    assert found.lift_off in places
    assert "contact is first lost at preload 31.66" in found.summary()[0]
    assert found.plot().axes[-1].get_xlabel() == "preload [N]"


def test_a_branch_ends_where_its_number_does():
    """Down to no restitution at all, at which multipliers are zero: an end, and no bifurcation."""
    restitution = 0.05
    least, _ = window(0.0)
    speed, state = one_landing(restitution, 1.05 * least)
    family = Family(LAW, Sweep(OperatingPoint(ball(restitution), speed), RESTITUTION), 1)
    motions, found = family.followed(family.at(restitution, state), 0.0, 0.1, up=False)
    assert found == []
    assert 0.0 <= motions[-1].point.restitution < 1e-6

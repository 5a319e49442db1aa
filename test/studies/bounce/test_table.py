"""Bounce maps against the closed forms of a ball on a moving table (Holmes 1982).

A is the amplitude of the table, ω its speed, g gravity, r the restitution and s̈ the table's
acceleration at the landing.
"""

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
    """A motion with one landing per turn doubles its period at the known speed.

    The condition is s̈/g = −2 (1 + r²)/(1 + r)². The speed agrees within a relative 1e-10.
    """
    _, doubling = window(restitution)
    speed, state = one_landing(restitution, 0.99 * doubling)
    family = Family(LAW, by_speed(ball(restitution)), 1)
    start = family.at(speed, state)
    assert start.stable
    motions, found = family.follow(start, speed, speed_at(1.02 * doubling), up=True)
    assert [bifurcation.kind for bifurcation in found] == [FLIP]
    assert found[0].point.rpm == pytest.approx(speed_at(doubling) / RPM, rel=1e-10)
    assert not motions[-1].stable


@pytest.mark.parametrize("restitution", [0.1, 0.3, 0.5, 0.7, 0.9, 0.99])
def test_the_window_starts_at_its_closed_form(restitution):
    """A motion with one landing per turn starts to exist at the known speed.

    The condition is A ω²/g = π (1 − r)/(1 + r), where two motions merge (a fold). The speed agrees
    within a relative 1e-10.
    """
    fold_ratio, _ = window(restitution)
    speed, state = one_landing(restitution, 1.05 * fold_ratio)
    family = Family(LAW, by_speed(ball(restitution)), 1)
    motions, found = family.follow(
        family.at(speed, state), 0.9 * speed_at(fold_ratio), speed, False
    )
    assert [bifurcation.kind for bifurcation in found] == [FOLD]
    assert found[0].point.rpm == pytest.approx(speed_at(fold_ratio) / RPM, rel=1e-10)
    assert motions[0].stable
    assert motions[-1].multipliers.real.max() > 1.0  # past the fold the branch is unstable


@pytest.mark.parametrize("restitution", [0.2, 0.5, 0.8])
def test_multipliers_are_those_of_the_closed_form(restitution):
    """The derivative of the motion over one turn has the known trace and determinant.

    The trace is (1 + r)² (1 + s̈/g) − 2 r within 1e-10, and the determinant r² within a relative
    1e-11.
    """
    fold_ratio, doubling = window(restitution)
    ratio = fold_ratio + 0.6 * (doubling - fold_ratio)
    speed, state = one_landing(restitution, ratio)
    motion = Family(LAW, by_speed(ball(restitution)), 1).at(speed, state)
    np.testing.assert_allclose(motion.state, state, rtol=1e-10)
    acceleration = -math.sqrt(ratio**2 - fold_ratio**2)
    trace = (1.0 + restitution) ** 2 * (1.0 + acceleration) - 2.0 * restitution
    assert np.trace(motion.derivative) == pytest.approx(trace, abs=1e-10)
    assert np.linalg.det(motion.derivative) == pytest.approx(restitution**2, rel=1e-11)


# -- sweeps over restitution, preload or mass at constant speed


@pytest.mark.parametrize(
    ("parameter", "values"),
    [(RESTITUTION, [0.3, 0.62, 0.9]), (PRELOAD, [6.0, 20.0, 50.0]), (MASS, [0.8, 1.0, 1.7])],
)
def test_a_swept_row_equals_the_row_of_such_a_rig(laws, rig, parameter, values):
    """A row of a sweep over a rig parameter equals the row of a rig with this value.

    The parameters are restitution, preload and mass. The rows describe the motion at 450 rpm.
    """
    fixed = {} if parameter == RESTITUTION else {"restitution": 0.7}
    how = {"turns": 20, "transient_turns": 80}
    result = cam_rig.bounce_map(
        laws["tm21"], rig, rpm=450, parameter=parameter, values=values, **fixed, **how
    )
    rows = result.data()["speeds"]
    assert [row[parameter] for row in rows] == values
    assert [row["rpm"] for row in rows] == [450.0] * 3
    shown = [
        c.key for c in result.tables()[0].columns if c.key in (SPEED, parameter) and not c.hidden
    ]
    assert shown == [parameter]
    for row, value in zip(rows, values, strict=True):
        alone = rig.with_follower(**({"restitution": 0.7} | {parameter: value}))
        assert row == cam_rig.bounce_map(laws["tm21"], alone, rpm=450, **how).data()["speeds"][0]


@pytest.mark.slow
@pytest.mark.parametrize("parameter", [PRELOAD, pytest.param(MASS, marks=pytest.mark.long)])
@pytest.mark.parametrize(
    "restitution", [0.2, *(pytest.param(e, marks=pytest.mark.long) for e in (0.6, 0.9))]
)
def test_windows_over_preload_and_mass(parameter, restitution):
    """In sweeps over preload P and mass m, fold and doubling are at the closed forms.

    They are at the same values of A ω² m/P as in a sweep over the speed, within a relative 1e-10.
    """
    fold_ratio, doubling = window(restitution)
    speed, state = one_landing(restitution, 0.5 * (fold_ratio + doubling))
    base = OperatingPoint(ball(restitution), speed)
    sweep = Sweep(base, parameter)
    start = Family(LAW, sweep, 1).at(getattr(base, parameter), state)
    ratios = {}
    for up in (False, True):
        ends = 0.1 * getattr(base, parameter), 10.0 * getattr(base, parameter)
        for bifurcation in Family(LAW, sweep, 1).follow(start, *ends, up)[1]:
            ratios.setdefault(
                bifurcation.kind,
                AMPLITUDE * speed**2 * bifurcation.point.mass / bifurcation.point.preload,
            )
    assert ratios[FOLD] == pytest.approx(fold_ratio, rel=1e-10)
    assert ratios[FLIP] == pytest.approx(doubling, rel=1e-10)


def test_contact_is_lost_at_the_closed_form():
    """In a sweep over the preload, contact is lost from P = m A ω² downward.

    The relative tolerance is 1e-10. The restitution has no effect on the first loss, so its sweep
    returns NaN. So does a preload that keeps contact at every mass.
    """
    base = OperatingPoint(ball(0.5), 30.0)
    values = np.linspace(0.5, 20.0, 40).tolist()
    assert Sweep(base, PRELOAD).lift_off(LAW, values) == pytest.approx(9.0, rel=1e-10)
    assert Sweep(base, MASS).lift_off(LAW, values) == pytest.approx(GRAVITY / 9.0, rel=1e-10)
    assert math.isnan(Sweep(base, RESTITUTION).lift_off(LAW, [0.1, 0.9]))
    heavy = replace(base, parameters=replace(base.parameters, preload=100.0))
    assert math.isnan(Sweep(heavy, MASS).lift_off(LAW, [0.1, 1.0]))


def test_bifurcations_of_a_map_over_preload(laws, rig):
    """A sweep over the preload lists its bifurcations by rising preload.

    The list includes the first lift-off, which the summary states, and the figure has the preload
    as axis.
    """
    how = {"restitution": 0.7, "turns": 20, "transient_turns": 100, "continuation": True}
    values = np.arange(14.0, 34.0, 2.0)
    result = cam_rig.bounce_map(laws["tm21"], rig, rpm=450, parameter=PRELOAD, values=values, **how)
    preloads = [row["preload"] for row in result.data()["bifurcations"]]
    assert preloads == sorted(preloads)
    assert result.lift_off in preloads
    assert "contact is first lost at preload 31.66" in result.summary()[0]
    assert result.plot().axes[-1].get_xlabel() == "preload [N]"


def test_a_branch_ends_at_the_limit_of_the_swept_number():
    """A branch over the restitution ends at 0, its lowest valid value.

    A branch is a family of periodic motions. The end is not reported as a bifurcation.
    """
    restitution = 0.05
    fold_ratio, _ = window(0.0)
    speed, state = one_landing(restitution, 1.05 * fold_ratio)
    family = Family(LAW, Sweep(OperatingPoint(ball(restitution), speed), RESTITUTION), 1)
    motions, found = family.follow(family.at(restitution, state), 0.0, 0.1, up=False)
    assert found == []
    assert 0.0 <= motions[-1].point.restitution < 1e-6

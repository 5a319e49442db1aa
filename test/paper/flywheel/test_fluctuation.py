"""Speed fluctuation of a flywheel: the handbook's formula, eq. 10's limit, and the preload."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics.torsional.model import from_rig as shaft_of
from cam_rig.dynamics.vibration import energy_fluctuation, flywheel_turn, steady_twist
from cam_rig.laws.cam import CamSet
from cam_rig.paper.flywheel import INERTIAS, SHOWN, study_flywheel
from cam_rig.units import RPM

from ...figure_faults import faults

SPEED = 300.0 * RPM


@pytest.fixture(scope="module")
def study(laws, table2):
    """The polynomial 3-4-5 over all inertias."""
    return study_flywheel(CamSet({}, {"poly345": laws["poly345"]}, table2), 300.0)


def turns(study):
    return [row.turn for row in study.rows]


def test_the_last_row_is_equation_10(study, laws, table2):
    """An infinite flywheel does not fluctuate; its twist is the vibration study's."""
    last = turns(study)[-1]
    assert last.fluctuation == 0.0 == last.formula
    twist = np.ptp(steady_twist(laws["poly345"], shaft_of(table2), SPEED)[1])
    assert last.twist == pytest.approx(twist, rel=1e-5)


def test_a_heavier_flywheel_fluctuates_less(study):
    """Towards 1/I_v, and the twist towards eq. 10's as 1/I_v."""
    found = turns(study)
    assert np.all(np.diff([turn.fluctuation for turn in found]) < 0.0)
    five, twenty = found[-3], found[-2]
    assert five.fluctuation / twenty.fluctuation == pytest.approx(4.0, rel=0.01)
    away = [found[-1].twist - turn.twist for turn in (five, twenty)]
    assert away[0] / away[1] == pytest.approx(4.0, rel=0.02)


@pytest.mark.parametrize("cam", ["poly4567", "tm21", "bezier15"])
def test_the_handbook_formula_holds_on_a_rigid_shaft(laws, table2, cam):
    """ΔE/(I ω²) for a flywheel so heavy that the load is that of even speed."""
    shaft = replace(shaft_of(table2), shaft_stiffness=1e6, shaft_damping=5.0)
    turn = flywheel_turn(laws[cam], shaft, 50.0, SPEED)
    assert turn.fluctuation == pytest.approx(turn.formula, rel=2e-3)


def test_surplus_without_damping_is_kinetic_and_potential(laws, table2):
    """No damper: ΔE is the largest of ½ m ω² s'² + ½ k s² + F₀ s."""
    shaft = shaft_of(table2)
    f = replace(shaft.follower, damping=0.0)
    law, angles = laws["cycloidal"], np.linspace(0.0, 2.0 * np.pi, 20_001)
    stored = 0.5 * (f.mass * SPEED**2 * law(angles, 1) ** 2 + f.spring_stiffness * law(angles) ** 2)
    expected = np.max(stored + f.preload * law(angles))
    found = energy_fluctuation(law, replace(shaft, follower=f), SPEED)
    assert found == pytest.approx(expected, rel=1e-5)


def test_the_preload_twists_the_shaft(study):
    """Eq. 10 has no preload: 0.1432 degrees with it, 0.1115 without, at 300 rpm."""
    with_it = math.degrees(turns(study)[-1].twist)
    without = math.degrees(study.without_preload["poly345"])
    assert (round(with_it, 4), round(without, 4)) == (0.1432, 0.1115)


def test_tables(study):
    """One row for each inertia and each cam."""
    over_inertia, over_cams = study.to_display({"poly345": "3-4-5"})
    assert [row[0] for row in over_inertia.text_rows][-2:] == ["20", "∞"]
    assert len(over_inertia.rows) == len(INERTIAS) and SHOWN in INERTIAS
    assert over_cams.rows[0][0] == "3-4-5"
    assert faults(study.plot()) == []


def test_a_rig_without_a_shaft(laws, rig):
    """Has no flywheel."""
    assert study_flywheel(CamSet({}, {"poly345": laws["poly345"]}, rig), 300.0) is None

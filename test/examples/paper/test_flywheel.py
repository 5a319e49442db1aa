"""Tests of the speed fluctuation with a flywheel: formula, limit, preload.

The formula is that of handbooks. The limit is a flywheel of infinite inertia, as in eq. 10 of the
paper.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics.torsional.model import from_rig as shaft_of
from cam_rig.dynamics.vibration import energy_fluctuation, flywheel_turn, steady_twist
from cam_rig.units import RPM
from examples.paper import flywheel as script
from examples.paper.flywheel import INERTIAS, SHOWN, study, tables

SPEED = 300.0 * RPM


@pytest.fixture(scope="module")
def found():
    """Speed fluctuations of the 3-4-5 cam for all flywheel inertias of the study."""
    return study(["poly345"])


def turns(found):
    return list(found.turns.values())


def test_the_last_row_is_equation_10(found, laws, table2):
    """With an infinite flywheel the cam has no fluctuation, as in eq. 10 of the paper.

    The twist of the shaft is then that of the torsional model, to 1e-5, relative.
    """
    last = turns(found)[-1]
    assert last.fluctuation == 0.0 == last.formula
    twist = np.ptp(steady_twist(laws["poly345"], shaft_of(table2), SPEED)[1])
    assert last.twist == pytest.approx(twist, rel=1e-5)


@pytest.mark.parametrize("cam", ["poly4567", "tm21", "bezier15"])
def test_the_handbook_formula_holds_on_a_rigid_shaft(laws, table2, cam):
    """On a rigid shaft a heavy flywheel fluctuates by ΔE/(I ω²), as in handbooks.

    ΔE is the surplus of energy in a turn and I the inertia. The relative tolerance is 2e-3.
    """
    shaft = replace(shaft_of(table2), shaft_stiffness=1e6, shaft_damping=5.0)
    turn = flywheel_turn(laws[cam], shaft, 50.0, SPEED)
    assert turn.fluctuation == pytest.approx(turn.formula, rel=2e-3)


def test_surplus_without_damping_is_kinetic_and_potential(laws, table2):
    """Without damping the energy surplus ΔE is the peak of the stored energy.

    The stored energy is ½ m ω² s'² + ½ k s² + F₀ s.
    """
    shaft = shaft_of(table2)
    f = replace(shaft.follower, damping=0.0)
    law, angles = laws["cycloidal"], np.linspace(0.0, 2.0 * np.pi, 20_001)
    stored = 0.5 * (f.mass * SPEED**2 * law(angles, 1) ** 2 + f.spring_stiffness * law(angles) ** 2)
    expected = np.max(stored + f.preload * law(angles))
    found = energy_fluctuation(law, replace(shaft, follower=f), SPEED)
    assert found == pytest.approx(expected, rel=1e-5)


def test_the_preload_twists_the_shaft(found):
    """At 300 rpm the twist of the shaft is 0.1432° with preload and 0.1115° without.

    The model is that of eq. 10 of the paper.
    """
    with_it = math.degrees(turns(found)[-1].twist)
    without = math.degrees(found.without_preload["poly345"])
    assert (round(with_it, 4), round(without, 4)) == (0.1432, 0.1115)


def test_the_script(found, printed_by, monkeypatch):
    """The script on flywheels prints a row per inertia and cam, and draws the figure."""
    over_inertia, over_cams = tables(found)
    assert [row[0] for row in over_inertia.rows][-2:] == ["20", "∞"]
    assert len(over_inertia.rows) == len(INERTIAS) and SHOWN in INERTIAS
    assert over_cams.for_report.text_rows == [
        ["Polynomial 3-4-5", "3.12", "0.1305", "0.1432", "0.1115"]
    ]
    monkeypatch.setattr(script, "study", lambda: found)
    assert "twist 0.1432°, 0.1115° without preload" in printed_by(script)

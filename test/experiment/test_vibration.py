"""Residual and torsional vibration: what is left in the low dwell, and known limits."""

from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.kinetostatic import state_at
from cam_rig.dynamics.torsional_block import from_rig as shaft_of
from cam_rig.errors import DynamicsError
from cam_rig.experiment.jump_search import RPM
from cam_rig.experiment.lineup import open_lineup
from cam_rig.experiment.low_dwell import low_dwell
from cam_rig.experiment.vibration import ringing, steady_turn, steady_twist, vibration
from cam_rig.experiment.vibration_table import Claim, vibration_claims, vibration_table
from cam_rig.laws import build_law
from cam_rig.schema import load_rig

FIVE = ("bezier15", "poly345", "poly4567", "cycloidal", "bezier_segments")


@pytest.fixture(scope="module")
def lineup(config_dir):
    """The five laws on the rig of the paper's jump speeds."""
    cams = [config_dir / "cams" / f"{name}.yaml" for name in FIVE]
    return open_lineup(cams, config_dir / "rigs" / "paper_table2.yaml")


@pytest.fixture(scope="module")
def soft(lineup):
    """Its follower as one mass on the stem."""
    return FollowerParameters.from_rig(lineup.rig)


def test_low_dwell_goes_around_the_turn(laws):
    """The dwell of a cam that rests about θ = 0 is one stretch; the high dwell is not meant."""
    found = low_dwell(laws["poly345"])
    assert found.dwell
    assert np.degrees([found.start, found.span]) == pytest.approx([328.75, 62.5])
    inside = np.radians([330.0, 0.0, 31.0, 32.0, 180.0])
    assert found.holds(inside).tolist() == [True, True, True, False, False]


def test_low_dwell_anywhere(make_cam):
    """A cam that rests low in mid-turn is read there."""
    cam = make_cam(
        {"law": "dwell", "span": 90},
        {"law": "poly345", "to": 0, "span": 60},
        {"law": "dwell", "span": 100},
        {"law": "poly345", "to": 1, "span": 110},
    )
    found = low_dwell(build_law(cam))
    assert np.degrees([found.start, found.span]) == pytest.approx([150.0, 100.0])


def test_a_law_that_never_rests(laws):
    """Bézier 15 has no low dwell: 62.5° about θ = 0 stand in, and it says so."""
    found = low_dwell(laws["bezier15"])
    assert not found.dwell
    assert np.degrees([found.start, found.span]) == pytest.approx([328.75, 62.5])


@pytest.mark.parametrize("cam", ["poly345", "poly4567", "cycloidal", "bezier_segments"])
def test_in_a_dwell_all_vibration_is_ringing(laws, soft, cam):
    """Where the cam rests nothing drives the stem: it swings by twice the ringing, dying out."""
    found = vibration(laws[cam], soft, None, 300.0 * RPM)
    assert 1.9 * found.ringing < found.swing <= 2.0 * found.ringing


def test_acceleration_on_a_stiff_stem_is_the_laws(laws, follower):
    """A stem of 3.3e8 N/m under a C3 law: the follower's acceleration is h s'' Ω², to 0.1 %."""
    turn = steady_turn(laws["poly4567"], follower, 300.0 * RPM)
    expected = laws["poly4567"](turn.angle, 2) * (300.0 * RPM) ** 2
    assert turn.acceleration == pytest.approx(expected, abs=1e-3 * np.abs(expected).max())


def test_vibration_is_what_the_share_leaves(laws, soft):
    """r is x less the static share of the lift."""
    turn = steady_turn(laws["poly345"], soft, 300.0 * RPM)
    share = soft.stem_stiffness / (soft.stem_stiffness + soft.spring_stiffness)
    left = turn.displacement - share * laws["poly345"](turn.angle)
    assert turn.vibration == pytest.approx(left, abs=1e-12)


def test_ringing_at_many_speeds_is_that_at_one(laws, soft):
    """Speeds together or alone: the same."""
    speeds = np.array([200.0, 300.0, 380.0]) * RPM
    alone = [ringing(laws["cycloidal"], soft, speeds[i : i + 1])[0] for i in range(3)]
    assert ringing(laws["cycloidal"], soft, speeds) == pytest.approx(np.array(alone), rel=1e-9)


def test_twist_on_a_stiff_shaft_is_torque_over_stiffness(laws, lineup):
    """A shaft that hardly gives twists by F s'/k as the cam's torque asks, to 1 %."""
    shaft = replace(shaft_of(lineup.rig), shaft_stiffness=1e7, shaft_damping=10.0)
    speed = 300.0 * RPM
    angle, twist = steady_twist(laws["poly4567"], shaft, speed)
    forces = [
        state_at(laws["poly4567"], shaft.follower, float(a), speed).contact_force for a in angle
    ]
    torque = np.array(forces) * laws["poly4567"](angle, 1)
    peak = np.abs(torque).max() / 1e7
    assert twist == pytest.approx(-torque / 1e7, abs=0.01 * peak)


def test_no_steady_state(laws, soft):
    """Without damping a harmonic at the stem's own frequency is no steady state."""
    undamped = replace(soft, damping=0.0)
    rate = np.sqrt((soft.stem_stiffness + soft.spring_stiffness) / soft.mass)
    with pytest.raises(DynamicsError, match="no steady state at"):
        vibration(laws["poly345"], undamped, None, rate / 24.0)


def test_what_the_paper_says(lineup):
    """At 250 and 300 rpm: Bézier 15 is gentlest to follower, stem and shaft, as in the paper."""
    table = vibration_table(lineup, (250.0, 300.0))
    claims = vibration_claims(table)
    assert len(claims) == 4
    assert {claim.verdict for claim in claims} == {"agrees"}
    assert list(table.at(300.0)) == list(FIVE)


def test_verdicts():
    """All, none or some of the cases."""
    words = [Claim("", "", holds, 3).verdict for holds in (3, 2, 0)]
    assert words == ["agrees", "agrees in part", "disagrees"]


def test_a_rig_without_a_shaft(config_dir, lineup):
    """No shaft, no twist, and nothing is said of it."""
    bare = replace(lineup, rig=load_rig(config_dir / "rigs" / "tm21.yaml"))
    table = vibration_table(bare, (300.0,))
    assert all(row[0].twist is None for row in table.measures.values())
    assert not any("twist" in claim.words for claim in vibration_claims(table))


@pytest.mark.parametrize("rpm", [0.0, -3.0, float("nan")])
def test_a_cam_must_turn(lineup, rpm):
    """A speed above zero."""
    with pytest.raises(DynamicsError, match="allowed: finite and above 0"):
        vibration_table(lineup, (rpm,))

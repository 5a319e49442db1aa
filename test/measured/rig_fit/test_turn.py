"""A turn that comes back to itself, against the models' own run from rest."""

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import MODELS, Interval
from cam_rig.measured.rig_fit.steady_turn import one_mass_turn, resonant, two_mass_turn
from cam_rig.units import NS, RPM, TURN

SETTLE = 80


def last_turn(law, model, parameters, speed, rate=5000):
    """Angles, lift and force of a turn after many from rest."""
    begin = round(SETTLE * TURN / speed * NS)
    first = Interval(0, begin, 0.0, speed)
    state, _ = MODELS[model].advance(law, parameters, None, first, rate)
    at = first.angle_at(first.duration)
    last = Interval(begin, begin + round(TURN / speed * NS), at, speed)
    _, block = MODELS[model].advance(law, parameters, state, last, rate)
    since = block.time - begin / NS
    return at + speed * since, block


@pytest.mark.parametrize("rpm", [200.0, 430.0, 470.0])
@pytest.mark.parametrize("restitution", [0.0, 0.3])
def test_one_mass(law, rig, rpm, restitution):
    """On the cam and above the jump speed, plastic and with bounces."""
    parameters = MODELS["one_mass"].parameters(rig.with_follower(restitution=restitution))
    angle, block = last_turn(law, "one_mass", parameters, rpm * RPM)
    lift, force = one_mass_turn(law, parameters, rpm * RPM).at(angle)
    assert np.abs(lift - block.lift).max() < 1e-9
    far = np.abs(force - block.force) > 1e-4 * block.force.max()
    assert far.sum() <= 2  # a sample beside a landing may fall on its other side


@pytest.mark.parametrize("rpm", [250.0, 420.0])
def test_two_masses(law, rpm):
    """In contact and with lift-offs: the fixed point is where many turns from rest end."""
    rig = cam_rig.load_rig("paper_table2")
    parameters = MODELS["two_mass"].parameters(rig)
    angle, block = last_turn(law, "two_mass", parameters, rpm * RPM)
    found = two_mass_turn(law, parameters, rpm * RPM)
    assert bool(found.events) == (rpm > 400.0)
    lift, force = found.at(angle)
    assert np.abs(lift - block.lift).max() < 1e-9
    assert np.median(np.abs(force - block.force)) < 1e-6 * block.force.max()


def test_a_turn_is_found_from_its_neighbour(law):
    """From the turn of nearly the same follower, the same as from nothing."""
    rig = cam_rig.load_rig("paper_table2")
    near = two_mass_turn(law, MODELS["two_mass"].parameters(rig), 420.0 * RPM)
    other = MODELS["two_mass"].parameters(rig.with_follower(preload=30.7))
    angle = np.linspace(0.0, TURN, 500)
    one = two_mass_turn(law, other, 420.0 * RPM, near).at(angle)[1]
    two = two_mass_turn(law, other, 420.0 * RPM).at(angle)[1]
    assert np.median(np.abs(one - two)) < 1e-6


def test_a_sensor_s_resonance_is_its_transfer_function(law, rig):
    """Order by order 1/(1 + 2iζr − r²); far above the orders of the force it shows the force."""
    parameters = MODELS["one_mass"].parameters(rig)
    turn, speed = one_mass_turn(law, parameters, 300.0 * RPM), 300.0 * RPM
    angle = np.linspace(0.0, TURN, 4096, endpoint=False)
    force = turn.at(angle)[1]
    stiff = resonant(turn, speed, 1e5, 0.5)(angle)
    assert np.abs(stiff - force).max() < 2e-3 * force.max()
    shown = np.fft.rfft(resonant(turn, speed, 40.0, 0.1)(angle))[:60]
    r = np.arange(60) * 5.0 / 40.0
    wanted = np.fft.rfft(force)[:60] / (1.0 - r**2 + 0.2j * r)
    assert np.abs(shown - wanted).max() < 1e-4 * np.abs(wanted).max()

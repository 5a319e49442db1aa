"""A mode at many speeds at once, held against the exact response at one speed."""

from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics.linear.sampling import sample
from cam_rig.dynamics.modal_minimum import ModalRun
from cam_rig.dynamics.modal_response import ModalResponse
from cam_rig.dynamics.two_mass.masses import TwoMassParameters, contact_response, force_output
from cam_rig.errors import DynamicsError
from cam_rig.schema import load_rig
from cam_rig.units import RPM


@pytest.fixture(scope="module")
def two_mass(config_dir):
    """The two-mass follower of the paper's jump speeds."""
    return TwoMassParameters.from_rig(load_rig(config_dir / "rigs" / "paper_table2.yaml"))


def ringing(law, parameters):
    return ModalResponse.of(contact_response(law, parameters, 1.0), force_output(parameters))


@pytest.mark.parametrize("duration", [0.4, None])
@pytest.mark.parametrize(
    "cam", ["poly345", "cycloidal", "bezier15", "modified_sine", "measured", "tm21"]
)
def test_lowest_force_is_the_exact_models(laws, two_mass, cam, duration):
    """From rest and in steady state: the least force of 400 000 exact samples, to 1e-3 N."""
    law, speed = laws[cam], 391.0 * RPM
    response = contact_response(law, two_mass, speed)
    start = np.zeros(2) if duration else response.periodic()
    length, count = duration or 2.0 * np.pi / speed, 400_000
    force = sample(response, start, 0.0, 0.0, length / count, count, force_output(two_mass))
    run = ModalRun(ringing(law, two_mass), duration)
    assert run.lowest(speed) == pytest.approx(force.min(), abs=1e-3)
    least = run.least(np.array([0.5, 1.0, 1.5]) * speed)[1]
    assert run.lowest(speed) <= least + 1e-9


@pytest.mark.parametrize("factor", [0.0, 1.0, 2.0 / 0.00874, 400.0])
def test_any_damping(laws, two_mass, factor):
    """Undamped, as it is, about critical and over-damped stems from rest."""
    parameters = replace(
        two_mass, stem_damping=factor * two_mass.stem_damping, damping=factor * two_mass.damping
    )
    law, speed, count = laws["poly345"], 300.0 * RPM, 200_000
    response = contact_response(law, parameters, speed)
    force = sample(response, np.zeros(2), 0.0, 0.0, 0.4 / count, count, force_output(parameters))
    assert ModalRun(ringing(law, parameters), 0.4).lowest(speed) == pytest.approx(
        force.min(), abs=1e-3
    )


def test_exactly_critical_damping(laws, two_mass):
    """Where two modes become one their amplitudes are endless, their sum is not."""
    critical = 2.0 * np.sqrt(two_mass.stiffness * two_mass.end_mass)
    parameters = replace(two_mass, stem_damping=0.5 * critical, damping=0.5 * critical)
    law, speed, count = laws["poly345"], 300.0 * RPM, 200_000
    response = contact_response(law, parameters, speed)
    force = sample(response, np.zeros(2), 0.0, 0.0, 0.4 / count, count, force_output(parameters))
    assert ModalRun(ringing(law, parameters), 0.4).lowest(speed) == pytest.approx(
        force.min(), rel=1e-3
    )


def test_only_joints_ring(laws, two_mass):
    """A law without a jump in any derivative leaves no ringing; one of C2 does."""
    speeds = np.array([200.0, 400.0]) * RPM
    smooth = np.abs(ringing(laws["trigonometric"], two_mass).steady(speeds))
    rough = np.abs(ringing(laws["poly345"], two_mass).steady(speeds))
    assert smooth.max() < 1e-6 * rough.min()


def test_amplitude_in_the_dwell(laws, two_mass):
    """In the low dwell the force swings about a constant by the ringing's amplitude, dying out."""
    law, speed = laws["poly345"], 300.0 * RPM
    last = law.spans.size - 1
    model = ringing(law, two_mass)
    angle = float(law.breaks[last])
    amplitude = model.amplitude_at(np.array([speed]), angle)[0]
    response = contact_response(law, two_mass, speed)
    start = response.states(response.periodic(), 0.0, np.array([angle / speed]))[:, 0]
    period = 2.0 * np.pi / abs(model.rates[0].imag)
    times = np.linspace(0.0, 3.0 * period, 3000)
    states = response.states(start, angle, times)
    force = force_output(two_mass).state @ states
    swing = float(np.ptp(force[0]))
    assert swing == pytest.approx(2.0 * amplitude, rel=0.06)
    assert swing < 2.0 * amplitude


def test_no_steady_state_at_undamped_resonance(laws, two_mass):
    """Without damping a harmonic of the speed at the mode's own frequency grows for ever."""
    parameters = replace(two_mass, stem_damping=0.0, damping=0.0)
    model = ringing(laws["poly345"], parameters)
    speed = abs(model.rates[0].imag) / 30.0
    with pytest.raises(DynamicsError, match=r"no steady state at .* rpm.*allowed: damping, or"):
        model.steady(np.array([0.9, 1.0]) * speed)


def test_kick_of_a_joint(laws, two_mass):
    """A jump of s''' by 60 h/β³ kicks a stiff stem to α (60 h/β³) (Ω/ω)³, to 1 %."""
    stiff = replace(two_mass, stem_stiffness=1e10)
    model, speed = ringing(laws["poly345"], stiff), 300.0 * RPM
    state_jump = 2.0 * np.abs(model.state_jumps(np.array([speed]))[0, 1, 0])
    rate = abs(model.rates[0])
    jump = 60.0 * 0.05 / np.radians(117.5) ** 3
    assert state_jump == pytest.approx(stiff.share * jump * (speed / rate) ** 3, rel=0.01)

"""Steady speeds from an encoder's counts."""

import numpy as np
import pytest

from cam_rig.errors import ConfigError
from cam_rig.measured.rig_fit.turns import steady_holds
from cam_rig.simulation.instruments import InstrumentErrors, MeasuredRun, Signal, measured_run
from cam_rig.units import RPM


@pytest.mark.parametrize("seed", range(8))
def test_every_hold_is_found_with_its_speed(law, rig, seed):
    """Five speeds between ramps, 1024 counts: each is found once."""
    rpms = np.random.default_rng(seed).uniform(60.0, 470.0, 5)
    errors = InstrumentErrors(rate=100)
    run = measured_run(law, rig, "kinetostatic", rpms, errors, seed, settled_for=1)
    holds = steady_holds(run)
    assert [round(hold.rpm) for hold in holds] == [round(rpm) for rpm in rpms]
    for hold, rpm in zip(holds, rpms, strict=True):
        # nearly whole counts a reading are the worst that an encoder does to a line
        assert abs(hold.speed - rpm * RPM) < 1e-3 * hold.speed
        assert hold.turns > 3.5
    off = [abs(h.speed - rpm * RPM) / h.speed_error for h, rpm in zip(holds, rpms, strict=True)]
    assert np.median(off) < 2.0


def test_a_cam_that_nowhere_turns_steadily_is_refused():
    """A ramp over the whole run has no speed to fit at."""
    time = np.linspace(0.0, 3.0, 3000)
    run = MeasuredRun("ramp", "cam", Signal(time, 40.0 * time**2, "encoder"))
    with pytest.raises(ConfigError, match=r"nowhere turns steadily.*needed"):
        steady_holds(run)


def test_an_error_of_a_speed_is_that_of_an_encoder_s_steps():
    """Steps that drift in two or three strands, at nearly k/n counts a reading, are no noise.

    By a scatter of free readings one speed in twenty was more than four of its errors off.
    """
    random, count = np.random.default_rng(1), 2.0 * np.pi / 1024
    off = []
    for strands in [2, 3] * 30:
        part = random.integers(5, 16) + random.integers(1, strands) / strands
        speed = 500.0 * count * (part + random.uniform(-0.02, 0.02))
        time = np.arange(0.0, 4.0 * 2.0 * np.pi / speed, 1.0 / 500.0)
        angle = np.floor((random.uniform(0.0, 2.0 * np.pi) + speed * time) / count) * count
        (hold,) = steady_holds(MeasuredRun("steps", "cam", Signal(time, angle, "encoder")))
        off.append((hold.speed - speed) / hold.speed_error)
    assert np.abs(off).max() < 4.0

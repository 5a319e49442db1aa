"""EventVibration and force as functions of the unknowns are those of the exact model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.linear.sampling import outputs_at
from cam_rig.dynamics.two_mass.masses import contact_response, force_output
from cam_rig.errors import ConfigError
from cam_rig.law_design.modal_amplitude import Cells, ForceAtSpeed, Mode
from cam_rig.law_design.request import LawClass
from cam_rig.law_design.space import Space
from cam_rig.laws import build_law
from cam_rig.schema import load_cam, load_rig
from cam_rig.schema.load import config_root
from cam_rig.units import TURN

RIG = load_rig(config_root() / "rigs" / "paper_table2.yaml")


@pytest.mark.parametrize("seed", range(6))
def test_the_force_is_that_of_the_exact_model(seed: int) -> None:
    """Any law, two masses, speed and turn: the first, a later one, and the steady state.

    The exact model propagates (η, η̇) by matrix exponentials; Gauss points in cells of 0.6 rad of
    phase give the same to 1e-9 of the force.
    """
    rng = np.random.default_rng(seed)
    start = build_law(load_cam(config_root() / "cams" / "poly345.yaml"))
    space = Space(start, LawClass(int(rng.integers(4, 12)), int(rng.integers(1, 5))))
    stock = TwoMassParameters.from_rig(RIG)
    follower = replace(
        stock,
        stem_stiffness=stock.stem_stiffness * rng.uniform(0.3, 3.0),
        stem_damping=stock.stem_damping * rng.uniform(0.0, 10.0),
        roller_mass=stock.roller_mass * rng.uniform(0.2, 2.0),
    )
    speed = rng.uniform(15.0, 60.0)
    ramps = np.linspace(0.0, 1.0, space.law_class.free)
    smooth = np.concatenate([ramps, ramps[::-1]]) + 0.05 * rng.normal(size=2 * ramps.size)
    unknowns = space.joined(smooth)
    law = space.law(unknowns, "any")
    found = ForceAtSpeed(Cells(space, Mode.of(follower), speed), speed)
    response = contact_response(law, follower, speed)
    chosen = np.arange(0, found.first.angles.size, 29)
    for turn in (1.0, 4.0, np.inf):
        steady = np.isinf(turn)
        state = response.periodic() if steady else np.zeros(2)
        angles = found.first.angles[chosen] - 1e-13 + (0.0 if steady else TURN * (turn - 1.0))
        exact = outputs_at(response, state, 0.0, angles / speed, force_output(follower))[0]
        values = found.values(unknowns, np.array([turn]))[0][chosen]
        size = np.abs(exact).max()
        np.testing.assert_allclose(values, exact, atol=1e-8 * size)
        constant, matrix = found.rows(chosen, turn)
        np.testing.assert_allclose(constant + matrix @ unknowns, values, atol=1e-11 * size)


def test_an_overdamped_stem_has_no_residual_vibration() -> None:
    """Critical damping and more: one line, with the limit."""
    follower = FollowerParameters(1.3, 4030.0, 1e4, 30.0, 1.26e6)
    with pytest.raises(ConfigError, match=r"does not vibrate.*allowed.*below"):
        Mode.of(follower)

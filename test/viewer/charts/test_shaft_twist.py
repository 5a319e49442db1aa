"""The twist that no message carries is solved again as the follower's model had it."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice, pairwise
from pathlib import Path

import numpy as np
import pytest

from cam_rig.dynamics import MODELS
from cam_rig.dynamics.torsional.motion import solve, steady_state
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import cam_states
from cam_rig.units import NS, TURN
from cam_rig.viewer.quantities import ShaftTwist


@pytest.mark.parametrize("free", [True, False])
def test_twist_tick_by_tick_is_that_of_the_model(config_dir: Path, free: bool) -> None:
    """Each tick ends with the model's twist; behind a free flywheel each turn is the steady one."""
    loaded = open_scene(config_dir / "scenes" / "flywheel.yaml")
    if not free:
        shaft = loaded.rig.shaft
        assert shaft is not None
        held = shaft.model_copy(update={"flywheel_inertia": None})
        loaded = replace(loaded, rig=loaded.rig.model_copy(update={"shaft": held}))
    states = list(islice(cam_states(loaded.scene), 3))
    twist, law, speed = ShaftTwist(loaded), loaded.laws[states[0].cam], states[0].speed
    parameters, state = MODELS["torsional"].parameters(loaded.rig), None
    for start, end in pairwise(states):
        times = np.linspace(start.time_ns, end.time_ns, 101) / NS
        shown = twist.tick(start.cam, start.until(end), times)
        state, _ = MODELS["torsional"].advance(law, parameters, state, start.until(end), 1000)
        peak = np.abs(shown).max()
        assert shown[-1] == pytest.approx(state.inner[0], rel=1e-9, abs=1e-10 * peak)
        if free:
            driven, first = steady_state(law, parameters, speed)
            turn = solve(law, driven, first, 0.0, TURN / speed)
            expected = turn.at(np.linspace(0.0, turn.stop_time, 101))[0]
            np.testing.assert_allclose(shown, expected, rtol=0, atol=1e-8 * peak)

"""Identifying the geometry of the TM21's own cam from its published noise curve.

No source prints a dimension of that cam. Its lift and its two arc angles are the three numbers
that bring the simulated level nearest to the published one, with the acoustic constants as they
were calibrated on another cam. They are identified, never TM21 data.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import Bounds, differential_evolution, minimize

from cam_rig.arrays import FloatArray, rms
from cam_rig.errors import LawError
from cam_rig.laws import build_law
from cam_rig.laws.cam import arc_cam
from cam_rig.schema import CamConfig, SceneConfig
from cam_rig.simulation.levels import step_levels
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.simulate import simulate
from cam_rig.units import to_rpm

#: Bounds of lift (m), event span (deg) and nose span as a fraction of the event span.
BOUNDS = np.array([[0.002, 0.05], [60.0, 300.0], [0.05, 0.95]])
#: Largest pitch radius (m) of a flank that is visibly concave, as the paper calls the cam; beyond
#: this a flank of some millimetres is straight.
MAX_FLANK = 0.5
#: Fit error given to a geometry that cannot exist, dB.
IMPOSSIBLE = 50.0
#: Sample rate of a trial.
TRIAL_RATE_HZ = 8000


@dataclass(frozen=True)
class Geometry:
    """The identified numbers and the r.m.s. difference they leave, dB."""

    lift_mm: float
    event_deg: float
    nose_deg: float
    rmse_db: float
    evaluations: int

    @property
    def dwell_deg(self) -> float:
        """Each of the two dwells beside the event."""
        return 180.0 - 0.5 * self.event_deg


def with_geometry(cam: CamConfig, lift_mm: float, event_deg: float, nose_deg: float) -> CamConfig:
    """The same cam file with other numbers."""
    data = cam.model_dump(exclude_none=True)
    dwell = 180.0 - 0.5 * event_deg
    data["lift"] |= {"identified": lift_mm, "unit": "mm"}
    for segment, span in zip(data["segments"], (dwell, event_deg, dwell), strict=True):
        segment["span"] |= {"identified": span, "unit": "deg"}
    data["segments"][1]["nose_span"] |= {"identified": nose_deg, "unit": "deg"}
    return CamConfig.model_validate(data)


def trial_stage(loaded: LoadedScene) -> LoadedScene:
    """The same scene, shorter and coarser: within 0.01 dB of the whole one, much faster."""
    data = loaded.scene.model_dump(exclude_none=True)
    data["sample_rate"] = {"assumed": TRIAL_RATE_HZ, "unit": "Hz"}
    data["program"]["turns"] = {"assumed": 3, "unit": "turns"}
    data["program"]["settle_turns"] = {"assumed": 1, "unit": "turns"}
    return replace(loaded, scene=SceneConfig.model_validate(data))


def identify(
    loaded: LoadedScene, cam: str, seed: int, on_progress: Callable[[float], None] = lambda _: None
) -> Geometry:
    """Search lift and angles of an arc cam; ``loaded`` holds the scene to run for each trial.

    A global search (differential evolution, seeded) followed by a local one.
    """
    arc_cam(loaded.cams[cam])  # it must have arcs to move
    trial = trial_stage(loaded)
    rpm = to_rpm(np.array(loaded.scene.program.speeds.si_list))
    target = loaded.published_levels(cam, rpm)
    evaluations = 0

    def rmse(x: FloatArray) -> float:
        nonlocal evaluations
        evaluations += 1
        level = _levels(trial, cam, x)
        return IMPOSSIBLE if level is None else rms(level - target)

    best = differential_evolution(
        rmse,
        Bounds(BOUNDS[:, 0], BOUNDS[:, 1]),
        seed=seed,
        popsize=10,
        maxiter=30,
        tol=1e-3,
        polish=False,
        callback=lambda intermediate_result: on_progress(float(intermediate_result.fun)),
    )
    polished = minimize(
        rmse, best.x, method="Nelder-Mead", options={"xatol": 1e-5, "fatol": 1e-5, "maxfev": 200}
    )
    lift, event, fraction = (float(v) for v in polished.x)
    # Rounded to what the residual can support, so that the file is readable and spans add up.
    for digits in (2, 3, 4, 6):  # the fewest that keep the geometry possible
        short = [round(lift, digits + 4), round(event, digits), round(event * fraction, digits)]
        left = rmse(np.array([short[0], short[1], short[2] / short[1]]))
        if left < IMPOSSIBLE:
            return Geometry(round(1e3 * short[0], 6), short[1], short[2], left, evaluations)
    raise LawError(f"cam {cam!r}: no arc cam within the bounds comes near its published noise")


def _levels(loaded: LoadedScene, cam: str, x: FloatArray) -> FloatArray | None:
    lift, event, fraction = (float(v) for v in x)
    if np.any(x < BOUNDS[:, 0]) or np.any(x > BOUNDS[:, 1]):
        return None
    try:
        config = with_geometry(loaded.cams[cam], 1e3 * lift, event, event * fraction)
        if arc_cam(config).radii()[0] > MAX_FLANK:
            return None
        trial = loaded.only(cam, build_law(config))
    except LawError:
        return None
    steps = step_levels(simulate(trial), trial.scene.program.settle_turns.si)[cam]
    return np.array([steps[speed] for speed in sorted(steps)])

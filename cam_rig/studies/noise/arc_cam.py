"""Refining the geometry of an arc cam against its published noise curve, from a good start.

The search of `identify` is global and takes minutes; this one takes seconds, for studies that ask
how the geometry moves when something else does. It keeps the flank, which every search leaves at
the straightest that still is concave, and moves two numbers: lift and event.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.optimize import Bounds, OptimizeResult, differential_evolution, minimize

from cam_rig.errors import LawError
from cam_rig.laws import Law, build_law
from cam_rig.laws.cam import arc_cam
from cam_rig.schema import CamConfig, SceneConfig
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.simulation.regression import cubic
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.simulate import Acoustics, Turns, simulate, step_levels
from cam_rig.studies.noise.calibration import PublishedCam
from cam_rig.units import FloatArray, rms, to_rpm

# Identifying the geometry of the TM21's own cam from its published noise curve.

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
    loaded: LoadedScene, cam: str, seed: int, progress: Progress = NULL_PROGRESS
) -> Geometry:
    """Search lift and angles of an arc cam: differential evolution, seeded, then a local search."""
    progress.start(None, "searching")
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

    def tell(intermediate_result: OptimizeResult) -> None:
        progress.describe(f"best {intermediate_result.fun:.2f} dB RMS")

    options: dict[str, Any] = {"popsize": 10, "maxiter": 30, "tol": 1e-3, "polish": False}
    limits = Bounds(BOUNDS[:, 0], BOUNDS[:, 1])
    best = differential_evolution(rmse, limits, seed=seed, callback=tell, **options)
    polished = minimize(
        rmse, best.x, method="Nelder-Mead", options={"xatol": 1e-5, "fatol": 1e-5, "maxfev": 200}
    )
    lift, event, fraction = polished.x.tolist()
    # Rounded to what the residual can support, so that the file is readable and spans add up.
    for digits in (2, 3, 4, 6):  # the fewest that keep the geometry possible
        short = [round(lift, digits + 4), round(event, digits), round(event * fraction, digits)]
        left = rmse(np.array([short[0], short[1], short[2] / short[1]]))
        if left < IMPOSSIBLE:
            return Geometry(round(1e3 * short[0], 6), short[1], short[2], left, evaluations)
    raise LawError(f"cam {cam!r}: no arc cam within the bounds comes near its published noise")


def _levels(loaded: LoadedScene, cam: str, x: FloatArray) -> FloatArray | None:
    lift, event, fraction = x.tolist()
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


#: Lifts tried as a start, relative to the given one, and events relative to the valley of equal
#: levels: shapes that sound alike lie along it, lift about in proportion to the event cubed.
LIFTS, EVENTS = (1.2, 1.0, 0.85, 0.72, 0.61), (0.97, 1.0, 1.03)
#: First steps of the search, relative to lift and event, and the most trials.
SIMPLEX, TRIALS = 0.03, 32
#: Step of a numerical derivative, relative to lift and event: where arcs join the force jumps
#: between samples, so levels jitter by 0.01 dB as a shape moves.
STEP = 2e-2


@dataclass(frozen=True)
class ArcShape:
    """The three numbers of an arc cam: lift (m), event (rad), curvature of the flank (1/m)."""

    lift: float
    event: float
    curvature: float

    @classmethod
    def of(cls, cam: CamConfig) -> ArcShape:
        """The shape of a cam file."""
        circles = arc_cam(cam)
        return cls(circles.lift, 2.0 * circles.event_half_angle, 1.0 / circles.radii()[0])

    @property
    def flank(self) -> float:
        """Radius of the flank, m."""
        return 1.0 / self.curvature

    def scaled(self, lift: float, event: float) -> ArcShape:
        """Another lift and event, the same flank."""
        return ArcShape(lift * self.lift, event * self.event, self.curvature)

    def nose(self, base: float) -> float:
        """Angle (rad) of a nose that touches the flank on the line of their centres."""
        flank, top, half = self.flank, base + self.lift, 0.5 * self.event
        a = base**2 + top**2 - 2.0 * base * top * np.cos(half)
        b = 2.0 * base - 2.0 * top * np.cos(half)
        nose = (a + b * flank) / (
            2.0 * (top - base * np.cos(half)) + 2.0 * flank * (1.0 - np.cos(half))
        )
        outer = (base + flank) * np.exp(1j * half)
        joint = outer + flank * (top - nose - outer) / (flank + nose)
        return float(2.0 * np.angle(joint))

    def law(self, cam: CamConfig) -> Law:
        """The law of the cam file with this shape."""
        base = arc_cam(cam).base_radius
        degrees = np.degrees([self.event, self.nose(base)])
        if not 0.0 < degrees[1] < degrees[0] < 359.0:
            raise LawError(f"cam {cam.name!r}: no nose of {degrees[1]:g}° in {degrees[0]:g}°")
        return build_law(with_geometry(cam, 1e3 * self.lift, *degrees.tolist()))


@dataclass(frozen=True)
class ShapeProblem:
    """An arc cam's file, its published levels (dB), and what runs a law at their speeds."""

    cam: CamConfig
    published: FloatArray
    turn: Callable[[Law], Turns]
    _known: dict[ArcShape, PublishedCam] = field(default_factory=dict, init=False, compare=False)

    def cam_of(self, shape: ArcShape) -> PublishedCam:
        """The shape's turns; kept, since fits to other constants begin at the same shapes."""
        if shape not in self._known:
            turns = self.turn(shape.law(self.cam))
            self._known[shape] = PublishedCam(self.cam.name, turns, self.published)
        return self._known[shape]

    def sensitivity(self, shape: ArcShape, acoustics: Acoustics) -> FloatArray:
        """``(n, 2)``: dB per change of lift, of event, by 1."""
        moved = [shape.scaled(*(1.0 + STEP * axis)) for axis in np.eye(2)]
        base, *levels = (acoustics.levels(self.cam_of(s).turns) for s in (shape, *moved))
        return np.stack([(level - base) / STEP for level in levels], axis=1)

    def fit(self, near: ArcShape, acoustics: Acoustics) -> ArcShape:
        """Lift and event whose cubic is nearest the published one, from near a shape."""
        compared = cubic(self.cam_of(near).rpm)

        def cost(shape: ArcShape) -> float:
            try:
                return rms(compared @ self.cam_of(shape).difference(acoustics))
            except LawError:
                return IMPOSSIBLE

        valley = [near.scaled(a, b * a ** (1.0 / 3.0)) for a in LIFTS for b in EVENTS]
        start = min([*valley, near], key=cost)

        def cost_at(x: FloatArray) -> float:
            return cost(start.scaled(*x.tolist()))

        simplex = np.ones((3, 2)) + SIMPLEX * np.eye(3, 2, -1)
        found = minimize(
            cost_at,
            np.ones(2),
            method="Nelder-Mead",
            options={"initial_simplex": simplex, "maxfev": TRIALS, "xatol": 1e-3, "fatol": 5e-3},
        )
        return start.scaled(*found.x.tolist())

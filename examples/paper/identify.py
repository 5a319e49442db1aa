"""Identification of the TM21's cam from its published noise: lift and angles.

No source states a dimension of that cam. A search over cams of tangent circular arcs finds the cam
whose simulated level is closest to eq. 20 of the paper. The acoustic constants are those of the
calibration with another cam. The found cam has the sound of the published cam, but can have other
dimensions.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import Bounds, OptimizeResult, differential_evolution, minimize

import cam_rig
from cam_rig.errors import LawError
from cam_rig.laws.cam import arc_cam
from cam_rig.show.figure import CAM_SPEED, LEVEL, empty, line, styled
from cam_rig.units import FloatArray, rms
from examples.paper.common import SCENE, Table, parser, publish

#: Cam that is identified.
CAM = "tm21"
#: Rig of this cam.
RIG = "tm21"
#: Limits of lift (m), event span (°) and nose span as a fraction of the event span.
LIMITS = Bounds([0.002, 60.0, 0.05], [0.05, 300.0, 0.95])
#: Largest pitch radius (m) of a visibly concave flank, as the paper describes the cam.
MAX_FLANK = 0.5
#: Difference (dB) of a geometry that is impossible.
IMPOSSIBLE = 50.0
#: Sample rate (Hz) and turns of a trial. Its levels agree with those of the scene to 0.01 dB.
TRIAL: dict[str, Any] = {"sample_rate": 8000, "turns": 3, "transient_turns": 1}


class Geometry(NamedTuple):
    """Lift (mm), event and nose span (°), r.m.s. difference (dB) and number of trials."""

    lift: float
    event: float
    nose: float
    rms: float
    trials: int


def with_geometry(cam: cam_rig.Cam, lift: float, event: float, nose: float) -> cam_rig.Cam:
    """Return the arc cam with another lift (m), event span and nose span (°).

    The dwells are equal.
    """
    dwell = {"law": "dwell", "span": f"{180.0 - 0.5 * event!r} deg"}
    arcs = {"law": "tangent_arcs", "span": f"{event!r} deg", "nose_span": f"{nose!r} deg"}
    return cam.replace(lift=lift, segments=[dwell, arcs, dwell])


def levels(cam: cam_rig.Cam, rpm: FloatArray) -> FloatArray:
    """Return the simulated levels (dB) of a cam at speeds in rpm."""
    return np.asarray(cam_rig.sweep(cam, RIG, rpm=rpm, **TRIAL).noise.curves[cam.name].level_db)


def study(seed: int = 1, generations: int = 30) -> Geometry:
    """Search by differential evolution, then locally, for a few minutes."""
    scene = cam_rig.load_scene(SCENE)
    rpm = np.array(scene.scene.schedule.speeds.numbers)
    published, cam, trials = scene.published_levels(CAM, rpm), scene.cams[CAM], 0

    def difference(x: Any) -> float:
        """Return the r.m.s. difference (dB) for lift (m), event (°) and nose fraction."""
        nonlocal trials
        trials += 1
        lift, event, fraction = x.tolist()
        if np.any(x < LIMITS.lb) or np.any(x > LIMITS.ub):
            return IMPOSSIBLE
        try:
            changed = with_geometry(cam, lift, event, event * fraction)
            if arc_cam(changed).radii()[0] > MAX_FLANK:
                return IMPOSSIBLE
            return rms(levels(changed, rpm) - published)
        except LawError:
            return IMPOSSIBLE

    def report(intermediate_result: OptimizeResult) -> None:
        print(f"{trials} trials: best {intermediate_result.fun:.2f} dB RMS", flush=True)

    options: dict[str, Any] = {"popsize": 10, "maxiter": generations, "tol": 1e-3, "polish": False}
    best = differential_evolution(difference, LIMITS, seed=seed, callback=report, **options)
    lift, event, fraction = minimize(
        difference,
        best.x,
        method="Nelder-Mead",
        options={"xatol": 1e-5, "fatol": 1e-5, "maxfev": 200},
    ).x.tolist()
    # Rounded to the fewest digits of a possible geometry, because the remaining difference is
    # large.
    for digits in (2, 3, 4, 6):
        numbers = round(lift, digits + 4), round(event, digits), round(event * fraction, digits)
        left = difference(np.array([numbers[0], numbers[1], numbers[2] / numbers[1]]))
        if left < IMPOSSIBLE:
            return Geometry(round(1e3 * numbers[0], 6), *numbers[1:], left, trials)
    raise LawError(f"cam {CAM!r}: no arc cam within the limits comes near its published noise")


def table(result: Geometry) -> Table:
    """Return a table of the identified numbers."""
    return Table(
        f"Geometry of {CAM}, identified from its published noise",
        "lift [mm] :.3f | event [°] :.2f | nose [°] :.2f | r.m.s. [dB] :.2f | trials :d",
        [result],
        "3 numbers fitted to one cubic. They are in config/cams/tm21.yaml.",
    )


@styled
def figure(result: Geometry) -> Figure:
    """Draw published and simulated level against speed."""
    scene = cam_rig.load_scene(SCENE)
    rpm = np.array(scene.scene.schedule.speeds.numbers)
    cam = with_geometry(scene.cams[CAM], 1e-3 * result.lift, result.event, result.nose)
    out = empty(3.3)
    axes = out.subplots()
    axes.plot(rpm, scene.published_levels(CAM, rpm), label="published", **line(CAM))
    axes.plot(rpm, levels(cam, rpm), "o", ms=4, color="0.3", label="identified cam")
    axes.set(xlabel=CAM_SPEED, ylabel=LEVEL, title=cam.title)
    axes.legend(frameon=False)
    return out


def main(argv: Sequence[str] | None = None) -> None:
    """Run the experiment, print its table and write its figure."""
    command = parser(__doc__)
    command.add_argument("--seed", type=int, default=1, help="of the search (%(default)s)")
    chosen = command.parse_args(argv)
    result = study(chosen.seed)
    text = f"{CAM}: lift {result.lift:.3f} mm, event {result.event:.2f}°, nose {result.nose:.2f}°"
    publish(
        chosen.out,
        [table(result)],
        {"identify": figure(result)},
        [f"{text}: {result.rms:.2f} dB RMS, {result.trials} trials"],
    )


if __name__ == "__main__":
    main()

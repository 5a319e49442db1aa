"""Local fit of the geometry of an arc cam to its published noise curve.

An arc cam has a profile of tangent circular arcs. A global search takes minutes
(examples/paper/identify.py). The local fit takes seconds, for studies of the effect of other
numbers on the geometry. It varies the lift and the event, which is the angle of rise and fall
together. The flank, the arc between base circle and nose, is fixed, because every global search
ends at the straightest flank that is still concave.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import minimize

from cam_rig.errors import LawError
from cam_rig.laws import Law, build_law
from cam_rig.laws.cam import arc_cam
from cam_rig.schema import CamConfig
from cam_rig.simulation.regression import cubic_projection
from cam_rig.simulation.simulate import Acoustics, Turns
from cam_rig.simulation.sound_constants import PublishedCam
from cam_rig.units import FloatArray, rms

#: Largest radius (m) of the pitch curve of a flank that is visibly concave, as the flanks of the
#: TM21 cam in the paper are. With a larger radius, a flank of some millimetres is practically
#: straight.
MAX_FLANK = 0.5
#: Level difference (dB) that a fit uses for a cam geometry that cannot exist. It is far above that
#: of any possible geometry.
IMPOSSIBLE = 50.0


def with_geometry(cam: CamConfig, lift_mm: float, event_deg: float, nose_deg: float) -> CamConfig:
    """Return the file of an arc cam with another lift, event angle and nose angle.

    An arc cam consists of tangent circular arcs. `lift_mm` is the lift in mm. `event_deg` is the
    angle of rise and fall together, and `nose_deg` the angle of the arc at the top, in degrees.
    """
    data = cam.model_dump(exclude_none=True)
    dwell = 180.0 - 0.5 * event_deg
    data["lift"] |= {"identified": lift_mm, "unit": "mm"}
    for segment, span in zip(data["segments"], (dwell, event_deg, dwell), strict=True):
        segment["span"] |= {"identified": span, "unit": "deg"}
    data["segments"][1]["nose_span"] |= {"identified": nose_deg, "unit": "deg"}
    return CamConfig.model_validate(data)


#: Lifts at which the search for the shape of an arc cam is started, as multiples of the given
#: shape's lift.
LIFTS = (1.2, 1.0, 0.85, 0.72, 0.61)
#: Event angles at which the search for a shape is started, as multiples of the given angle times
#: the cube root of the factor of the lift (see `LIFTS`). Shapes with about equal sound levels have
#: lifts proportional to the cube of the event angle.
EVENTS = (0.97, 1.0, 1.03)
#: Initial steps of the Nelder-Mead search, relative to lift and event angle (angle of rise and fall
#: together).
SIMPLEX = 0.03
#: Largest number of shapes of the arc cam that the Nelder-Mead search evaluates.
TRIALS = 32
#: Step of a difference quotient, relative to lift or event angle. It is large, because levels
#: scatter by 0.01 dB as the shape changes: at the joints of arcs the force jumps between samples.
DERIVATIVE_STEP = 2e-2


@dataclass(frozen=True)
class ArcShape:
    """Shape of a cam of tangent arcs: lift (m), event (rad), flank curvature (1/m).

    The event is the angle of rise and fall together. The flank is the arc between base circle and
    nose. Its curvature is negative if it is concave.
    """

    lift: float
    event: float
    curvature: float

    @classmethod
    def of(cls, cam: CamConfig) -> ArcShape:
        """Return the shape of the cam of tangent arcs in a cam file."""
        circles = arc_cam(cam)
        return cls(circles.lift, 2.0 * circles.event_half_angle, 1.0 / circles.radii()[0])

    @property
    def flank(self) -> float:
        """Radius (m) of the flank of an arc cam, negative if the flank is concave."""
        return 1.0 / self.curvature

    def scaled(self, lift: float, event: float) -> ArcShape:
        """Return the shape with lift and event angle multiplied by factors.

        The curvature of the flank is unchanged.
        """
        return ArcShape(lift * self.lift, event * self.event, self.curvature)

    def nose(self, base: float) -> float:
        """Return the angle (rad) of the nose, which is the arc at the top.

        The nose is tangent to the flank. ``base`` is the base radius of the pitch curve in m.
        """
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
        """Return the law of a cam file whose arcs have this shape.

        Raises
        ------
        LawError
            If the shape has no nose.
        """
        base = arc_cam(cam).base_radius
        degrees = np.degrees([self.event, self.nose(base)])
        if not 0.0 < degrees[1] < degrees[0] < 359.0:
            raise LawError(f"cam {cam.name!r}: no nose of {degrees[1]:g}° in {degrees[0]:g}°")
        return build_law(with_geometry(cam, 1e3 * self.lift, *degrees.tolist()))


@dataclass(frozen=True)
class ShapeProblem:
    """Fit of the shape of a cam of tangent arcs to its published sound levels.

    Parameters
    ----------
    cam : Cam
        File of the arc cam.
    published : ndarray
        Published levels in dB, shape (n,).
    turn : callable
        Function that simulates a law at the n speeds of the published levels.
    """

    cam: CamConfig
    published: FloatArray
    turn: Callable[[Law], Turns]
    _cache: dict[ArcShape, PublishedCam] = field(default_factory=dict, init=False, compare=False)

    def cam_of(self, shape: ArcShape) -> PublishedCam:
        """Return the simulated turns of the arc cam with a shape.

        They are cached, because fits with other acoustic constants evaluate the same shapes.
        """
        if shape not in self._cache:
            turns = self.turn(shape.law(self.cam))
            self._cache[shape] = PublishedCam(self.cam.name, turns, self.published)
        return self._cache[shape]

    def sensitivity(self, shape: ArcShape, acoustics: Acoustics) -> FloatArray:
        """Return the derivatives of the sound levels by lift and event angle, (n, 2).

        They are in dB per relative change, one row per speed. The event angle is that of rise and
        fall together. ``shape`` is the shape of the cam, and ``acoustics`` are the acoustic
        constants.
        """
        changed = [shape.scaled(*(1.0 + DERIVATIVE_STEP * axis)) for axis in np.eye(2)]
        base, *levels = (acoustics.levels(self.cam_of(s).turns) for s in (shape, *changed))
        return np.stack([(level - base) / DERIVATIVE_STEP for level in levels], axis=1)

    def fit(self, near: ArcShape, acoustics: Acoustics) -> ArcShape:
        """Fit lift and event angle of the arc cam to its published cubic regression.

        The event angle is that of rise and fall together. The regression over speed of the
        simulated levels is compared with the published regression. The search starts at the shape
        `near` and at shapes with other lifts.
        """
        projection = cubic_projection(self.cam_of(near).rpm)

        def cost(shape: ArcShape) -> float:
            try:
                return rms(projection @ self.cam_of(shape).difference(acoustics))
            except LawError:
                return IMPOSSIBLE

        valley = [near.scaled(a, b * a ** (1.0 / 3.0)) for a in LIFTS for b in EVENTS]
        start = min([*valley, near], key=cost)

        def cost_at(x: FloatArray) -> float:
            return cost(start.scaled(*x.tolist()))

        simplex = np.ones((3, 2)) + SIMPLEX * np.eye(3, 2, -1)
        solution = minimize(
            cost_at,
            np.ones(2),
            method="Nelder-Mead",
            options={"initial_simplex": simplex, "maxfev": TRIALS, "xatol": 1e-3, "fatol": 5e-3},
        )
        return start.scaled(*solution.x.tolist())

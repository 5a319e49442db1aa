"""The base radius that a contact asks for, from below and from above.

The profile thesis (§2.3.1) names two bounds. From below the Hertz pressure, which asks for a least
radius of curvature (eq. 2.41-2.42, after Riba); from above the sliding speed, which grows with the
cam. Handbooks add the pressure angle, from below.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.profile.checks.base_radius import least_base, least_base_radius, plates_on
from cam_rig.profile.checks.pressure_angle import greatest_allowed
from cam_rig.profile.extremes import Scan
from cam_rig.studies.contact.surfaces import ContactCase, Surfaces

#: A number of the whole turn, larger than its limit when it is bad.
Measure = Callable[[Surfaces, Scan], float]
#: Lower bounds, those of the thesis first.
LOWER = ("curvature", "pressure", "pressure_angle")


@dataclass(frozen=True)
class BaseBounds:
    """Base radii (m) of one cam at one speed; each holds with the cam's other numbers unchanged.

    Parameters
    ----------
    curvature : least, without undercut and sharper parts than asked for
    pressure_angle : least, for the most pressure angle
    pressure : least, for the most Hertz pressure
    sliding : greatest, for the most sliding speed; infinite for a roller

    None where no base radius will do, 0 where every one down to a hundredth of the cam's own does.
    """

    curvature: float | None
    pressure_angle: float | None
    pressure: float | None
    sliding: float | None

    @property
    def least(self) -> float | None:
        """The largest of the three lower bounds, None where one cannot be met."""
        lower = [getattr(self, key) for key in LOWER]
        return None if None in lower else max(lower)

    @property
    def governing(self) -> str:
        """Key of the largest lower bound, or of one that no base radius meets; "" for none."""
        lower = {key: getattr(self, key) for key in LOWER}
        worst = max(LOWER, key=lambda key: np.inf if lower[key] is None else lower[key])
        return "" if lower[worst] == 0.0 else worst

    @property
    def feasible(self) -> bool:
        """Whether a base radius meets all of them."""
        return self.least is not None and self.sliding is not None and self.least <= self.sliding


def base_bounds(case: ContactCase) -> BaseBounds:
    """All bounds on the base radius of a cam."""
    follower, limits = case.cam.follower, case.surfaces.parts
    own = follower.base_radius.si

    def least(measure: Measure, limit: float) -> float | None:
        return least_base(lambda base: -_excess(case, measure, limit, base, np.inf), own)

    return BaseBounds(
        curvature=least_base_radius(follower, case.law),
        pressure_angle=least(_steepest, greatest_allowed(follower, case.surfaces.element)),
        pressure=least(peak_pressure, limits.most_pressure.si),
        sliding=_greatest(case, own, limits.most_sliding_speed.si),
    )


def peak_pressure(surfaces: Surfaces, scan: Scan) -> float:
    """Largest Hertz pressure (Pa) over the turn."""
    return scan.greatest_of(surfaces.pressure).value


def peak_sliding(surfaces: Surfaces, scan: Scan) -> float:
    """Largest sliding speed (m/s) over the turn."""
    return scan.greatest_of(surfaces.sliding).value


def _steepest(_: Surfaces, scan: Scan) -> float:
    return scan.greatest(lambda touch: np.abs(touch.pressure)).value


def measured(case: ContactCase, measure: Measure, base: float) -> float | None:
    """A measure of the cam on another base radius (m); None where the follower does not reach."""
    plates = plates_on(case.cam.follower, case.law, base)
    if not plates:
        return None
    surfaces = replace(case.surfaces, element=plates[0].element)
    return measure(surfaces, Scan(case.law, surfaces.element))


def _excess(
    case: ContactCase, measure: Measure, limit: float, base: float, missing: float
) -> float:
    """Measure over its limit less 1, within ±1 for the root finder; ``missing`` out of reach."""
    value = measured(case, measure, base)
    return float(np.clip((missing if value is None else value / limit) - 1.0, -1.0, 1.0))


def _greatest(case: ContactCase, own: float, limit: float) -> float | None:
    """Above this base radius (m) the follower slides too fast; None where it does on every one."""
    if case.surfaces.rolls:
        return np.inf
    found = least_base(
        lambda base: _excess(case, peak_sliding, limit, base, np.inf if base > own else 0.0), own
    )
    if found == 0.0:
        return None
    reaches = found is not None and measured(case, peak_sliding, found * 1.001) is not None
    return found if reaches else np.inf  # the follower ends before the bound does

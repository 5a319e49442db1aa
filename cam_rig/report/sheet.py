"""Design sheet of a cam at its working speed: the numbers on the first page of a report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from pydantic import BaseModel

from cam_rig.dynamics import Block, FollowerParameters
from cam_rig.dynamics.kinetostatic import force_weights
from cam_rig.laws import Law
from cam_rig.laws.law import Extreme, continuity, extremes, format_continuity
from cam_rig.profile import discs
from cam_rig.profile.checks import Check, sharpest_concave, sharpest_convex
from cam_rig.profile.contact import Scan
from cam_rig.quantities.steady import scene_at, steady_turn
from cam_rig.schema import CamConfig
from cam_rig.schema.cam import OscillatingPoint, Point
from cam_rig.schema.quantity import Quantity
from cam_rig.schema.segment_base import iterate_quantities
from cam_rig.show.tables import Cell, DataTable, Header, pluralize
from cam_rig.simulation.by_speed import SpeedRow
from cam_rig.simulation.scene import LoadedScene
from cam_rig.studies.contact.surfaces import contact_case
from cam_rig.units import TURN, FloatArray, to_rpm

#: Number of samples of the turn from which torque and the angles of the forces are read.
TURN_SAMPLES = 1440
#: Largest number of segments in the table of a sheet. More would not fit on its page.
MAX_SEGMENTS = 8
#: Decimals of a lift divided by the largest lift. Further digits are rounding errors.
LIFT_DECIMALS = 9
#: Distance from an extreme, as a fraction of the range, within which a sample counts as equal to
#: it. The force of a dwell is constant to rounding.
FIRST_RTOL = 1e-9
#: Smallest class of continuity of a law with a finite jerk.
FINITE_JERK = 2
#: Mark of a computed number that depends on an assumed number.
ASSUMED_MARK = "computed *"
#: Keys of a cam's section ``contact`` without which the sheet has no Hertz pressure.
CONTACT_KEYS = ("face_width", "youngs_modulus")
#: Names of derivatives of the lift in time and their units, by order.
DERIVATIVES = (("lift s", "mm", 1e3), ("velocity v", "m/s", 1.0), ("acceleration a", "m/s²", 1.0))
JERK = ("jerk j", "m/s³", 1.0)

Row = tuple[Cell, ...]


@dataclass(frozen=True, eq=False)
class DesignSheet:
    """Numbers of a cam on the rig of a scene, at the highest speed of the scene.

    Parameters
    ----------
    loaded : LoadedScene
        Scene with its rig.
    cam : CamConfig
    law : Law
    jump_rpm : float or None
        Jump speed in rpm, or None if the cam has none.
    checks : sequence of Check
        Checks of the contour.
    """

    loaded: LoadedScene
    cam: CamConfig
    law: Law
    jump_rpm: float | None
    checks: Sequence[Check] = ()

    @cached_property
    def speed(self) -> float:
        """Working speed in rad/s: the highest of the scene."""
        return max(self.loaded.scene.schedule.speeds.si_list)

    @cached_property
    def rpm(self) -> float:
        """Working speed in rpm."""
        return to_rpm(self.speed)

    @cached_property
    def turn(self) -> tuple[Block, SpeedRow, bool]:
        """Steady turn of the scene's model, its row, and True if the turns repeat."""
        scene = scene_at(self.loaded.scene.model_copy(update={"cams": [self.cam.name]}), self.speed)
        return steady_turn(self.law, self.loaded.rig, scene, self.speed, TURN_SAMPLES)

    @property
    def angle(self) -> FloatArray:
        """Cam angles of the samples of the turn, rad."""
        return np.asarray(self.turn[0].time * self.speed)

    @property
    def force(self) -> FloatArray:
        """Contact force of the turn, N."""
        return np.asarray(self.turn[0].force)

    @property
    def torque(self) -> FloatArray:
        """Torque of the contact force on the cam over the turn, N·m: F s′."""
        return self.force * self.law(self.angle, 1)

    @cached_property
    def spring_force(self) -> FloatArray:
        """Force of spring and preload at the lift of the law over the turn, N."""
        return self._follower.preload + self._follower.spring_stiffness * self.law(self.angle)

    @property
    def largest_radius(self) -> float:
        """Largest distance of the contour from the axis, m."""
        return self._scan.greatest(lambda touch: np.abs(touch.contact)).value

    @property
    def has_assumed(self) -> bool:
        """True if a number of the rig or of the cam is assumed."""
        return ASSUMED_MARK in (self._origin(dynamic=True), self._hertz_origin)

    @property
    def remarks(self) -> list[str]:
        """Sentences on failed checks, lost contact, and numbers that the sheet lacks."""
        lines = [f"Failed check: {check}." for check in self.checks if not check.passed]
        if self.jump_rpm is not None and self.jump_rpm < self.rpm:
            lines.append("The working speed is above the jump speed: the follower leaves the cam.")
        if keys := self._missing_contact:
            names = ", ".join(f"contact.{key}" for key in keys)
            are = "is" if len(keys) == 1 else "are"
            lines.append(f"No Hertz pressure: {names} {are} not in the file of the cam.")
        if self.jump_rpm is None:
            lines.append("No jump speed and no margin: see the section on the jump speed.")
        return lines

    @cached_property
    def tables(self) -> dict[str, DataTable]:
        """Tables of the sheet by name."""
        star = ("* An assumed number enters.",) if self.has_assumed else ()
        number = Header("value", "", ".4g")
        given = (Header("quantity"), number, Header("unit"), Header("origin"))
        angle = Header("at °", "", ".1f")
        peaks = (
            *(Header("quantity"), Header("largest", "", ".4g"), angle),
            *(Header("smallest", "", ".4g"), angle, Header("origin")),
        )
        segments = (
            *(Header("from °", "", ".4g"), Header("to °", "", ".4g"), Header("law")),
            *(Header("s from mm", "", ".4g"), Header("to mm", "", ".4g"), Header("span")),
        )
        jerk = () if self._jerk_is_finite else ("The jerk is infinite at joints of the law.",)
        steady = () if self.turn[2] else ("The turns do not repeat: the follower bounces.",)
        at = f"at {self.rpm:.6g} rpm"
        results = (Header("quantity"), number, Header("unit"), angle, Header("origin"))
        return {
            "given": DataTable("Machine and cam", given, tuple(self._given())),
            "results": DataTable(f"Results {at}", results, tuple(self._results()), star),
            "peaks": DataTable(f"Peaks {at}", peaks, tuple(self._peaks()), (*jerk, *steady)),
            "segments": DataTable(
                f"Segments, law {format_continuity(self.law)}", segments, *self._segments()
            ),
        }

    # Rows of the tables.

    def _given(self) -> Iterator[Row]:
        """Yield the numbers of rig and cam that the results depend on, and the working speed."""
        quantities = [("working speed", self._working_speed()), ("lift", self.cam.lift)]
        for model in (self.cam.follower, self.loaded.rig.follower):
            quantities += iterate_quantities(model, "")
        if not self._missing_contact:
            keys = (*self._contact_keys, "poisson_ratio")
            quantities += [(key, getattr(self.cam.parts, key)) for key in keys]
        for name, quantity in quantities:
            unit = "" if quantity.unit == "1" else quantity.unit.replace("*", "·")
            yield name.replace("_", " "), float(quantity.numbers[0]), unit, quantity.origin

    def _working_speed(self) -> Quantity:
        speeds = self.loaded.scene.schedule.speeds
        return Quantity.model_validate({speeds.origin: max(speeds.numbers), "unit": speeds.unit})

    def _results(self) -> Iterator[Row]:
        """Yield jump speed, margin, spring forces, Hertz pressure and sizes of the contour."""
        dynamic, shape = self._origin(dynamic=True), self._origin(dynamic=False)
        if self.jump_rpm is not None:
            yield "jump speed", self.jump_rpm, "rpm", None, dynamic
            yield "margin, jump / working", self.jump_rpm / self.rpm, "", None, dynamic
        required = self._required_spring_force
        available = self._follower.preload + self._follower.spring_stiffness * float(
            self.law(required.angle)
        )
        yield "spring force required", required.value, "N", _degrees(required), dynamic
        yield "spring force available there", available, "N", _degrees(required), dynamic
        if not self._missing_contact:
            case = contact_case(self.cam, self.law, self._follower, self.speed)
            pressure = case.scan.greatest_of(case.surfaces.pressure)
            row = "Hertz pressure", 1e-6 * pressure.value, "MPa", _degrees(pressure)
            yield *row, self._hertz_origin
        convex, concave = sharpest_convex(self._scan), sharpest_concave(self._scan)
        for name, radius in (("smallest convex radius", convex), ("smallest hollow", concave)):
            if radius is not None and np.isfinite(radius.value):
                yield name, 1e3 * radius.value, "mm", _degrees(radius), shape
        yield "largest diameter", 2e3 * self.largest_radius, "mm", None, shape

    def _peaks(self) -> Iterator[Row]:
        """Yield the largest and smallest value of each quantity over the turn."""
        orders = (*DERIVATIVES, JERK) if self._jerk_is_finite else DERIVATIVES
        origin = self._origin(dynamic=False)
        for order, (name, unit, factor) in enumerate(orders):
            low, high = extremes(self.law, order)
            scale = factor * self.speed**order
            yield _peak_row(name, unit, high, low, scale, origin)
        dynamic, (_, row, _) = self._origin(dynamic=True), self.turn
        low, high = self._sampled(self.force)
        low, high = replace(low, value=row.min_force), replace(high, value=row.peak_force)
        yield _peak_row("contact force F", "N", high, low, 1.0, dynamic)
        low, high = self._sampled(self.torque)
        yield _peak_row("torque F s′", "N·m", high, low, 1.0, dynamic)
        high = self._scan.greatest(lambda touch: touch.pressure)
        low = self._scan.least(lambda touch: touch.pressure)
        yield _peak_row("pressure angle", "°", high, low, 360.0 / TURN, origin)

    def _segments(self) -> tuple[tuple[Row, ...], tuple[str, ...]]:
        """Return the rows of the segments, and a note on segments that are left out."""
        spans = [segment.span for segment in self.cam.segments]
        ends = np.cumsum([0.0, *(span.si for span in spans)])
        lifts = 1e3 * self.law.lift * np.round(self.law(ends) / self.law.lift, LIFT_DECIMALS)
        rows = [
            (*np.degrees(end).tolist(), segment.law.replace("_", " "), *lift, span.origin)
            for segment, span, end, lift in zip(
                self.cam.segments, spans, pairwise(ends), pairwise(lifts.tolist()), strict=True
            )
        ]
        more = len(rows) - MAX_SEGMENTS
        notes = (f"and {pluralize(more, 'segment')} more",) if more > 0 else ()
        return tuple(rows[:MAX_SEGMENTS]), notes

    # Terms of the rows.

    @cached_property
    def _follower(self) -> FollowerParameters:
        return FollowerParameters.from_rig(self.loaded.rig)

    @cached_property
    def _scan(self) -> Scan:
        return Scan(self.law, discs(self.cam.follower, self.law)[0].element)

    @property
    def _jerk_is_finite(self) -> bool:
        return continuity(self.law) >= FINITE_JERK

    @property
    def _required_spring_force(self) -> Extreme:
        """Least force (N) that keeps one rigid mass on the cam: the maximum of −(m s̈ + c ṡ)."""
        weights = force_weights(self._follower, self.speed) * (0.0, 1.0, 1.0)
        inertia = np.tensordot(weights, self.law.motion, axes=1)
        low, _ = extremes(Law(self.law.name, self.law.breaks, inertia), 0)
        return Extreme(-low.value, low.angle)

    @property
    def _missing_contact(self) -> list[str]:
        """Keys of the section ``contact`` that the cam file lacks for the Hertz pressure."""
        stated = set() if self.cam.contact is None else self.cam.contact.model_fields_set
        return [key for key in self._contact_keys if key not in stated]

    @property
    def _contact_keys(self) -> tuple[str, ...]:
        is_point = isinstance(self.cam.follower, Point | OscillatingPoint)
        return (*CONTACT_KEYS, "tip_radius") if is_point else CONTACT_KEYS

    def _sampled(self, values: FloatArray) -> tuple[Extreme, Extreme]:
        """Return the smallest and largest of values at the samples, each where it is first met."""
        low, high = float(values.min()), float(values.max())
        margin = FIRST_RTOL * (high - low)
        first = int(np.argmax(values <= low + margin)), int(np.argmax(values >= high - margin))
        return Extreme(low, float(self.angle[first[0]])), Extreme(high, float(self.angle[first[1]]))

    def _origin(self, dynamic: bool, *others: Quantity) -> str:
        """Return the origin of a computed number.

        It depends on the cam and on the quantities `others`, and if `dynamic` is True on the rig.
        """
        models: list[BaseModel] = [self.cam.follower, *self.cam.segments]
        models += [self.loaded.rig.follower] if dynamic else []
        numbers = [self.cam.lift, *others]
        numbers += [number for model in models for _, number in iterate_quantities(model, "")]
        is_assumed = any(number.origin == "assumed" for number in numbers)
        return ASSUMED_MARK if is_assumed else "computed"

    @property
    def _hertz_origin(self) -> str:
        """Origin of the Hertz pressure, "computed" without it."""
        if self._missing_contact:
            return "computed"
        keys = (*self._contact_keys, "poisson_ratio")
        return self._origin(True, *(getattr(self.cam.parts, key) for key in keys))


def _peak_row(name: str, unit: str, high: Extreme, low: Extreme, factor: float, origin: str) -> Row:
    values = (factor * high.value, _degrees(high), factor * low.value + 0.0, _degrees(low))
    return (f"{name} [{unit}]", *values, origin)


def _degrees(extreme: Extreme) -> float:
    return float(np.degrees(extreme.angle)) % 360.0

"""Contact of cams at one speed: Hertz pressure, sliding, and bounds on the base radius."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cam_rig.arguments import check_arguments
from cam_rig.dynamics import FollowerParameters
from cam_rig.errors import ConfigError
from cam_rig.laws.cam import CamSet
from cam_rig.laws.law import Extreme
from cam_rig.profile.contact import Motion
from cam_rig.schema import CamConfig
from cam_rig.schema.cam import ContactParts
from cam_rig.schema.quantity import Quantity
from cam_rig.schema.segment_base import iterate_quantities
from cam_rig.show.result import (
    Column,
    Footnote,
    Records,
    Result,
    subject_line,
)
from cam_rig.show.tables import Cell
from cam_rig.simulation.inputs import MAX_RPM, Cams, Rig, resolve_cams
from cam_rig.studies.contact.surfaces import (
    LOWER,
    RISES,
    BaseBounds,
    ContactCase,
    base_bounds,
    by_face,
    by_pressure_angle,
    contact_case,
)
from cam_rig.units import RPM, RPM_PER_RAD_S, TURN

#: Event angles (spans of a rise) in the tables of the nomogram, degrees.
EVENTS = (60.0, 90.0, 120.0, 150.0, 180.0)


@dataclass(frozen=True, eq=False)
class CamContact:
    """Largest pressure and sliding of one cam over the turn, and base radius bounds.

    Parameters
    ----------
    case : ContactCase
        Cam with its law and surfaces.
    pressure : Extreme
        Largest Hertz pressure in Pa and its cam angle.
    load, width : float
        Normal force in N and width of the contact in m at the largest pressure.
    relative_radius : float
        Relative radius of curvature 1/κ of cam and follower in m at the largest pressure. It is the
        radius of the follower if the cam is straight there.
    sliding : Extreme
        Largest sliding speed in m/s and its cam angle.
    lost : bool
        True if contact is lost, because the cam would have to pull at some angle.
    bounds : BaseBounds
        Bounds on the base radius.
    """

    case: ContactCase
    pressure: Extreme
    load: float
    width: float
    relative_radius: float
    sliding: Extreme
    lost: bool
    bounds: BaseBounds

    @property
    def cam(self) -> CamConfig:
        """Content of the cam file, with the follower."""
        return self.case.cam

    @property
    def roller_rpm(self) -> float | None:
        """Largest speed (rpm) of a roller about its pin, or None without a roller."""
        surfaces = self.case.surfaces
        return self.sliding.value / surfaces.radius * RPM_PER_RAD_S if surfaces.rolls else None

    @property
    def result(self) -> str:
        """Comparison of the cam's base radius with its bounds, as text.

        It is "within", "outside", or a text if no base radius satisfies all bounds.
        """
        lower, upper = self.bounds.least, self.bounds.sliding
        if lower is None or upper is None or lower > upper:
            return "no base radius meets all"
        radius = self.cam.follower.base_radius.si
        return "within" if lower <= radius <= upper else "outside"


def contact_row(case: ContactCase) -> CamContact:
    """Compute pressure, sliding and bounds on the base radius of one cam.

    ``case`` is the cam on a rig at a speed.
    """
    surfaces, scan = case.surfaces, case.scan
    pressure = scan.greatest_of(surfaces.pressure)
    min_force = -scan.greatest_of(lambda *motion: -surfaces.normal_force(*motion)).value
    # The pressure jumps at a joint, so the side with the larger pressure is selected.
    sides = [Motion.at(case.law, np.array([pressure.angle + d])) for d in (-1e-9 * TURN, 0.0)]
    motion = max(sides, key=lambda side: surfaces.pressure(side, scan.element.touch(side))[0])
    touch = scan.element.touch(motion)
    return CamContact(
        case=case,
        pressure=pressure,
        load=float(surfaces.normal_force(motion, touch)[0]),
        width=float(surfaces.width(motion, touch)[0]),
        relative_radius=float(1.0 / surfaces.curvature(touch)[0]),
        sliding=scan.greatest_of(surfaces.sliding),
        lost=min_force <= 0.0,
        bounds=base_bounds(case),
    )


def _values(values: Iterable[float]) -> str:
    """Return the distinct numbers in rising order as text."""
    return ", ".join(f"{value:g}" for value in sorted(set(values)))


def _follower(row: CamContact) -> str:
    """Return the type of the follower and its radius in mm as text."""
    radius = row.case.surfaces.radius
    kind = row.cam.follower.type.replace("_", " ")
    return kind + (f", R {1e3 * radius:.3g} mm" if math.isfinite(radius) else "")


def _bound_column(key: str, heading: str) -> Column:
    """Return the table column of a bound on the base radius.

    ``key`` is a field of `BaseBounds`.
    """

    def cell(row: CamContact) -> Cell:
        value = getattr(row.bounds, key)
        if value is None:
            return "impossible"
        return "no bound" if math.isinf(value) else 1e3 * value

    return Column(key, "mm", ".1f", heading, f"bounds.{key}", cell)


CAM = Column("cam", of="cam.name", cell=lambda row: str(row.cam.title))
RADII = (
    Column("rise", of="0"),
    *(
        Column(f"event_{event:g}", "", ".2f", f"β = {event:g}°", f"{i}")
        for i, event in enumerate(EVENTS, 1)
    ),
)


@dataclass(frozen=True, repr=False)
class ContactResult(Result):
    """Hertz pressure, sliding and base radius bounds of cams on a rig at one speed.

    Parameters
    ----------
    rig : str
        Name of the rig.
    rpm : float
        Speed of the cam in rpm.
    rows : tuple of CamContact
        Contact of each cam.
    steepest : float, optional
        Largest pressure angle of the nomogram in rad. None without a nomogram.
    """

    schema = "cam_rig.contact.1"
    plot_function = "cam_rig.studies.contact.figures:figure"
    columns: ClassVar = {
        "contact": (
            CAM,
            Column("follower", of="cam.follower.type", cell=_follower),
            Column("pressure", "MPa", ".1f", "largest pressure", "pressure.value"),
            Column("angle", "°", ".1f", "at", "pressure.angle"),
            Column("normal_force", "N", ".1f", "normal force there", "load"),
            Column("relative_radius", "mm", ".2f"),
            Column("contact_width", "µm", ".1f", of="width"),
            Column(
                "sliding_speed",
                "m/s",
                ".3f",
                of=lambda row: None if row.case.surfaces.rolls else row.sliding.value,
                missing="rolls",
            ),
            Column("roller_rpm", "rpm", ".0f", "roller speed", missing="–"),
            Column("contact_lost", of="lost", hidden=True),
        ),
        "bounds": (
            CAM,
            Column("base_radius", "mm", ".4g", of="cam.follower.base_radius.si"),
            _bound_column("curvature", "least by curvature"),
            _bound_column("pressure_angle", "least by pressure angle"),
            _bound_column("pressure", "least by Hertz pressure"),
            _bound_column("sliding", "greatest by sliding"),
            Column(
                "governing",
                heading="largest lower bound",
                of="bounds.governing",
                cell=lambda row: LOWER.get(row.bounds.governing),
            ),
            Column("feasible", of="bounds.feasible", hidden=True),
            Column("result"),
        ),
        "assumed": (
            Column("number", of="0"),
            Column("value", of=lambda row: _quantity(row[1])),
            Column("origin", of="1.origin"),
            Column("source", of="1.source"),
        ),
        "run": (Column("rig"), Column("rpm", "rpm")),
        "roller_radii": RADII,
        "face_radii": RADII,
    }

    rig: str
    rpm: float
    rows: tuple[CamContact, ...]
    steepest: float | None = None

    @property
    def subject(self) -> str:
        """Cams, rig and model."""
        return subject_line((row.cam.name for row in self.rows), self.rig, "kinetostatic")

    def tables(self) -> list[Records]:
        """Return the tables ``contact``, ``bounds``, ``assumed`` and ``run``.

        With a nomogram, they include its tables ``roller_radii`` and ``face_radii``.
        """
        parts = [row.cam.parts for row in self.rows]
        contact = self.table(
            "contact",
            f"Hertz pressure and sliding at {self.rpm:g} rpm, rig {self.rig}",
            self.rows,
            "A roller that turns freely does not slide; the cam carries its rim along.",
            Footnote(
                "A point without a radius would have infinite pressure: its tip radius is used.",
                lambda row: not row.case.surfaces.rolls and math.isfinite(row.case.surfaces.radius),
            ),
            f"Face width: {_values(1e3 * part.face_width.si for part in parts)} mm.",
            Footnote(
                "The cam would have to pull somewhere: contact is lost, and landings press harder.",
                lambda row: row.lost,
                "†",
            ),
        )
        bounds = self.table(
            "bounds",
            f"Bounds on the base radius at {self.rpm:g} rpm",
            self.rows,
            "0: every base radius down to a hundredth of the cam's satisfies the limit.",
            f"Most pressure: {_values(1e-6 * part.most_pressure.si for part in parts)} MPa. "
            f"Most sliding speed: {_values(part.most_sliding_speed.si for part in parts)} m/s.",
        )
        assumed = self.table(
            "assumed",
            "Assumed numbers of a contact that a cam file does not contain",
            iterate_quantities(ContactParts(), ""),
        )
        run = self.table("run", "Rig and speed", [self], single=True, hidden=True)
        return [contact, bounds, assumed, *self._nomogram(), run]

    def _nomogram(self) -> Iterator[Records]:
        """Yield the two tables of the nomogram, if a largest pressure angle is given.

        They contain the smallest radii over the event angle, for each law of a rise.
        """
        if self.steepest is None:
            return
        event, note = np.radians(EVENTS), "The guide goes through the cam's axis."
        angle = f"pressure angle of at most {math.degrees(self.steepest):g}°"
        roller = [(name, *by_pressure_angle(name, event, self.steepest)) for name in RISES]
        face = [(name, *by_face(name, event)) for name in RISES]
        caption = f"Roller: least (R_b + R_r) / h for a {angle}"
        yield self.table("roller_radii", caption, roller, note)
        caption = "Flat follower: least (R_b − ρ_min) / h for the radius of curvature ρ_min"
        yield self.table("face_radii", caption, face, note)


def _quantity(quantity: Quantity) -> str:
    """Return the value of a quantity with its unit as text."""
    unit = "" if quantity.unit == "1" else f" {quantity.unit}"
    return f"{quantity.numbers[0]:g}{unit}"


def compare_contacts(cam_set: CamSet, rpm: float, steepest: float | None = None) -> ContactResult:
    """Return the contact of every cam of a set at one speed.

    ``rpm`` is the speed of the cam. ``steepest`` (rad) is the largest pressure angle of the
    nomogram, or None without a nomogram.
    """
    rig = FollowerParameters.from_rig(cam_set.rig)
    rows = (
        contact_row(contact_case(cam, cam_set.laws[name], rig, rpm * RPM))
        for name, cam in cam_set.cams.items()
    )
    return ContactResult(cam_set.rig.name, rpm, tuple(rows), steepest)


#: Default speed of the cam, rpm. It is below the jump speed of every cam of the default set.
SPEED = 300.0


@check_arguments
def contact_stress(
    cams: Cams = None, rig: Rig = None, rpm: float = SPEED, *, pressure_angle: float | None = None
) -> ContactResult:
    """Find Hertz pressure, sliding speed and bounds on the base radius.

    The follower is rigid, in contact and without friction. Face width and material are in the
    section ``contact`` of the cam. The command is ``cam-rig contact``.

    Parameters
    ----------
    cams : str, Path, Cam or sequence
        Cams as names, paths or results of `load_cam`, or one scene (default: the cams of the
        paper's Table 2).
    rig : str, Path or Rig
        Rig (default: that of the scene, or the only rig next to the cams, else
        ``paper_table2``).
    rpm : float
        Speed of the cam in rpm, 0 to 1e5 rpm (default: 300 rpm).
    pressure_angle : float, optional
        Largest pressure angle in rad, 1° to 89°. With it the result contains the tables
        ``roller_radii`` and ``face_radii`` of the nomogram: least base radii over the event angle.

    Returns
    -------
    ContactResult
        Pressure, sliding and bounds of each cam, and the assumed numbers.

    Raises
    ------
    ConfigError
        A cam, rig or scene is unknown, or a number is out of range.
    ProfileError
        A tip radius is larger than a concave radius of curvature of the cam.

    Examples
    --------
    >>> import cam_rig
    >>> result = cam_rig.contact_stress("poly345", rpm=200)
    >>> result.to_pandas().cam.tolist()
    ['poly345']
    """
    if not 0.0 <= rpm <= MAX_RPM:
        raise ConfigError(f"rpm must be between 0 and {MAX_RPM:g} rpm, got {rpm:g}")
    if pressure_angle is not None and not 1.0 <= math.degrees(pressure_angle) <= 89.0:
        raise ConfigError(
            f"pressure_angle must be between 1° and 89°, got {math.degrees(pressure_angle):g}°"
        )
    return compare_contacts(resolve_cams(cams, rig), rpm, pressure_angle)

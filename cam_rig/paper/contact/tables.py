"""Contact of cams as tables and as plain data."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import asdict
from typing import Any

import numpy as np

from cam_rig.paper.contact.comparison import (
    RISES,
    ContactRow,
    ContactTable,
    PlayRow,
    by_face,
    by_pressure_angle,
)
from cam_rig.schema.cam import ContactParts
from cam_rig.schema.quantity import Quantity
from cam_rig.schema.segment_base import quantities
from cam_rig.show.tables import Cell, DataTable, Head, tabulate
from cam_rig.units import RPM_PER_RAD_S, FloatArray

#: Event angles of the table, degrees.
EVENTS = (60.0, 90.0, 120.0, 150.0, 180.0)

#: Key of a bound, and its heading.
BOUNDS = {
    "curvature": "least by curvature",
    "pressure_angle": "least by pressure angle",
    "pressure": "least by Hertz pressure",
    "sliding": "greatest by sliding",
}

#: The lower bounds, as a sentence names them.
LOWER = {
    "curvature": "curvature",
    "pressure_angle": "pressure angle",
    "pressure": "Hertz pressure",
}


def contact_tables(found: ContactTable) -> list[DataTable]:
    """Pressure and sliding over the turn, and the bounds on the base radius."""
    return [_peaks(found), _bounds(found)]


def _peaks(found: ContactTable) -> DataTable:
    rows = list(found.rows.values())
    lost = any(row.lost for row in rows)
    return tabulate(
        f"Hertz pressure and sliding at {found.rpm:g} rpm, rig {found.rig}",
        rows,
        (
            (Head("cam"), lambda row: row.case.cam.title + (" †" if row.lost else "")),
            (Head("follower"), _follower),
            (Head("largest pressure", "MPa", ".1f"), lambda row: 1e-6 * row.pressure.value),
            (Head("at", "°", ".1f"), lambda row: math.degrees(row.pressure.angle)),
            (Head("normal force there", "N", ".1f"), lambda row: row.load),
            (Head("relative radius", "mm", ".2f"), lambda row: 1e3 * row.relative_radius),
            (Head("contact width", "µm", ".1f"), lambda row: 1e6 * row.width),
            (Head("sliding speed", "m/s", ".3f", "rolls"), _sliding),
            (Head("roller speed", "rpm", ".0f", "–"), _roller),
        ),
        "A roller that turns freely does not slide; the cam carries its rim along.",
        "A point without a radius would have infinite pressure: it is taken with its tip radius."
        if any(_pointed(row) for row in rows)
        else "",
        f"Face width: {_each(1e3 * row.case.cam.parts.face_width.si for row in rows)} mm.",
        "† The cam would have to pull somewhere: contact is lost, and landings press harder."
        if lost
        else "",
    )


def _follower(row: ContactRow) -> str:
    kind = row.case.cam.follower.type.replace("_", " ")
    radius = row.case.surfaces.radius
    return f"{kind}, R {1e3 * radius:.3g} mm" if math.isfinite(radius) else kind


def _pointed(row: ContactRow) -> bool:
    return not row.case.surfaces.rolls and math.isfinite(row.case.surfaces.radius)


def _sliding(row: ContactRow) -> Cell:
    return None if row.case.surfaces.rolls else row.sliding.value


def _roller(row: ContactRow) -> Cell:
    return None if row.roller_speed is None else row.roller_speed * RPM_PER_RAD_S


def _bounds(found: ContactTable) -> DataTable:
    parts = [row.case.cam.parts for row in found.rows.values()]
    return tabulate(
        f"Bounds on the base radius at {found.rpm:g} rpm",
        found.rows.values(),
        (
            (Head("cam"), lambda row: row.case.cam.title),
            (
                Head("base radius", "mm", ".4g"),
                lambda row: 1e3 * row.case.cam.follower.base_radius.si,
            ),
            *((Head(heading, "mm", ".1f"), _bound(key)) for key, heading in BOUNDS.items()),
            (Head("largest lower bound"), lambda row: LOWER.get(row.bounds.governing)),
            (Head("result"), _result),
        ),
        "0: every base radius down to a hundredth of the cam's own will do.",
        f"Most pressure: {_each(1e-6 * one.most_pressure.si for one in parts)} MPa. "
        f"Most sliding speed: {_each(one.most_sliding_speed.si for one in parts)} m/s.",
    )


def _bound(key: str) -> Callable[[ContactRow], Cell]:
    def cell(row: ContactRow) -> Cell:
        value = getattr(row.bounds, key)
        if value is None:
            return "none will do"
        return "no bound" if math.isinf(value) else 1e3 * value

    return cell


def _result(row: ContactRow) -> str:
    if not row.bounds.feasible:
        return "no base radius meets all"
    assert row.bounds.least is not None and row.bounds.sliding is not None
    inside = row.bounds.least <= row.case.cam.follower.base_radius.si <= row.bounds.sliding
    return "within" if inside else "outside"


def _each(values: Iterable[float]) -> str:
    return ", ".join(f"{value:g}" for value in sorted(set(values)))


def event_tables(most: float) -> list[DataTable]:
    """Least radii over event angles, in lifts; ``most`` is the most pressure angle, rad."""
    event = np.radians(EVENTS)
    roller = {name: by_pressure_angle(name, event, most) for name in RISES}
    face = {name: by_face(name, event) for name in RISES}
    angle = f"pressure angle of at most {math.degrees(most):g}°"
    return [
        _events(f"Roller: least (R_b + R_r) / h for a {angle}", roller),
        _events("Flat follower: least (R_b − ρ_min) / h for the radius of curvature ρ_min", face),
    ]


def _events(caption: str, radii: dict[str, FloatArray]) -> DataTable:
    return tabulate(
        caption,
        radii.items(),
        (
            (Head("rise"), lambda row: row[0]),
            *(
                (Head(f"β = {degrees:g}°", "", ".2f"), lambda row, i=i: float(row[1][i]))
                for i, degrees in enumerate(EVENTS)
            ),
        ),
        "The guide goes through the cam's axis.",
    )


def play_table(rows: Iterable[PlayRow]) -> DataTable:
    """Play of followers that a cam moves both ways."""
    return tabulate(
        "Play between the two contacts over the turn, each element put on its finished contour",
        rows,
        (
            (Head("cam"), lambda row: row.cam.title),
            (Head("follower"), lambda row: row.cam.follower.type.replace("_", " ")),
            (Head("least", "nm", ".1e"), lambda row: 1e9 * row.least),
            (Head("greatest", "nm", ".1e"), lambda row: 1e9 * row.greatest),
        ),
        "Negative: the follower would jam. The contours are splines through 3600 points.",
    )


def parts_table() -> DataTable:
    """What a cam file's ``contact`` is where it does not say."""
    return tabulate(
        "What is assumed of a contact where a cam file does not say",
        quantities(ContactParts(), ""),
        (
            (Head("number"), lambda row: row[0]),
            (Head("value"), lambda row: _shown(row[1])),
            (Head("origin"), lambda row: row[1].origin),
            (Head("source"), lambda row: row[1].source),
        ),
    )


def _shown(quantity: Quantity) -> str:
    unit = "" if quantity.unit == "1" else f" {quantity.unit}"
    return f"{quantity.numbers[0]:g}{unit}"


def to_json(found: ContactTable) -> dict[str, Any]:
    """Every row as plain data, SI units but for degrees and rpm."""
    return {
        "rig": found.rig,
        "rpm": found.rpm,
        "cams": {name: _entry(row) for name, row in found.rows.items()},
    }


def _entry(row: ContactRow) -> dict[str, Any]:
    surfaces = row.case.surfaces
    bounds = {f"{key}_m": _finite(value) for key, value in asdict(row.bounds).items()}
    return {
        "follower": row.case.cam.follower.type,
        "pressure_Pa": row.pressure.value,
        "pressure_at_deg": math.degrees(row.pressure.angle),
        "normal_force_N": row.load,
        "contact_width_m": row.width,
        "relative_radius_m": _finite(row.relative_radius),
        "sliding_speed_m_per_s": None if surfaces.rolls else row.sliding.value,
        "roller_speed_rpm": _roller(row),
        "contact_lost": row.lost,
        "base_radius_m": row.case.cam.follower.base_radius.si,
        "bounds": bounds,
        "feasible": row.bounds.feasible,
    }


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else value


# The report's figures, drawn as SVG and carried in the page itself.

#: Roller and least radius of the contour in the nomogram, in lifts.
SHARPEST = 2.0


# All findings of a report, and the jobs that compute them.

#: Speed of the contact study, rpm, and the cams besides the paper's: other kinds of follower.
CONTACT_RPM, CONTACT_CAMS = 300.0, ("flat", "oscillating_flat", "point")

#: Cams that move their follower both ways.
FORM_CLOSED = ("constant_breadth", "constant_diameter", "conjugate", "oscillating_conjugate")

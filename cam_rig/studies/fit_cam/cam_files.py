"""Cam file of a fitted spline with its table of points, and helpers for all cam files."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import islice
from typing import Any, NamedTuple

import numpy as np

from cam_rig.laws import Law, build_law
from cam_rig.profile.cam_checks import check_cam
from cam_rig.schema import CamConfig
from cam_rig.schema.load import quantity_data, to_yaml, validate_cam
from cam_rig.studies.fit_cam.arcs.contour import FollowerKind
from cam_rig.studies.fit_cam.dwells import DEGREE_DECIMALS
from cam_rig.studies.fit_cam.spline_fit import SplineFit
from cam_rig.units import TURN

#: Base radii, in multiples of the lift, that are tried in this order if the base radius is unknown.
#: The first whose contour passes all checks is used.
BASE_RADII_IN_LIFTS = (2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0, 30.0)
#: Assumed roller radius as a fraction of the base radius if it is unknown: a usual proportion.
ROLLER_PART = 0.3
#: Number of decimals of lengths in mm in a written file: 1 nm, below the step of any gauge.
MILLIMETRE_DECIMALS = 6
#: Text in a cam file that documents the source of an assumed radius.
FREE_CHOICE = "a free choice, not identifiable from the readings: replace it with the cam's radius"


@dataclass(frozen=True)
class CamFiles:
    """Cam with its law, and the text of each of its files by file name.

    `assumed` lists, as sentences, the assumptions that no reading supports.
    """

    cam: CamConfig
    law: Law
    texts: dict[str, str]
    assumed: tuple[str, ...]


class _Candidate(NamedTuple):
    """Cam with one of the possible base radii, and the result of its checks.

    ``radius`` is the base radius in m, ``data`` the content of the cam file. `passes` is True if
    the cam passes all checks.
    """

    radius: float
    data: dict[str, Any]
    cam: CamConfig
    law: Law
    passes: bool


def spline_cam(
    name: str,
    fit: SplineFit,
    kind: FollowerKind,
    base_radius: float | None = None,
    roller_radius: float | None = None,
) -> CamFiles:
    """Return the cam file of a fitted spline, and the table of its points.

    ``kind`` is the type of the follower. `base_radius` is in m. The default is the first of
    `BASE_RADII_IN_LIFTS` that passes the checks. `roller_radius` is in m. The default is the
    fraction `ROLLER_PART` of the base radius.
    """
    degrees = [float(f"{math.degrees(angle):.9g}") for angle in fit.readings.angles]
    points = {  # rounded as in the table of points, which is not written yet
        "file": f"{name}.csv",
        "angles": tuple(angle * (TURN / 360.0) for angle in degrees),
        "lifts": tuple(1e-3 * to_mm(lift) for lift in fit.readings.lifts),
    }

    def build(radius: float) -> _Candidate:
        base = radius_quantity(radius, base_radius is not None)
        roller = radius_quantity(roller_radius or ROLLER_PART * radius, roller_radius is not None)
        data = _spline_data(name, fit, follower_data(kind, base, roller))
        cam = validate_cam({**data, "segments": [{**data["segments"][0], "file": points}]})
        law = build_law(cam)
        passes = all(check.passed for check in check_cam(cam, law))
        return _Candidate(radius, data, cam, law, passes)

    candidates = (build(n * fit.law.lift) for n in BASE_RADII_IN_LIFTS)
    passing = (candidate for candidate in candidates if candidate.passes)
    if base_radius is None:
        best = next(passing, None) or build(BASE_RADII_IN_LIFTS[-1] * fit.law.lift)
    else:
        best = build(base_radius)
    assumed = [f"follower {kind}, and a gauge whose foot is of its shape"]
    assumed += assumed_radii(best.data["follower"])
    if not best.passes and base_radius is None:
        assumed.append("no base radius passes all checks: see cam-rig profile")
    elif not best.passes:
        other = "".join(f", {to_mm(better.radius):.4g} mm does" for better in islice(passing, 1))
        radius = f"the given base radius of {to_mm(best.radius):.4g} mm"
        assumed.append(f"{radius} does not pass all checks{other}: see cam-rig profile")
    source = f"{fit.readings.name}: the law is the spline of {name}.csv."
    texts = {
        f"{name}.yaml": cam_text(best.data, source, *fit.notes, assumed=assumed),
        f"{name}.csv": _points_table(fit),
    }
    return CamFiles(best.cam, best.law, texts, tuple(assumed))


def _spline_data(name: str, fit: SplineFit, follower: dict[str, Any]) -> dict[str, Any]:
    """Return the content of the cam file of a fitted spline as a dict.

    ``follower`` is its follower section, and ``name`` the name of the cam.
    """
    source = "spline through the readings"
    return {
        "name": name,
        "title": f"{name}, from readings",
        "lift": quantity_data("identified", to_mm(fit.law.lift), "mm", source, _residual(fit)),
        "follower": follower,
        "segments": [_table_segment(f"{name}.csv", fit)],
    }


def _table_segment(file: str, fit: SplineFit) -> dict[str, Any]:
    """Return the segment of a cam file that refers to the table of points.

    It also contains the tolerance of the spline and the dwells.
    """
    allowed = float(f"{fit.tolerance * 1e3:.9g}")
    if fit.followed:
        tolerance = quantity_data("given", allowed, "mm", "the gauge's error, as requested")
    else:
        source = f"scatter of the readings, {fit.scatter * 1e3:.3g} mm, and its error"
        if fit.widened:
            source = "the least that a spline with fewer knots than readings reaches"
        tolerance = quantity_data("identified", allowed, "mm", source, _residual(fit))
    segment: dict[str, Any] = {
        "law": "table",
        "span": quantity_data("given", 360, "deg", "readings all around"),
        "file": file,
        "source": fit.readings.name,
        "tolerance": tolerance,
    }
    dwells = []
    for dwell in fit.dwells:
        start, span, level = dwell.rest
        start, span = (round(math.degrees(angle), DEGREE_DECIMALS) for angle in (start, span))
        dwells.append(
            {
                "start": quantity_data("identified", start % 360.0, "deg", "found in the readings"),
                "span": quantity_data("identified", span, "deg", f"{dwell.count} readings rest"),
                "level": quantity_data("identified", to_mm(level), "mm", "their mean"),
            }
        )
    return {**segment, "dwells": dwells} if dwells else segment


def _points_table(fit: SplineFit) -> str:
    """Return the text of the table of points: angles in deg and lifts in mm.

    Comments list the zero of the gauge that was subtracted, changes to the readings, and outliers.
    """
    readings = fit.readings
    lines = [f"# {readings.name}, {to_mm(fit.zero):.6g} mm subtracted"]
    lines += [f"# {note}" for note in readings.notes]
    lines += [
        f"# excluded as an outlier: line {outlier.line}, {math.degrees(outlier.angle):.6g} deg, "
        f"{to_mm(outlier.lift):.6g} mm"
        for outlier in readings.outliers
    ]
    lines.append("angle_deg,lift_mm")
    degrees = np.degrees(readings.angles)
    lines += [f"{a:.9g},{to_mm(s)!r}" for a, s in zip(degrees, readings.lifts, strict=True)]
    return "\n".join(lines) + "\n"


def _residual(fit: SplineFit) -> str:
    """Return r.m.s. and largest residual of a spline as text for a cam file."""
    smoothed = fit.smoothed
    return f"{to_mm(smoothed.rms):.3g} mm r.m.s., {to_mm(smoothed.largest):.3g} mm at most"


# Helpers for all cam files.


def cam_text(data: dict[str, Any], *header: str, assumed: list[str]) -> str:
    """Return the text of a cam file, with a header and the assumptions as comments.

    ``header`` are the lines of the header. Unprintable characters of the comments are removed.
    ``data`` is the content of the file, and ``assumed`` are sentences on assumptions.
    """
    lines = [*header, *(f"assumed: {assumption}" for assumption in assumed)]
    comments = (f"# {''.join(c for c in line if c.isprintable())}\n" for line in lines)
    return "".join(comments) + to_yaml(data)


def follower_data(
    kind: FollowerKind, base: dict[str, Any], roller: dict[str, Any]
) -> dict[str, Any]:
    """Return the follower section of a cam file.

    ``base`` and ``roller`` are the radii as quantities. Only a roller has a roller radius.
    """
    data = {"type": kind, "base_radius": base}
    return {**data, "roller_radius": roller} if kind == "roller" else data


def assumed_radii(follower: dict[str, Any]) -> list[str]:
    """Return the assumed radii of a follower section as texts with names and units."""
    return [
        f"{key.replace('_', ' ')} {value['assumed']:.4g} mm"
        for key, value in follower.items()
        if "assumed" in value
    ]


def radius_quantity(radius: float, is_given: bool) -> dict[str, Any]:
    """Return a radius (m) as a quantity of a cam file, given or assumed.

    It is used for radii that do not follow from the readings.
    """
    if is_given:
        source = "an option of cam-rig, or stated in the table"
        return quantity_data("given", to_mm(radius), "mm", source)
    return quantity_data("assumed", to_mm(radius), "mm", FREE_CHOICE)


def to_mm(metres: float) -> float:
    """Convert a length from m to mm, rounded to the decimals of a file."""
    return round(float(metres) * 1e3, MILLIMETRE_DECIMALS)

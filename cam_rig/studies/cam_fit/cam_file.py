"""A fit as a cam file of the rig, with its points where it has some."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.laws import Law, build_law
from cam_rig.profile.checks.all_checks import check_cam
from cam_rig.schema import CamConfig
from cam_rig.studies.cam_fit.dwells import DEGREES
from cam_rig.studies.cam_fit.spline_fit import SplineFit
from cam_rig.units import TURN

FollowerKind = Literal["roller", "flat", "point"]
#: A base radius is sought in lifts, the first that passes the checks of the contour.
BASE_RADII_IN_LIFTS = (2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0, 30.0)
#: A roller is as large as this part of the base radius.
ROLLER_PART = 0.3
#: Decimals of lengths in mm of a file.
MILLIMETRES = 6
FREE_CHOICE = "a free choice, the readings do not tell it: replace it by the cam's own"


@dataclass(frozen=True)
class CamFiles:
    """A cam and the text of each of its files by name; ``assumed`` says what no reading tells."""

    cam: CamConfig
    law: Law
    texts: dict[str, str]
    assumed: tuple[str, ...]


def quantity(
    origin: str, value: float | list[float], unit: str, source: str, residual: str = ""
) -> dict[str, Any]:
    """A number as the rig's files have it."""
    words = {"residual": residual} if residual else {}
    return {origin: value, "unit": unit, "source": source, **words}


def spline_cam(
    name: str,
    fit: SplineFit,
    kind: FollowerKind,
    base_radius: float | None = None,
    roller_radius: float | None = None,
    notes: tuple[str, ...] = (),
) -> CamFiles:
    """The cam file of a spline, and its points.

    Parameters
    ----------
    base_radius : m; None takes the first that passes the checks, from two lifts on
    roller_radius : m; None takes a part of the base radius
    notes : how the readings were read, for the file's first lines

    Raises
    ------
    ConfigError : the name is not one
    """
    table = _table_segment(f"{name}.csv", fit)
    points = {"file": f"{name}.csv", **_points(fit)}
    radii = [base_radius] if base_radius else [n * fit.law.lift for n in BASE_RADII_IN_LIFTS]
    for radius in radii:
        data = {
            "name": name,
            "title": f"{name}, from readings",
            "lift": quantity(
                "identified", _mm(fit.law.lift), "mm", "spline through the readings", _distance(fit)
            ),
            "follower": follower_data(
                kind,
                chosen(radius, base_radius is not None),
                chosen(roller_radius or ROLLER_PART * radius, roller_radius is not None),
            ),
            "segments": [table],
        }
        cam = valid_cam({**data, "segments": [{**table, "file": points}]})
        law = build_law(cam)
        passes = all(check.passed for check in check_cam(cam, law))
        if passes:
            break
    assumed = [f"follower {kind}, and a gauge whose foot is of its shape"]
    if base_radius is None:
        first = ", the first to pass the checks" if passes else ""
        assumed.append(f"base radius {_mm(radius):.4g} mm{first}")
    if kind == "roller" and roller_radius is None:
        assumed.append(f"roller radius {_mm(ROLLER_PART * radius):.4g} mm")
    if not passes:
        assumed.append("no base radius passes all checks: see cam-rig profile")
    header = comments(f"{fit.readings.name}: the law is the spline of {name}.csv.", *notes)
    header += comments(*(f"assumed: {words}" for words in assumed))
    texts = {f"{name}.yaml": header + to_yaml(data), f"{name}.csv": _csv(fit)}
    return CamFiles(cam, law, texts, tuple(assumed))


def comments(*lines: str) -> str:
    """The first lines of a file."""
    return "".join(f"# {''.join(c for c in line if c.isprintable())}\n" for line in lines)


def to_yaml(data: dict[str, Any]) -> str:
    """A file of the rig: a number is one line, and so is a follower's or a segment's key."""
    return "\n".join(_lines(data, 0)) + "\n"


def _lines(data: dict[str, Any], indent: int) -> list[str]:
    space, out = " " * indent, []
    for key, value in data.items():
        if isinstance(value, dict) and "unit" not in value:
            out += [f"{space}{key}:", *_lines(value, indent + 2)]
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            out.append(f"{space}{key}:")
            for item in value:
                first, *rest = _lines(item, indent + 4)
                out += [f"{space}  - {first.lstrip()}", *rest]
        else:
            out.append(f"{space}{key}: {_flow(value)}")
    return out


def _flow(value: Any) -> str:
    """A value in one line; JSON's texts are YAML's."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, str) and value.replace("_", "").isalnum() and not value[0].isdigit():
        return value
    return json.dumps(value, ensure_ascii=False)


def valid_cam(data: dict[str, Any]) -> CamConfig:
    """The cam that a file of this content has.

    Raises
    ------
    ConfigError : something in it is wrong
    """
    from pydantic import ValidationError

    from cam_rig.schema.explain import explain

    try:
        return CamConfig.model_validate(data)
    except ValidationError as error:
        raise ConfigError(f"{data['name']}: {explain(error, CamConfig)}") from None


def follower_data(
    kind: FollowerKind, base: dict[str, Any], roller: dict[str, Any]
) -> dict[str, Any]:
    """A follower as a cam's file has it."""
    data = {"type": kind, "base_radius": base}
    return {**data, "roller_radius": roller} if kind == "roller" else data


def chosen(radius: float, asked: bool) -> dict[str, Any]:
    """A radius that no reading tells: the one asked for, or a free choice."""
    if asked:
        return quantity("given", _mm(radius), "mm", "as asked of cam-rig")
    return quantity("assumed", _mm(radius), "mm", FREE_CHOICE)


def _table_segment(file: str, fit: SplineFit) -> dict[str, Any]:
    allowed = float(f"{fit.tolerance * 1e3:.9g}")
    if fit.followed:
        tolerance = quantity("given", allowed, "mm", "the gauge's error, as asked")
    else:
        source = f"scatter of the readings, {fit.scatter * 1e3:.3g} mm, and its error"
        if fit.widened:
            source = "the least that a spline with fewer knots than readings reaches"
        tolerance = quantity("identified", allowed, "mm", source, _distance(fit))
    segment: dict[str, Any] = {
        "law": "table",
        "span": quantity("given", 360, "deg", "readings all around"),
        "file": file,
        "source": fit.readings.name,
        "tolerance": tolerance,
    }
    if fit.dwells:
        segment["dwells"] = [
            {
                "start": quantity("identified", start, "deg", "found in the readings"),
                "span": quantity("identified", span, "deg", f"{dwell.count} readings rest"),
                "level": quantity("identified", _mm(dwell.rest.level), "mm", "their mean"),
            }
            for dwell, start, span in zip(fit.dwells, *_angles(fit), strict=True)
        ]
    return segment


def _angles(fit: SplineFit) -> tuple[list[float], list[float]]:
    """Start and span of each dwell, deg, as the file has them."""
    starts = [round(math.degrees(dwell.rest.start), DEGREES) % 360.0 for dwell in fit.dwells]
    return starts, [round(math.degrees(dwell.rest.span), DEGREES) for dwell in fit.dwells]


def _points(fit: SplineFit) -> dict[str, tuple[float, ...]]:
    """The points as the file's reader will have them."""
    degrees = [float(f"{math.degrees(angle):.9g}") for angle in fit.readings.angles]
    lifts = [_mm(lift) for lift in fit.readings.lifts]
    return {
        "angles": tuple(angle * (TURN / 360.0) for angle in degrees),
        "lifts": tuple(1e-3 * lift for lift in lifts),
    }


def _csv(fit: SplineFit) -> str:
    kept = fit.readings
    lines = [f"# {kept.name}, {_mm(fit.zero):.6g} mm subtracted"]
    lines += [f"# {note}" for note in kept.notes]
    lines += [
        f"# left out, an outlier: line {outlier.line}, {math.degrees(outlier.angle):.6g} deg, "
        f"{_mm(outlier.lift):.6g} mm"
        for outlier in kept.outliers
    ]
    lines.append("angle_deg,lift_mm")
    degrees = np.degrees(kept.angles)
    lines += [f"{a:.9g},{_mm(s)!r}" for a, s in zip(degrees, kept.lifts, strict=True)]
    return "\n".join(lines) + "\n"


def _distance(fit: SplineFit) -> str:
    found = fit.smoothed
    return f"{_mm(found.rms):.3g} mm r.m.s., {_mm(found.largest):.3g} mm at most"


def _mm(metres: float) -> float:
    return round(float(metres) * 1e3, MILLIMETRES)

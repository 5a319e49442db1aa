"""A fit as a cam file of the rig, with its points where it has some."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.jump_speed import rigid_jump_speed
from cam_rig.laws import Law, build_law
from cam_rig.measured.cam_fit.arcs import FollowerKind
from cam_rig.measured.cam_fit.dwells import DEGREES
from cam_rig.measured.cam_fit.spline_fit import SplineFit
from cam_rig.profile.check_table import check_cam
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.load import assumed_numbers, quantity, to_yaml, valid_cam
from cam_rig.units import TURN, to_rpm

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


def spline_cam(
    name: str,
    fit: SplineFit,
    kind: FollowerKind,
    base_radius: float | None = None,
    roller_radius: float | None = None,
) -> CamFiles:
    """The cam file of a spline, and its points.

    ``base_radius``: m; None takes the first that passes the checks, from two lifts on;
    ``roller_radius``: m; None takes a part of the base radius.
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
    header = comments(f"{fit.readings.name}: the law is the spline of {name}.csv.", *fit.notes)
    header += comments(*(f"assumed: {words}" for words in assumed))
    texts = {f"{name}.yaml": header + to_yaml(data), f"{name}.csv": _csv(fit)}
    return CamFiles(cam, law, texts, tuple(assumed))


def comments(*lines: str) -> str:
    """The first lines of a file."""
    return "".join(f"# {''.join(c for c in line if c.isprintable())}\n" for line in lines)


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


# A rig and a scene for a cam of one's own: they run as they are, and say what they assume.

#: Speeds of the scene in parts of the rigid follower's jump speed: the last is above it.
PARTS = (0.4, 0.6, 0.8, 0.9, 1.1)

#: Speeds (rpm) of a cam that no speed lifts its follower off, and the most of any.
SPEEDS, MOST_RPM = (100.0, 200.0, 300.0), 20_000.0

#: Samples a turn at the highest speed, at least, and of any scene a second.
SAMPLES, LEAST_RATE = 720, 10_000


def own_rig(name: str, like: RigConfig) -> str:
    """A rig file with the numbers of another rig, every one of them assumed."""
    data: dict[str, Any] = {"name": name, "title": f"{name}: mass, spring and sound assumed"}
    source = f"the rig {like.name}'s, not this one's: measure it and put it in as given"
    for section, own in (("follower", like.follower), ("radiation", like.radiation)):
        if own is not None:
            data[section] = assumed_numbers(own, source)
    words = "# Nothing of this rig was measured: its numbers are another's, to begin with.\n"
    return words + to_yaml(data)


def own_scene(name: str, law: Law, rig: RigConfig) -> tuple[str, tuple[float, ...]]:
    """A scene file for a cam and a rig of one name, and its speeds in rpm."""
    speeds = own_speeds(law, rig)
    rate = max(LEAST_RATE, 1000 * math.ceil(SAMPLES * max(speeds) / 60.0 / 1000.0))
    jump = to_rpm(rigid_jump_speed(law, FollowerParameters.from_rig(rig)))
    above = (
        f"40 to 110 % of the speed at which a rigid follower leaves the cam, {jump:.4g} rpm"
        if math.isfinite(jump)
        else "a rigid follower never leaves the cam"
    )
    turns, settle = "one turn to settle, two to measure", "one turn to settle"
    data = {
        "name": name,
        "title": f"{name}, from readings",
        "cams": [name],
        "rig": name,
        "model": "one_mass",
        "sample_rate": quantity("assumed", rate, "Hz", f"at least {SAMPLES} samples a turn"),
        "program": {
            "speeds": quantity("assumed", list(speeds), "rpm", above),
            "turns": quantity("assumed", 3, "turns", turns),
            "settle_turns": quantity("assumed", 1, "turns", settle),
        },
    }
    return to_yaml(data), speeds


def own_speeds(law: Law, rig: RigConfig) -> tuple[float, ...]:
    """Rising speeds (rpm) of two digits, about the one at which a rigid follower leaves the cam."""
    jump = to_rpm(rigid_jump_speed(law, FollowerParameters.from_rig(rig)))
    if not math.isfinite(jump):
        return SPEEDS
    rounded = {float(f"{min(part * jump, MOST_RPM):.2g}") for part in PARTS}
    return tuple(sorted(rounded))

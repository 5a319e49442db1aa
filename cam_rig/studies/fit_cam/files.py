"""Files of a fitted cam: cam file, table of points, rig file and scene file."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.errors import ConfigError, LawError
from cam_rig.laws import Law, build_law
from cam_rig.profile.cam_checks import check_cam
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.load import assumed_numbers, quantity_data, to_yaml, validate_cam
from cam_rig.studies.fit_cam.arcs import FLANK, LIFT, NOSE, PRIME, Arcs, FollowerKind
from cam_rig.studies.fit_cam.arcs_fit import ArcsFit
from cam_rig.studies.fit_cam.arcs_intervals import Told
from cam_rig.studies.fit_cam.dwells import DEGREES, FoundDwell
from cam_rig.studies.fit_cam.spline_fit import SplineFit
from cam_rig.units import TURN, round_to_error, to_rpm

#: Base radii, as multiples of the lift, that are tried in this order. The first whose contour
#: passes the checks is taken.
BASE_RADII_IN_LIFTS = (2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0, 30.0)
#: Assumed roller radius, as a fraction of the base radius.
ROLLER_PART = 0.3
#: Number of decimals of lengths in mm in a file.
MILLIMETRES = 6
FREE_CHOICE = "a free choice, the readings do not tell it: replace it by the cam's own"


@dataclass(frozen=True)
class CamFiles:
    """A cam, its law, and the text of each of its files by file name.

    `assumed` lists the assumptions that no reading supports.
    """

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
    """Return the cam file of a spline, and the table of its points.

    `base_radius` is in m. The default is the first of `BASE_RADII_IN_LIFTS` that passes the checks.
    `roller_radius` is in m. The default is the fraction `ROLLER_PART` of the base radius.
    """
    table = _table_segment(f"{name}.csv", fit)
    points = {"file": f"{name}.csv", **_points(fit)}

    def tried(radius: float) -> tuple[dict[str, Any], CamConfig, Law, bool]:
        rolling = chosen(roller_radius or ROLLER_PART * radius, roller_radius is not None)
        data = {
            "name": name,
            "title": f"{name}, from readings",
            "lift": quantity_data(
                "identified", _mm(fit.law.lift), "mm", "spline through the readings", _distance(fit)
            ),
            "follower": follower_data(kind, chosen(radius, base_radius is not None), rolling),
            "segments": [table],
        }
        cam = validate_cam({**data, "segments": [{**table, "file": points}]})
        law = build_law(cam)
        return data, cam, law, all(check.passed for check in check_cam(cam, law))

    radii = [n * fit.law.lift for n in BASE_RADII_IN_LIFTS]
    passing = (one for one in radii if tried(one)[-1])
    radius = next(passing, radii[-1]) if base_radius is None else base_radius
    data, cam, law, passes = tried(radius)
    assumed = [f"follower {kind}, and a gauge whose foot is of its shape"]
    if base_radius is None:
        first = ", the first to pass the checks" if passes else ""
        assumed.append(f"base radius {_mm(radius):.4g} mm{first}")
    if kind == "roller" and roller_radius is None:
        assumed.append(f"roller radius {_mm(ROLLER_PART * radius):.4g} mm")
    if not passes and base_radius is None:
        assumed.append("no base radius passes all checks: see cam-rig profile")
    elif not passes:
        better = next(passing, None)
        other = "" if better is None else f", {_mm(better):.4g} mm does"
        words = f"the base radius of {_mm(radius):.4g} mm, as asked, does not pass all checks"
        assumed.append(f"{words}{other}: see cam-rig profile")
    header = comments(f"{fit.readings.name}: the law is the spline of {name}.csv.", *fit.notes)
    header += comments(*(f"assumed: {words}" for words in assumed))
    texts = {f"{name}.yaml": header + to_yaml(data), f"{name}.csv": _csv(fit)}
    return CamFiles(cam, law, texts, tuple(assumed))


def comments(*lines: str) -> str:
    """Return lines of text as comments of a YAML file.

    Unprintable characters are removed.
    """
    return "".join(f"# {''.join(c for c in line if c.isprintable())}\n" for line in lines)


def follower_data(
    kind: FollowerKind, base: dict[str, Any], roller: dict[str, Any]
) -> dict[str, Any]:
    """Return the follower section of a cam file. Only a roller has a roller radius."""
    data = {"type": kind, "base_radius": base}
    return {**data, "roller_radius": roller} if kind == "roller" else data


def chosen(radius: float, asked: bool) -> dict[str, Any]:
    """Return a radius (m) as a quantity of a file, with its origin.

    The radius does not follow from the readings. Its origin is ``given`` if `asked` is
    True, otherwise ``assumed``.
    """
    if asked:
        return quantity_data(
            "given", _mm(radius), "mm", "an option of cam-rig, or stated in the table"
        )
    return quantity_data("assumed", _mm(radius), "mm", FREE_CHOICE)


def _table_segment(file: str, fit: SplineFit) -> dict[str, Any]:
    allowed = float(f"{fit.tolerance * 1e3:.9g}")
    if fit.followed:
        tolerance = quantity_data("given", allowed, "mm", "the gauge's error, as asked")
    else:
        source = f"scatter of the readings, {fit.scatter * 1e3:.3g} mm, and its error"
        if fit.widened:
            source = "the least that a spline with fewer knots than readings reaches"
        tolerance = quantity_data("identified", allowed, "mm", source, _distance(fit))
    segment: dict[str, Any] = {
        "law": "table",
        "span": quantity_data("given", 360, "deg", "readings all around"),
        "file": file,
        "source": fit.readings.name,
        "tolerance": tolerance,
    }
    if fit.dwells:
        segment["dwells"] = [_dwell(dwell) for dwell in fit.dwells]
    return segment


def _dwell(dwell: FoundDwell) -> dict[str, Any]:
    start, span = (round(math.degrees(x), DEGREES) for x in (dwell.rest.start, dwell.rest.span))
    return {
        "start": quantity_data("identified", start % 360.0, "deg", "found in the readings"),
        "span": quantity_data("identified", span, "deg", f"{dwell.count} readings rest"),
        "level": quantity_data("identified", _mm(dwell.rest.level), "mm", "their mean"),
    }


def _points(fit: SplineFit) -> dict[str, tuple[float, ...]]:
    """Return angles (rad) and lifts (m), rounded as the table of points contains them."""
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


# Cam file of tangent arcs. Each number has as many digits as the readings determine.

#: Largest change of the contour by rounding, as a fraction of the error of a reading, and number of
#: attempts to stay below it, each with one more digit. The standard errors alone do not determine
#: the number of digits, because the errors of radii are correlated.
MOVED, MOST_DIGITS = 0.1, 6


def arcs_cam(name: str, fit: ArcsFit, kind: FollowerKind) -> CamFiles:
    """Return the cam file of tangent arcs, with a follower of type `kind`."""
    arcs, roller = _rounded(fit)
    source = "tangent arcs through " + " and ".join(
        column.readings.name for column in fit.fitted_columns
    )
    residual = ", ".join(f"{c.rms * 1e3:.3g} mm r.m.s. {c.kind}" for c in fit.fitted_columns)

    def found(metres: float, told: Told) -> dict[str, Any]:
        interval = told.interval
        words = f"95 %: {told.name} {interval}; {residual}" if interval else residual
        return quantity_data("identified", float(f"{1e3 * metres:.12g}"), "mm", source, words)

    segment = {
        "law": "arcs_by_radii",
        "span": quantity_data("given", 360, "deg", "the whole contour"),
        "flank": arcs.flank,
        "nose_radius": found(arcs.nose_radius, fit.told[NOSE]),
    }
    if arcs.flank_radius is not None:
        segment["flank_radius"] = found(abs(arcs.flank_radius), fit.told[FLANK])
    follower = follower_data(kind, *_radii(fit, arcs.base_radius, roller, found))
    assumed = [
        f"{key.replace('_', ' ')} {value['assumed']:.4g} mm"
        for key, value in follower.items()
        if "assumed" in value
    ]
    data = {
        "name": name,
        "title": f"{name}, tangent arcs through readings",
        "lift": found(arcs.lift, fit.told[LIFT]),
        "follower": follower,
        "segments": [segment],
    }
    cam = validate_cam(data)
    nose = math.degrees(arcs.nose_angle) % 360.0
    at_nose = f"Cam angle 180 deg, the nose, is {nose:.2f} deg of the readings."
    header = comments(
        f"{source}.", at_nose, *fit.notes, *(f"assumed: {words}" for words in assumed)
    )
    return CamFiles(cam, build_law(cam), {f"{name}.yaml": header + to_yaml(data)}, tuple(assumed))


def _radii(
    fit: ArcsFit, base: float, roller: float, found: Any
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return base and roller radius (m) as quantities: given, assumed or identified.

    The readings determine only the sum of the two, so a given base radius identifies the roller.
    """
    base_given, roller_given = (fit.known in (one, "both") for one in ("base", "roller"))
    prime = fit.told[PRIME]
    base_data = chosen(base, base_given) if base_given or fit.only_flat else found(base, prime)
    if base_given and not roller_given and not fit.only_flat:
        return base_data, found(roller, prime)
    return base_data, chosen(roller, roller_given)


def _rounded(fit: ArcsFit) -> tuple[Arcs, float]:
    """Return the rounded contour and roller radius (m).

    The number of digits is the smallest for which rounding has almost no effect on the fit.
    """
    search = fit.best.search
    for more in range(MOST_DIGITS):
        arcs, roller = _with_digits(fit, 10.0**-more)
        numbers = search.form.coordinates(arcs.grown(roller))
        with suppress(LawError):
            held = replace(search, held=dict(enumerate(numbers)), least=0.0)
            squares = float(np.sum(held.away(np.array([])) ** 2))
            if fit.best.away(squares) < MOVED:
                return arcs, roller
    return fit.arcs, fit.roller_radius


def _with_digits(fit: ArcsFit, part: float) -> tuple[Arcs, float]:
    """Return contour and roller radius (m), rounded according to their errors.

    The last digit is the second digit of the standard error times `part`. Given radii are not
    rounded.
    """
    exact, told = fit.arcs, fit.told

    def to(metres: float, number: Told) -> float:
        error = 1e3 * part * number.error
        if not math.isfinite(error):  # undetermined: four digits if `part` is 1
            error = part * 10.0 ** (math.floor(math.log10(abs(1e3 * metres))) - 2)
        return 1e-3 * float(round_to_error(1e3 * metres, error))

    flank = None if exact.flank_radius is None else to(exact.flank_radius, told[FLANK])
    base, roller = exact.base_radius, fit.roller_radius
    if fit.known == "base" and not fit.only_flat:
        roller = to(roller, told[PRIME])
    elif not told[PRIME].held:
        base = to(base, told[PRIME])
    nose = to(exact.nose_radius, told[NOSE])
    return Arcs(base, to(exact.lift, told[LIFT]), flank, nose, exact.nose_angle), roller


def require_told(fit: ArcsFit, named: bool) -> None:
    """Raise ConfigError if follower type or base radius is undetermined.

    `named` is True if the types of the followers are given. A base radius that is given or assumed
    is not checked.
    """
    unclear = fit.unclear_kinds
    if unclear is not None and not named:
        found, other = fit.best.search.name, unclear.search.name
        several = ", once for each column" if len(fit.fitted_columns) > 1 else ""
        raise ConfigError(
            f"the readings do not tell the follower: {found} leaves {fit.rms * 1e3:.3g} mm r.m.s., "
            f"{other} {unclear.rms * 1e3:.3g} mm; allowed: --follower roller, flat or point"
            f"{several}"
        )
    prime = fit.prime_if_straight or fit.told[PRIME]
    if not (prime.held or math.isfinite(prime.high)):
        rolling = " and --roller-radius" if fit.roller_radius else ""
        raise ConfigError(
            f"lifts alone do not tell the base radius: {prime.name} is {prime.interval} "
            f"with 95 %; allowed: --base-radius{rolling}, or readings of a flat follower too"
        )


# Rig and scene for a new cam. They run without changes, and their files list the assumptions.

#: Speeds of the scene as fractions of the jump speed of a rigid follower. The last is above it.
PARTS = (0.4, 0.6, 0.8, 0.9, 1.1)
#: Speeds (rpm) if a rigid follower leaves the cam at every speed or never, and the largest speed
#: (rpm) of any scene.
SPEEDS: tuple[float, ...] = (100.0, 200.0, 300.0)
MOST_RPM = 20_000.0
#: Smallest number of samples per turn at the highest speed, and smallest sample rate, Hz.
SAMPLES, LEAST_RATE = 720, 10_000


def default_rig(name: str, like: RigConfig) -> str:
    """Return a rig file with the numbers of the rig `like`, marked as assumed."""
    data: dict[str, Any] = {"name": name, "title": f"{name}: mass, spring and sound assumed"}
    source = f"the rig {like.name}'s, not this one's: measure it and put it in as given"
    for section, own in (("follower", like.follower), ("radiation", like.radiation)):
        if own is not None:
            data[section] = assumed_numbers(own, source)
    words = "# Nothing of this rig was measured: its numbers are another's, to begin with.\n"
    return words + to_yaml(data)


def own_scene(name: str, law: Law, rig: RigConfig) -> tuple[str, tuple[float, ...]]:
    """Return a scene file and its speeds in rpm.

    The cam and the rig of the scene are called `name`. Speeds that follow from the jump
    speed have two significant digits.
    """
    jump = to_rpm(rigid_jump_speed(law, FollowerParameters.from_rig(rig)))
    leaves = "never leaves the cam" if jump else "leaves the cam at any speed"
    speeds, above = SPEEDS, f"a rigid follower {leaves}"
    if 0.0 < jump < math.inf:
        speeds = tuple(sorted({float(f"{min(part * jump, MOST_RPM):.2g}") for part in PARTS}))
        above = f"40 to 110 % of the speed at which a rigid follower leaves the cam, {jump:.4g} rpm"
    rate = max(LEAST_RATE, 1000 * math.ceil(SAMPLES * max(speeds) / 60.0 / 1000.0))
    turns, settle = "one turn to settle, two to measure", "one turn to settle"
    data = {
        "name": name,
        "title": f"{name}, from readings",
        "cams": [name],
        "rig": name,
        "model": "one_mass",
        "sample_rate": quantity_data("assumed", rate, "Hz", f"at least {SAMPLES} samples a turn"),
        "schedule": {
            "speeds": quantity_data("assumed", list(speeds), "rpm", above),
            "turns": quantity_data("assumed", 3, "turns", turns),
            "transient_turns": quantity_data("assumed", 1, "turns", settle),
        },
    }
    return to_yaml(data), speeds

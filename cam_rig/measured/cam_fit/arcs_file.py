"""A contour of tangent arcs as a cam file, each number to the digits that readings tell."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cam_rig.errors import ConfigError, LawError
from cam_rig.laws import build_law
from cam_rig.measured.cam_fit.arcs import FLANK, LIFT, NOSE, PRIME, Arcs, FollowerKind, Form
from cam_rig.measured.cam_fit.arcs_intervals import Told
from cam_rig.measured.cam_fit.arcs_result import ArcsFit
from cam_rig.measured.cam_fit.files import CamFiles, chosen, comments, follower_data
from cam_rig.schema.load import quantity, to_yaml, valid_cam
from cam_rig.units import FloatArray, rounded_to_error

#: Rounding moves a contour by so much of the error of a reading at most, and has so many digits
#: more than the errors tell where it needs them: errors of radii go together.
MOVED, MOST_DIGITS = 0.1, 6


def arcs_cam(name: str, fit: ArcsFit, kind: FollowerKind) -> CamFiles:
    """The cam file of a contour of tangent arcs, with a follower on it."""
    arcs, roller = _rounded(fit)
    source = "tangent arcs through " + " and ".join(
        column.readings.name for column in fit.fitted_columns
    )
    residual = ", ".join(f"{c.rms * 1e3:.3g} mm r.m.s. {c.kind}" for c in fit.fitted_columns)

    def found(metres: float, told: Told) -> dict[str, Any]:
        interval = told.interval
        words = f"95 %: {told.name} {interval}; {residual}" if interval else residual
        return quantity("identified", _mm(metres), "mm", source, words)

    segment = {
        "law": "arcs_by_radii",
        "span": quantity("given", 360, "deg", "the whole contour"),
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
    cam = valid_cam(data)
    nose = math.degrees(arcs.nose_angle) % 360.0
    at_nose = f"Cam angle 180 deg, the nose, is {nose:.2f} deg of the readings."
    header = comments(
        f"{source}.", at_nose, *fit.notes, *(f"assumed: {words}" for words in assumed)
    )
    return CamFiles(cam, build_law(cam), {f"{name}.yaml": header + to_yaml(data)}, tuple(assumed))


def _radii(
    fit: ArcsFit, base: float, roller: float, found: Any
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Base and roller radius (m): given, assumed, or identified as what their sum leaves."""
    base_given, roller_given = (fit.known in (one, "both") for one in ("base", "roller"))
    prime = fit.told[PRIME]
    base_data = chosen(base, base_given) if base_given or fit.only_flat else found(base, prime)
    if base_given and not roller_given and not fit.only_flat:
        return base_data, found(roller, prime)
    return base_data, chosen(roller, roller_given)


def _rounded(fit: ArcsFit) -> tuple[Arcs, float]:
    """The contour and its roller's radius (m), to the digits of their errors.

    More digits are kept until the rounded contour is as near to the readings.
    """
    exact, roller = fit.arcs, fit.roller_radius
    for more in range(MOST_DIGITS):
        arcs, rolling = _with_digits(fit, 10.0**-more)
        try:
            squares = float(np.sum(_away(fit, arcs, rolling) ** 2))
        except LawError:
            continue
        if fit.best.away(squares) < MOVED:
            return arcs, rolling
    return exact, roller


def _with_digits(fit: ArcsFit, part: float) -> tuple[Arcs, float]:
    """All lengths to the second digit of a part of their errors; what was given stands."""
    exact, told = fit.arcs, fit.told

    def to(metres: float, number: Told) -> float:
        error = 1e3 * part * number.error
        if not math.isfinite(error):  # hardly told: by what rounding to four digits leaves
            error = part * 10.0 ** (math.floor(math.log10(abs(1e3 * metres))) - 2)
        return 1e-3 * float(rounded_to_error(1e3 * metres, error))

    flank = None if exact.flank_radius is None else to(exact.flank_radius, told[FLANK])
    base, roller = exact.base_radius, fit.roller_radius
    if fit.known == "base" and not fit.only_flat:
        roller = to(roller, told[PRIME])
    elif not told[PRIME].held:
        base = to(base, told[PRIME])
    nose = to(exact.nose_radius, told[NOSE])
    return Arcs(base, to(exact.lift, told[LIFT]), flank, nose, exact.nose_angle), roller


def _away(fit: ArcsFit, arcs: Arcs, roller: float) -> FloatArray:
    """Residuals (m) of all readings from another contour under another roller."""
    form = Form(roller, fit.best.search.form.sums)
    held = dict(enumerate(form.coordinates(arcs)))
    search = fit.best.search.of(form, held)
    return search.away(np.array([]))


def _mm(metres: float) -> float:
    return float(f"{1e3 * metres:.12g}")


def require_told(fit: ArcsFit, named: bool) -> None:
    """Refuse to write what no reading tells and nobody has given; ``named``: the followers are."""
    unclear = fit.unclear_kinds
    if unclear is not None and not named:
        found, several = fit.best.search.named(), len(fit.fitted_columns) > 1
        raise ConfigError(
            f"the readings do not tell the follower: {found} leaves {fit.rms * 1e3:.3g} mm r.m.s., "
            f"{unclear.name} {unclear.rms * 1e3:.3g} mm; allowed: --follower roller, flat or point"
            f"{', once for each column' if several else ''}"
        )
    if not fit.base_is_told:
        prime = fit.told[PRIME]
        rolling = " and --roller-radius" if fit.roller_radius else ""
        raise ConfigError(
            f"lifts alone do not tell the base radius: {prime.name} is {prime.interval} "
            f"with 95 %; allowed: --base-radius{rolling}, or readings of a flat follower too"
        )

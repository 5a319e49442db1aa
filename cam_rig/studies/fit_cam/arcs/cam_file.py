"""Cam file of fitted tangent arcs, rounded to the digits that the readings determine."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from cam_rig.errors import ConfigError, LawError
from cam_rig.laws import build_law
from cam_rig.schema.load import quantity_data, validate_cam
from cam_rig.studies.fit_cam.arcs.contour import Arcs, FollowerKind, Parameter
from cam_rig.studies.fit_cam.arcs.intervals import ParameterInterval
from cam_rig.studies.fit_cam.arcs.result import ArcsFit
from cam_rig.studies.fit_cam.cam_files import (
    CamFiles,
    assumed_radii,
    cam_text,
    follower_data,
    radius_quantity,
)
from cam_rig.units import round_to_error

#: Largest allowed effect of rounding the parameters: the distance of the rounded contour from the
#: best, in standard errors of a reading (see `Profile.distance`). The standard errors of the
#: parameters alone do not determine the number of digits, because the errors of the radii are
#: correlated.
MAX_ROUNDING_DISTANCE = 0.1
#: Largest number of digits that are added, one by one, to the digits that follow from the standard
#: errors.
MAX_ADDED_DIGITS = 6


def arcs_cam(name: str, fit: ArcsFit, kind: FollowerKind) -> CamFiles:
    """Return the files of a cam with fitted tangent arcs.

    ``name`` is the name of the cam, and `kind` the type of its follower.
    """
    arcs, roller = _round_contour(fit)
    columns, intervals = fit.fitted_columns, fit.intervals
    source = f"tangent arcs through {' and '.join(column.readings.name for column in columns)}"
    residuals = ", ".join(f"{c.rms * 1e3:.3g} mm r.m.s. {c.kind}" for c in columns)

    def identified(metres: float, parameter: Parameter) -> dict[str, Any]:
        name, interval = intervals[parameter].name, intervals[parameter].interval_text
        residual = f"95 %: {name} {interval}; {residuals}" if interval else residuals
        return quantity_data("identified", float(f"{1e3 * metres:.12g}"), "mm", source, residual)

    # Lifts of a roller determine only the sum of base and roller radius.
    base_given, roller_given = (fit.given_radii in (key, "both") for key in ("base", "roller"))
    base_data = identified(arcs.base_radius, Parameter.PRIME)
    roller_data = radius_quantity(roller, roller_given)
    if base_given or fit.only_flat:
        base_data = radius_quantity(arcs.base_radius, base_given)
        if not roller_given and not fit.only_flat:
            roller_data = identified(roller, Parameter.PRIME)
    segment = {
        "law": "arcs_by_radii",
        "span": quantity_data("given", 360, "deg", "the whole contour"),
        "flank": arcs.flank,
        "nose_radius": identified(arcs.nose_radius, Parameter.NOSE),
    }
    if arcs.flank_radius is not None:
        segment["flank_radius"] = identified(abs(arcs.flank_radius), Parameter.FLANK)
    follower = follower_data(kind, base_data, roller_data)
    assumed = assumed_radii(follower)
    data = {
        "name": name,
        "title": f"{name}, tangent arcs through readings",
        "lift": identified(arcs.lift, Parameter.LIFT),
        "follower": follower,
        "segments": [segment],
    }
    cam = validate_cam(data)
    nose = math.degrees(arcs.nose_angle) % 360.0
    at_nose = f"Cam angle 180 deg, the nose, is {nose:.2f} deg of the readings."
    text = cam_text(data, f"{source}.", at_nose, *fit.notes, assumed=assumed)
    return CamFiles(cam, build_law(cam), {f"{name}.yaml": text}, tuple(assumed))


def _round_contour(fit: ArcsFit) -> tuple[Arcs, float]:
    """Return the fitted contour and the roller radius (m), rounded for a cam file.

    The number of digits is the smallest with which rounding has almost no effect on the fit.
    """
    search = fit.best.search
    for added_digits in range(MAX_ADDED_DIGITS):
        arcs, roller = _round_to_errors(fit, 10.0**-added_digits)
        coordinates = search.coordinates.of(arcs.offset(roller))
        fixed = dict(zip(Parameter, coordinates.tolist(), strict=True))
        with suppress(LawError):
            sse = replace(search, fixed=fixed, min_radius=0.0).sse(np.array([]))
            if fit.best.distance(sse) < MAX_ROUNDING_DISTANCE:
                return arcs, roller
    return fit.arcs, fit.roller_radius


def _round_to_errors(fit: ArcsFit, fraction: float) -> tuple[Arcs, float]:
    """Return contour and roller radius (m), rounded to their standard errors.

    The last digit of a number is the second digit of its standard error times `fraction`. Radii
    that are given are not rounded.
    """
    arcs, roller, intervals = fit.arcs, fit.roller_radius, fit.intervals

    def rounded(metres: float, interval: ParameterInterval) -> float:
        error = 1e3 * fraction * interval.error
        if not math.isfinite(error):  # without a standard error: four digits if `fraction` is 1
            error = fraction * 10.0 ** (math.floor(math.log10(abs(1e3 * metres))) - 2)
        return 1e-3 * float(round_to_error(1e3 * metres, error))

    base, flank, prime = arcs.base_radius, arcs.flank_radius, intervals[Parameter.PRIME]
    if fit.given_radii == "base" and not fit.only_flat:
        roller = rounded(roller, prime)
    elif not prime.is_fixed:
        base = rounded(base, prime)
    contour = Arcs(
        base_radius=base,
        lift=rounded(arcs.lift, intervals[Parameter.LIFT]),
        flank_radius=None if flank is None else rounded(flank, intervals[Parameter.FLANK]),
        nose_radius=rounded(arcs.nose_radius, intervals[Parameter.NOSE]),
        nose_angle=arcs.nose_angle,
    )
    return contour, roller


def require_identifiable(fit: ArcsFit, is_kind_given: bool) -> None:
    """Raise ConfigError if the readings do not determine follower type or base radius.

    `is_kind_given` is True if the types of the followers are given, which are then not checked. A
    base radius that is given or assumed is not checked either.
    """
    other = fit.other_kinds
    if other is not None and not is_kind_given:
        several = ", once for each column" if len(fit.fitted_columns) > 1 else ""
        raise ConfigError(
            f"the readings do not identify the follower: {fit.best.search.name} leaves "
            f"{fit.rms * 1e3:.3g} mm r.m.s., {other.search.name} {other.rms * 1e3:.3g} mm; "
            f"allowed: --follower roller, flat or point{several}"
        )
    prime = fit.prime_if_straight or fit.intervals[Parameter.PRIME]
    if not (prime.is_fixed or math.isfinite(prime.high)):
        roller = " and --roller-radius" if fit.roller_radius else ""
        raise ConfigError(
            f"lifts alone do not identify the base radius: {prime.name} is {prime.interval_text} "
            f"with 95 %; allowed: --base-radius{roller}, or readings of a flat follower too"
        )

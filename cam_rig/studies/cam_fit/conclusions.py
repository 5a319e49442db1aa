"""What a fit found, in sentences: what was assumed, not followed, left out, or cannot be told."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from cam_rig.laws.families.scatter import least_tolerance
from cam_rig.studies.cam_fit.arcs_fit import ArcsFit
from cam_rig.studies.cam_fit.spline_fit import SplineFit

#: Readings wider apart than this (deg) leave the law between them to the spline.
WIDE_DEG = 5.0
#: Of two readings of the columns this much nearer (in parts) one is told from the other.
CLEARLY_NEARER = 1.1


def spline_conclusions(fit: SplineFit) -> Iterator[str]:
    """The answer first: how far the law is from the readings."""
    found, readings = fit.smoothed, fit.readings
    yield (
        f"The law is {found.rms * 1e3:.3g} mm r.m.s. and {found.largest * 1e3:.3g} mm at most from "
        f"{readings.angles.size} readings, with {found.knots} knots."
    )
    if fit.widened:
        yield (
            f"Allowed are {fit.tolerance * 1e3:.3g} mm: nearer, the spline needs nearly a knot a "
            "reading. The law is less smooth than its readings are fine."
        )
    elif fit.asked is not None and not fit.followed:
        yield (
            f"Not followed: {fit.asked * 1e3:.3g} mm were asked, the readings scatter by "
            f"{fit.scatter * 1e3:.3g} mm. A spline so near would follow their noise; allowed: "
            f"{least_tolerance(fit.scatter, readings.angles.size) * 1e3:.3g} mm or more."
        )
    step = math.degrees(float(np.median(np.diff(readings.angles))))
    if step > WIDE_DEG:
        yield (
            f"Readings stand {step:.3g} deg apart: what the law does between them counts as "
            "scatter, and peaks of acceleration are rough."
        )
    yield (
        "A spline knows no jumps of acceleration between readings: for a cam of arcs take --shape "
        "arcs."
    )
    if not fit.dwells:
        yield "No dwell is found: nowhere do enough readings rest within their scatter."
    outliers = ", ".join(
        f"line {outlier.line} by {outlier.beside * 1e3:.3g} mm" for outlier in readings.outliers
    )
    yield (
        f"Left out, for they look like outliers: {outliers}."
        if outliers
        else "No reading looks like an outlier."
    )


def arcs_conclusions(fit: ArcsFit) -> Iterator[str]:
    """Which column is which, in which sense it was read, and what cannot be told."""
    distance = fit.rms * 1e3
    count = int(np.count_nonzero(np.isfinite(fit.errors)))
    readings = sum(column.away.size for column in fit.columns)
    yield f"{count} numbers of tangent arcs: {distance:.3g} mm r.m.s. from {readings} readings."
    flat = [column.readings.name for column in fit.columns if column.kind == "flat"]
    if flat and len(flat) < len(fit.columns):
        yield f"The flat follower's readings are {' and '.join(flat)}."
    reverse = [column.readings.name for column in fit.columns if column.reverse]
    if reverse:
        apart = abs(math.degrees(2.0 * fit.arcs.nose_angle) + 180.0) % 360.0 - 180.0
        yield (
            f"{' and '.join(reverse)} fits as read in the other turning sense, or from a zero "
            f"{abs(apart):.2g} deg apart."
        )
    near = [other for other in fit.others if other[1] < CLEARLY_NEARER * fit.rms]
    if near:
        yield f"As near, and not told apart: {near[0][0]}, {near[0][1] * 1e3:.3g} mm r.m.s."
    elif fit.others:
        name, next_best = fit.others[0]
        yield f"The next best reading of the columns is {name}: {next_best * 1e3:.3g} mm r.m.s."
    yield from fit.cannot_tell

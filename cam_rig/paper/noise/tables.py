"""A noise study as tables and as plain data."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from cam_rig.paper.noise.arc_cam import ArcShape
from cam_rig.paper.noise.calibration import StructureFit
from cam_rig.paper.noise.high_dwell import high_dwell_json, high_dwell_tables
from cam_rig.paper.noise.methods import Band, Crossing, Method
from cam_rig.paper.noise.shared_rig import OneRig
from cam_rig.paper.noise.study import TESTED_ON, NoiseClaim, NoiseStudy, noise_claims
from cam_rig.schema import PublishedNoise
from cam_rig.show.tables import Cell, DataTable, Head, tabulate
from cam_rig.simulation.simulate import Acoustics

# Where the curves of a noise study cross, and the paper's claims of them, as tables.


def finite(value: float | None) -> float | None:
    """What is not a number is missing."""
    return value if value is not None and math.isfinite(value) else None


def largest_table(study: NoiseStudy) -> DataTable:
    """What the r.m.s. of each curve hides."""
    return tabulate(
        "Largest difference of the points to published",
        [(method, curve) for method in study.methods for curve in method.curves.values()],
        (
            (Head("calibration"), lambda row: row[0].name),
            (Head("cam"), lambda row: row[1].cam),
            (Head("difference", "dB", "+.2f"), lambda row: row[1].largest_db),
            (Head("at", "rpm", ".0f"), lambda row: float(study.rpm[row[1].largest_at])),
        ),
    )


def crossings_table(study: NoiseStudy, published: PublishedNoise) -> DataTable:
    """Where the curves of two cams cross, by each way of calibrating."""
    nowhere = "nowhere"
    named = published.crossover
    return tabulate(
        "Speeds at which two cams are equally loud",
        [(method, pair) for method in study.methods for pair in method.pairs],
        (
            (Head("calibration"), lambda row: row[0].name),
            (Head("cams"), lambda row: " and ".join(row[1].between)),
            (Head("published curves", "rpm", ".1f"), lambda row: row[1].published_rpm),
            (Head("regressions", "rpm", ".1f", nowhere), lambda row: row[1].found.rpm),
            (
                Head("standard deviation", "rpm", ".1f"),
                lambda row: finite(row[1].found.deviation),
            ),
            (Head("95 % from", "rpm", ".0f"), lambda row: finite(row[1].found.low)),
            (Head("to", "rpm", ".0f"), lambda row: finite(row[1].found.high)),
            (Head("draws without", "%", ".0f"), lambda row: 100.0 * row[1].found.missing),
            (Head("points", "rpm", ".1f", nowhere), lambda row: row[1].found.points_rpm),
        ),
        f"The paper names {' and '.join(named.between)}, {named.rpm:g} rpm. Standard deviation and "
        "95 %: of the bootstrap's draws that cross at all.",
    )


def claims_table(study: NoiseStudy, published: PublishedNoise) -> DataTable:
    """The paper's claims of noise, on its own curves and on those of the study."""

    def by(name: str) -> Callable[[NoiseClaim], Cell]:
        def words(claim: NoiseClaim) -> str:
            share = f"at {claim.holds[name]} of {claim.cases} speeds"
            fails = claim.fails_rpm[name]
            return share if fails is None else f"{share}, not at {_span(fails)} rpm"

        return words

    return tabulate(
        "The paper's claims of noise, tested",
        noise_claims(study, published.crossover.rpm),
        (
            (Head("claim"), lambda claim: claim.words),
            (Head("in the paper"), lambda claim: claim.source),
            *((Head(name), by(name)) for name in TESTED_ON),
        ),
        f"Regressions and points: simulated, calibrated {_way(study.best.name)}, which predicts "
        "best what it was not fitted to.",
    )


def _span(ends: tuple[float, float]) -> str:
    low, high = ends
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _way(name: str) -> str:
    """A way of calibrating, in a sentence."""
    return name if name.startswith("by ") else f"with {name}"


#: Every so many speeds have a row in the table of levels.
EVERY = 2


def tables(study: NoiseStudy, published: PublishedNoise) -> list[DataTable]:
    """Every table, from the structures that were tried to the levels."""
    return [
        structures_table(study),
        curves_table(study),
        constants_table(study),
        largest_table(study),
        crossings_table(study, published),
        left_out_table(study),
        one_rig_table(study),
        claims_table(study, published),
        *high_dwell_tables(study.high_dwell, study.rpm.tolist()),
        levels_table(study),
    ]


def structures_table(study: NoiseStudy) -> DataTable:
    """The transfer functions between force and sound, fitted to one cam, tried on the other."""
    cams = list(study.structures)

    def fitted(i: int) -> Callable[[tuple[StructureFit, ...]], Cell]:
        return lambda row: row[i].fitted_db

    def predicted(i: int) -> Callable[[tuple[StructureFit, ...]], Cell]:
        return lambda row: next(iter(row[i].predicted_db.values()))

    each = [
        field
        for i, cam in enumerate(cams)
        for field in (
            (Head(f"fitted to {cam}", "dB", ".2f"), fitted(i)),
            (Head(f"predicted from {cam}", "dB", ".2f"), predicted(i)),
        )
    ]
    return tabulate(
        "Transfer functions between contact force and sound: r.m.s. difference",
        zip(*study.structures.values(), strict=True),
        (
            (Head("structure, weighting"), lambda row: f"{row[0].name}, {row[0].weighting}"),
            (Head("numbers fitted", "", "d"), lambda row: row[0].numbers),
            *each,
        ),
    )


def curves_table(study: NoiseStudy) -> DataTable:
    """Each cam's curve by each way of calibrating, against the published regression."""
    return tabulate(
        "Noise of three cams by three ways of calibrating: r.m.s. difference to published",
        [(m, curve) for m in study.methods for curve in m.curves.values()],
        (
            (Head("calibration"), lambda row: row[0].name),
            (Head("cam"), lambda row: row[1].cam),
            (Head("role"), lambda row: row[1].role),
            (Head("numbers fitted to it", "", "d"), lambda row: row[1].numbers),
            (Head("points", "dB", ".2f"), lambda row: row[1].rms_db),
            (Head("regression", "dB", ".2f"), lambda row: row[1].rms_regression_db),
            (Head("95 % band, half", "dB", ".1f"), lambda row: _half(row[1].expected)),
            (
                Head("published inside", "%", ".0f"),
                lambda row: 100.0 * row[1].expected.holds(row[1].published_db),
            ),
        ),
        "A published regression has four numbers: a fit of as many proves nothing.",
    )


def _half(band: Band) -> float:
    return 0.5 * float((band.high - band.low).mean())


def constants_table(study: NoiseStudy) -> DataTable:
    """What each way of calibrating fitted: the shared constants, and the arc cam's geometry."""

    def response(i: int) -> Callable[[Method], Cell]:
        return lambda m: m.acoustics.response[i] if m.acoustics.response else None

    terms = [
        (Head(f"response x{p}", "dB", "+.2f"), response(i)) for i, p in enumerate(("", "²", "³"))
    ]
    return tabulate(
        "Constants by way of calibrating",
        study.methods,
        (
            (Head("calibration"), lambda m: m.name),
            (Head("gain", "Pa·s/N", ".4g"), lambda m: m.acoustics.radiation.gain),
            (Head("cut-off", "Hz", ".4g"), lambda m: m.acoustics.radiation.corner),
            *terms,
            (Head("arc cam: lift", "mm", ".2f"), lambda m: 1e3 * m.shape.lift),
            (Head("event", "°", ".1f"), lambda m: math.degrees(m.shape.event)),
            (Head("flank", "m", ".2f"), lambda m: 1.0 / m.shape.curvature),
        ),
        "Response: x = (rpm − 300)/100."
        if any(m.acoustics.response for m in study.methods)
        else "",
    )


def left_out_table(study: NoiseStudy) -> DataTable:
    """Each cam left out of the calibration in turn."""
    return tabulate(
        "Each cam left out: gain and cut-off from the other two, r.m.s. difference on it",
        study.left_out,
        (
            (Head("left out"), lambda row: row.cam),
            (Head("numbers fitted to the others", "", "d"), lambda row: row.numbers),
            (Head("gain", "Pa·s/N", ".3g"), lambda row: row.acoustics.radiation.gain),
            (Head("cut-off", "Hz", ".2f"), lambda row: row.acoustics.radiation.corner),
            (Head("points", "dB", ".2f"), lambda row: row.rms_db),
            (Head("regression", "dB", ".2f"), lambda row: row.rms_regression_db),
        ),
    )


def one_rig_table(study: NoiseStudy) -> DataTable:
    """Noise with the follower of the jump speeds, and with the rigid one that it is fitted with."""
    base = study.methods[1]
    own = OneRig(
        base.name,
        base.acoustics,
        {cam: curve.rms_db for cam, curve in base.curves.items()},
        base.shape,
        base.crossing.rpm,
    )

    def points(cam: str) -> Callable[[OneRig], Cell]:
        return lambda rig: rig.rms_db.get(cam)

    aside = any(rig.shape is None for rig in study.one_rig)
    return tabulate(
        "One rig for jump and noise: r.m.s. difference of the points to published",
        [own, *study.one_rig],
        (
            (Head("rig"), lambda rig: rig.name),
            *((Head(cam, "dB", ".2f", "not run"), points(cam)) for cam in base.curves),
            (Head("crossing", "rpm", ".1f"), lambda rig: rig.crossing_rpm),
        ),
        "Not run: a search of minutes, cam-rig noise --one-rig." if aside else "",
    )


def levels_table(study: NoiseStudy) -> DataTable:
    """Published regressions and simulated points by the best way of calibrating."""
    method = study.best

    def at(levels: np.ndarray[Any, Any]) -> Callable[[int], Cell]:
        return lambda i: float(levels[i])

    each = [
        (Head(f"{curve.cam}, {what}", "dB", ".1f"), at(levels))
        for curve in method.curves.values()
        for what, levels in (("published", curve.published_db), ("here", curve.level_db))
    ]
    return tabulate(
        f"The paper's Table 3: levels, published and simulated {method.name}",
        range(0, study.rpm.size, EVERY),
        ((Head("speed", "rpm", "g"), at(study.rpm)), *each),
    )


def to_json(study: NoiseStudy) -> dict[str, Any]:
    """The study as plain data; what is not a number becomes null."""
    return {
        "rpm": [round(rpm, 9) for rpm in study.rpm.tolist()],
        "parts": vars(study.roles),
        "structures": {cam: [vars(f) for f in fits] for cam, fits in study.structures.items()},
        "high_dwell": high_dwell_json(study.high_dwell),
        "best_method": study.best.name,
        "methods": {method.name: _method_json(method) for method in study.methods},
        "left_out": [
            vars(row) | {"acoustics": _acoustics_json(row.acoustics)} for row in study.left_out
        ],
        "one_rig": [
            vars(rig)
            | {"acoustics": _acoustics_json(rig.acoustics), "shape": _shape_json(rig.shape)}
            for rig in study.one_rig
        ],
    }


def _method_json(method: Method) -> dict[str, Any]:
    return {
        "acoustics": _acoustics_json(method.acoustics),
        "shape": _shape_json(method.shape),
        "predicted_rms_db": finite(method.predicted_rms_db),
        "crossing": _crossing_json(method.crossing),
        "crossings": [
            {"between": pair.between, "published_rpm": pair.published_rpm}
            | _crossing_json(pair.found)
            for pair in method.pairs
        ],
        "cams": {
            curve.cam: {
                "role": curve.role,
                "numbers": curve.numbers,
                "rms_db": curve.rms_db,
                "rms_regression_db": curve.rms_regression_db,
                "level_db": curve.level_db.tolist(),
                "coefficients": curve.coefficients.tolist(),
                "published_db": curve.published_db.tolist(),
                "confidence_db": _band_json(curve.confidence),
                "expected_db": _band_json(curve.expected),
            }
            for curve in method.curves.values()
        },
    }


def _crossing_json(crossing: Crossing) -> dict[str, float | None]:
    return {key: finite(value) for key, value in vars(crossing).items()}


def _band_json(band: Band) -> dict[str, list[float]]:
    return {"low": band.low.tolist(), "high": band.high.tolist()}


def _acoustics_json(acoustics: Acoustics) -> dict[str, Any]:
    r = acoustics.radiation
    return {"gain": r.gain, "corner_hz": r.corner, "response_db": list(acoustics.response)}


def _shape_json(shape: ArcShape | None) -> dict[str, float] | None:
    if shape is None:
        return None
    return {
        "lift_mm": 1e3 * shape.lift,
        "event_deg": math.degrees(shape.event),
        "flank_m": 1.0 / shape.curvature,
    }

"""A noise study as plain data, for programs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # a second of imports, which `--help` should not pay
    from cam_rig.simulation.settled_turns import Acoustics
    from cam_rig.studies.noise.arc_shape import ArcShape
    from cam_rig.studies.noise.bootstrap import Band
    from cam_rig.studies.noise.calibration_methods import Method
    from cam_rig.studies.noise.run import NoiseStudy


def to_json(study: NoiseStudy) -> dict[str, Any]:
    """The study as plain data; what is not a number becomes null."""
    return {
        "rpm": [round(rpm, 9) for rpm in study.rpm.tolist()],
        "parts": vars(study.cast),
        "structures": {cam: [vars(f) for f in fits] for cam, fits in study.structures.items()},
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
        "crossing": {
            key: value if value is not None and math.isfinite(value) else None
            for key, value in vars(method.crossing).items()
        },
        "cams": {
            curve.cam: {
                "role": curve.role,
                "numbers": curve.numbers,
                "rms_db": curve.rms_db,
                "rms_regression_db": curve.rms_regression_db,
                "level_db": curve.level_db.tolist(),
                "coefficients": curve.coefficients.tolist(),
                "published_db": curve.published_db.tolist(),
                "sure_db": _band_json(curve.sure),
                "expected_db": _band_json(curve.expected),
            }
            for curve in method.curves.values()
        },
    }


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

"""Where the curves of a noise study cross, and the paper's claims of them, as tables."""

from __future__ import annotations

import math
from collections.abc import Callable

from cam_rig.schema import PublishedNoise
from cam_rig.studies.noise.claims import TESTED_ON, NoiseClaim, noise_claims
from cam_rig.studies.noise.run import NoiseStudy
from cam_rig.tables import Cell, Column, DataTable, tabulate


def finite(value: float | None) -> float | None:
    """What is not a number is missing."""
    return value if value is not None and math.isfinite(value) else None


def largest_table(study: NoiseStudy) -> DataTable:
    """What the r.m.s. of each curve hides."""
    return tabulate(
        "Largest difference of the points to published",
        [(method, curve) for method in study.methods for curve in method.curves.values()],
        (
            (Column("calibration"), lambda row: row[0].name),
            (Column("cam"), lambda row: row[1].cam),
            (Column("difference", "dB", "+.2f"), lambda row: row[1].largest_db),
            (Column("at", "rpm", ".0f"), lambda row: float(study.rpm[row[1].largest_at])),
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
            (Column("calibration"), lambda row: row[0].name),
            (Column("cams"), lambda row: " and ".join(row[1].between)),
            (Column("published curves", "rpm", ".1f"), lambda row: row[1].published_rpm),
            (Column("regressions", "rpm", ".1f", nowhere), lambda row: row[1].found.rpm),
            (
                Column("standard deviation", "rpm", ".1f"),
                lambda row: finite(row[1].found.deviation),
            ),
            (Column("95 % from", "rpm", ".0f"), lambda row: finite(row[1].found.low)),
            (Column("to", "rpm", ".0f"), lambda row: finite(row[1].found.high)),
            (Column("draws without", "%", ".0f"), lambda row: 100.0 * row[1].found.missing),
            (Column("points", "rpm", ".1f", nowhere), lambda row: row[1].found.points_rpm),
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
            (Column("claim"), lambda claim: claim.words),
            (Column("in the paper"), lambda claim: claim.source),
            *((Column(name), by(name)) for name in TESTED_ON),
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

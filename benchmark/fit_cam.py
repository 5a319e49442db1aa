"""Accuracy of cams that are fitted to readings: the table of docs/accuracy.md.

    .venv/bin/python -m benchmark.fit_cam

Readings of the lift of shipped laws get noise, an unknown zero and one outlier. The program runs
for half a minute.
"""

from __future__ import annotations

import numpy as np

import cam_rig
from cam_rig.studies.fit_cam.gauge import order_readings
from cam_rig.studies.fit_cam.gauge_table import GaugeColumn, GaugeTable
from cam_rig.studies.fit_cam.spline_fit import fit_spline
from cam_rig.units import TURN

CAMS = ("poly345", "cycloidal", "flat", "bezier15", "b_spline")
#: Numbers of readings per turn.
COUNTS = (360, 72, 36)
#: Random seeds of the noise, for each cam and number of readings.
SEEDS = range(5000, 5040)
#: Lift of every cam (m).
LIFT = 0.01
#: Standard deviation of a reading (m).
NOISE = 2e-6
#: Zero offset of the gauge (m).
ZERO = 3e-3
#: Error (m) of the outlier.
OUTLIER = 4e-4
#: Cam angles (rad) at which a fit is compared with the cam.
COMPARED_ANGLES = np.linspace(0.0, TURN, 2000, endpoint=False)


def errors(name: str, count: int, seed: int) -> tuple[float, float, float]:
    """Return the errors of a fit.

    These are the r.m.s. error of the lift (µm), that of the acceleration relative to its peak (%),
    and the error of the peak (%).
    """
    rng = np.random.default_rng(seed)
    law = cam_rig.build_law(cam_rig.load_cam(name))
    scale = LIFT / law.lift
    angles = np.linspace(0.0, TURN, count, endpoint=False)
    lifts = scale * law(angles) + NOISE * rng.normal(size=count) + ZERO
    lifts[rng.integers(count)] += OUTLIER
    column = GaugeColumn("lift", tuple(lifts), 1e-9)
    table = GaugeTable(name, tuple(angles), (column,), tuple(range(count)), ())
    fit = fit_spline(order_readings(table, column))
    true, fitted = scale * law(COMPARED_ANGLES, 2), fit.law(COMPARED_ANGLES, 2)
    peak = np.abs(true).max()
    away = fit.law(COMPARED_ANGLES) - scale * law(COMPARED_ANGLES)
    return (
        1e6 * float(np.sqrt(np.mean(away**2))),
        100.0 * float(np.sqrt(np.mean((fitted - true) ** 2)) / peak),
        100.0 * abs(float(np.abs(fitted).max() / peak) - 1.0),
    )


def main() -> None:
    """Print the median, the 95th percentile and the maximum of each error."""
    for count in COUNTS:
        values = np.array([errors(name, count, seed) for name in CAMS for seed in SEEDS])
        cells = [
            ", ".join(f"{value:.2g}" for value in (np.median(e), np.percentile(e, 95), e.max()))
            for e in values.T
        ]
        print(f"| {count} | {cells[0]} µm | {cells[1]} % | {cells[2]} % |")


if __name__ == "__main__":
    main()

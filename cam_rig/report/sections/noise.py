"""Noise: fig. 16 and Table 3."""

from __future__ import annotations

import math

import numpy as np

from cam_rig.report.blocks import Block, Grid, Picture, Section, Words
from cam_rig.report.results import Findings
from cam_rig.report.words import number
from cam_rig.studies.noise.calibration_methods import Method

#: Every so many speeds have a row in Table 3.
EVERY = 2


def section(results: Findings) -> Section:
    """Levels, what they are worth, and the recorded run beside them."""
    blocks: list[Block] = [
        Words(
            "Sound pressure follows the rate of the contact force through a structure with one "
            "corner; landings add their own pulse, background rises with speed. One cam "
            "calibrates the constants, one is predicted, and one has its geometry identified from "
            "its own curve. The paper's levels are lost (its Table 3 with them): its three "
            "regressions are the data."
        ),
        Picture(
            "fig16",
            "Fig. 16: level against speed. Dots: simulated; lines: their regression; dashed: the "
            "published regressions; bands: where those should lie, 95 %. One panel a way to "
            "calibrate.",
        ),
        _methods(results),
        _left_out(results),
        _one_rig(results),
        _table_3(results),
    ]
    if results.sources.recorded is not None:
        blocks.append(_recorded(results))
    return Section("noise", "Noise", tuple(blocks))


def _methods(results: Findings) -> Grid:
    rows = []
    for method in results.noise.methods:
        for i, curve in enumerate(method.curves.values()):
            rows.append(
                (
                    method.name if i == 0 else "",
                    curve.cam,
                    curve.role,
                    str(curve.numbers) if curve.numbers else "none",
                    f"{curve.rms_db:.2f}",
                    f"{curve.rms_regression_db:.2f}",
                    f"{100.0 * curve.expected.holds(curve.published_db):.0f} %",
                    _crossing(method) if curve.cam == results.noise.cast.predicted else "",
                    _points(method) if curve.cam == results.noise.cast.predicted else "",
                )
            )
    head = (
        "way to calibrate",
        "cam",
        "which is",
        "fitted to it",
        "points, dB RMS",
        "regression, dB RMS",
        "published in band",
        "crosses TM21 at [rpm]",
        "its points at [rpm]",
    )
    published = results.sources.loaded.published
    assert published is not None  # the study has its levels
    return Grid(
        "Three cams, three ways to calibrate",
        head,
        tuple(rows),
        left=3,
        note="Points and regression: to the published regression. One of those has four numbers: "
        "what is fitted with as many says nothing. "
        "Crossing: of the regressions, ± one standard deviation of the draws; and of the simulated "
        f"points, joined by lines. Published: {published.crossover.rpm:g} rpm.",
    )


def _crossing(method: Method) -> str:
    found = method.crossing
    if found.rpm is None:
        return "nowhere"
    return f"{found.rpm:.1f} ± {found.deviation:.1f}"


def _points(method: Method) -> str:
    found = method.crossing.points_rpm
    return "nowhere" if found is None else f"{found:.1f}"


def _left_out(results: Findings) -> Grid:
    rows = tuple(
        (
            row.cam,
            str(row.numbers),
            number(row.acoustics.radiation.gain, 3),
            f"{row.acoustics.radiation.corner:.2f}",
            f"{row.rms_db:.2f}",
            f"{row.rms_regression_db:.2f}",
        )
        for row in results.noise.left_out
    )
    head = (
        "left out",
        "numbers fitted to the others",
        "gain [Pa·s/N]",
        "corner [Hz]",
        "points [dB RMS]",
        "regression [dB RMS]",
    )
    return Grid("Each cam left out, the constants from the other two", head, rows)


def _one_rig(results: Findings) -> Grid:
    cams = list(results.noise.methods[0].curves)
    rows = tuple(
        (
            rig.name,
            *(f"{rig.rms_db[cam]:.2f}" if cam in rig.rms_db else "see below" for cam in cams),
            "" if rig.crossing_rpm is None else f"{rig.crossing_rpm:.1f}",
        )
        for rig in results.noise.one_rig
    )
    head = ("rig", *(f"{cam} [dB RMS]" for cam in cams), "crossing [rpm]")
    return Grid(
        "One rig for everything: that of the jump speeds, heard",
        head,
        rows,
        note="Not run here: with its elastic stem the arc cam is a search of minutes. cam-rig "
        "noise --one-rig runs it; docs/noise.md has what it gave.",
    )


def _table_3(results: Findings) -> Grid:
    curves = results.noise.methods[-1].curves
    rpm = results.noise.rpm
    rows = [
        (
            f"{rpm[i]:g}",
            *(f"{v[i]:.1f}" for c in curves.values() for v in (c.published_db, c.level_db)),
        )
        for i in range(0, rpm.size, EVERY)
    ]
    head = ("rpm", *(f"{cam}, {what}" for cam in curves for what in ("published", "here")))
    return Grid(
        "Table 3. Levels [dB]: the published regressions evaluated, and the simulated points",
        head,
        tuple(rows),
        left=0,
        note=f"Way to calibrate: {results.noise.methods[-1].name}.",
    )


def _recorded(results: Findings) -> Grid:
    recorded = results.sources.recorded
    assert recorded is not None
    curves = results.noise.methods[0].curves
    rows = []
    for cam, levels in recorded.level_db.items():
        off = levels - curves[cam].level_db
        published = levels - curves[cam].published_db
        rms = math.sqrt(float(np.mean(published**2)))
        rows.append((cam, f"{np.abs(off).max():.4f}", f"{rms:.2f}"))
    return Grid(
        f"The recorded run {recorded.bag.name}, {recorded.messages} messages",
        ("cam", "largest difference to this run [dB]", "to published [dB RMS]"),
        tuple(rows),
    )

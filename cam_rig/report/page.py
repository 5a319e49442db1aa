"""The page itself: one template a section, rendered as HTML or as Markdown."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from functools import partial
from typing import Any

from cam_rig.dynamics.vibration import STAND_IN
from cam_rig.paper.as_cut.study import CUT
from cam_rig.paper.flywheel import SHOWN as FLYWHEEL_SHOWN
from cam_rig.paper.jump.refit import ROUNDED_TO
from cam_rig.paper.noise import calibration, methods
from cam_rig.report.document import Document, Made, called, render
from cam_rig.report.paper import PROPOSED, STEADY_RPM, TAKEOFF_RPM, Findings
from cam_rig.report.tables import files, tables, titles_of
from cam_rig.schema.quantity import ORIGINS
from cam_rig.schema.segment_base import quantities
from cam_rig.units import to_rpm

TITLE = "Cam rig: the paper's experiments, redone and taken further"
#: The sections in the order they are read: template, title.
SECTIONS = {
    "summary": "In short",
    "cams": "Cams and laws",
    "vibration": "Residual and torsional vibration",
    "flywheel": "A flywheel that does not hold its speed",
    "jump": "Jump speed",
    "readings": "The paper's Table 2 read in other ways",
    "stem": "Where two masses stop being enough",
    "as_cut": "The cam as it was cut",
    "timing": "Timing of the events",
    "contact": "Contact pressure and sliding",
    "noise": "Noise",
    "orders": "Orders of force and sound",
    "question": "Continuity or lower slopes",
    "design": "What a better law could reach",
    "numbers": "Given, assumed, identified",
    "reading": "How the paper was read, and how this was made",
}

#: What is drawn at random.
SEEDS = (
    f"{methods.SEED} (bootstrap of the noise study, {methods.DRAWS} draws), "
    f"{calibration.SEED} (starts of its transfer functions, {calibration.STARTS})"
)


def html(found: Findings, figures: dict[str, list[str]], made: Made) -> str:
    """One self-contained page; ``figures`` are data URIs by key, from the top."""
    return render("html", _document(found, figures, made))


def markdown(found: Findings, made: Made) -> str:
    """The words and tables alone."""
    return render("md", _document(found, {}, made))


def _document(found: Findings, figures: dict[str, list[str]], made: Made) -> Document:
    return Document(
        title=TITLE,
        sections=SECTIONS,
        made=replace(made, seeds=SEEDS),
        tables=tables(found),
        figures=figures,
        values=_values(found),
    )


def _values(found: Findings) -> dict[str, Any]:
    """What the sections' sentences take their numbers from."""
    sources = found.sources
    origins = Counter(q.origin for model in files(found).values() for _, q in quantities(model, ""))
    return {
        "found": found,
        "called": partial(called, titles=titles_of(found)),
        "jump": found.jumps.comparison,
        "question": found.factorial.conclusions(),
        "proposed": sources.cam_set.titles[found.factorial.config.proposed],
        "contact": found.contact,
        "origins": ", ".join(f"{origins[origin]} {origin}" for origin in ORIGINS),
        "moves": _moves(found),
        "rounding": _rounding(found),
        "rounded_to": ROUNDED_TO,
        "angles": _angles(found),
        "infinity": math.inf,
        "flywheel_shown": FLYWHEEL_SHOWN,
        "stiffer": _stiffer(found),
        "readings_nearest": found.readings.nearest,
        "readings_widest": found.readings.widest,
        "cut": found.cuts.of(CUT),
        "cut_name": CUT,
        "rpm": to_rpm,
        "steady_rpm": STEADY_RPM,
        "takeoff_rpm": TAKEOFF_RPM,
    }


def _moves(found: Findings) -> float:
    """Lift of Bézier 15 at the edge of the stand-in for its low dwell, over its lift."""
    cam_set = found.sources.cam_set
    return float(cam_set.laws[PROPOSED](0.5 * STAND_IN)) / cam_set.cams[PROPOSED].lift.si


def _rounding(found: Findings) -> float:
    """r.m.s. relative difference that the rounding of Table 2 alone makes."""
    printed = [row.published_rpm for row in found.jumps.rows if row.published_rpm]
    return ROUNDED_TO / math.sqrt(12.0) * math.sqrt(sum(x**-2 for x in printed) / len(printed))


def _angles(found: Findings) -> tuple[float, float]:
    """Cam angles (degrees) between which contact is first lost."""
    angles = [math.degrees(row.found.angle) for row in found.jumps.rows]
    return min(angles), max(angles)


def _stiffer(found: Findings) -> float:
    """By how much the residual amplitude is smaller on the printed stem, at least."""
    elastic, stiff = (t.at(STEADY_RPM) for t in (found.vibration, found.stiff_vibration))
    return min(elastic[cam].residual_amplitude / stiff[cam].residual_amplitude for cam in elastic)

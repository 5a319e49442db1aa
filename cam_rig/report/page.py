"""The page itself: one template a section, rendered as HTML or as Markdown."""

from __future__ import annotations

import math
import re
from collections import Counter
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from cam_rig import __version__
from cam_rig.report.figures import PROPOSED, STEADY_RPM, TAKEOFF_RPM
from cam_rig.report.results import CUT, Findings
from cam_rig.report.tables import files, tables
from cam_rig.schema.quantity import ORIGINS
from cam_rig.schema.segments.base import quantities
from cam_rig.studies.factorial.conclusions import conclusions
from cam_rig.studies.flywheel.fluctuation import SHOWN as FLYWHEEL_SHOWN
from cam_rig.studies.jump import reading_tables
from cam_rig.studies.jump.comparison import compare
from cam_rig.studies.jump.refit import ROUNDED_TO
from cam_rig.studies.vibration.dwell import STAND_IN
from cam_rig.tables import number, to_markdown
from cam_rig.units import to_rpm

TITLE = "Cam rig: the paper's experiments, redone and taken further"
#: The sections in the order they are read: template, title.
SECTIONS = {
    "summary": "In short",
    "cams": "Cams and laws",
    "vibration": "Residual and torsional vibration",
    "flywheel": "A flywheel that does not hold its speed",
    "jump": "Jump speed",
    "readings": "Table 2 read in other ways",
    "stem": "Where two masses stop being enough",
    "as_cut": "The cam as it was cut",
    "timing": "Timing of the events",
    "contact": "Contact pressure and sliding",
    "noise": "Noise",
    "orders": "Orders of force and sound",
    "question": "Continuity or lower slopes",
    "numbers": "Given, assumed, identified",
    "reading": "How the paper was read, and how this was made",
}


def html(found: Findings, figures: dict[str, str]) -> str:
    """One self-contained page; ``figures`` are data URIs by key."""
    return _render("html", found, figures)


def markdown(found: Findings) -> str:
    """The words and tables alone."""
    return re.sub("\n{3,}", "\n\n", _render("md", found, {})).strip() + "\n"


def environment(kind: str) -> Environment:
    """Where the templates are: "html" escapes what people wrote, "md" does not."""
    found = Environment(
        loader=PackageLoader("cam_rig.report"),
        autoescape=kind == "html",
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters |= {"percent": percent, "number": number, "to": to, "markdown": to_markdown}
    found.filters["degrees"] = math.degrees
    return found


def _render(kind: str, found: Findings, figures: dict[str, str]) -> str:
    templates = environment(kind)
    return templates.get_template(f"report.{kind}").render(
        title=TITLE,
        sections=SECTIONS,
        figures=figures,
        page=templates.get_template(f"layout.{kind}").module,
        tables=tables(found),
        **_values(found),
    )


def percent(share: float, shown: str = ".0f") -> str:
    """A share as a percentage."""
    return f"{100.0 * share:{shown}} %"


def to(pair: tuple[float, float], shown: str = ".0f") -> str:
    """A range from its ends."""
    return " to ".join(number(end, shown) for end in pair)


def _values(found: Findings) -> dict[str, Any]:
    """What the sections' sentences take their numbers from."""
    sources, published = found.sources, found.sources.loaded.published
    assert published is not None  # the noise study has its levels
    origins = Counter(q.origin for model in files(found).values() for _, q in quantities(model, ""))
    return {
        "found": found,
        "jump": compare(found.jumps),
        "question": conclusions(found.factorial),
        "proposed": sources.cam_set.titles[found.factorial.config.proposed],
        "published": published,
        "rivals": [sources.loaded.cams[cam].title for cam in published.crossover.between],
        "contact": found.contact,
        "roles": found.noise.roles,
        "origins": ", ".join(f"{origins[origin]} {origin}" for origin in ORIGINS),
        "moves": _moves(found),
        "rounding": _rounding(found),
        "rounded_to": ROUNDED_TO,
        "angles": _angles(found),
        "infinity": math.inf,
        "flywheel_shown": FLYWHEEL_SHOWN,
        "stiffer": _stiffer(found),
        "readings_nearest": reading_tables.nearest(found.readings),
        "readings_widest": reading_tables.widest(found.readings),
        "cut": found.cuts.get(CUT),
        "cut_name": CUT,
        "rpm": to_rpm,
        "steady_rpm": STEADY_RPM,
        "takeoff_rpm": TAKEOFF_RPM,
        "version": __version__,
    }


def _moves(found: Findings) -> float:
    """Lift of Bézier 15 at the edge of the stand-in for its low dwell, over its lift."""
    cam_set = found.sources.cam_set
    return float(cam_set.laws[PROPOSED](0.5 * STAND_IN)) / cam_set.cams[PROPOSED].lift.si


def _rounding(found: Findings) -> float:
    """r.m.s. relative difference that the rounding of Table 2 alone makes."""
    printed = [row.published_rpm for row in found.jumps if row.published_rpm]
    return ROUNDED_TO / math.sqrt(12.0) * math.sqrt(sum(x**-2 for x in printed) / len(printed))


def _angles(found: Findings) -> tuple[float, float]:
    """Cam angles (degrees) between which contact is first lost."""
    angles = [math.degrees(row.found.angle) for row in found.jumps]
    return min(angles), max(angles)


def _stiffer(found: Findings) -> float:
    """By how much the residual amplitude is smaller on the printed stem, at least."""
    elastic, stiff = (t.at(STEADY_RPM) for t in (found.vibration, found.stiff_vibration))
    return min(elastic[cam].residual_amplitude / stiff[cam].residual_amplitude for cam in elastic)

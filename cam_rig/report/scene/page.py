"""The page of a scene: the same layout as the paper's page, with sections of its own."""

from __future__ import annotations

from collections import Counter
from typing import Any

from cam_rig.report.document import Document, Made, render
from cam_rig.report.scene.results import SceneFindings, rig_seconds, speeds_of
from cam_rig.report.scene.tables import files, tables
from cam_rig.schema.quantity import ORIGINS
from cam_rig.schema.segments.base import quantities
from cam_rig.studies.orders.waterfall import HIGHEST

#: The sections in the order they are read: template, title.
SECTIONS = {
    "summary": "In short",
    "cams": "Cams and laws",
    "contour": "Contour and checks",
    "turn": "Contact over the turn",
    "jump": "Jump speed",
    "vibration": "Residual vibration",
    "sound": "Sound",
    "numbers": "Given, assumed, identified",
}


def html(found: SceneFindings, figures: dict[str, list[str]], made: Made) -> str:
    """One self-contained page; ``figures`` are data URIs by key, from the top."""
    return render("html", _document(found, figures, made))


def markdown(found: SceneFindings, made: Made) -> str:
    """The words and tables alone."""
    return render("md", _document(found, {}, made))


def _document(found: SceneFindings, figures: dict[str, list[str]], made: Made) -> Document:
    return Document(
        title=found.loaded.scene.title,
        sections=SECTIONS,
        made=made,
        tables=tables(found),
        figures=figures,
        values=_values(found),
        folder="scene/",
    )


def _values(found: SceneFindings) -> dict[str, Any]:
    """What the sections' sentences take their numbers from."""
    loaded = found.loaded
    origins = Counter(q.origin for model in files(found).values() for _, q in quantities(model, ""))
    return {
        "found": found,
        "scene": loaded.scene,
        "rig": loaded.rig,
        "calibrated": loaded.calibrated,
        "titles": found.cam_set.titles,
        "model": loaded.scene.model.replace("_", " "),
        "speeds": speeds_of(loaded),
        "failed": [
            (found.cam_set.titles[cam], check)
            for cam, checks in found.checks.items()
            for check in checks
            if not check.passed
        ],
        "seconds": rig_seconds(found.run),
        "highest": HIGHEST,
        "origins": ", ".join(f"{origins[origin]} {origin}" for origin in ORIGINS),
    }

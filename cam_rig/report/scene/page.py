"""The page of a scene: the same layout as the paper's page, with sections of its own."""

from __future__ import annotations

import re
from collections import Counter
from typing import Any

from cam_rig import __version__
from cam_rig.report.page import environment
from cam_rig.report.scene.results import SceneFindings, rig_seconds, speeds_of
from cam_rig.report.scene.tables import files, tables
from cam_rig.schema.quantity import ORIGINS
from cam_rig.schema.scene import MODEL_ALIASES
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
#: The field's names of the models that have another one.
MODELS = {name: model for model, name in MODEL_ALIASES.items()}


def html(found: SceneFindings, figures: dict[str, str]) -> str:
    """One self-contained page; ``figures`` are data URIs by key."""
    return _render("html", found, figures)


def markdown(found: SceneFindings) -> str:
    """The words and tables alone."""
    return re.sub("\n{3,}", "\n\n", _render("md", found, {})).strip() + "\n"


def _render(kind: str, found: SceneFindings, figures: dict[str, str]) -> str:
    templates = environment(kind)
    return templates.get_template(f"report.{kind}").render(
        title=found.loaded.scene.title,
        sections=SECTIONS,
        folder="scene/",
        made_by=f"cam-rig report {found.loaded.scene_file.name} --out page.md",
        figures=figures,
        page=templates.get_template(f"layout.{kind}").module,
        tables=tables(found),
        **_values(found),
    )


def _values(found: SceneFindings) -> dict[str, Any]:
    """What the sections' sentences take their numbers from."""
    loaded, rows = found.loaded, found.run.by_speed
    levels = [row.level_db for row in rows if row.level_db is not None]
    origins = Counter(q.origin for model in files(found).values() for _, q in quantities(model, ""))
    return {
        "found": found,
        "scene": loaded.scene,
        "rig": loaded.rig,
        "calibrated": loaded.calibrated,
        "titles": found.cam_set.titles,
        "model": MODELS.get(loaded.scene.model, loaded.scene.model),
        "speeds": speeds_of(loaded),
        "lifting": [row for row in rows if row.flight > 0.0],
        "pulled": [row for row in rows if row.force_least < 0.0],
        "levels": (min(levels), max(levels)),
        "failed": [
            (found.cam_set.titles[cam], check)
            for cam, checks in found.checks.items()
            for check in checks
            if not check.passed
        ],
        "checked": sum(map(len, found.checks.values())),
        "seconds": rig_seconds(found.run),
        "highest": HIGHEST,
        "origins": ", ".join(f"{origins[origin]} {origin}" for origin in ORIGINS),
        "version": __version__,
    }

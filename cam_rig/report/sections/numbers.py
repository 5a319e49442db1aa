"""Every number that went in: given, assumed or identified."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from pydantic import BaseModel

from cam_rig.report.blocks import Block, Grid, Section, Words
from cam_rig.report.results import Findings
from cam_rig.report.words import number
from cam_rig.schema.quantity import ORIGINS, Quantity
from cam_rig.schema.segments.base import quantities


def section(results: Findings) -> Section:
    """A table for each file."""
    sources = results.sources
    files: dict[str, BaseModel] = {
        f"rig {sources.cam_set.rig.name}": sources.cam_set.rig,
        f"rig {sources.stiff.name}": sources.stiff,
        **{f"cam {name}": cam for name, cam in sources.cam_set.cams.items()},
        **{f"cam {name}": cam for name, cam in sources.loaded.cams.items()},
        f"scene {sources.loaded.scene.name}": sources.loaded.scene,
        f"factorial {sources.factorial.name}": sources.factorial,
    }
    counts = Counter(q.origin for model in files.values() for _, q in quantities(model, ""))
    told = ", ".join(f"{counts[origin]} {origin}" for origin in ORIGINS)
    blocks: list[Block] = [
        Words(
            f"Given: a source prints it. Assumed: and why. Identified: fitted, and to what. {told}."
        )
    ]
    blocks += [_grid(name, model) for name, model in files.items()]
    return Section("numbers", "Given, assumed, identified", tuple(blocks))


def _grid(name: str, model: BaseModel) -> Grid:
    return Grid(name, ("number", "value", "origin", "source"), tuple(_rows(model)), left=4)


def _rows(model: BaseModel) -> Iterator[tuple[str, ...]]:
    for key, quantity in quantities(model, ""):
        source = quantity.source + (f" ({quantity.residual})" if quantity.residual else "")
        yield key, _value(quantity), quantity.origin, source


def _value(quantity: Quantity) -> str:
    unit = "" if quantity.unit == "1" else f" {quantity.unit}"
    numbers = [number(value) for value in quantity.numbers]
    if len(numbers) > 8:
        numbers = [*numbers[:3], "…", *numbers[-2:]]
    return ", ".join(numbers) + unit

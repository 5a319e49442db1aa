"""What both pages have: laws, origins of numbers, and a recorded sweep beside the simulated one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from cam_rig.bag.completeness import require_complete
from cam_rig.errors import BagError
from cam_rig.laws import Law
from cam_rig.laws.cam import CamSet
from cam_rig.laws.law import continuity_in_words, extremes
from cam_rig.report.document import Content
from cam_rig.schema.quantity import ORIGINS, Quantity
from cam_rig.schema.segment_base import quantities
from cam_rig.show.result import Column, Records
from cam_rig.show.tables import Cell, DataTable, Header, format_number, tabulate
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.simulate import step_levels
from cam_rig.studies.simulate.recorded import read_recording
from cam_rig.units import FloatArray, rms


@dataclass(frozen=True, eq=False)
class Recorded:
    """Levels (dB) of a bag by cam, at the scene's speeds in rising order, and its messages."""

    bag: Path
    level_db: dict[str, FloatArray]
    messages: int


def read_recorded(bag: Path, loaded: LoadedScene) -> Recorded:
    """Read a bag of that scene."""
    recording = read_recording(bag)
    _require_same(bag, recording.loaded, loaded)
    require_complete(bag, loaded.scene)
    levels = step_levels(recording.ticks, loaded.scene.program.settle_turns.si)
    by_cam = {cam: np.array([steps[s] for s in sorted(steps)]) for cam, steps in levels.items()}
    return Recorded(bag, by_cam, sum(recording.counts.values()))


def recorded_table(
    recorded: Recorded,
    simulated: Mapping[str, FloatArray],
    titles: Mapping[str, str],
    published: Mapping[str, FloatArray] | None = None,
) -> DataTable:
    """What lies between a bag's levels and the simulated ones (dB), and published ones if any."""
    known, away = published or {}, Header("largest difference to this run", "dB", ".4f")
    left = Header("r.m.s. difference to published", "dB", ".2f")
    return tabulate(
        f"The recorded run {recorded.bag.name}, {recorded.messages} messages",
        recorded.level_db.items(),
        (
            (Header("cam"), lambda row: titles[row[0]]),
            (away, lambda row: float(np.abs(row[1] - simulated[row[0]]).max())),
            (left, lambda row: rms(row[1] - known[row[0]]) if row[0] in known else None),
        ),
    )


def _require_same(bag: Path, found: LoadedScene, wanted: LoadedScene) -> None:
    if found.scene.name != wanted.scene.name:
        raise BagError(
            f"{bag}: is a recording of the scene {found.scene.name!r}; allowed: of "
            f"{wanted.scene.name!r}, so record that with: cam-rig run {wanted.scene.name}"
        )
    now = _numbers(wanted)
    if changed := [name for name, number in _numbers(found).items() if number != now[name]]:
        raise BagError(
            f"{bag}: was recorded with another {' and '.join(changed)} than the files have now; "
            f"allowed: the same, so record it anew with: cam-rig run {wanted.scene.name}"
        )


def _numbers(loaded: LoadedScene) -> dict[str, Any]:
    """What would make other levels: not what a file's words say, only its numbers."""
    laws = loaded.laws.items()
    return {
        "program": loaded.scene.program.speeds.si_list,
        "model": loaded.scene.model,
        "follower": loaded.follower,
        "sound": None if loaded.missing_for_sound else loaded.radiation,
        "cams": {cam: (law.breaks.tobytes(), law.ordinates.tobytes()) for cam, law in laws},
    }


# What both pages show: the laws, and where each number is from.

#: More numbers than this of one quantity are not all shown.
MOST_SHOWN = 8
#: A derivative of the lift in the cam angle, and what its unit is divided by.
DERIVATIVES = (("", ""), ("s′", "rad"), ("s″", "rad²"), ("s‴", "rad³"))


def laws_table(
    caption: str, cam_set: CamSet, shown: Mapping[int, str], *notes: str, over_lift: bool = False
) -> DataTable:
    """Smoothness and peaks of each law, from exact roots, in mm or over the lift."""
    unit = "1" if over_lift else "mm"

    def peak(order: int, end: int) -> Callable[[tuple[str, Law]], Cell]:
        return lambda row: (
            extremes(row[1], order)[end].value * (1.0 / row[1].lift if over_lift else 1e3)
        )

    fields: list[tuple[Header, Callable[[tuple[str, Law]], Cell]]]
    fields = [(Header("law" if over_lift else "cam"), lambda row: cam_set.titles[row[0]])]
    if not over_lift:
        fields.append((Header("lift", "mm", ".4g"), lambda row: 1e3 * row[1].lift))
    fields.append((Header("continuity"), lambda row: continuity_in_words(row[1])))
    for order, form in shown.items():
        name, per = DERIVATIVES[order]
        fields += [
            (Header(f"{words} {name}", f"{unit}/{per}", form), peak(order, end))
            for words, end in (("largest", 1), ("smallest", 0))
        ]
    return tabulate(caption, cam_set.laws.items(), fields, *notes)


def origins(files: Mapping[str, BaseModel], own: bool = False) -> Content:
    """Every number of every file with its origin; whether they are a person's ``own``."""
    rows = {name: list(quantities(model, "")) for name, model in files.items()}
    counts = Counter(quantity.origin for some in rows.values() for _, quantity in some)
    columns = (
        Column("number", of="0"),
        Column("value", of=lambda row: _value(row[1])),
        Column("origin", of="1.origin"),
        Column("source", of=lambda row: _source(row[1])),
    )
    tables = [Records("", name, columns, some) for name, some in rows.items()]
    return Content(
        [part for table in tables for part in table.to_display()],
        values={"origins": ", ".join(f"{counts[o]} {o}" for o in ORIGINS), "own": own},
    )


def _source(quantity: Quantity) -> str:
    return quantity.source + (f" ({quantity.residual})" if quantity.residual else "")


def _value(quantity: Quantity) -> str:
    unit = "" if quantity.unit == "1" else f" {quantity.unit}".replace(" deg", "°")
    numbers = [format_number(value) for value in quantity.numbers]
    if len(numbers) > MOST_SHOWN:
        numbers = [*numbers[:3], "…", *numbers[-2:]]
    return ", ".join(numbers) + unit.replace("*", "·").replace("^2", "²")

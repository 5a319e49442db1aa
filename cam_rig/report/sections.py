"""A recorded sweep beside the simulated one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from cam_rig.bag.completeness import require_complete
from cam_rig.bag.reader import read_recording
from cam_rig.errors import BagError
from cam_rig.schema.quantity import Quantity
from cam_rig.schema.segment_base import quantities
from cam_rig.show.tables import DataTable, Head, number, tabulate
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.simulate import step_levels
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
    """What lies between a bag's levels and the simulated ones (dB), and published ones if any.

    ``titles`` are what cams are called.
    """
    known = published or {}
    return tabulate(
        f"The recorded run {recorded.bag.name}, {recorded.messages} messages",
        recorded.level_db.items(),
        (
            (Head("cam"), lambda row: titles[row[0]]),
            (
                Head("largest difference to this run", "dB", ".4f"),
                lambda row: float(np.abs(row[1] - simulated[row[0]]).max()),
            ),
            (
                Head("r.m.s. difference to published", "dB", ".2f"),
                lambda row: rms(row[1] - known[row[0]]) if row[0] in known else None,
            ),
        ),
    )


def _require_same(bag: Path, found: LoadedScene, wanted: LoadedScene) -> None:
    if found.scene.name != wanted.scene.name:
        raise BagError(
            f"{bag}: is a recording of the scene {found.scene.name!r}; allowed: of "
            f"{wanted.scene.name!r}, so record that with: cam-rig run {wanted.scene.name}"
        )
    if changed := _changed(found, wanted):
        raise BagError(
            f"{bag}: was recorded with another {' and '.join(changed)} than the files have now; "
            f"allowed: the same, so record it anew with: cam-rig run {wanted.scene.name}"
        )


def _changed(found: LoadedScene, wanted: LoadedScene) -> list[str]:
    """What would make other levels: not what a file's words say, only its numbers."""
    pairs = {
        "program": (found.scene.program.speeds.si_list, wanted.scene.program.speeds.si_list),
        "model": (found.scene.model, wanted.scene.model),
        "follower": (found.follower, wanted.follower),
        "sound": (found.radiation, wanted.radiation),
        "cams": (_numbers(found), _numbers(wanted)),
    }
    return [name for name, (one, other) in pairs.items() if one != other]


def _numbers(loaded: LoadedScene) -> dict[str, tuple[bytes, bytes]]:
    """The laws of a loaded scene as their exact numbers."""
    return {
        cam: (law.breaks.tobytes(), law.ordinates.tobytes()) for cam, law in loaded.laws.items()
    }


# The report's tables: those of the studies, and those that only a report has.

#: More numbers than this of one quantity are not all shown.
MOST_SHOWN = 8


def origins_table(name: str, model: BaseModel) -> DataTable:
    """Every number of a file with its origin and its source."""
    return tabulate(
        name,
        quantities(model, ""),
        (
            (Head("number"), lambda row: row[0]),
            (Head("value"), lambda row: _value(row[1])),
            (Head("origin"), lambda row: row[1].origin),
            (Head("source"), lambda row: _source(row[1])),
        ),
    )


def _source(quantity: Quantity) -> str:
    return quantity.source + (f" ({quantity.residual})" if quantity.residual else "")


def _value(quantity: Quantity) -> str:
    unit = "" if quantity.unit == "1" else f" {quantity.unit}".replace(" deg", "°")
    numbers = [number(value) for value in quantity.numbers]
    if len(numbers) > MOST_SHOWN:
        numbers = [*numbers[:3], "…", *numbers[-2:]]
    return ", ".join(numbers) + unit.replace("*", "·").replace("^2", "²")

"""Parts of several pages: laws, origins of numbers, and the comparison with a recorded run."""

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
from cam_rig.laws.law import extremes, format_continuity
from cam_rig.report.document import Content
from cam_rig.schema.quantity import ORIGINS, Quantity
from cam_rig.schema.segment_base import iterate_quantities
from cam_rig.show.result import Column, Records
from cam_rig.show.tables import Cell, DataTable, Header, format_number, tabulate
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.simulate import step_levels
from cam_rig.studies.simulate.recorded import read_recording
from cam_rig.units import FloatArray, rms


@dataclass(frozen=True, eq=False)
class Recorded:
    """Levels of a recorded run.

    Attributes
    ----------
    bag : Path
    level_db : dict of str to array
        Sound pressure levels (dB) by cam, at the speeds of the scene in rising order.
    messages : int
        Number of messages in the bag.
    """

    bag: Path
    level_db: dict[str, FloatArray]
    messages: int


def read_recorded(bag: Path, loaded: LoadedScene) -> Recorded:
    """Read the levels of a bag.

    Raises
    ------
    BagError
        If the bag is incomplete, or if its scene or one of its numbers differs from `loaded`.
    """
    recording = read_recording(bag)
    _require_same(bag, recording.loaded, loaded)
    require_complete(bag, loaded.scene)
    levels = step_levels(recording.ticks, loaded.scene.schedule.transient_turns.si)
    by_cam = {cam: np.array([steps[s] for s in sorted(steps)]) for cam, steps in levels.items()}
    return Recorded(bag, by_cam, sum(recording.counts.values()))


def recorded_table(
    recorded: Recorded,
    simulated: Mapping[str, FloatArray],
    titles: Mapping[str, str],
    published: Mapping[str, FloatArray] | None = None,
) -> DataTable:
    """Return a table of the differences (dB) of recorded and other levels, by cam.

    The other levels are the simulated and, if there are any, the published levels.
    """
    reference = published or {}
    difference = Header("largest difference to this run", "dB", ".4f")
    rms_error = Header("r.m.s. difference to published", "dB", ".2f")
    return tabulate(
        f"The recorded run {recorded.bag.name}, {recorded.messages} messages",
        recorded.level_db.items(),
        (
            (Header("cam"), lambda row: titles[row[0]]),
            (difference, lambda row: float(np.abs(row[1] - simulated[row[0]]).max())),
            (
                rms_error,
                lambda row: rms(row[1] - reference[row[0]]) if row[0] in reference else None,
            ),
        ),
    )


def _require_same(bag: Path, recorded: LoadedScene, loaded: LoadedScene) -> None:
    """Raise BagError if a bag was recorded with another scene than that of the files.

    The names and all numbers on which the sound levels depend are compared.
    """
    name = loaded.scene.name
    if recorded.scene.name != name:
        raise BagError(
            f"{bag}: must be a recording of the scene {name!r}, got {recorded.scene.name!r}; "
            f"record it with: cam-rig run {name}"
        )
    numbers = _determining_numbers(loaded)
    before = _determining_numbers(recorded)
    if changed := [key for key, number in before.items() if number != numbers[key]]:
        raise BagError(
            f"{bag}: was recorded with another {' and '.join(changed)} than the files have now; "
            f"record it again with: cam-rig run {name}"
        )


def _determining_numbers(loaded: LoadedScene) -> dict[str, Any]:
    """Return the numbers of a scene on which the levels depend, by subject.

    Titles and other texts of the files are left out.
    """
    laws = loaded.laws.items()
    return {
        "schedule": loaded.scene.schedule.speeds.si_list,
        "model": loaded.scene.model,
        "follower": loaded.follower,
        "sound": None if loaded.missing_for_sound else loaded.radiation,
        "cams": {cam: (law.breaks.tobytes(), law.ordinates.tobytes()) for cam, law in laws},
    }


# Tables of the laws, and of the origin of each number.

#: Largest number of values of a quantity that are all displayed. Of a longer list only the first 3
#: and the last 2 values are displayed.
MAX_SHOWN_NUMBERS = 8
#: Symbol, and divisor of the unit, of the derivatives of the lift in the cam angle, by order.
DERIVATIVES = (("", ""), ("s′", "rad"), ("s″", "rad²"), ("s‴", "rad³"))


def laws_table(
    caption: str, cam_set: CamSet, formats: Mapping[int, str], *notes: str, over_lift: bool = False
) -> DataTable:
    """Return a table with the continuity and the peaks of each law, from exact roots.

    Parameters
    ----------
    caption : str
        Caption of the table.
    cam_set : CamSet
        Cams with their laws.
    formats : mapping of int to str
        Number format of each displayed derivative, by its order.
    *notes : str
        Notes under the table.
    over_lift : bool, optional
        True for peaks divided by the lift, instead of in mm (default: False).
    """
    unit = "1" if over_lift else "mm"

    def peak(order: int, end: int) -> Callable[[tuple[str, Law]], Cell]:
        return lambda row: (
            extremes(row[1], order)[end].value * (1.0 / row[1].lift if over_lift else 1e3)
        )

    fields: list[tuple[Header, Callable[[tuple[str, Law]], Cell]]]
    fields = [(Header("law" if over_lift else "cam"), lambda row: cam_set.titles[row[0]])]
    if not over_lift:
        fields.append((Header("lift", "mm", ".4g"), lambda row: 1e3 * row[1].lift))
    fields.append((Header("continuity"), lambda row: format_continuity(row[1])))
    for order, number_format in formats.items():
        symbol, divisor = DERIVATIVES[order]
        fields += [
            (Header(f"{word} {symbol}", f"{unit}/{divisor}", number_format), peak(order, end))
            for word, end in (("largest", 1), ("smallest", 0))
        ]
    return tabulate(caption, cam_set.laws.items(), fields, *notes)


def origins(files: Mapping[str, BaseModel], own: bool = False) -> Content:
    """Return a table per file with the value, origin and source of each number.

    `own` is True for the files of a user, on a page of `cam-rig report`.
    """
    rows = {name: list(iterate_quantities(model, "")) for name, model in files.items()}
    counts = Counter(quantity.origin for numbers in rows.values() for _, quantity in numbers)
    columns = (
        Column("number", of="0"),
        Column("value", of=lambda row: _value(row[1])),
        Column("origin", of="1.origin"),
        Column("source", of=lambda row: _source(row[1])),
    )
    tables = [Records("", name, columns, numbers) for name, numbers in rows.items()]
    return Content(
        [part for table in tables for part in table.to_display()],
        values={"origins": ", ".join(f"{counts[o]} {o}" for o in ORIGINS), "own": own},
    )


def _source(quantity: Quantity) -> str:
    return quantity.source + (f" ({quantity.residual})" if quantity.residual else "")


def _value(quantity: Quantity) -> str:
    unit = "" if quantity.unit == "1" else f" {quantity.unit}".replace(" deg", "°")
    numbers = [format_number(value) for value in quantity.numbers]
    if len(numbers) > MAX_SHOWN_NUMBERS:
        numbers = [*numbers[:3], "…", *numbers[-2:]]
    return ", ".join(numbers) + unit.replace("*", "·").replace("^2", "²")

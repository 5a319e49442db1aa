"""The readings of Table 2 as tables, and what they come to in a sentence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from cam_rig.paper.jump.refit import ROUNDED_TO
from cam_rig.paper.readings.readings import Read
from cam_rig.paper.readings.search import Found
from cam_rig.schema import TableReading
from cam_rig.schema.quantity import Quantity
from cam_rig.show.tables import Cell, DataTable, Head, tabulate

#: The numbers of a reading: heading, unit, format, factor from SI.
NUMBERS = {
    "event": ("event angle", "°", ".1f", 180.0 / math.pi),
    "high_dwell": ("high dwell", "°", ".1f", 180.0 / math.pi),
    "stem_stiffness": ("stem", "N/m", ".4g", 1.0),
    "roller_share": ("mass split", "", ".4g", 1.0),
    "stem_damping": ("stem damping", "N·s/m", ".4g", 1.0),
    "damping": ("damping to ground", "N·s/m", ".4g", 1.0),
    "preload": ("preload", "N", ".4g", 1.0),
}


def numbers_table(readings: Mapping[str, TableReading]) -> DataTable:
    """The numbers of each reading; those identified from the table are marked."""
    return tabulate(
        "Readings of the paper's Table 2: their numbers",
        readings.items(),
        (
            (Head("reading"), lambda item: item[0]),
            *(
                (Head(heading, unit), lambda item, key=key: _number(item[1], key))
                for key, (heading, unit, _, _) in NUMBERS.items()
            ),
            (Head("fitted", "", "d"), lambda item: len(item[1].fitted)),
        ),
        "* identified from the paper's Table 2. The others are given or assumed, with their "
        "sources in the readings' file.",
    )


def _number(reading: TableReading, key: str) -> Cell:
    quantity = getattr(reading, key)
    _, _, shown, factor = NUMBERS[key]
    mark = "*" if quantity.origin == "identified" else ""
    return format(quantity.si * factor, shown) + mark


def speeds_table(found: Sequence[Read]) -> DataTable:
    """The first speed of the grid at which each reading loses contact, beside the printed one."""
    cams = [row.cam for row in found[0].rows]
    return tabulate(
        f"Readings of the paper's Table 2: first speed with loss of contact, looked at every "
        f"{ROUNDED_TO:g} rpm",
        found,
        (
            (Head("reading"), lambda read: read.name),
            (Head("fitted", "", "d"), lambda read: len(read.reading.fitted)),
            *(
                (
                    Head(f"{cam}, {found[0].rows[i].printed.rpm:g} printed", "rpm", "g"),
                    lambda read, i=i: _finite(read.rows[i].rpm),
                )
                for i, cam in enumerate(cams)
            ),
            (Head("speeds that agree", "", "d"), lambda read: read.speeds),
            (Head("times that agree", "", "d"), lambda read: read.times),
            (Head("jump speeds, r.m.s.", "%", ".2f"), lambda read: 100.0 * read.rms),
        ),
        "A time agrees within half a turn, where the speed does.",
        "Jump speeds, r.m.s.: of those at any speed, also between those of the grid.",
    )


def times_table(found: Sequence[Read]) -> DataTable:
    """When contact is first lost, and what a part in a million of the speed does to it."""
    return tabulate(
        "Readings of the paper's Table 2: time of the first loss of contact",
        [(read, row) for read in found for row in read.rows],
        (
            (Head("reading"), lambda item: item[0].name),
            (Head("cam"), lambda item: item[1].cam),
            (Head("jump speed", "rpm", ".1f"), lambda item: item[1].jump),
            (Head("paper", "s", ".2f"), lambda item: item[1].printed.time_s),
            (Head("time", "s", ".3f"), lambda item: _finite(item[1].time)),
            (Head("at the jump + 1e-6", "s", ".3f"), lambda item: _finite(item[1].at_limit)),
            (Head("+ 1e-3", "s", ".3f"), lambda item: _finite(item[1].beyond)),
            (Head("window", "rpm", ".2f"), lambda item: item[1].window),
            (Head("least force", "N", "+.1f"), lambda item: item[1].force),
        ),
        "Time: at the first speed of the grid, and above the jump speed by so much of it.",
        f"Window: over how many rpm, of {ROUNDED_TO:g} on "
        "either side of the printed speed, the printed time comes out within half a turn.",
        "Least force: of a run at the printed speed. Where it is positive, vibration would have to "
        "take it away.",
    )


def with_numbers(reading: TableReading, found: Found) -> TableReading:
    """A reading with the numbers that a search found in place of those it identified."""
    changed = {}
    for key, value in found.numbers.items():
        quantity: Quantity = getattr(reading, key)
        update: dict[str, float] = {quantity.origin: value / quantity.factor}
        changed[key] = quantity.model_copy(update=update)
    return reading.model_copy(update=changed)


def widest(found: Sequence[Read]) -> float:
    """The widest range of speeds (rpm) over which a printed time comes out."""
    return max(row.window for read in found for row in read.rows)


def nearest(found: Sequence[Read]) -> Read:
    """The reading whose jump speeds, at any speed, are nearest to the printed ones."""
    return min(found, key=lambda read: read.rms)


def conclusion(found: Sequence[Read]) -> str:
    """What the readings come to, in a line."""
    fitted = ", ".join(
        f"{read.name} {read.speeds} of {len(read.rows)} speeds and {read.times} times with "
        f"{len(read.reading.fitted)} fitted"
        for read in found
    )
    near = nearest(found)
    return (
        f"{fitted}; jump speeds at any speed are nearest on {near.name}, {100.0 * near.rms:.2f} % "
        f"r.m.s.; a printed time comes out over {widest(found):.2g} of {2 * ROUNDED_TO:g} rpm "
        "about its speed at most"
    )


def _finite(value: float) -> float | None:
    return None if math.isnan(value) else value

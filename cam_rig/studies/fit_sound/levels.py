"""Tables of sound pressure levels as a sound level meter or a spreadsheet gives them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from cam_rig.schema.instrument_table import NOTHING, CellTable, read_lines
from cam_rig.units import FloatArray

#: Headings of a speed in rpm and of a level in dB, in English, Spanish, German, French, Italian.
HEADINGS = {
    "speed": re.compile(r"rpm|1/min|min-1|speed|drehzahl|velocidad|vitesse|giri", re.I),
    "level": re.compile(r"db|level|pegel|nivel|niveau|livello", re.I),
}


def read_levels(path: Path) -> FloatArray:
    """Read speeds (rpm) and levels (dB), `(n, 2)`; rows without a level are left out."""
    table = CellTable(path.name, read_lines(path, "speed and level"))
    if table.first is None or table.first == 0:
        raise table.refused("has no heading over its numbers; allowed: a heading, such as rpm, dB")
    headings = table.headings(len(table.rows[table.first][1]))
    columns = []
    for name, pattern in HEADINGS.items():
        fitting = [i for i, one in enumerate(headings) if pattern.search(one.text)]
        if len(fitting) != 1:
            texts = ", ".join(one.text for one in headings)
            raise table.refused(f"columns are {texts}; allowed: one {name}, such as rpm, and dB")
        columns.append(fitting[0])
    body = table.rows[table.first :]
    table.how_read(body, columns)  # refuses a mixture of decimal marks
    cells = (table.numbers(line, row, headings, columns) for line, row in body)
    rows = [[row[i] for i in columns] for row in cells]
    return np.array([row for row in rows if row[1] != NOTHING], dtype=float).reshape(-1, 2)

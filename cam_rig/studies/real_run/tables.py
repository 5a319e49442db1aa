"""A comparison as tables and as plain data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from cam_rig.simulation.calibrated import RELATIVE_NOTE
from cam_rig.studies.real_run.comparison import SpeedDeparture
from cam_rig.studies.real_run.departure import Departure
from cam_rig.studies.real_run.lost_contact import LostContact
from cam_rig.tables import Cell, Column, DataTable, tabulate

Take = Callable[[SpeedDeparture], Cell]


def departure_table(rows: Sequence[SpeedDeparture], title: str) -> DataTable:
    """Lift and force: r.m.s. and largest difference, noise, and where."""
    noisy = any(one is not None and not one.exact for row in rows for one in (row.lift, row.force))
    return tabulate(
        f"{title}: measured less model",
        rows,
        (
            (Column("cam"), lambda row: row.cam),
            (Column("speed", "rpm", ".5g"), lambda row: row.rpm),
            (Column("turns", "", ".3g"), lambda row: row.turns),
            *_columns("lift", "µm", 1e6, noisy),
            *_columns("force", "N", 1.0, noisy),
        ),
        "R.m.s. of all readings. Noise: scatter of the readings from turn to turn. Largest: of the "
        "mean over the turns, in parts of 2°. Forces within 0.5° of a jump of the model's are left "
        "out, such as at a landing: there they say when, as the other table does."
        if noisy
        else "Sample by sample, driven with the recorded states of the cam.",
        "*: within the noise, which explains all but half of itself at most."
        if noisy
        else "=: equal to rounding.",
    )


def _columns(name: str, unit: str, factor: float, noisy: bool) -> list[tuple[Column, Take]]:
    def of(field: str, scale: float) -> Take:
        def take(row: SpeedDeparture) -> Cell:
            found: Departure | None = getattr(row, name)
            return None if found is None else float(getattr(found, field)) * scale

        return take

    def verdict(row: SpeedDeparture) -> Cell:
        found: Departure | None = getattr(row, name)
        return None if found is None or not found.within else "*" if noisy else "="

    columns: list[tuple[Column, Take]] = [
        (Column(f"{name} r.m.s.", unit, ".3g"), of("rms", factor)),
        (Column("noise", unit, ".3g"), of("noise", factor)),
        (Column("largest", unit, "+.3g"), of("largest", factor)),
        (Column("at", "°", ".0f"), of("degrees", 1.0)),
        (Column(""), verdict),
    ]
    return columns if noisy else [columns[0], *columns[2:]]


def event_table(rows: Sequence[SpeedDeparture], calibrated: bool) -> DataTable:
    """Lift-offs of both, how far apart in time, and the sound levels."""

    def of(field: str, factor: float = 1.0) -> Take:
        def take(row: SpeedDeparture) -> Cell:
            found: LostContact | None = row.contact
            value = None if found is None else getattr(found, field)
            return None if value is None else float(value) * factor

        return take

    heard = any(row.measured_db is not None for row in rows)
    return tabulate(
        "Lift-offs and landings, sound level",
        rows,
        (
            (Column("cam"), lambda row: row.cam),
            (Column("speed", "rpm", ".5g"), lambda row: row.rpm),
            (Column("lift-offs measured", "1/turn", ".3g"), of("measured")),
            (Column("model", "1/turn", ".3g"), of("model")),
            (Column("events later by", "ms", "+.3f"), of("shift", 1e3)),
            (Column("by", "°", "+.2f"), of("degrees")),
            (Column("contact lost"), lambda row: row.contact.rule if row.contact else None),
            (Column("level measured", "dB", ".1f"), lambda row: row.measured_db),
            (Column("model", "dB", ".1f"), lambda row: row.model_db if heard else None),
            (Column("difference", "dB", "+.2f"), lambda row: row.level_difference),
        ),
        "Events later by: the median, of lift-offs and landings that both have."
        if any(row.contact and row.contact.shift is not None for row in rows)
        else "",
        RELATIVE_NOTE if heard and not calibrated else "",
    )


def every_number_table(rows: Sequence[SpeedDeparture], title: str) -> DataTable:
    """One table of all, a row each cam and speed, in SI units, for another program to read."""
    plain = [_plain(row) for row in rows]
    names = list(dict.fromkeys(name for row in plain for name in row))
    fields = ((Column(name), lambda row, name=name: _cell(row.get(name))) for name in names)
    return tabulate(f"{title}: measured less model", plain, fields)


def _cell(value: Any) -> Cell:
    return str(value).lower() if isinstance(value, bool) else value


def to_json(rows: Sequence[SpeedDeparture], sentences: Sequence[str]) -> dict[str, Any]:
    """Every number in SI units, with the unit in its name."""
    return {"speeds": [_plain(row) for row in rows], "conclusions": list(sentences)}


def _plain(row: SpeedDeparture) -> dict[str, Any]:
    plain: dict[str, Any] = {"cam": row.cam, "rpm": row.rpm, "turns": row.turns}
    for name, unit in (("lift", "m"), ("force", "N")):
        found: Departure | None = getattr(row, name)
        if found is not None:
            plain |= {
                f"{name}_rms_{unit}": found.rms,
                f"{name}_noise_{unit}": found.noise,
                f"{name}_largest_{unit}": found.largest,
                f"{name}_largest_at_deg": found.degrees,
                f"{name}_within_noise": found.within,
            }
    if row.contact is not None:
        plain |= {
            "lift_offs_measured_per_turn": row.contact.measured,
            "lift_offs_model_per_turn": row.contact.model,
            "events_later_s": row.contact.shift,
            "events_later_deg": row.contact.degrees,
        }
    return plain | {
        "level_measured_db": row.measured_db,
        "level_model_db": row.model_db,
        "force_difference_peak_hz": row.peak_hz,
    }

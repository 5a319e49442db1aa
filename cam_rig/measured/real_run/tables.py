"""A comparison as tables and as plain data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cam_rig.measured.real_run.comparison import SpeedDeparture, common_frequency
from cam_rig.measured.real_run.deviation import Departure, LostContact
from cam_rig.measured.real_run.pairs import MeasuredPairs
from cam_rig.show.tables import Cell, DataTable, Head, tabulate
from cam_rig.simulation.instruments import pulls
from cam_rig.simulation.scene import RELATIVE_NOTE
from cam_rig.units import TURN

# What a comparison says, in sentences that follow from its rows.

#: Both by their name: factor to the unit that is shown, and the unit.
SHOWN = {"lift": (1e6, "µm"), "force": (1.0, "N")}

#: A lift that is so many times the cam's is that of another.
UNLIKE = 2.0

#: °, by which events that both have are not of one time.
LATER_DEG = 1.0

#: dB, levels that differ by less are alike to the ear.
ALIKE_DB = 1.0


def sentences(rows: Sequence[SpeedDeparture]) -> list[str]:
    """Where they part most, or that they agree."""
    found = [
        (name, row, one)
        for row in rows
        for name in SHOWN
        if (one := getattr(row, name)) is not None
    ]
    if not found:
        return ["Neither lift nor force was measured at a steady speed: only levels compare."]
    restless = {id(row) for _, row, one in found if one.restless}
    parted = [entry for entry in found if not entry[2].within and id(entry[1]) not in restless]
    said = [_largest(*max(parted, key=lambda entry: entry[2].relative))] if parted else []
    said += _agreements(found)
    if restless:
        speeds = ", ".join(f"{row.rpm:.4g}" for row in rows if id(row) in restless)
        said.append(
            f"At {speeds} rpm the model's own turns differ, as it bounces: there lift-offs a turn "
            "compare, and curves do not."
        )
    differing = [row for row in rows if row.contact and _count_differs(row)]
    if differing:
        row = differing[0]
        assert row.contact is not None
        said.append(
            f"Lift-offs differ first at {row.rpm:.4g} rpm: {row.contact.measured:.2g} a turn "
            f"measured, {row.contact.model:.2g} of the model."
        )
    said += _later(rows)
    said += _levels(rows)
    peaks = [row.peak_hz for row in rows]
    frequency = common_frequency([row.rpm for row in rows], peaks)
    if frequency is not None:
        said.append(
            f"The difference of the force rings near {frequency:.3g} Hz at several speeds alike: a "
            "resonance, perhaps of the force sensor."
        )
    return said


def _largest(name: str, row: SpeedDeparture, one: Departure) -> str:
    factor, unit = SHOWN[name]
    part = 100.0 * one.relative
    percent = f"{part:.2g}" if part < 10.0 else f"{part:.0f}"
    return (
        f"The largest departure is of the {name}: {factor * one.largest:+.3g} {unit} at "
        f"{row.rpm:.4g} rpm, θ = {one.degrees:.0f}° ({row.cam}), {percent} % of "
        "its range."
    )


def _agreements(found: Sequence[tuple[str, SpeedDeparture, Departure]]) -> list[str]:
    said = []
    for name, (factor, unit) in SHOWN.items():
        here = [one for what, _, one in found if what == name]
        if not here or not all(one.within or one.restless for one in here):
            continue
        steady = "steady " if any(one.restless for one in here) else ""
        here = [one for one in here if not one.restless] or here
        noise = max(max(one.noise, one.rms) for one in here)
        if all(one.exact for one in here):
            said.append(f"The {name} is that of the model, to rounding, at every speed.")
        else:
            said.append(
                f"The {name} agrees with the model within the noise at every {steady}speed: "
                f"{factor * noise:.2g} {unit} r.m.s."
            )
    return said


def _count_differs(row: SpeedDeparture) -> bool:
    """Whether a lift-off in two turns is more or less: noise alone may show one now and then."""
    assert row.contact is not None
    return abs(row.contact.measured - row.contact.model) >= 0.5


def _later(rows: Sequence[SpeedDeparture]) -> list[str]:
    """Where lift-offs and landings come at another time than the model's."""
    known = [row.contact for row in rows if row.contact and row.contact.degrees is not None]
    worst = max(known, key=lambda one: abs(one.degrees or 0.0), default=None)
    if worst is None or worst.degrees is None or abs(worst.degrees) < LATER_DEG:
        return []
    row = next(row for row in rows if row.contact is worst)
    return [
        f"Lift-offs and landings come {1e3 * abs(worst.shift or 0.0):.2g} ms, "
        f"{abs(worst.degrees):.2g}° of the cam, {'later' if worst.degrees > 0.0 else 'earlier'} "
        f"than the model's at {row.rpm:.4g} rpm."
    ]


def _levels(rows: Sequence[SpeedDeparture]) -> list[str]:
    known = [row for row in rows if row.level_difference is not None]
    if not known:
        return []
    worst = max(known, key=lambda row: abs(row.level_difference or 0.0))
    most = worst.level_difference or 0.0
    if abs(most) < ALIKE_DB:
        return [f"Sound levels differ by {abs(most):.2g} dB at most."]
    return [f"The level differs most at {worst.rpm:.4g} rpm: {most:+.1f} dB."]


def done(pairs: MeasuredPairs) -> list[str]:
    """What was done to lay a bench's readings on the cam's angle."""
    said = [_resolution(pairs), *_aligned(pairs)]
    said += _range(pairs)
    if pairs.run.force is not None and pulls(pairs.run.force.value):
        said.append(
            "The contact force measured is mostly below zero, as a pull: turn its sign with "
            "force=-/TOPIC."
        )
    curved = sum(not stretch.line for stretch in pairs.stretches)
    if curved:
        said.append(
            f"The speed is not even within {curved} of {len(pairs.stretches)} steady parts: there "
            "the cam follows a smooth curve through the readings."
        )
    if pairs.left_out > 0.02:
        said.append(
            f"{100.0 * pairs.left_out:.0f} % of the time the cam does not turn steadily: left out."
        )
    return said


def _range(pairs: MeasuredPairs) -> list[str]:
    """A lift that is not the cam's by far: of another unit, perhaps, or another cam."""
    if pairs.run.lift is None:
        return []
    span = float(np.ptp(np.percentile(pairs.run.lift.value, [0.5, 99.5])))
    whole = pairs.loaded.laws[pairs.cam].lift
    if whole / UNLIKE < span < whole * UNLIKE:
        return []
    return [
        f"The lift measured ranges over {1e3 * span:.3g} mm, that of cam {pairs.cam} over "
        f"{1e3 * whole:.3g} mm: is it the cam, and the unit?"
    ]


def _resolution(pairs: MeasuredPairs) -> str:
    if not pairs.count:
        return "The angle shows no counts of an encoder: it is taken as it is, smoothed."
    worst = max(float(np.degrees(stretch.largest)) for stretch in pairs.stretches)
    return (
        f"The angle has {TURN / pairs.count:.0f} counts a turn; the motion through them is within "
        f"{worst:.2g}° of every reading."
    )


def _aligned(pairs: MeasuredPairs) -> list[str]:
    found = pairs.alignment
    degrees = float(np.degrees(found.offset))
    if pairs.given:
        said = [f"The cam is {degrees:+.3f}° from the angle measured, as given."]
    elif found.shows("offset") or found.errors[0] > 0.0:
        said = [f"The cam is {degrees:+.3f}° from the angle measured, found from the lift."]
    else:
        why = "has too few readings" if pairs.run.lift is not None else "was not measured"
        return [
            f"The cam is taken {degrees:+.3g}° from the angle measured: the lift {why} to find it "
            "by; --offset gives it."
        ]
    if found.drift:
        said.append(
            f"The sensors' clock is {1e6 * abs(found.drift):.0f} ppm "
            f"{'slow' if found.drift > 0.0 else 'fast'} beside that of the angle: corrected."
        )
    if found.delay:
        said.append(
            f"The sensors' stamps are {1e3 * abs(found.delay):.3g} ms "
            f"{'early' if found.delay > 0.0 else 'late'} beside those of the angle: corrected."
        )
    if found.shows("zero") and abs(found.zero) > found.scatter:
        said.append(f"The lift's zero is off by {1e3 * found.zero:+.3g} mm: taken off.")
    if found.shows("lag") and abs(found.lag) > found.scatter:
        said.append(
            f"On rise and return the lift differs by {2e6 * abs(found.lag):.3g} µm: "
            f"{'backlash, or a gauge that sticks' if found.lag < 0.0 else 'it leads its motion'}."
        )
    return said


Take = Callable[[SpeedDeparture], Cell]


def departure_table(rows: Sequence[SpeedDeparture], title: str) -> DataTable:
    """Lift and force: r.m.s. and largest difference, noise, and where."""
    noisy = any(one is not None and not one.exact for row in rows for one in (row.lift, row.force))
    return tabulate(
        f"{title}: measured less model",
        rows,
        (
            (Head("cam"), lambda row: row.cam),
            (Head("speed", "rpm", ".5g"), lambda row: row.rpm),
            (Head("turns", "", ".3g"), lambda row: row.turns),
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


def _columns(name: str, unit: str, factor: float, noisy: bool) -> list[tuple[Head, Take]]:
    def of(field: str, scale: float) -> Take:
        def take(row: SpeedDeparture) -> Cell:
            found: Departure | None = getattr(row, name)
            return None if found is None else float(getattr(found, field)) * scale

        return take

    def verdict(row: SpeedDeparture) -> Cell:
        found: Departure | None = getattr(row, name)
        return None if found is None or not found.within else "*" if noisy else "="

    columns: list[tuple[Head, Take]] = [
        (Head(f"{name} r.m.s.", unit, ".3g"), of("rms", factor)),
        (Head("noise", unit, ".3g"), of("noise", factor)),
        (Head("largest", unit, "+.3g"), of("largest", factor)),
        (Head("at", "°", ".0f"), of("degrees", 1.0)),
        (Head(""), verdict),
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
            (Head("cam"), lambda row: row.cam),
            (Head("speed", "rpm", ".5g"), lambda row: row.rpm),
            (Head("lift-offs measured", "1/turn", ".3g"), of("measured")),
            (Head("model", "1/turn", ".3g"), of("model")),
            (Head("events later by", "ms", "+.3f"), of("shift", 1e3)),
            (Head("by", "°", "+.2f"), of("degrees")),
            (Head("contact lost"), lambda row: row.contact.rule if row.contact else None),
            (Head("level measured", "dB", ".1f"), lambda row: row.measured_db),
            (Head("model", "dB", ".1f"), lambda row: row.model_db if heard else None),
            (Head("difference", "dB", "+.2f"), lambda row: row.level_difference),
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
    fields = ((Head(name), lambda row, name=name: _cell(row.get(name))) for name in names)
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

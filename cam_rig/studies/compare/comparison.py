"""Where a run and its model part: a row for each speed, and sentences."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cam_rig.laws import Law
from cam_rig.show import looks
from cam_rig.simulation.instruments import pulls
from cam_rig.studies.compare.deviation import (
    Departure,
    LostContact,
    PairedSignal,
    PairedStep,
    departure,
    lost_contact,
)
from cam_rig.studies.compare.pairs import MeasuredPairs
from cam_rig.units import TURN

# A frequency that stands out of a difference: a sensor or its mounting may have it.

#: Readings of a part whose spectrum is taken, at most, and parts, at least.
LONGEST, PARTS = 1024, 4
#: A peak so many times the median stands out.
STANDS_OUT = 30.0
#: Frequencies that differ by less than this part are one; speeds by more are several.
SAME, OTHER = 0.05, 0.15
#: Below this order of the cam a difference is the motion's: of mass, spring, damping.
LOWEST_ORDER = 8.0


def peak_frequency(pair: PairedSignal) -> float | None:
    """The frequency (Hz) at which a difference has most power; None where none stands out."""
    from scipy.signal import welch

    step = float(np.median(np.diff(pair.time)))
    even = np.arange(pair.time[0], pair.time[-1], step)
    length = min(LONGEST, even.size // PARTS)
    if length < 32:
        return None
    difference = np.interp(even, pair.time, pair.difference)
    frequency, power = welch(difference, 1.0 / step, nperseg=length)
    peak = 1 + int(np.argmax(power[1:]))
    if power[peak] < STANDS_OUT * float(np.median(power[1:])):
        return None
    return float(frequency[peak])


def common_frequency(speeds: Sequence[float], peaks: Sequence[float | None]) -> float | None:
    """The frequency (Hz) that stands out at several speeds alike; None: it moves with them."""
    found = [(speed, peak) for speed, peak in zip(speeds, peaks, strict=True) if peak is not None]
    if len(found) < 2:
        return None
    middle = float(np.median([peak for _, peak in found]))
    alike = [speed for speed, peak in found if abs(peak - middle) <= SAME * middle]
    if len(alike) < 2 or 2 * len(alike) <= len(found) or max(alike) < (1.0 + OTHER) * min(alike):
        return None
    if middle < LOWEST_ORDER * max(alike) / 60.0:
        return None
    return middle


#: What is drawn: its words, unit and factor to it, the same of its differences, and its colour.
QUANTITIES = {
    "lift": ("lift", "mm", 1e3, "µm", 1e6, looks.LIFT),
    "force": ("contact force", "N", 1.0, "N", 1.0, looks.FORCE),
}
#: Readings of a drawn turn, at least and at most.
LEAST_DRAWN, MOST_DRAWN = 300, 1500


@dataclass(frozen=True, eq=False)
class SpeedDeparture:
    """One cam at one speed; what is None was not measured.

    ``turns``: settled; ``contact``: lift-offs a turn, and when; ``measured_db``, ``model_db``:
    sound level, dB re 20 µPa; ``peak_hz``: frequency that stands out of the force's difference,
    None where none does; ``drawn``: the last turn of each of `QUANTITIES`, for a picture.
    """

    cam: str
    rpm: float
    turns: float
    lift: Departure | None
    force: Departure | None
    contact: LostContact | None
    measured_db: float | None
    model_db: float | None
    peak_hz: float | None
    drawn: dict[str, PairedSignal]

    @property
    def level_difference(self) -> float | None:
        """Measured less modelled level, dB."""
        if self.measured_db is None or self.model_db is None:
            return None
        return self.measured_db - self.model_db

    @property
    def exact(self) -> bool:
        """Whether the model was driven with the very states of the cam, sample by sample."""
        return any(one is not None and one.exact for one in (self.lift, self.force))

    @property
    def agrees(self) -> bool:
        """Whether lift and force agree within their noise, or exactly where there is none."""
        return all(one is None or one.within for one in (self.lift, self.force))

    @property
    def later(self) -> float | None:
        """By how much cam angle (rad) events come later than the model's; None: none to compare."""
        degrees = None if self.contact is None else self.contact.degrees
        return None if degrees is None else float(np.radians(degrees))


def compare_steps(steps: Iterable[PairedStep], laws: dict[str, Law]) -> list[SpeedDeparture]:
    """A row for each step; no more than one step is held at a time."""
    return [_row(step, laws[step.cam]) for step in steps]


def _row(step: PairedStep, law: Law) -> SpeedDeparture:
    pairs = {"lift": step.lift, "force": step.force}
    lift, force = (None if pair is None else departure(pair, step.exact) for pair in pairs.values())
    seen = step.force is not None and force is not None and not step.exact and not force.within
    return SpeedDeparture(
        cam=step.cam,
        rpm=step.rpm,
        turns=step.turns,
        lift=lift,
        force=force,
        contact=lost_contact(step, law),
        measured_db=step.levels[0],
        model_db=step.levels[1],
        peak_hz=peak_frequency(step.force) if seen and step.force is not None else None,
        drawn={name: _last_turn(pair) for name, pair in pairs.items() if pair is not None},
    )


def by_cam(rows: Iterable[SpeedDeparture]) -> list[list[SpeedDeparture]]:
    """The rows of each cam."""
    found = dict[str, list[SpeedDeparture]]()
    for row in rows:
        found.setdefault(row.cam, []).append(row)
    return list(found.values())


def _last_turn(pair: PairedSignal) -> PairedSignal:
    """The last turn, or as many of the last as have enough readings, in the order of the angle."""
    count = int(np.count_nonzero(pair.angle > pair.angle[-1] - TURN))
    last = pair.some(slice(-min(pair.angle.size, max(count, LEAST_DRAWN)), None))
    order = np.argsort(last.degrees, kind="stable")
    if order.size > MOST_DRAWN:
        order = order[np.linspace(0, order.size - 1, MOST_DRAWN).astype(np.intp)]
    return last.some(order)


# What a comparison says, in sentences: where run and model part, and what was done to readings.

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
    counts = ((row.rpm, row.contact.measured, row.contact.model) for row in rows if row.contact)
    # noise alone may show a lift-off now and then: one in two turns is more or less
    if differing := [one for one in counts if abs(one[1] - one[2]) >= 0.5]:
        said.append(
            "Lift-offs differ first at {:.4g} rpm: {:.2g} a turn measured, {:.2g} of the "
            "model.".format(*differing[0])
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


def _agreements(found: Sequence[tuple[str, SpeedDeparture, Departure]]) -> Iterator[str]:
    for name, (factor, unit) in SHOWN.items():
        here = [one for what, _, one in found if what == name]
        if not here or not all(one.within or one.restless for one in here):
            continue
        steady = "steady " if any(one.restless for one in here) else ""
        here = [one for one in here if not one.restless] or here
        noise = max(max(one.noise, one.rms) for one in here)
        if all(one.exact for one in here):
            yield f"The {name} is that of the model, to rounding, at every speed."
        else:
            yield (
                f"The {name} agrees with the model within the noise at every {steady}speed: "
                f"{factor * noise:.2g} {unit} r.m.s."
            )


def _later(rows: Sequence[SpeedDeparture]) -> Iterator[str]:
    contacts = ((row.rpm, row.contact) for row in rows if row.contact)
    known = [(one.degrees or 0.0, one.shift or 0.0, rpm) for rpm, one in contacts]
    degrees, shift, rpm = max(known, key=lambda one: abs(one[0]), default=(0.0, 0.0, 0.0))
    if abs(degrees) >= LATER_DEG:
        yield (
            f"Lift-offs and landings come {1e3 * abs(shift):.2g} ms, {abs(degrees):.2g}° of the "
            f"cam, {'later' if degrees > 0.0 else 'earlier'} than the model's at {rpm:.4g} rpm."
        )


def _levels(rows: Sequence[SpeedDeparture]) -> list[str]:
    known = [(off, row.rpm) for row in rows if (off := row.level_difference) is not None]
    if not known:
        return []
    most, rpm = max(known, key=lambda one: abs(one[0]))
    if abs(most) < ALIKE_DB:
        return [f"Sound levels differ by {abs(most):.2g} dB at most."]
    return [f"The level differs most at {rpm:.4g} rpm: {most:+.1f} dB."]


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


def _range(pairs: MeasuredPairs) -> Iterator[str]:
    """A lift that is not the cam's by far: of another unit, perhaps, or another cam."""
    if pairs.run.lift is None:
        return
    span = float(np.ptp(np.percentile(pairs.run.lift.value, [0.5, 99.5])))
    whole = pairs.loaded.laws[pairs.cam].lift
    if not whole / UNLIKE < span < whole * UNLIKE:
        yield (
            f"The lift measured ranges over {1e3 * span:.3g} mm, that of cam {pairs.cam} over "
            f"{1e3 * whole:.3g} mm: is it the cam, and the unit?"
        )


def _resolution(pairs: MeasuredPairs) -> str:
    if not pairs.count:
        return "The angle shows no counts of an encoder: it is taken as it is, smoothed."
    worst = max(float(np.degrees(stretch.largest)) for stretch in pairs.stretches)
    return (
        f"The angle has {TURN / pairs.count:.0f} counts a turn; the motion through them is within "
        f"{worst:.2g}° of every reading."
    )


def _aligned(pairs: MeasuredPairs) -> Iterator[str]:
    found = pairs.alignment
    degrees = float(np.degrees(found.offset))
    if pairs.given:
        yield f"The cam is {degrees:+.3f}° from the angle measured, as given."
    elif found.shows("offset") or found.errors[0] > 0.0:
        yield f"The cam is {degrees:+.3f}° from the angle measured, found from the lift."
    else:
        why = "has too few readings" if pairs.run.lift is not None else "was not measured"
        yield (
            f"The cam is taken {degrees:+.3g}° from the angle measured: the lift {why} to find it "
            "by; give the offset."
        )
        return
    if found.drift:
        yield (
            f"The sensors' clock is {1e6 * abs(found.drift):.0f} ppm "
            f"{'slow' if found.drift > 0.0 else 'fast'} beside that of the angle: corrected."
        )
    if found.delay:
        yield (
            f"The sensors' stamps are {1e3 * abs(found.delay):.3g} ms "
            f"{'early' if found.delay > 0.0 else 'late'} beside those of the angle: corrected."
        )
    if found.shows("zero") and abs(found.zero) > found.scatter:
        yield f"The lift's zero is off by {1e3 * found.zero:+.3g} mm: taken off."
    if found.shows("lag") and abs(found.lag) > found.scatter:
        yield (
            f"On rise and return the lift differs by {2e6 * abs(found.lag):.3g} µm: "
            f"{'backlash, or a gauge that sticks' if found.lag < 0.0 else 'it leads its motion'}."
        )

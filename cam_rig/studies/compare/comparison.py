"""Deviation of a run from its model: a row for each speed, and the largest of each quantity."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

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


# The largest deviation of each quantity, and how the readings were aligned with the cam.


@dataclass(frozen=True)
class LargestDeviation:
    """Largest deviation, measured less model, of one quantity over all speeds; SI units.

    ``angle``: cam angle in the turn (rad), None for a quantity of a whole speed; ``relative``:
    fraction of the model's range; ``agreeing``: speeds at which noise or rounding explains the
    deviation, of ``speeds`` at which the quantity was measured.
    """

    quantity: str
    unit: str
    value: float
    rpm: float
    speeds: int
    angle: float | None = None
    relative: float | None = None
    agreeing: int | None = None


def largest_deviations(rows: Sequence[SpeedDeparture]) -> list[LargestDeviation]:
    """Return the largest deviation of each quantity that was measured."""
    found = []
    for name, unit in (("lift", "m"), ("force", "N")):
        parts = [(one, row.rpm) for row in rows if (one := getattr(row, name)) is not None]
        if parts:
            one, rpm = max(parts, key=lambda part: part[0].relative)
            agreeing = sum(part.within for part, _ in parts)
            angle = float(np.radians(one.degrees))
            found.append(
                LargestDeviation(
                    *(name, unit, one.largest, rpm, len(parts), angle, one.relative, agreeing)
                )
            )
    contacts = [(row.rpm, row.contact) for row in rows if row.contact is not None]
    by_speed = {
        ("lift_offs", "1/turn"): [(one.measured - one.model, rpm) for rpm, one in contacts],
        ("events_later", "s"): [(one.shift, rpm) for rpm, one in contacts if one.shift is not None],
        ("level", "dB"): [
            (row.level_difference, row.rpm) for row in rows if row.level_difference is not None
        ],
    }
    for (name, unit), known in by_speed.items():
        if known:
            value, rpm = max(known, key=lambda one: abs(one[0]))
            found.append(LargestDeviation(name, unit, value, rpm, len(known)))
    return found


class Origin(Enum):
    """Origin of a number that aligns the readings with the cam."""

    GIVEN = "given"
    FROM_LIFT = "from the lift"
    FROM_ANGLE = "from the angle"
    ASSUMED = "assumed"


@dataclass(frozen=True)
class AlignmentNumber:
    """A number by which the readings were aligned with the cam, SI; None: not determined."""

    quantity: str
    value: float | None
    unit: str
    origin: Origin


def alignment_numbers(pairs: MeasuredPairs) -> list[AlignmentNumber]:
    """Return the numbers by which a bench's readings were aligned with the cam angle."""
    found, lift = pairs.alignment, Origin.FROM_LIFT
    is_found = found.shows("offset") or found.errors[0] > 0.0
    origin = Origin.GIVEN if pairs.given else lift if is_found else Origin.ASSUMED
    residual = max((stretch.largest for stretch in pairs.stretches), default=0.0)
    uneven = sum(not stretch.line for stretch in pairs.stretches) / max(1, len(pairs.stretches))
    return [
        AlignmentNumber("cam_angle_offset", found.offset, "rad", origin),
        AlignmentNumber(
            *("encoder_counts", TURN / pairs.count if pairs.count else None, "1/turn"),
            Origin.FROM_ANGLE,
        ),
        AlignmentNumber("angle_residual", residual, "rad", Origin.FROM_ANGLE),
        AlignmentNumber("uneven_speed", uneven, "1", Origin.FROM_ANGLE),
        AlignmentNumber("left_out_time", pairs.left_out, "1", Origin.FROM_ANGLE),
        AlignmentNumber("sensor_clock_drift", found.drift, "1", lift),
        AlignmentNumber("sensor_stamp_delay", found.delay, "s", lift),
        AlignmentNumber("lift_zero", found.zero if found.shows("zero") else None, "m", lift),
        # Twice the lag: below zero, the lift trails its motion, as with backlash.
        AlignmentNumber(
            "lift_hysteresis", 2.0 * found.lag if found.shows("lag") else None, "m", lift
        ),
    ]


#: Ratio of measured to modelled lift range beyond which the cam or the unit is doubtful.
MAX_RANGE_RATIO = 2.0


def warnings_of(pairs: MeasuredPairs) -> Iterator[str]:
    """Yield a warning for each sign that the readings are not what they were taken for."""
    origin = alignment_numbers(pairs)[0].origin
    if origin is Origin.ASSUMED:
        reason = "was not measured" if pairs.run.lift is None else "has too few readings"
        yield (
            f"The lift {reason}, so the cam angle is assumed to be the angle measured: "
            "set the offset with --offset."
        )
    if pairs.run.force is not None and pulls(pairs.run.force.value):
        yield (
            "The contact force measured is mostly below zero, as a pull: turn its sign with "
            "force=-/TOPIC."
        )
    if pairs.run.lift is not None:
        span = float(np.ptp(np.percentile(pairs.run.lift.value, [0.5, 99.5])))
        lift = pairs.loaded.laws[pairs.cam].lift
        if not lift / MAX_RANGE_RATIO < span < lift * MAX_RANGE_RATIO:
            yield (
                f"The lift measured ranges over {1e3 * span:.3g} mm, that of cam {pairs.cam} over "
                f"{1e3 * lift:.3g} mm: check the cam and the unit."
            )

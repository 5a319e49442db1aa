"""Where a run and its model part: a row for each speed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from cam_rig.laws import Law
from cam_rig.measured.real_run.deviation import (
    Departure,
    LostContact,
    PairedSignal,
    PairedStep,
    departure,
    lost_contact,
)
from cam_rig.show import looks
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


def _last_turn(pair: PairedSignal) -> PairedSignal:
    """The last turn, or as many of the last as have enough readings, in the order of the angle."""
    count = int(np.count_nonzero(pair.angle > pair.angle[-1] - TURN))
    last = pair.some(slice(-min(pair.angle.size, max(count, LEAST_DRAWN)), None))
    order = np.argsort(last.degrees, kind="stable")
    if order.size > MOST_DRAWN:
        order = order[np.linspace(0, order.size - 1, MOST_DRAWN).astype(np.intp)]
    return last.some(order)

"""Deviation of a measured run from its model, for each speed and over all speeds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

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

# Dominant frequency of the difference between measurement and model. It may be a resonance of a
# sensor or its mount.
#: Largest number of readings per segment in Welch's method, which divides a signal into segments
#: and averages their power spectra.
MAX_SEGMENT_READINGS = 1024
#: Smallest number of segments of a signal in Welch's method, which averages their power spectra.
MIN_SEGMENTS = 4
#: Smallest ratio of a spectral peak's power to the median power at which the peak is reported.
MIN_PEAK_RATIO = 30.0
#: Largest relative difference of peak frequencies at two speeds that count as equal.
FREQUENCY_RTOL = 0.05
#: Smallest relative range of the cam speeds at which a spectral peak at one frequency is attributed
#: to a resonance. If the speeds are nearly equal, the peak could also be a fixed multiple of the
#: rotation frequency.
MIN_SPEED_RANGE = 0.15
#: Smallest multiple of the rotation frequency of the cam at which a common peak is reported as a
#: resonance. Errors of mass, spring and damping cause differences at lower multiples.
MIN_RESONANCE_ORDER = 8.0


def peak_frequency(pair: PairedSignal) -> float | None:
    """Return the frequency (Hz) at which measurement minus model has most power.

    Returns None if no frequency has more than `MIN_PEAK_RATIO` times the median power, or if there
    are too few readings.
    """
    from scipy.signal import welch

    step = float(np.median(np.diff(pair.time)))
    even = np.arange(pair.time[0], pair.time[-1], step)
    length = min(MAX_SEGMENT_READINGS, even.size // MIN_SEGMENTS)
    if length < 32:
        return None
    difference = np.interp(even, pair.time, pair.difference)
    frequency, power = welch(difference, 1.0 / step, nperseg=length)
    peak = 1 + int(np.argmax(power[1:]))
    if power[peak] < MIN_PEAK_RATIO * float(np.median(power[1:])):
        return None
    return float(frequency[peak])


def common_frequency(speeds: Sequence[float], peaks: Sequence[float | None]) -> float | None:
    """Return the peak frequency (Hz) that is equal at several speeds.

    `speeds` are in rpm, and `peaks` in Hz or None. Returns None if the frequency changes with the
    speed, because a natural frequency of a sensor does not.
    """
    peaked = [(speed, peak) for speed, peak in zip(speeds, peaks, strict=True) if peak is not None]
    if len(peaked) < 2:
        return None
    middle = float(np.median([peak for _, peak in peaked]))
    common = [speed for speed, peak in peaked if abs(peak - middle) <= FREQUENCY_RTOL * middle]
    if (
        len(common) < 2
        or 2 * len(common) <= len(peaked)
        or max(common) < (1.0 + MIN_SPEED_RANGE) * min(common)
    ):
        return None
    if middle < MIN_RESONANCE_ORDER * max(common) / 60.0:
        return None
    return middle


class DrawnQuantity(NamedTuple):
    """Properties of a quantity in figures.

    They are title, unit and factor from SI for values, unit and factor for differences, and colour.
    """

    title: str
    unit: str
    factor: float
    difference_unit: str
    difference_factor: float
    colour: int


#: Labels, units and colours of lift and force in the figures.
QUANTITIES = {
    "lift": DrawnQuantity("lift", "mm", 1e3, "µm", 1e6, looks.LIFT),
    "force": DrawnQuantity("contact force", "N", 1.0, "N", 1.0, looks.FORCE),
}
#: Largest noise that is attributed to an instrument, as a fraction of the model's range, by
#: quantity. The noise of gauges and load cells is less than a tenth of this limit.
MAX_NOISE = {"lift": 0.1, "force": 0.5}
#: Smallest number of readings in the drawn turn of a figure. If the last turn has fewer, readings
#: of earlier turns are added.
MIN_DRAWN_READINGS = 300
#: Largest number of readings that a figure draws for a turn.
MAX_DRAWN_READINGS = 1500


@dataclass(frozen=True, eq=False)
class SpeedDeparture:
    """Deviation of a measured run from the model, for one cam at one speed.

    A value is None if the quantity was not measured. `turns` is the number of settled turns. `lift`
    and `force` are the deviations of these quantities. `contact` contains the number of lift-offs
    per turn, and the delay of events. `measured_db` and `model_db` are sound levels in dB re 20
    µPa. `peak_hz` is the dominant frequency of the force's difference, or None without a distinct
    peak. `drawn` contains the last turn of each of `QUANTITIES` for figures.
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
        """Measured minus modelled sound level, dB, or None if a level is missing."""
        if self.measured_db is None or self.model_db is None:
            return None
        return self.measured_db - self.model_db

    @property
    def exact(self) -> bool:
        """True if the model was driven with the exact recorded cam states.

        This is the case for a bag of the rig, which is compared sample by sample.
        """
        return any(part is not None and part.exact for part in (self.lift, self.force))

    @property
    def agrees(self) -> bool:
        """True if measured and modelled lift and force agree within their noise.

        If the model was driven with exact cam states, they must agree within rounding.
        """
        return all(part is None or part.within for part in (self.lift, self.force))

    @property
    def later(self) -> float | None:
        """Delay of measured lift-offs and landings behind the model, as cam angle (rad).

        It is None if run and model have no lift-off or landing in common.
        """
        degrees = None if self.contact is None else self.contact.degrees
        return None if degrees is None else float(np.radians(degrees))


def compare_steps(steps: Iterable[PairedStep], laws: dict[str, Law]) -> list[SpeedDeparture]:
    """Compare a run with the model, and return one result per step of the run.

    A step is one cam at one speed. `laws` are the laws by cam name. Only one step is in memory at a
    time.
    """
    return [_speed_departure(step, laws[step.cam]) for step in steps]


def _speed_departure(step: PairedStep, law: Law) -> SpeedDeparture:
    """Return the deviation of one step (a cam at one speed) from the model."""
    pairs = {"lift": step.lift, "force": step.force}
    lift, force = (
        None if pair is None else departure(pair, step.exact, MAX_NOISE[name])
        for name, pair in pairs.items()
    )
    differs = step.force is not None and force is not None and not step.exact and not force.within
    return SpeedDeparture(
        cam=step.cam,
        rpm=step.rpm,
        turns=step.turns,
        lift=lift,
        force=force,
        contact=lost_contact(step, law),
        measured_db=step.levels[0],
        model_db=step.levels[1],
        peak_hz=peak_frequency(step.force) if differs and step.force is not None else None,
        drawn={name: _last_turn(pair) for name, pair in pairs.items() if pair is not None},
    )


def group_by_cam(rows: Iterable[SpeedDeparture]) -> list[list[SpeedDeparture]]:
    """Group the deviations by cam, in the order in which the cams first appear."""
    rows_by_cam = dict[str, list[SpeedDeparture]]()
    for row in rows:
        rows_by_cam.setdefault(row.cam, []).append(row)
    return list(rows_by_cam.values())


def _last_turn(pair: PairedSignal) -> PairedSignal:
    """Return the readings of the last turn for a figure, in the order of the angle.

    If the turn has fewer than `MIN_DRAWN_READINGS` readings, earlier readings are added.
    """
    count = int(np.count_nonzero(pair.angle > pair.angle[-1] - TURN))
    last = pair.select(slice(-min(pair.angle.size, max(count, MIN_DRAWN_READINGS)), None))
    order = np.argsort(last.degrees, kind="stable")
    if order.size > MAX_DRAWN_READINGS:
        order = order[np.linspace(0, order.size - 1, MAX_DRAWN_READINGS).astype(np.intp)]
    return last.select(order)


# Summary over all speeds: largest deviations, and the alignment of the readings with the cam.


@dataclass(frozen=True)
class LargestDeviation:
    """Largest deviation (measured minus model) of one quantity over all speeds, SI.

    `value` is the deviation with its sign, and `rpm` the speed at which it occurs. `angle` is the
    cam angle within the turn (rad), or None for a quantity with one value per speed. `relative` is
    the deviation as a fraction of the model's range. `agreeing` is the number of speeds at which
    noise or rounding explains the deviation, of the `speeds` at which the quantity was measured.
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
    """Return the largest deviation of each quantity that was measured.

    `rows` are the deviations, one per cam and speed.
    """
    deviations = []
    for name, unit in (("lift", "m"), ("force", "N")):
        parts = [(part, row.rpm) for row in rows if (part := getattr(row, name)) is not None]
        if parts:
            part, rpm = max(parts, key=lambda entry: entry[0].relative)
            agreeing = sum(entry.within for entry, _ in parts)
            angle = float(np.radians(part.degrees))
            deviations.append(
                LargestDeviation(
                    *(name, unit, part.largest, rpm, len(parts), angle, part.relative, agreeing)
                )
            )
    contacts = [(row.rpm, row.contact) for row in rows if row.contact is not None]
    by_speed = {
        ("lift_offs", "1/turn"): [(part.measured - part.model, rpm) for rpm, part in contacts],
        ("event_delay", "s"): [(c.shift, rpm) for rpm, c in contacts if c.shift is not None],
        ("level", "dB"): [
            (row.level_difference, row.rpm) for row in rows if row.level_difference is not None
        ],
    }
    for (name, unit), values in by_speed.items():
        if values:
            value, rpm = max(values, key=lambda part: abs(part[0]))
            deviations.append(LargestDeviation(name, unit, value, rpm, len(values)))
    return deviations


class Origin(Enum):
    """How a parameter that aligns the sensors' readings with the cam was obtained."""

    GIVEN = "given"
    FROM_LIFT = "from the lift"
    FROM_ANGLE = "from the angle"
    ASSUMED = "assumed"


@dataclass(frozen=True)
class AlignmentNumber:
    """Parameter by which the sensors' readings were aligned with the cam, SI.

    `quantity` is its name. `value` is None if it was not determined.
    """

    quantity: str
    value: float | None
    unit: str
    origin: Origin


def alignment_numbers(pairs: MeasuredPairs) -> list[AlignmentNumber]:
    """Return the parameters by which the readings of a test bench were aligned.

    They relate the sensors' readings to the cam angle, such as the encoder's offset.
    """
    fit, from_lift = pairs.alignment, Origin.FROM_LIFT
    is_identified = fit.is_significant("offset") or fit.errors[0] > 0.0
    origin = (
        Origin.GIVEN if pairs.is_offset_given else from_lift if is_identified else Origin.ASSUMED
    )
    residual = max((stretch.largest for stretch in pairs.stretches), default=0.0)
    uneven = sum(not stretch.is_uniform for stretch in pairs.stretches) / max(
        1, len(pairs.stretches)
    )
    return [
        AlignmentNumber("cam_angle_offset", fit.offset, "rad", origin),
        AlignmentNumber(
            *("encoder_counts", TURN / pairs.count if pairs.count else None, "1/turn"),
            Origin.FROM_ANGLE,
        ),
        AlignmentNumber("angle_residual", residual, "rad", Origin.FROM_ANGLE),
        AlignmentNumber("uneven_speed", uneven, "1", Origin.FROM_ANGLE),
        AlignmentNumber("excluded_time", pairs.excluded, "1", Origin.FROM_ANGLE),
        AlignmentNumber("sensor_clock_drift", fit.drift, "1", from_lift),
        AlignmentNumber("sensor_stamp_delay", fit.delay, "s", from_lift),
        AlignmentNumber(
            "lift_zero", fit.zero if fit.is_significant("zero") else None, "m", from_lift
        ),
        # The hysteresis is twice the lag. A negative value means that the measured lift follows the
        # motion late, as with backlash.
        AlignmentNumber(
            "lift_hysteresis", 2.0 * fit.lag if fit.is_significant("lag") else None, "m", from_lift
        ),
    ]


def turn_warnings(rows: Iterable[SpeedDeparture]) -> list[str]:
    """Return a warning if the turns of the run at one speed differ by more than noise.

    It names the speed and the quantity with the largest difference. The list is empty if there is
    no such difference.
    """
    parts = [
        (part.noise / part.scale, row.rpm, name)
        for row in rows
        for name in MAX_NOISE
        if (part := getattr(row, name)) is not None and part.turns_differ
    ]
    if not parts:
        return []
    noise, rpm, name = max(parts)
    return [
        f"The turns at {rpm:.5g} rpm differ from each other by {100 * noise:.2g} % of the {name}, "
        "r.m.s., which is more than noise: check the angle and its number of counts per turn."
    ]


#: Largest relative drift between two clocks without a warning, s/s. Quartz clocks differ by less
#: than a fifth of this limit.
MAX_CLOCK_DRIFT = 1e-3
#: Largest ratio between the measured and the modelled range of the lift, in either direction,
#: without a warning about the cam or the unit.
MAX_RANGE_RATIO = 2.0


def warnings_of(pairs: MeasuredPairs) -> Iterator[str]:
    """Yield a warning for each sign of a mistake in the options of a comparison.

    It may be a wrong topic, sign, unit, offset or cam.
    """
    origin = alignment_numbers(pairs)[0].origin
    if origin is Origin.ASSUMED:
        reason = "was not measured" if pairs.run.lift is None else "has too few readings"
        yield (
            f"The lift {reason}, so the cam angle is assumed to be the angle measured: "
            "set the offset with --offset."
        )
    if abs(pairs.alignment.drift) > MAX_CLOCK_DRIFT:
        yield (
            f"The lift turns {100 * abs(pairs.alignment.drift):.2g} % "
            f"{'faster' if pairs.alignment.drift > 0.0 else 'slower'} than the angle, which is "
            "more than two clocks differ: check the number of counts per turn."
        )
    if pairs.run.force is not None and pulls(pairs.run.force.value):
        yield (
            "The measured contact force is mostly below zero, as a pull: change its sign with "
            "force=-/TOPIC."
        )
    if pairs.run.lift is not None:
        span = float(np.ptp(np.percentile(pairs.run.lift.value, [0.5, 99.5])))
        lift = pairs.loaded.laws[pairs.cam].lift
        if not lift / MAX_RANGE_RATIO < span < lift * MAX_RANGE_RATIO:
            yield (
                f"The measured lift ranges over {1e3 * span:.3g} mm, that of cam {pairs.cam} over "
                f"{1e3 * lift:.3g} mm: check the cam and the unit."
            )

"""What a fit found of a rig, as tables and as plain data."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from cam_rig.measured.rig_fit.jump_fit import JumpFit
from cam_rig.measured.rig_fit.jump_table import JumpReading
from cam_rig.measured.rig_fit.models import LEAST_PLAY
from cam_rig.measured.rig_fit.numbers import NUMBERS
from cam_rig.measured.rig_fit.result import FoundNumber, HoldFit, RigFit
from cam_rig.show.tables import Cell, DataTable, Head, tabulate
from cam_rig.units import FloatArray, rounded_to_error, to_rpm


def numbers_table(numbers: Iterable[FoundNumber], caption: str) -> DataTable:
    """A row a number: what was found, to the digits that its error leaves, or that nothing was."""

    def origin(number: FoundNumber) -> str:
        return "; ".join(filter(None, (number.origin, number.caution)))

    return tabulate(
        caption,
        numbers,
        (
            (Head("number"), lambda number: number.name),
            (Head("value", "", ".6g"), lambda number: number.shown),
            (Head("standard error", "", ".2g"), lambda number: number.shown_error),
            (Head("unit"), lambda number: number.unit),
            (Head(""), origin),
        ),
    )


def correlation_table(names: tuple[str, ...], correlation: FloatArray) -> DataTable:
    """How the errors of the identified numbers go together, -1 to 1."""
    return tabulate(
        "Correlation of their errors",
        range(len(names)),
        (
            (Head("number"), lambda i: names[i]),
            *(
                (Head(_short(name), "", ".2f"), lambda i, k=k: float(correlation[i, k]))
                for k, name in enumerate(names)
            ),
        ),
    )


def _short(name: str) -> str:
    """A heading of several lines."""
    return name.replace("_", " ")


def holds_table(fit: RigFit) -> DataTable:
    """Residuals of lift and force at each speed."""

    def micro(hold: HoldFit) -> Cell:
        return None if hold.lift is None else hold.lift * 1e6

    return tabulate(
        "Residuals, r.m.s.",
        fit.holds,
        (
            (Head("speed", "rpm", ".2f"), lambda hold: hold.rpm),
            (Head("turns", "", ".1f"), lambda hold: hold.turns),
            (Head("samples", "", "d"), lambda hold: hold.samples),
            (Head("lift", "µm", ".3g"), micro),
            (Head("force", "N", ".3g"), lambda hold: hold.force),
            (Head("lift-offs a turn", "", "d"), lambda hold: hold.lift_offs),
        ),
    )


def gauges_table(fit: RigFit) -> DataTable:
    """What the same samples say of the instruments."""
    g = fit.gauges
    rows: list[tuple[str, float | None, float | None, str]] = [
        ("encoder at θ = 0", math.degrees(g.offset), math.degrees(g.offset_error), "deg"),
        ("sensors' clock, fast by", _times(g.clock, 1e6), _times(g.clock_error, 1e6), "ppm"),
        ("zero offset of the lift", _times(g.zero, 1e6), _times(g.zero_error, 1e6), "µm"),
        ("backlash of the lift", _times(g.backlash, 1e6), _times(g.backlash_error, 1e6), "µm"),
        ("noise of the lift", _times(g.lift_noise, 1e6), None, "µm"),
        ("zero offset of the force", g.force_zero, g.force_zero_error, "N"),
        ("noise of the force", g.force_noise, None, "N"),
        ("and of the force itself", _times(g.force_part or None, 100.0), None, "%"),
        ("resonance of the force sensor", g.sensor_frequency, None, "Hz"),
        ("its damping ratio", _times(g.sensor_damping, 100.0), None, "%"),
    ]
    return tabulate(
        "The instruments, by the same samples",
        [row for row in rows if row[1] is not None],
        (
            (Head(""), lambda row: row[0]),
            (Head("value", "", ".4g"), lambda row: _digits(row[1], row[2])),
            (Head("standard error", "", ".2g"), lambda row: row[2]),
            (Head("unit"), lambda row: row[3]),
        ),
    )


def _digits(value: float | None, error: float | None) -> Cell:
    """A value to the digits of its error, if it has one."""
    return value if value is None or error is None else rounded_to_error(value, error)


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


def numbers_json(numbers: Iterable[FoundNumber]) -> dict[str, Any]:
    """By name; null where nothing tells it, and why."""
    return {
        n.name: {
            "value": n.value,
            "standard_error": n.error if n.value is not None else None,
            "unit": n.unit,
            "origin": n.origin,
            **({"caution": n.caution} if n.caution else {}),
            **({"reason": n.reason} if n.reason else {}),
        }
        for n in numbers
    }


def rig_json(fit: RigFit) -> dict[str, Any]:
    """All that a fit found, SI."""
    return {
        "source": str(fit.run.source),
        "cam": fit.law.name,
        "model": fit.model,
        "numbers": numbers_json(fit.numbers),
        "correlation": {
            "of": list(fit.correlated),
            "matrix": fit.correlation.tolist(),
        },
        "instruments": {
            "encoder_offset_rad": fit.gauges.offset,
            "sensor_clock_fast_by": fit.gauges.clock,
            "lift_zero_m": fit.gauges.zero,
            "lift_backlash_m": fit.gauges.backlash,
            "lift_noise_m": fit.gauges.lift_noise,
            "force_noise_N": fit.gauges.force_noise,
            "force_noise_part": fit.gauges.force_part,
            "force_sensor_resonance_Hz": fit.gauges.sensor_frequency,
        },
        "by_speed": [
            {
                "rpm": hold.rpm,
                "turns": hold.turns,
                "samples": hold.samples,
                "lift_rms_m": hold.lift,
                "force_rms_N": hold.force,
                "lift_offs_per_turn": hold.lift_offs,
            }
            for hold in fit.holds
        ],
        "notes": list(fit.run.notes),
    }


def jumps_table(fit: JumpFit) -> DataTable:
    """Jump speeds as read, and of the numbers found."""
    rows = list(zip(fit.table.readings, fit.speeds, fit.left.tolist(), strict=True))

    def known(name: str) -> Callable[[tuple[JumpReading, float, float]], Cell]:
        return lambda row: row[0].known.get(name)

    return tabulate(
        "Jump speeds",
        rows,
        (
            (Head("line", "", "d"), lambda row: row[0].line),
            (Head("mass put on", "kg", ".6g"), known("mass")),
            (Head("spring", "N/m", ".6g"), known("spring_stiffness")),
            (Head("preload", "N", ".6g"), known("preload")),
            (Head("read", "rpm", ".2f"), lambda row: float(to_rpm(row[0].speed))),
            (Head("fitted", "rpm", ".2f"), lambda row: row[1]),
            (Head("residual", "rpm", ".2f"), lambda row: -row[2]),
        ),
    )


def jumps_json(fit: JumpFit) -> dict[str, Any]:
    """All that a fit of jump speeds found, SI but for rpm."""
    return {
        "source": fit.table.file,
        "cam": fit.law.name,
        "model": fit.model,
        "numbers": numbers_json(fit.numbers),
        "correlation": {
            "of": [number.name for number in fit.identified],
            "matrix": fit.correlation.tolist(),
        },
        "error_rpm": fit.error,
        "error_given": fit.error_given,
        "degrees_of_freedom": fit.free,
        "readings": [
            {"line": r.line, "read_rpm": float(to_rpm(r.speed)), "found_rpm": speed, **r.known}
            for r, speed in zip(fit.table.readings, fit.speeds, strict=True)
        ],
    }


# What a fit found of a rig, in sentences: the answer, what is not told and why, what looks odd.

#: Neighbours that err alike over more samples than this are no noise.
COLOURED = 1.5

#: A backlash is one beyond so many standard errors.
PLAY = 2.0

#: A residual larger than this part of the lift is not a gauge's.
WRONG_CAM = 0.01

#: A lift that is so near, in parts of itself, is no gauge's: what is left is rounding.
EXACT = 1e-9

#: A peak of a spectrum stands out that has this part of all of it in its eight lines.
STANDS_OUT = 0.3

#: A sample that is off by so many standard deviations is an outlier; a standard deviation by the
#: median of what is off, which outliers do not move.
OUTLIER, TO_DEVIATION = 10.0, 1.4826

#: One jump speed with more than this part of all that is left, as squares, is an outlier.
OUTLYING = 0.55


def number_sentences(numbers: Iterable[FoundNumber]) -> Iterator[str]:
    """What has no number, and why."""
    for number in numbers:
        if number.value is None:
            end = "" if number.reason.endswith("?") else "."
            yield f"{number.name}: not identified, {number.reason}{end}"


def _told(numbers: Iterable[FoundNumber]) -> str:
    """Identified numbers in words, each with its caution."""
    return ", ".join(
        f"{number.name} {number.shown} {number.unit}".removesuffix(" 1")
        + (f" ({number.caution})" if number.caution else "")
        for number in numbers
    )


def rig_conclusions(fit: RigFit) -> Iterator[str]:
    """The answer first, then what stands in its way."""
    told = _told(fit.identified)
    model = "two masses and a stem" if fit.model == "two_mass" else "one rigid mass"
    yield (
        f"Identified as {model}: {told}."
        if told
        else f"Nothing of the follower is identifiable, as {model}."
    )
    reasons = {number.reason for number in fit.numbers if number.value is None}
    if len(reasons) == 1 and not fit.identified:
        yield f"Not identified: {reasons.pop()}"
    else:
        yield from number_sentences(fit.numbers)
    if fit.left_out:
        speeds = ", ".join(f"{rpm:.4g}" for rpm in fit.left_out)
        yield f"At {speeds} rpm the follower lifts off: " + (
            "these speeds identify the restitution alone."
            if fit.solution.bounce is not None and not any(hold.lift_offs for hold in fit.holds)
            else "no such follower does so as it was measured, so these speeds are left out."
        )
    if fit.model == "two_mass" and any(hold.lift_offs for hold in fit.holds):
        yield (
            "Bounces on an elastic stem depend on every number at once: trust the intervals of a "
            "fit without the speeds that lift off more."
        )
    tare = "" if fit.gauges.force_zero is not None else ", its zero offset is in the preload"
    yield (
        f"The gain of the force sensor is taken as true{tare}; so is the encoder's clock: 100 ppm "
        "of it are 200 ppm of a mass."
    )
    yield from _odd(fit)


def jump_conclusions(fit: JumpFit) -> Iterator[str]:
    """The answer first, then how far it may be trusted."""
    told = _told(fit.identified)
    yield f"Identified: {told}." if told else "Nothing of the follower is identifiable."
    yield from number_sentences(fit.numbers)
    if "mass" in fit.table.columns:
        yield "The mass is the follower's own, beside what was put on."
    if not fit.error_given:
        yield (
            f"The error of a reading is taken from the residuals: {fit.error:.3g} rpm, of "
            f"{fit.free} readings more than free parameters; "
            f"intervals of 95 % reach {fit.numbers[0].within:.3g} standard errors."
        )
    worst = int(np.abs(fit.left).argmax())
    if fit.free > 1 and fit.left[worst] ** 2 > OUTLYING * float(fit.left @ fit.left):
        reading = fit.table.readings[worst]
        yield f"Line {reading.line} is {-fit.left[worst]:.3g} rpm off the others: an outlier?"


def _odd(fit: RigFit) -> Iterator[str]:
    noise = fit.gauges.lift_noise
    if noise is not None and noise > WRONG_CAM * fit.law.lift:
        yield (
            f"The lift is {noise * 1e3:.3g} mm r.m.s. from the law of {fit.law.name}: another cam, "
            "or turned the other way?"
        )
        return
    play, error = fit.gauges.backlash or 0.0, fit.gauges.backlash_error or 0.0
    if abs(play) > max(PLAY * error, LEAST_PLAY * fit.law.lift):
        yield (
            f"The lift reads {abs(play) * 1e3:.3g} mm "
            f"{'less' if play > 0.0 else 'more'} in rises than in falls: backlash, "
            "or a gauge that drags. It is fitted with."
        )
    if fit.gauges.sensor_frequency is not None:
        yield (
            f"The force rings at {fit.gauges.sensor_frequency:.4g} Hz as a sensor or its mount "
            "does, and not as a stem: it is fitted with."
        )
    exact = noise is not None and noise < EXACT * fit.law.lift
    if not exact:
        yield from _outliers(fit)
    for name, length in zip(("lift", "force"), fit.alike, strict=True):
        if length > COLOURED and not exact:
            yield (
                f"The residuals of the {name} are correlated over {length:.2g} samples"
                f"{_frequency_words(fit, name)}. The standard errors take account of it, but the "
                "noise is not white or the model lacks something."
            )
    ripple = max(hold.hold.ripple for hold in fit.solution.likelihood.holds)
    if ripple > np.radians(0.3):
        yield (
            f"The cam's angle is up to {np.degrees(ripple):.2g} deg from a steady turn: the speed "
            "fluctuates, and the model holds it."
        )


def _outliers(fit: RigFit) -> Iterator[str]:
    """Samples that no noise has; least squares follows them."""
    likelihood, parts = fit.solution.likelihood, {"lift": [np.empty(0)], "force": [np.empty(0)]}
    for i in range(len(likelihood.holds)):
        turn = likelihood.predicted(fit.solution.x, i)
        if turn is not None:
            parts["lift"].append(turn.lift_left / likelihood.lift_noise)
            parts["force"].append(turn.force_left / likelihood.force_deviation(i))
    for name, found in parts.items():
        off = np.abs(np.concatenate(found))
        deviation = TO_DEVIATION * float(np.median(off)) if off.size else 0.0
        count = int(np.count_nonzero(off > OUTLIER * deviation))
        if count and deviation > 0.0:
            yield (
                f"{count} of {off.size} samples of the {name} are more than {OUTLIER:g} standard "
                "deviations off, outliers: they move the numbers, so leave them out."
            )


def _frequency_words(fit: RigFit, name: str) -> str:
    """Where the spectrum of what is left stands out, of the hold with most samples."""
    found = strongest_frequency(fit, name)
    if found is None:
        return ""
    cause = "a resonance of the sensor or its mount?" if name == "force" else "the gauge's?"
    return f", most at {found:.3g} Hz ({cause})"


def strongest_frequency(fit: RigFit, name: str) -> float | None:
    """Hz at which what is left stands out; None where it nowhere does."""
    likelihood, best, found = fit.solution.likelihood, STANDS_OUT, None
    for i, hold in enumerate(likelihood.holds):
        predicted = likelihood.predicted(fit.solution.x, i)
        if predicted is None:
            continue
        if name == "lift":
            since, left = hold.lift.since, predicted.lift_left
        else:
            since, left = hold.force.since[likelihood.kept[i]], predicted.force_left
        if since.size < 64:
            continue
        step = float(np.median(np.diff(since)))
        even = np.zeros(round((since[-1] - since[0]) / step) + 1)
        even[np.rint((since - since[0]) / step).astype(int)] = left - left.mean()
        power = np.abs(np.fft.rfft(even)) ** 2
        at = int(np.argmax(power))
        part = float(power[max(0, at - 4) : at + 5].sum() / power.sum())
        if part > best:
            best, found = part, at / (even.size * step)
    return found


def gist(number: FoundNumber) -> str:
    """A number in words: 1.2995 ± 0.0008 kg."""
    unit = NUMBERS[number.name].unit
    words = f"{number.shown} ± {number.shown_error} {unit}".removesuffix(" 1")
    return f"{words} ({number.caution})" if number.caution else words

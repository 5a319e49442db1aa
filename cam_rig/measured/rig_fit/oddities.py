"""What looks odd in the residuals of a rig's fit: another cam, backlash, outliers, correlation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from cam_rig.measured.rig_fit.models import LEAST_PLAY

if TYPE_CHECKING:
    from cam_rig.measured.rig_fit.result import RigFit

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


def oddities(fit: RigFit) -> Iterator[str]:
    """What looks odd, a sentence each; of another cam that alone."""
    gauges = {number.key: number for number in fit.instruments}
    noise = gauges["lift_noise"].value if "lift_noise" in gauges else None
    if noise is not None and noise > WRONG_CAM * fit.law.lift:
        yield (
            f"The lift is {noise * 1e3:.3g} mm r.m.s. from the law of {fit.law.name}: another cam, "
            "or turned the other way?"
        )
        return
    play = gauges.get("lift_backlash")
    if play and abs(play.value) > max(PLAY * (play.error or 0.0), LEAST_PLAY * fit.law.lift):
        yield (
            f"The lift reads {abs(play.value) * 1e3:.3g} mm "
            f"{'less' if play.value > 0.0 else 'more'} in rises than in falls: backlash, "
            "or a gauge that drags. It is fitted with."
        )
    if "force_sensor_resonance" in gauges:
        yield (
            f"The force rings at {gauges['force_sensor_resonance'].value:.4g} Hz as a sensor or "
            "its mount does, and not as a stem: it is fitted with."
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

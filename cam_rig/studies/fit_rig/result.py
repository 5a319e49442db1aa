"""What a run that was measured on a rig says of it: numbers, residuals by speed, instruments."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from cam_rig.show.result import SI_UNITS, Column, Records
from cam_rig.show.tables import format_number
from cam_rig.simulation.instruments import MeasuredRun
from cam_rig.studies.fit_rig.models import LEAST_BACKLASH
from cam_rig.studies.fit_rig.numbers import FoundNumbers
from cam_rig.studies.fit_rig.search import FitSolution
from cam_rig.units import rounded_to_error

#: What the samples say of the instruments: words, unit as shown, and of the data.
INSTRUMENTS = {
    "encoder_offset": ("encoder at θ = 0", "°", "rad"),
    "clock_fast_by": ("sensors' clock, fast by", "ppm", "1"),
    "lift_zero": ("zero offset of the lift", "µm", "m"),
    "lift_backlash": ("backlash of the lift", "µm", "m"),
    "lift_noise": ("noise of the lift", "µm", "m"),
    "force_zero": ("zero offset of the force", "N", "N"),
    "force_noise": ("noise of the force", "N", "N"),
    "force_noise_part": ("and of the force itself", "%", "1"),
    "force_sensor_resonance": ("resonance of the force sensor", "Hz", "Hz"),
    "force_sensor_damping": ("its damping ratio", "%", "1"),
}


@dataclass(frozen=True)
class HoldFit:
    """What is left at one speed: r.m.s. of lift (m) and force (N), and what the follower does."""

    rpm: float
    turns: float
    samples: int
    lift: float | None
    force: float | None
    lift_offs: int


@dataclass(frozen=True)
class InstrumentNumber:
    """What the same samples say of an instrument, one of `INSTRUMENTS`: SI, with standard error."""

    key: str
    value: float
    error: float | None = None

    @property
    def scale(self) -> float:
        """One of the unit that is shown, in SI."""
        shown = INSTRUMENTS[self.key][1]
        return 1e-6 if shown == "ppm" else SI_UNITS.get(shown, ("", 1.0))[1]

    @property
    def shown(self) -> str:
        """To the digits of its error, if it has one; in the unit that is shown."""
        value = self.value / self.scale
        if self.error is None:
            return format_number(value, ".4g")
        return rounded_to_error(value, self.error / self.scale)

    @property
    def shown_error(self) -> float | None:
        """In the unit that is shown."""
        return None if self.error is None else self.error / self.scale


@dataclass(frozen=True, eq=False, repr=False)
class RigFit(FoundNumbers):
    """What a run says of its rig.

    ``alike`` as in `Uncertainty`; ``left_out`` are speeds (rpm) whose motion told nothing but
    perhaps the restitution.
    """

    schema = "cam_rig.fit_rig.1"
    plot_function = "cam_rig.studies.fit_rig.figures:rig_figure"
    columns: ClassVar = FoundNumbers.columns | {
        "speeds": (
            Column("rpm", "rpm", ".2f", "speed"),
            Column("turns", "", ".1f"),
            Column("samples", "", "d"),
            Column("lift_residual", "µm", ".3g", "lift", "lift"),
            Column("force_residual", "N", ".3g", "force", "force"),
            Column("lift_offs_per_turn", "", "d", "lift-offs a turn", "lift_offs"),
        ),
        "instruments": (
            Column("quantity", of="key", cell=lambda one: INSTRUMENTS[one.key][0]),
            Column("value", "", ".4g", cell=lambda one: one.shown),
            Column("standard_error", "", ".2g", of="error", cell=lambda one: one.shown_error),
            Column(
                "unit",
                of=lambda one: INSTRUMENTS[one.key][2],
                cell=lambda one: INSTRUMENTS[one.key][1],
            ),
        ),
        "fit": (
            Column("source", of=lambda fit: str(fit.run.source)),
            Column("cam", of="law.name"),
            Column("model"),
            Column("left_out", "rpm", doc="speeds that told nothing but perhaps the restitution"),
            Column("notes", of="run.notes", doc="how the run was read"),
            Column("conclusions", of=lambda fit: [*fit.conclusions()]),
        ),
    }

    run: MeasuredRun
    holds: tuple[HoldFit, ...]
    instruments: tuple[InstrumentNumber, ...]
    solution: FitSolution
    alike: tuple[float, float]
    left_out: tuple[float, ...]
    assumed: tuple[str, ...] = ()

    @property
    def residual(self) -> str:
        """In words, for a rig file."""
        shown = {one.key: f"{one.value / one.scale:.3g}" for one in self.instruments}
        names = (("lift_noise", "µm"), ("force_noise", "N"))
        left = [f"{shown[key]} {unit}" for key, unit in names if float(shown.get(key, 0.0))]
        return f"{' and '.join(left)} r.m.s. over {len(self.holds)} speeds"

    def tables(self) -> list[Records]:
        """The follower's numbers, what is left at each speed, and the instruments' numbers."""
        caption, gauges = f"{Path(self.run.source).name}: the follower", self.instruments
        sought = self.solution.likelihood.sought
        names = tuple(n.name for n in self.identified if n.name in sought)
        return [
            *self.number_tables(caption, names),
            self.table("speeds", "Residuals, r.m.s.", self.holds),
            self.table("instruments", "The instruments, by the same samples", gauges),
            self.table("fit", "The fit", [self], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """How the run was read, the answer, and what stands in its way."""
        return [*self.run.notes, *self.conclusions()]

    def conclusions(self) -> Iterator[str]:
        """The answer first, then what stands in its way."""
        found = ", ".join(number.in_a_sentence() for number in self.identified)
        model = "two masses and a stem" if self.model == "two_mass" else "one rigid mass"
        yield (
            f"Identified as {model}: {found}."
            if found
            else f"Nothing of the follower is identifiable, as {model}."
        )
        reasons = {number.reason for number in self.numbers if number.value is None}
        if len(reasons) == 1 and not self.identified:
            yield f"Not identified: {reasons.pop()}"
        else:
            yield from (n.in_a_sentence() for n in self.numbers if n.value is None)
        if self.left_out:
            speeds = ", ".join(f"{rpm:.4g}" for rpm in self.left_out)
            alone = self.solution.bounce is not None
            if alone and not any(hold.lift_offs for hold in self.holds):
                what = "the follower lifts off: these speeds identify the restitution alone."
            else:
                what = "no such follower moves as was measured: these speeds are left out."
            yield f"At {speeds} rpm {what}"
        if self.model == "two_mass" and any(hold.lift_offs for hold in self.holds):
            yield (
                "Bounces on an elastic stem depend on every number at once: trust the intervals of "
                "a fit without the speeds that lift off more."
            )
        known = any(number.key == "force_zero" for number in self.instruments)
        taken = "" if known else ", its zero offset is in the preload"
        yield (
            f"The gain of the force sensor is taken as true{taken}; so is the encoder's clock: 100 "
            "ppm of it are 200 ppm of a mass."
        )
        yield from _oddities(self)


# What looks odd in the residuals: another cam, backlash, outliers, correlation.

#: Neighbours that err alike over more samples than this are no noise.
COLOURED = 1.5
#: A backlash is one beyond so many standard errors.
CLEAR_BACKLASH = 2.0
#: A residual larger than this part of the lift is not a gauge's.
WRONG_CAM = 0.01
#: A lift that is so near, in parts of itself, is no gauge's: what is left is rounding.
EXACT = 1e-9
#: A peak of a spectrum stands out that has this part of all of it in its eight lines.
STANDS_OUT = 0.3
#: A sample that is off by so many standard deviations is an outlier; a standard deviation by the
#: median of what is off, which outliers do not move.
OUTLIER, TO_DEVIATION = 10.0, 1.4826


def _oddities(fit: RigFit) -> Iterator[str]:
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
    least = LEAST_BACKLASH * fit.law.lift
    if play and abs(play.value) > max(CLEAR_BACKLASH * (play.error or 0.0), least):
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
    ripple = max(hold.hold.ripple for hold in fit.solution.holds)
    if ripple > np.radians(0.3):
        yield (
            f"The cam's angle is up to {np.degrees(ripple):.2g} deg from a steady turn: the speed "
            "fluctuates, and the model holds it."
        )


def _outliers(fit: RigFit) -> Iterator[str]:
    likelihood, parts = fit.solution.likelihood, {"lift": [np.empty(0)], "force": [np.empty(0)]}
    for i, there in enumerate(fit.solution.predicted):
        if there is not None:
            parts["lift"].append(there.lift.left / likelihood.lift_noise)
            parts["force"].append(there.force.left / likelihood.force_deviation(i))
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
    best, found = STANDS_OUT, None
    for i, there in enumerate(fit.solution.predicted):
        since = fit.solution.likelihood.samples(i)[name == "force"].since
        if there is None or since.size < 64:
            continue
        left = getattr(there, name).left
        step = float(np.median(np.diff(since)))
        even = np.zeros(round((since[-1] - since[0]) / step) + 1)
        even[np.rint((since - since[0]) / step).astype(int)] = left - left.mean()
        power = np.abs(np.fft.rfft(even)) ** 2
        at = int(np.argmax(power))
        part = float(power[max(0, at - 4) : at + 5].sum() / power.sum())
        if part > best:
            best, found = part, at / (even.size * step)
    if found is None:
        return ""
    cause = "a resonance of the sensor or its mount?" if name == "force" else "the gauge's?"
    return f", most at {found:.3g} Hz ({cause})"

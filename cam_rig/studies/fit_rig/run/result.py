"""Result of a fit to a measured run: parameters, instrument errors, residuals by speed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from cam_rig.show.result import SI_UNITS, Column, Records
from cam_rig.show.tables import format_number
from cam_rig.simulation.instruments import MeasuredRun
from cam_rig.studies.fit_rig.estimate import RigParameters, warn_of_unusual_values
from cam_rig.studies.fit_rig.run.models import MIN_BACKLASH_FRACTION
from cam_rig.studies.fit_rig.run.search import FitSolution
from cam_rig.units import round_to_error

#: Description, displayed unit and SI unit of each estimated instrument error, by its key in the
#: JSON and CSV output.
INSTRUMENTS = {
    "encoder_offset": ("encoder at θ = 0", "°", "rad"),
    "clock_drift": ("sensors' clock drift", "ppm", "1"),
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
class SegmentFit:
    """Residuals of the fit, and lift-offs, at one steady speed.

    ``rpm`` is the cam speed. ``turns`` and ``samples`` are the numbers of measured turns and of
    included samples. ``lift`` (m) and ``force`` (N) are r.m.s. residuals, or None if not measured.
    ``lift_offs`` is the computed number per turn.
    """

    rpm: float
    turns: float
    samples: int
    lift: float | None
    force: float | None
    lift_offs: int


@dataclass(frozen=True)
class InstrumentEstimate:
    """Estimate of an instrument error, with its standard error.

    ``key`` is a key of `INSTRUMENTS`. ``value`` and ``error`` are in the SI unit listed there.
    ``error`` is None if it was not estimated.
    """

    key: str
    value: float
    error: float | None = None

    @property
    def scale(self) -> float:
        """Factor from the displayed unit of an instrument error to its SI unit."""
        unit = INSTRUMENTS[self.key][1]
        return 1e-6 if unit == "ppm" else SI_UNITS.get(unit, ("", 1.0))[1]

    @property
    def value_text(self) -> str:
        """Instrument error in its displayed unit as text, rounded to its standard error."""
        value = self.value / self.scale
        if self.error is None:
            return format_number(value, ".4g")
        return round_to_error(value, self.error / self.scale)

    @property
    def displayed_error(self) -> float | None:
        """Standard error of an instrument error in its displayed unit, or None.

        It is None if it was not estimated.
        """
        return None if self.error is None else self.error / self.scale


@dataclass(frozen=True, eq=False, repr=False)
class RigFit(RigParameters):
    """Follower parameters and instrument errors, identified from a measured run.

    ``segments`` are the residuals by steady speed. ``solution`` is the final state of the search.
    ``correlation_lengths`` are those of `Uncertainty`. ``excluded`` are the speeds in rpm that
    contribute to no parameter, or only to the restitution. ``assumed`` has one sentence for each
    group of values that the rig file takes from another rig.
    """

    schema = "cam_rig.fit_rig.1"
    plot_function = "cam_rig.studies.fit_rig.figures:rig_figure"
    columns: ClassVar = RigParameters.columns | {
        "speeds": (
            Column("rpm", "rpm", ".2f", "speed"),
            Column("turns", "", ".1f"),
            Column("samples", "", "d"),
            Column("lift_residual", "µm", ".3g", "lift", "lift"),
            Column("force_residual", "N", ".3g", "force", "force"),
            Column("lift_offs_per_turn", "", "d", "lift-offs a turn", "lift_offs"),
        ),
        "instruments": (
            Column("quantity", of="key", cell=lambda number: INSTRUMENTS[number.key][0]),
            Column("value", "", ".4g", cell=lambda number: number.value_text),
            Column(
                "standard_error", "", ".2g", of="error", cell=lambda number: number.displayed_error
            ),
            Column(
                "unit",
                of=lambda number: INSTRUMENTS[number.key][2],
                cell=lambda number: INSTRUMENTS[number.key][1],
            ),
        ),
        "fit": (
            Column("source", of=lambda fit: str(fit.run.source)),
            Column("cam", of="law.name"),
            Column("model"),
            Column("excluded", "rpm", doc="speeds that identify nothing, or only the restitution"),
            Column("notes", of="run.notes", doc="how the run was read"),
            Column("conclusions", of=lambda fit: [*fit.conclusions()]),
        ),
    }

    run: MeasuredRun
    segments: tuple[SegmentFit, ...]
    instruments: tuple[InstrumentEstimate, ...]
    solution: FitSolution
    correlation_lengths: tuple[float, float]
    excluded: tuple[float, ...]
    assumed: tuple[str, ...] = ()

    @property
    def residual_text(self) -> str:
        """R.m.s. noise of lift and force as text, for the rig file."""
        values = {number.key: f"{number.value / number.scale:.3g}" for number in self.instruments}
        names = (("lift_noise", "µm"), ("force_noise", "N"))
        parts = [f"{values[key]} {unit}" for key, unit in names if float(values.get(key, 0.0))]
        return f"{' and '.join(parts)} r.m.s. over {len(self.segments)} speeds"

    def tables(self) -> list[Records]:
        """Return the tables of parameters, residuals by speed, and instrument errors."""
        caption, gauges = f"{Path(self.run.source).name}: the follower", self.instruments
        free = self.solution.likelihood.free
        names = tuple(n.name for n in self.identified if n.name in free)
        return [
            *self.number_tables(caption, names),
            self.table("speeds", "Residuals, r.m.s.", self.segments),
            self.table("instruments", "The instruments, by the same samples", gauges),
            self.table("fit", "The fit", [self], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """Return notes on how the run was read, the parameters, and warnings."""
        return [*self.run.notes, *self.conclusions()]

    def conclusions(self) -> Iterator[str]:
        """Yield the identified parameters as a sentence, then reasons and warnings.

        The reasons explain missing values. The warnings concern excluded speeds and anomalies of
        the residuals.
        """
        parameters = ", ".join(number.to_sentence() for number in self.identified)
        model = "two masses and a stem" if self.model == "two_mass" else "one rigid mass"
        yield (
            f"Identified as {model}: {parameters}."
            if parameters
            else f"No parameter of the follower is identifiable, as {model}."
        )
        reasons = {number.reason for number in self.numbers if number.value is None}
        if len(reasons) == 1 and not self.identified:
            yield f"Not identified: {reasons.pop()}"
        else:
            yield from (n.to_sentence() for n in self.numbers if n.value is None)
        if self.excluded:
            speeds = ", ".join(f"{rpm:.4g}" for rpm in self.excluded)
            alone = self.solution.bounce is not None
            if alone and not any(segment.lift_offs for segment in self.segments):
                consequence = "the follower lifts off: these speeds identify the restitution alone."
            else:
                consequence = "no follower fits the samples: these speeds are left out."
            yield f"At {speeds} rpm {consequence}"
        if self.model == "two_mass" and any(segment.lift_offs for segment in self.segments):
            yield (
                "Bounces on an elastic stem depend on every parameter: the intervals of a fit "
                "without the speeds with lift-offs are more reliable."
            )
        has_zero = any(number.key == "force_zero" for number in self.instruments)
        note = "" if has_zero else " The zero offset of the force is part of the preload."
        yield (
            "The gain of the force sensor and the encoder's clock are assumed to be exact: 100 ppm "
            f"of the clock are 200 ppm of a mass.{note}"
        )
        yield from warn_of_unusual_values(self.identified)
        yield from _warnings(self)


# Warnings about anomalies of the residuals: another cam, backlash, outliers, correlation.
#: Correlation length of residuals, in samples, above which a warning reports that they are not
#: white noise.
MIN_CORRELATION_LENGTH = 1.5
#: Smallest backlash of the lift gauge that is reported, in standard errors.
MIN_BACKLASH_ERRORS = 2.0
#: R.m.s. residual of the lift above which a different cam is suspected, as a fraction of the total
#: lift.
MAX_LIFT_NOISE = 0.01
#: R.m.s. residual of the lift below which it is rounding instead of a gauge's noise, as a fraction
#: of the total lift. Such residuals get no warnings of outliers and correlation.
ROUNDING_FRACTION = 1e-9
#: Smallest fraction of the residuals' spectral power within ±4 frequency lines of the largest peak
#: at which the frequency of the peak is reported.
MIN_PEAK_FRACTION = 0.3
#: Residual above which a sample is reported as an outlier, in standard deviations.
OUTLIER_DEVIATIONS = 10.0
#: Ratio of the standard deviation to the median absolute value of normally distributed noise. A
#: deviation computed from the median is not affected by outliers.
MEDIAN_TO_DEVIATION = 1.4826


def _warnings(fit: RigFit) -> Iterator[str]:
    """Yield a sentence for each anomaly of the residuals and instrument errors.

    If the lift indicates another cam, this is the only sentence.
    """
    gauges = {number.key: number for number in fit.instruments}
    noise = gauges["lift_noise"].value if "lift_noise" in gauges else None
    if noise is not None and noise > MAX_LIFT_NOISE * fit.law.lift:
        yield (
            f"The lift differs by {noise * 1e3:.3g} mm r.m.s. from the law of {fit.law.name}: is "
            "it another cam, or does it turn the other way?"
        )
        return
    backlash = gauges.get("lift_backlash")
    min_backlash = MIN_BACKLASH_FRACTION * fit.law.lift
    if backlash and abs(backlash.value) > max(
        MIN_BACKLASH_ERRORS * (backlash.error or 0.0), min_backlash
    ):
        yield (
            f"The lift reads {abs(backlash.value) * 1e3:.3g} mm "
            f"{'less' if backlash.value > 0.0 else 'more'} in rises than in falls: backlash, "
            "or a gauge that drags. It is a parameter of the fit."
        )
    if "force_sensor_resonance" in gauges:
        yield (
            f"The force rings at {gauges['force_sensor_resonance'].value:.4g} Hz, as a sensor or "
            "its mount does, and not as a stem. The resonance is a parameter of the fit."
        )
    exact = noise is not None and noise < ROUNDING_FRACTION * fit.law.lift
    if not exact:
        yield from _outliers(fit)
    for name, length in zip(("lift", "force"), fit.correlation_lengths, strict=True):
        if length > MIN_CORRELATION_LENGTH and not exact:
            yield (
                f"The residuals of the {name} are correlated over {length:.2g} samples"
                f"{_frequency_text(fit, name)}. The standard errors take account of it, but the "
                "noise is not white, or the model is incomplete."
            )
    ripple = max(segment.line.ripple for segment in fit.solution.segments)
    if ripple > np.radians(0.3):
        yield (
            f"The cam's angle differs by up to {np.degrees(ripple):.2g} deg from a steady turn: "
            "the speed fluctuates, which the model does not include."
        )


def _outliers(fit: RigFit) -> Iterator[str]:
    """Yield a sentence each on the outliers of lift and of force, if there are any.

    Outliers are samples with a residual of more than `OUTLIER_DEVIATIONS` standard deviations.
    """
    likelihood, parts = fit.solution.likelihood, {"lift": [np.empty(0)], "force": [np.empty(0)]}
    for i, predicted in enumerate(fit.solution.predicted):
        if predicted is not None:
            parts["lift"].append(predicted.lift.residual / likelihood.lift_noise)
            parts["force"].append(predicted.force.residual / likelihood.force_deviation(i))
    for name, arrays in parts.items():
        deviations = np.abs(np.concatenate(arrays))
        deviation = MEDIAN_TO_DEVIATION * float(np.median(deviations)) if deviations.size else 0.0
        count = int(np.count_nonzero(deviations > OUTLIER_DEVIATIONS * deviation))
        if count and deviation > 0.0:
            yield (
                f"{count} of {deviations.size} samples of the {name} are more than "
                f"{OUTLIER_DEVIATIONS:g} standard deviations off, outliers that change the "
                "parameters: leave them out."
            )


def _frequency_text(fit: RigFit, name: str) -> str:
    """Return the frequency of the residuals' largest spectral peak as text.

    ``name`` is lift or force. The spectrum is that of the steady-speed segment with the clearest
    peak. The text is empty if no peak contains `MIN_PEAK_FRACTION` of the power.
    """
    best, frequency = MIN_PEAK_FRACTION, None
    for i, predicted in enumerate(fit.solution.predicted):
        since = fit.solution.likelihood.samples(i)[name == "force"].since
        if predicted is None or since.size < 64:
            continue
        residuals = getattr(predicted, name).residual
        step = float(np.median(np.diff(since)))
        even = np.zeros(round((since[-1] - since[0]) / step) + 1)
        even[np.rint((since - since[0]) / step).astype(int)] = residuals - residuals.mean()
        power = np.abs(np.fft.rfft(even)) ** 2
        peak = int(np.argmax(power))
        fraction = float(power[max(0, peak - 4) : peak + 5].sum() / power.sum())
        if fraction > best:
            best, frequency = fraction, peak / (even.size * step)
    if frequency is None:
        return ""
    instrument = "sensor" if name == "force" else "gauge"
    return f", mainly at {frequency:.3g} Hz (a resonance of the {instrument} or its mount?)"

"""What a run that was measured on a rig says of it: numbers, residuals by speed, instruments."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from cam_rig.laws import Law
from cam_rig.measured.rig_fit.found import (
    CORRELATION_COLUMNS,
    NUMBER_COLUMNS,
    FoundNumber,
    number_sentences,
    number_tables,
    told,
)
from cam_rig.measured.rig_fit.oddities import oddities
from cam_rig.measured.rig_fit.search import FitSolution
from cam_rig.show.result import SI, Column, Records, Result
from cam_rig.show.tables import number
from cam_rig.simulation.instruments import MeasuredRun
from cam_rig.units import FloatArray, rounded_to_error

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
        return 1e-6 if shown == "ppm" else SI.get(shown, ("", 1.0))[1]

    @property
    def shown(self) -> str:
        """To the digits of its error, if it has one; in the unit that is shown."""
        value = self.value / self.scale
        if self.error is None:
            return number(value, ".4g")
        return rounded_to_error(value, self.error / self.scale)

    @property
    def shown_error(self) -> float | None:
        """In the unit that is shown."""
        return None if self.error is None else self.error / self.scale


@dataclass(frozen=True, eq=False, repr=False)
class RigFit(Result):
    """What a run says of its rig.

    ``correlation`` ``(n, n)`` is of the numbers that were identified, in their order; ``model`` is
    one_mass or two_mass; ``alike`` as in `Uncertainty`; ``left_out`` are speeds (rpm) whose
    motion told nothing but perhaps the restitution.
    """

    schema = "cam_rig.fit_rig.1"
    drawn_by = "cam_rig.measured.rig_fit.figures:rig_figure"
    columns: ClassVar = {
        "numbers": NUMBER_COLUMNS,
        "correlation": CORRELATION_COLUMNS,
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
            Column("left_out", "rpm", about="speeds that told nothing but perhaps the restitution"),
            Column("notes", of="run.notes", about="how the run was read"),
            Column("conclusions", of=lambda fit: [*fit.conclusions()]),
        ),
    }

    law: Law
    run: MeasuredRun
    model: str
    numbers: tuple[FoundNumber, ...]
    correlation: FloatArray
    holds: tuple[HoldFit, ...]
    instruments: tuple[InstrumentNumber, ...]
    solution: FitSolution
    alike: tuple[float, float]
    left_out: tuple[float, ...]

    @property
    def identified(self) -> tuple[FoundNumber, ...]:
        """The numbers that the run tells."""
        return tuple(n for n in self.numbers if n.origin == "identified")

    @property
    def correlated(self) -> tuple[str, ...]:
        """The names of those in ``correlation``."""
        sought = self.solution.likelihood.sought
        return tuple(n.name for n in self.identified if n.name in sought)

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
        return [
            *number_tables(caption, self.numbers, self.correlated, self.correlation),
            self.table("speeds", "Residuals, r.m.s.", self.holds),
            self.table("instruments", "The instruments, by the same samples", gauges),
            self.table("fit", "The fit", [self], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """How the run was read, the answer, and what stands in its way."""
        return [*self.run.notes, *self.conclusions()]

    def conclusions(self) -> Iterator[str]:
        """The answer first, then what stands in its way."""
        found = told(self.identified)
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
            yield from number_sentences(self.numbers)
        if self.left_out:
            speeds = ", ".join(f"{rpm:.4g}" for rpm in self.left_out)
            yield f"At {speeds} rpm the follower lifts off: " + (
                "these speeds identify the restitution alone."
                if self.solution.bounce is not None
                and not any(hold.lift_offs for hold in self.holds)
                else "no such follower does so as it was measured, so these speeds are left out."
            )
        if self.model == "two_mass" and any(hold.lift_offs for hold in self.holds):
            yield (
                "Bounces on an elastic stem depend on every number at once: trust the intervals of "
                "a fit without the speeds that lift off more."
            )
        tared = any(number.key == "force_zero" for number in self.instruments)
        tare = "" if tared else ", its zero offset is in the preload"
        yield (
            f"The gain of the force sensor is taken as true{tare}; so is the encoder's clock: 100 "
            "ppm of it are 200 ppm of a mass."
        )
        yield from oddities(self)

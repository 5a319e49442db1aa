"""The question the paper leaves open: Bézier 15's continuity, or its lower acceleration.

Two full tables of laws against angles. In the first every law has the same event angles, so that
smoother laws are also sharper: continuity costs acceleration. In the second every law has the
angle at which all accelerate alike, so that continuity stands alone. Then the proposed cam itself:
what of its advantage remains with a rigid follower, and what when its event is compressed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from cam_rig.acoustics import RadiationParameters
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.jump.jump_speed import rigid_jump_speed
from cam_rig.dynamics.jump.search import sought_speed
from cam_rig.dynamics.vibration import require_speeds, residual_vibration, steady_turn
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.laws.catalogue import figures
from cam_rig.laws.law import peak
from cam_rig.laws.segments import MIN_DWELL, NAMED_RISES
from cam_rig.schema import RigConfig
from cam_rig.schema.load import load
from cam_rig.schema.quantity import Quantity, Strict, must_be
from cam_rig.schema.scene import MAX_SPEED, Name
from cam_rig.schema.segments import RiseName
from cam_rig.simulation.simulate import Acoustics, settled_turns
from cam_rig.units import RPM, TURN, FloatArray, rms


def open_factorial(path: Path) -> FactorialConfig:
    """Read a study's file, and refuse rises whose velocity jumps."""
    config = load(path, FactorialConfig)
    for key, rises in (("rises", config.rises), ("reference", [config.reference])):
        for rise in rises:
            if figures(rise).continuity < 1 or any(NAMED_RISES[rise].slopes):
                good = [n for n in NAMED_RISES if not any(NAMED_RISES[n].slopes)]
                allowed = ", ".join(n for n in good if figures(n).continuity >= 1)
                raise ConfigError(
                    f"{path}: {key}: is {rise!r}, whose velocity jumps where it joins a dwell; "
                    f"allowed: {allowed}"
                )
    return config


def as_gentle(rise: str, reference: str, event: float) -> float:
    """The event angle (rad) over which a rise accelerates as the reference does over ``event``."""
    ratio = figures(rise).peak_acceleration / figures(reference).peak_acceleration
    return event * math.sqrt(ratio)


def squeezed(law: Law, span: float) -> Law:
    """A cam's whole turn pressed into ``span`` rad, and its lift at θ = 0 held for the rest."""
    if span > TURN - MIN_DWELL:
        return law
    rest = np.full_like(law.ordinates[:, :1], law.ordinates[0, 0])
    breaks = np.append(law.breaks * (span / TURN), TURN)
    name = f"{law.name} in {math.degrees(span):.4g}°"
    return Law(name, breaks, np.hstack([law.ordinates, rest]))


Events = Annotated[Quantity, must_be("angle", many=True, above=0.0, most=math.pi)]

#: Slowest speed of a measurement, rad/s.
SLOWEST = 1.0 * RPM

Speeds = Annotated[Quantity, must_be("speed", many=True, least=SLOWEST, most=MAX_SPEED)]


class FactorialConfig(Strict):
    """One file of ``config/factorials/``.

    Every rise of ``rises`` is built over every angle of ``events``, up and down alike; then over
    the angles at which it accelerates as ``reference`` does over those of ``gentle``. The cam
    ``proposed`` is pressed into each span of ``squeezed``, with a low dwell for the rest.
    """

    name: Name
    title: str
    rig: Name
    noise_rig: Name
    lift: Annotated[Quantity, must_be("length", above=0.0, most=100.0)]
    rises: list[RiseName] = Field(min_length=2)
    events: Events
    reference: RiseName
    gentle: Events
    proposed: Name
    squeezed: Annotated[Quantity, must_be("angle", many=True, above=0.0, most=TURN)]
    run: Annotated[Quantity, must_be("time", above=0.0, most=3600.0)]
    accelerated: Speeds
    residual: Speeds
    noise: Speeds
    noise_in_contact: Annotated[Quantity, must_be("speed", least=SLOWEST, most=MAX_SPEED)]

    @model_validator(mode="after")
    def _levels(self) -> FactorialConfig:
        for key in ("events", "gentle"):
            angles = getattr(self, key).numbers
            if len(angles) < 2 or len(set(angles)) != len(angles):
                raise ValueError(f"{key}: are {angles}; allowed: at least two, each once")
        if len(set(self.rises)) != len(self.rises):
            raise ValueError(f"rises: {self.rises} names a law twice; allowed: each once")
        return self


@dataclass(frozen=True)
class Measures:
    """The effects of one law.

    ``jump`` is the jump speed from rest (rad/s), ``rigid_jump`` that of a rigid follower;
    ``acceleration`` (m/s²) the geometric mean over the speeds of the largest |ẍ| in steady state,
    ``own_acceleration`` that of the law itself; ``residual`` (m) the r.m.s. over the speeds of the
    residual vibration in the low dwell; ``noise`` (dB) the mean over the speeds, landings among it,
    on the rigid follower; ``noise_in_contact`` (dB) at the one speed on the elastic one.
    """

    jump: float
    rigid_jump: float
    acceleration: float
    own_acceleration: float
    residual: float
    noise: float
    noise_in_contact: float


@dataclass(frozen=True)
class Bench:
    """Rigs and speeds of a study, ready to measure a law."""

    two_mass: TwoMassParameters
    follower: FollowerParameters
    rigid: FollowerParameters
    sound: Acoustics
    rigid_sound: Acoustics
    config: FactorialConfig

    @classmethod
    def of(cls, config: FactorialConfig, rig: RigConfig, noise_rig: RigConfig) -> Bench:
        """Take the numbers of the rigs."""
        if rig.follower.mass.si != noise_rig.follower.mass.si:
            raise ConfigError(
                f"factorial {config.name!r}: follower.mass is {rig.follower.mass.si:g} kg on "
                f"{rig.name} and {noise_rig.follower.mass.si:g} kg on {noise_rig.name}; allowed: "
                "the same, or the effects are not of one follower"
            )
        follower = FollowerParameters.from_rig(rig)
        for key in ("accelerated", "residual"):
            try:
                require_speeds(follower, [v / RPM for v in getattr(config, key).si_list])
            except ConfigError as error:
                raise ConfigError(f"factorial {config.name!r}: {key}: {error}") from None
        two_mass, rigid = TwoMassParameters.from_rig(rig), FollowerParameters.from_rig(noise_rig)
        own, other = (Acoustics(RadiationParameters.from_rig(one)) for one in (rig, noise_rig))
        return cls(two_mass, follower, rigid, own, other, config)

    def measure(self, law: Law) -> Measures:
        """Every effect of one law."""
        config = self.config
        speeds = config.accelerated.si_list
        turns = [steady_turn(law, self.follower, speed) for speed in speeds]
        peaks = [math.log(float(np.abs(turn.acceleration).max())) for turn in turns]
        bend = abs(peak(law, 2).value)
        own = [math.log(bend * speed**2) for speed in speeds]
        amplitude = residual_vibration(law, self.follower, np.array(config.residual.si_list))
        noise = settled_turns(law, "one_mass", self.rigid, config.noise.si_list)
        contact = settled_turns(law, "two_mass", self.two_mass, [config.noise_in_contact.si])
        return Measures(
            jump=sought_speed(law, self.two_mass, config.run.si),
            rigid_jump=rigid_jump_speed(law, self.follower),
            acceleration=math.exp(float(np.mean(peaks))),
            own_acceleration=math.exp(float(np.mean(own))),
            residual=rms(amplitude),
            noise=float(self.rigid_sound.levels(noise).mean()),
            noise_in_contact=float(self.sound.levels(contact)[0]),
        )


# Analysis of variance of a full table with one value a cell. A model has no scatter, so there is
# nothing to test against: what counts are the shares of the sum of squares. What rows and columns
# do not explain together is interaction.


@dataclass(frozen=True, eq=False)
class TwoWay:
    """Effects of rows ``(a,)`` and columns ``(b,)`` about the mean, and sums of squares.

    ``classes`` is the part of ``rows`` that lies between groups of rows; the rest is within them.
    """

    mean: float
    row_effects: FloatArray
    column_effects: FloatArray
    rows: float
    classes: float
    columns: float
    interaction: float

    @property
    def total(self) -> float:
        """Sum of squares about the mean."""
        return self.rows + self.columns + self.interaction

    @property
    def shares(self) -> tuple[float, float, float]:
        """Shares of rows, columns and interaction; all zero where nothing varies."""
        whole = self.total or 1.0
        return self.rows / whole, self.columns / whole, self.interaction / whole

    @property
    def class_share(self) -> float:
        """Share of what lies between groups of rows."""
        return self.classes / (self.total or 1.0)


def two_way(values: FloatArray, groups: Sequence[object] | None = None) -> TwoWay:
    """Analyse a table ``(a, b)``; rows of one label of ``groups`` are a class, or each its own."""
    a, b = values.shape
    mean = float(values.mean())
    row, column = values.mean(axis=1) - mean, values.mean(axis=0) - mean
    left = values - mean - row[:, None] - column
    labels = list(groups) if groups is not None else list(range(a))
    members = [[i for i in range(a) if labels[i] == label] for label in dict.fromkeys(labels)]
    between = sum(len(some) * float(row[some].mean()) ** 2 for some in members)
    rows, columns = b * float(row @ row), a * float(column @ column)
    return TwoWay(mean, row, column, rows, b * between, columns, float((left**2).sum()))


#: A table of fewer laws or angles has no variance to analyse.
LEAST = 2
#: From this class on the acceleration is continuous.
SMOOTH = 2


@dataclass(frozen=True)
class Effect:
    """An effect that is analysed: its key in `Measures`, name, unit, and factor to that unit.

    ``decibels`` of amplitude: effects multiply, so logarithms of them add. ``speeds`` is the key
    of the study's speeds at which a follower in contact is supposed; empty where it may leave.
    """

    key: str
    name: str
    unit: str
    factor: float = 1.0
    decibels: bool = True
    speeds: str = ""

    def values(self, cells: list[list[Measures]]) -> FloatArray:
        """The table in the unit, ``(a, b)``."""
        return self.factor * np.array([[getattr(m, self.key) for m in row] for row in cells])


EFFECTS = (
    Effect("jump", "jump speed", "rpm", 30.0 / math.pi),
    Effect("acceleration", "peak acceleration", "m/s²", speeds="accelerated"),
    Effect("residual", "residual vibration", "µm", 1e6, speeds="residual"),
    Effect("noise", "noise, rigid follower", "dB", decibels=False),
    Effect("noise_in_contact", "noise, elastic", "dB", decibels=False, speeds="noise_in_contact"),
)


@dataclass(frozen=True, eq=False)
class Design:
    """A table of laws (rows) against angles (columns, rad), and its analysis by effect."""

    name: str
    rises: tuple[str, ...]
    angles: FloatArray
    cells: list[list[Measures]]

    @property
    def classes(self) -> list[int]:
        """C^k of each law against its dwells."""
        return [figures(rise).continuity for rise in self.rises]

    def analysis(self, effect: Effect) -> TwoWay:
        """The analysis of variance of one effect, in dB: of amplitudes 20 lg."""
        values = effect.values(self.cells)
        return two_way(20.0 * np.log10(values) if effect.decibels else values, self.classes)

    def part(self, name: str, rows: Sequence[int], columns: Sequence[int]) -> Design | None:
        """Some of its laws and angles; None where too few are left to analyse."""
        if min(len(rows), len(columns)) < LEAST:
            return None
        rises, angles = tuple(self.rises[i] for i in rows), self.angles[list(columns)]
        cells = [[self.cells[i][j] for j in columns] for i in rows]
        return Design(f"{self.name}, {name}", rises, angles, cells)

    @property
    def smooth(self) -> Design | None:
        """The laws of C2 and above alone; None for fewer than two."""
        rows = [i for i, order in enumerate(self.classes) if order >= SMOOTH]
        return self.part(f"C{SMOOTH} and above", rows, range(self.angles.size))

    @property
    def smoother(self) -> Design | None:
        """The same; None where all laws are such."""
        smooth = self.smooth
        return None if smooth is None or smooth.rises == self.rises else smooth


@dataclass(frozen=True, eq=False, repr=False)
class Factorial:
    """Both designs; the proposed cam and those it is compared with; the proposed cam squeezed."""

    config: FactorialConfig
    same_angles: Design
    same_acceleration: Design
    cams: dict[str, Measures]
    squeezed: dict[float, Measures]

    @property
    def designs(self) -> list[Design]:
        """Both designs, each followed by its laws of C2 and above where only some are."""
        both = (self.same_angles, self.same_acceleration)
        return [part for whole in both for part in (whole, whole.smoother) if part is not None]

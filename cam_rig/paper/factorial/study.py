"""The question the paper leaves open: Bézier 15's continuity, or its lower acceleration.

Two full tables of laws against angles. In the first every law has the same event angles, so that
smoother laws are also sharper; in the second every law has the angle at which all accelerate alike,
so that continuity stands alone. Then the proposed cam itself: what of its advantage remains with a
rigid follower, and what when its event is compressed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from cam_rig.acoustics import RadiationParameters
from cam_rig.arguments import checked
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.dynamics.jump.two_masses import find_jump_speed
from cam_rig.dynamics.vibration import require_speeds, residual_vibration, steady_turn
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.laws.cam import open_cam_set
from cam_rig.laws.catalogue import figures
from cam_rig.laws.law import peak
from cam_rig.laws.segments import MIN_DWELL, NAMED_RISES, up_and_down
from cam_rig.schema import RigConfig, load_rig, load_tables
from cam_rig.schema.load import cam_path, load, named_path, rig_path, tables_path
from cam_rig.schema.quantity import Quantity, Strict, must_be
from cam_rig.schema.scene import MAX_SPEED, Name
from cam_rig.schema.segments import RiseName
from cam_rig.show.result import NULL_PROGRESS, Column, Progress, Records, Result
from cam_rig.simulation.simulate import Acoustics, settled_turns
from cam_rig.units import RPM, RPM_PER_RAD_S, TURN, FloatArray, rms

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


def open_factorial(path: Path) -> FactorialConfig:
    """Read a study's file, and refuse rises whose velocity jumps."""
    config = load(path, FactorialConfig)
    smooth = [
        n for n, one in NAMED_RISES.items() if not any(one.slopes) and figures(n).continuity >= 1
    ]
    for key, rises in (("rises", config.rises), ("reference", [config.reference])):
        if bad := [rise for rise in rises if rise not in smooth]:
            raise ConfigError(
                f"{path}: {key}: is {bad[0]!r}, whose velocity jumps where it joins a dwell; "
                f"allowed: {', '.join(smooth)}"
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
    return Law(f"{law.name} in {math.degrees(span):.4g}°", breaks, np.hstack([law.ordinates, rest]))


@dataclass(frozen=True)
class Measures:
    """The effects of one law.

    Jump speeds (rpm) from rest, of the elastic and of a rigid follower; ``acceleration`` (m/s²) the
    geometric mean over the speeds of the largest |ẍ| in steady state, ``own_acceleration`` that of
    the law itself; ``residual`` (m) the r.m.s. over the speeds of the vibration in the low dwell;
    ``noise`` (dB) the mean over the speeds, landings among it, on the rigid follower;
    ``noise_in_contact`` (dB) at the one speed on the elastic one.
    """

    jump: float
    rigid_jump: float
    acceleration: float
    own_acceleration: float
    residual: float
    noise: float
    noise_in_contact: float


def bench_of(config: FactorialConfig, rig: RigConfig, noise_rig: RigConfig) -> Any:
    """What measures a law, `measured` on these rigs; refused are two that are no one follower."""
    mass, other = rig.follower.mass.si, noise_rig.follower.mass.si
    if mass != other:
        raise ConfigError(
            f"factorial {config.name!r}: follower.mass is {mass:g} kg on {rig.name} and {other:g} "
            f"kg on {noise_rig.name}; allowed: the same, or the effects are not of one follower"
        )
    for key in ("accelerated", "residual"):
        speeds = [v / RPM for v in getattr(config, key).si_list]
        try:
            require_speeds(FollowerParameters.from_rig(rig), speeds)
        except ConfigError as error:
            raise ConfigError(f"factorial {config.name!r}: {key}: {error}") from None
    return partial(measured, config, rig, noise_rig)


def measured(config: FactorialConfig, rig: RigConfig, noise_rig: RigConfig, law: Law) -> Measures:
    """Every effect of one law."""
    follower, rigid = (FollowerParameters.from_rig(one) for one in (rig, noise_rig))
    sound, other = (Acoustics(RadiationParameters.from_rig(one)) for one in (rig, noise_rig))
    two_mass, speeds = TwoMassParameters.from_rig(rig), config.accelerated.si_list
    peaks = [np.abs(steady_turn(law, follower, speed).acceleration).max() for speed in speeds]
    own = abs(peak(law, 2).value) * np.square(speeds)
    amplitude = residual_vibration(law, follower, np.array(config.residual.si_list))
    noise = settled_turns(law, "one_mass", rigid, config.noise.si_list)
    contact = settled_turns(law, "two_mass", two_mass, [config.noise_in_contact.si])
    return Measures(
        jump=find_jump_speed(law, two_mass, config.run.si) * RPM_PER_RAD_S,
        rigid_jump=rigid_jump_speed(law, follower) * RPM_PER_RAD_S,
        acceleration=math.exp(float(np.mean(np.log(peaks)))),
        own_acceleration=math.exp(float(np.mean(np.log(own)))),
        residual=rms(amplitude),
        noise=float(other.levels(noise).mean()),
        noise_in_contact=float(sound.levels(contact)[0]),
    )


class Effect(NamedTuple):
    """An effect that is analysed: its key in `Measures`, name, unit, factor to that unit.

    ``decibels`` of amplitude: effects multiply, so logarithms of them add. ``speeds`` is the key
    of the study's speeds at which a follower in contact is supposed; empty where it may leave.
    """

    key: str
    name: str
    unit: str
    factor: float = 1.0
    decibels: bool = True
    speeds: str = ""


EFFECTS = (
    Effect("jump", "jump speed", "rpm"),
    Effect("acceleration", "peak acceleration", "m/s²", speeds="accelerated"),
    Effect("residual", "residual vibration", "µm", 1e6, speeds="residual"),
    Effect("noise", "noise, rigid follower", "dB", decibels=False),
    Effect("noise_in_contact", "noise, elastic", "dB", decibels=False, speeds="noise_in_contact"),
)
BY_KEY = {effect.key: effect for effect in EFFECTS}
#: From this class on the acceleration is continuous; a table of fewer laws or angles has no
#: variance; a factor with at least this share of the sum of squares governs an effect.
SMOOTH, LEAST, GOVERNS = 2, 2, 0.6


@dataclass(frozen=True)
class Shares:
    """Shares of the sum of squares (dB²) of a table of one value a cell, and effects of the laws.

    A model has no scatter, so there is nothing to test against. What rows and columns do not
    explain together is interaction; ``classes`` is the part of ``law`` between classes of
    continuity, ``told`` whether several laws of each of several classes tell it apart.
    """

    law: float
    classes: float
    angle: float
    interaction: float
    total: float
    told: bool
    effects: FloatArray  #: of each law about the mean, dB

    @property
    def governed_by(self) -> str:
        """What explains most; continuity only where it can be told."""
        if self.told and self.classes >= GOVERNS:
            return "continuity"
        named = (("law", self.law), ("slopes", self.angle))
        return next((name for name, share in named if share >= GOVERNS), "no single factor")


def shares_of(values: FloatArray, classes: Sequence[int]) -> Shares:
    """Analyse a table ``(a, b)`` of laws of these classes against angles."""
    left = values - values.mean()
    row, column, order = left.mean(axis=1), left.mean(axis=0), np.array(classes)
    between = sum((order == k).sum() * row[order == k].mean() ** 2 for k in set(classes))
    rest = ((left - row[:, None] - column) ** 2).sum()
    parts = np.array(
        [column.size * (row @ row), column.size * between, row.size * (column @ column), rest]
    )
    total = float(parts[0] + parts[2] + parts[3])
    law, classed, angle, interaction = (parts / (total or 1.0)).tolist()
    told = 1 < len(set(classes)) < len(classes)
    return Shares(law, classed, angle, interaction, total, told, row)


@dataclass(frozen=True, eq=False)
class Design:
    """A table of laws (rows) against angles (columns, rad)."""

    name: str
    rises: tuple[str, ...]
    angles: FloatArray
    cells: list[list[Measures]]

    @property
    def classes(self) -> list[int]:
        """C^k of each law against its dwells."""
        return [figures(rise).continuity for rise in self.rises]

    def values(self, key: str) -> FloatArray:
        """One effect of the cells, ``(a, b)``."""
        return np.array([[getattr(m, key) for m in row] for row in self.cells])

    def shares(self, effect: Effect) -> Shares:
        """The analysis of one effect, in dB: of amplitudes 20 lg."""
        values = effect.factor * self.values(effect.key)
        return shares_of(20.0 * np.log10(values) if effect.decibels else values, self.classes)

    def part(self, name: str, rows: Sequence[int], columns: Sequence[int]) -> Design | None:
        """Some of its laws and angles; None where too few are left to analyse."""
        if min(len(rows), len(columns)) < LEAST:
            return None
        cells = [[self.cells[i][j] for j in columns] for i in rows]
        rises = tuple(self.rises[i] for i in rows)
        return Design(f"{self.name}, {name}", rises, self.angles[list(columns)], cells)

    @property
    def smooth(self) -> Design | None:
        """The laws of C2 and above alone; None where there are fewer than two, or no others."""
        rows = [i for i, order in enumerate(self.classes) if order >= SMOOTH]
        some = self.part(f"C{SMOOTH} and above", rows, range(self.angles.size))
        return None if len(rows) == len(self.rises) else some

    def lost(self, effect: Effect, config: FactorialConfig) -> NDArray[np.bool_]:
        """Which cells leave the cam below the effect's fastest speed, ``(a, b)``."""
        speed = fastest(effect, config)
        return self.values("jump") < (-math.inf if speed is None else speed)

    def staying(self, effect: Effect, config: FactorialConfig) -> Design | None:
        """The laws and angles whose cells all keep contact; None where too few remain.

        Laws and angles are dropped one after the other, those first that most of their cells leave.
        """
        lost = self.lost(effect, config)
        rows, columns = (list(range(n)) for n in lost.shape)
        while (part := lost[np.ix_(rows, columns)]).any():
            by_row, by_column = part.mean(axis=1), part.mean(axis=0)
            if by_row.max() >= by_column.max():
                del rows[int(np.argmax(by_row))]
            else:
                del columns[int(np.argmax(by_column))]
        return self.part("in contact", rows, columns)


def fastest(effect: Effect, config: FactorialConfig) -> float | None:
    """The fastest speed (rpm) at which an effect supposes contact; None where it does not."""
    speeds = np.atleast_1d(getattr(config, effect.speeds).si_list) if effect.speeds else None
    return None if speeds is None else float(max(speeds)) * RPM_PER_RAD_S


class Variance(NamedTuple):
    """Of a design, or its part in contact: how many cells are ``lost``, below which speed (rpm)."""

    whole: Design
    part: Design
    effect: Effect
    shares: Shares
    lost: int | None
    fastest: float | None


class Advantage(NamedTuple):
    """By how much the proposed cam is better than ``cam``, as factors; noise in dB.

    Shares of the slopes are of logarithms: what a rigid follower has too; the rest is vibration.
    """

    cam: str
    jump: float
    jump_share: float
    acceleration: float
    acceleration_share: float
    residual: float
    noise: float


class Cell(NamedTuple):
    """A law at an angle (rad) in a design, a cam, or the proposed cam in a span (rad)."""

    name: str
    measured: Measures
    law: str = ""
    angle: float = 0.0


#: What is measured of a law.
MEASURES = (
    Column("jump", "rpm", ".1f", "jump speed", "measured.jump"),
    Column("rigid_jump", "rpm", ".1f", "rigid follower", "measured.rigid_jump"),
    Column("acceleration", "m/s²", ".1f", "peak acceleration", "measured.acceleration"),
    Column("own_acceleration", "m/s²", of="measured.own_acceleration", hidden=True),
    Column("residual", "µm", ".2f", "residual vibration", "measured.residual"),
    Column("noise", "dB", ".1f", of="measured.noise"),
    Column("noise_in_contact", "dB", of="measured.noise_in_contact", hidden=True),
)


@dataclass(frozen=True, eq=False, repr=False)
class FactorialResult(Result):
    """Both designs; the proposed cam and those it is compared with; the proposed cam squeezed."""

    schema = "cam_rig.factorial.2"
    plot_function = "cam_rig.paper.factorial.figures:figure"
    columns: ClassVar = {
        "variance": (
            Column("design", of="whole.name"),
            Column(
                "effect",
                of="effect.key",
                cell=lambda v: v.effect.name if v.part is v.whole else "… in contact",
            ),
            Column("in_contact", of=lambda v: v.part is not v.whole, hidden=True),
            Column("laws", "", "d", of=lambda v: len(v.part.rises)),
            Column("angles", "", "d", of=lambda v: v.part.angles.size),
            *(
                Column(key, "%", ".1f", of=f"shares.{key}")
                for key in ("law", "classes", "angle", "interaction")
            ),
            Column("sum_of_squares", "dB²", ".1f", of="shares.total"),
            Column("cells_without_contact", "", "d", of="lost"),
            Column("governed_by", of="shares.governed_by"),
            Column("fastest", "rpm", hidden=True, doc="contact is lost by a jump below it"),
            Column("effects", "dB", of="shares.effects", hidden=True, doc="of the laws"),
        ),
        "laws": (
            Column("law", of="0"),
            Column("continuity", of="1", cell=lambda row: f"C{row[1]}"),
            Column("same_angles", "rpm", ".0f", of="2"),
            Column("same_acceleration", "rpm", ".0f", of="3"),
        ),
        "advantage": (
            Column("over", of="cam"),
            Column("jump", "%", "+.1f", "jump speed", lambda row: row.jump - 1.0),
            Column("jump_share", "%", ".0f", "from slopes"),
            Column(
                "acceleration", "%", "+.1f", "peak acceleration", lambda row: row.acceleration - 1.0
            ),
            Column("acceleration_share", "%", ".0f", "from slopes"),
            Column("residual", "", ".1f", "residual vibration, divided by"),
            Column("noise", "dB", "+.1f"),
        ),
        "compressed": (Column("span", "°", ".4g", of="angle"), *MEASURES),
        "cams": (Column("cam", of="name"), *MEASURES),
        "cells": (Column("design", of="name"), Column("law"), Column("angle", "°"), *MEASURES),
    }

    config: FactorialConfig
    same_angles: Design
    same_acceleration: Design
    cams: dict[str, Measures]
    squeezed: dict[float, Measures]

    @property
    def designs(self) -> list[Design]:
        """Both designs, each followed by its laws of C2 and above where only some are."""
        both = (self.same_angles, self.same_acceleration)
        return [part for whole in both for part in (whole, whole.smooth) if part is not None]

    def variance(self) -> list[Variance]:
        """Each effect in each design, and in its part in contact where cells leave the cam."""
        found = []
        for design in self.designs:
            for effect in EFFECTS:
                count, rpm = (
                    int(design.lost(effect, self.config).sum()),
                    fastest(effect, self.config),
                )
                stay = design.staying(effect, self.config) if count else None
                for some in filter(None, (design, stay)):
                    lost = None if rpm is None else count * (some is design)
                    found.append(Variance(design, some, effect, some.shares(effect), lost, rpm))
        return found

    def advantages(self) -> list[Advantage]:
        """The proposed cam against each other."""
        best, found = self.cams[self.config.proposed], []
        for cam, other in self.cams.items():
            if cam != self.config.proposed:
                jump, slopes = best.jump / other.jump, best.rigid_jump / other.rigid_jump
                less = best.acceleration / other.acceleration
                own = best.own_acceleration / other.own_acceleration
                shares = (math.log(slopes) / math.log(jump), math.log(own) / math.log(less))
                numbers = (jump, shares[0], less, shares[1], other.residual / best.residual)
                found.append(Advantage(cam, *numbers, best.noise - other.noise))
        return found

    def tables(self) -> list[Records]:
        """``variance`` first: a row for each effect in each design."""
        same, alike = self.same_angles, self.same_acceleration
        means = (np.exp(np.log(one.values("jump")).mean(axis=1)).tolist() for one in (same, alike))
        proposed, pressed = self.config.proposed, sorted(self.squeezed.items(), reverse=True)
        return [
            self.table(
                "variance",
                "Analysis of variance, {design}",
                self.variance(),
                "Shares of the sum of squares; classes: the part of the law between classes of "
                "continuity. Degrees of freedom: laws − 1, angles − 1, and their product.",
                "Cells without contact: contact is lost below the effect's fastest speed, where "
                "the model holds the follower on. The row below has the laws and angles that all "
                "keep contact.",
                group_by="design",
            ),
            self.table(
                "laws",
                "Jump speed by law, geometric mean over the angles",
                zip(same.rises, same.classes, *means, strict=True),
            ),
            self.table(
                "advantage",
                f"Advantage of {proposed}, and the part of it that comes from the slopes",
                self.advantages(),
                "From slopes: what a rigid follower has too, in logarithms; the rest is vibration. "
                "Above 100 %: at its own, higher jump speed the cam excites more vibration.",
            ),
            self.table(
                "compressed",
                f"{proposed} compressed, with a low dwell for the rest of the turn",
                (Cell(proposed, measured, angle=span) for span, measured in pressed),
            ),
            self.table("cams", "The cams", (Cell(*one) for one in self.cams.items()), hidden=True),
            self.table(
                "cells",
                "Both designs, cell by cell",
                [
                    Cell(design.name, measured, rise, angle)
                    for design in (same, alike)
                    for rise, row in zip(design.rises, design.cells, strict=True)
                    for angle, measured in zip(design.angles.tolist(), row, strict=True)
                ],
                hidden=True,
            ),
        ]

    def summary(self) -> list[str]:
        """Where the advantage comes from, and what governs residual vibration."""
        ahead = sorted(row.jump_share for row in self.advantages() if row.jump > 1.0)
        words = f"{self.config.proposed} jumps later than {len(ahead)} of {len(self.cams) - 1} cams"
        if ahead:
            words += f"; {ahead[0]:.0%} to {ahead[-1]:.0%} of that from the slopes"
        alike = self.same_acceleration
        lost = int(alike.lost(BY_KEY["residual"], self.config).sum())
        governs = alike.shares(BY_KEY["residual"]).governed_by
        return [
            words,
            f"residual vibration at the same acceleration: {governs}; {lost} of "
            f"{alike.values('jump').size} cells lose contact below its fastest speed",
        ]


def run_factorial(
    config: FactorialConfig,
    bench: Any,
    cams: Mapping[str, Law],
    pool: Executor | None = None,
    progress: Progress = NULL_PROGRESS,
) -> FactorialResult:
    """Measure every cell, in a pool if there is one; ``cams``: the proposed one and its rivals."""
    lift, rises, spans = config.lift.si, tuple(config.rises), config.squeezed.si_list
    angles = (
        {rise: config.events.si_list for rise in rises},
        {
            rise: [as_gentle(rise, config.reference, event) for event in config.gentle.si_list]
            for rise in rises
        },
    )
    laws = [up_and_down(rise, at, lift) for one in angles for rise in rises for at in one[rise]]
    todo = [*laws, *cams.values(), *(squeezed(cams[config.proposed], span) for span in spans)]
    progress.start(len(todo), config.name)
    found = []
    for one in (map if pool is None else pool.map)(bench, todo):
        found.append(one)
        progress.advance()
    left = iter(found)

    def table(name: str, levels: list[float]) -> Design:
        return Design(name, rises, np.array(levels), [[next(left) for _ in levels] for _ in rises])

    return FactorialResult(
        config,
        table("same angles", config.events.si_list),
        table("same acceleration", config.gentle.si_list),
        {cam: next(left) for cam in cams},
        {span: next(left) for span in spans},
    )


@checked
def factorial(
    study: str | Path = "continuity",
    *,
    executor: Executor | None = None,
    progress: Progress = NULL_PROGRESS,
) -> FactorialResult:
    r"""Laws of every continuity with the same angles, then the same acceleration: what matters.

    Jump speed, peak acceleration, residual vibration and noise of each, and their variance. Some
    40 s of one core.

    The command is ``cam-rig factorial``.

    Parameters
    ----------
    study : a name in ``config/factorials``, or the path of a YAML file
    executor : where laws are measured, such as a `ProcessPoolExecutor`; None is this process
    progress : told how far it is

    Raises
    ------
    ConfigError : something wrong in the study

    Examples
    --------
    >>> import cam_rig
    >>> found = cam_rig.factorial()  # doctest: +SKIP
    >>> found.summary()  # doctest: +SKIP
    """
    config = open_factorial(named_path("factorials", study))
    others = [cam for cam in load_tables(tables_path()).table_2_jump if cam != config.proposed]
    cam_set = open_cam_set(map(cam_path, [config.proposed, *others]), rig_path(config.rig))
    bench = bench_of(config, cam_set.rig, load_rig(rig_path(config.noise_rig)))
    return run_factorial(config, bench, cam_set.laws, executor, progress)

"""A factorial study run: its tables, and what it comes to in short."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from cam_rig.arguments import checked
from cam_rig.laws import Law
from cam_rig.laws.cam import open_cam_set
from cam_rig.laws.segments import up_and_down
from cam_rig.paper.factorial.conclusions import (
    Conclusions,
    advantages,
    conclusions,
    contact_lost,
    fastest,
    governed_by,
    mean_jumps,
    staying,
)
from cam_rig.paper.factorial.design import (
    EFFECTS,
    Bench,
    Design,
    Effect,
    Factorial,
    FactorialConfig,
    Measures,
    TwoWay,
    as_gentle,
    open_factorial,
    squeezed,
)
from cam_rig.schema import load_rig, load_tables
from cam_rig.schema.load import cam_path, named_path, rig_path, tables_path
from cam_rig.show.result import SILENT, Column, Progress, Records, Result
from cam_rig.units import RPM_PER_RAD_S


class Variance(NamedTuple):
    """Of a design, or its part in contact: ``lost`` cells, None where contact is not supposed."""

    whole: Design
    part: Design
    effect: Effect
    found: TwoWay
    governed_by: str
    lost: int | None
    fastest: float | None


class EffectAt(NamedTuple):
    """By how much (dB) a law, or an angle (rad), is above the mean of its design."""

    of: Variance
    law: str | None
    angle: float | None
    effect: float


class Cell(NamedTuple):
    """A law at an angle (rad) in a design, a cam, or the proposed cam in a span (rad)."""

    name: str
    measured: Measures
    law: str = ""
    angle: float = 0.0


def _percent(logarithm: str) -> Any:
    """By how much more, or less, %."""
    sign = -1.0 if logarithm == "acceleration" else 1.0
    return lambda row: 100.0 * math.expm1(sign * getattr(row, logarithm))


def _rpm(field: str) -> Any:
    return lambda row: getattr(row.measured, field) * RPM_PER_RAD_S


def _pair(field: str) -> tuple[Column, ...]:
    """The least and the greatest; None without any."""
    return Column(f"{field}_from", of=f"{field}.0"), Column(f"{field}_to", of=f"{field}.1")


#: What is measured of a law.
MEASURES = (
    Column("jump", "rpm", ".1f", "jump speed", _rpm("jump")),
    Column("rigid_jump", "rpm", ".1f", "rigid follower", _rpm("rigid_jump")),
    Column("acceleration", "m/s²", ".1f", "peak acceleration", "measured.acceleration"),
    Column("own_acceleration", "m/s²", of="measured.own_acceleration", hidden=True),
    Column("residual", "µm", ".2f", "residual vibration", "measured.residual"),
    Column("noise", "dB", ".1f", of="measured.noise"),
    Column("noise_in_contact", "dB", of="measured.noise_in_contact", hidden=True),
)

#: Which analysis of variance.
ANALYSED = (
    Column("design", of="whole.name"),
    Column(
        "effect",
        of="effect.key",
        cell=lambda row: row.effect.name if row.part is row.whole else "… in contact",
    ),
    Column("in_contact", of=lambda row: row.part is not row.whole, hidden=True),
    Column("laws", "", "d", of=lambda row: len(row.part.rises)),
    Column("angles", "", "d", of=lambda row: row.part.angles.size),
)


@dataclass(frozen=True, eq=False, repr=False)
class FactorialResult(Factorial, Result):
    """A factorial study with its analysis."""

    schema = "cam_rig.factorial.1"
    drawn_by = "cam_rig.paper.factorial.figures:figure"
    columns: ClassVar = {
        "variance": (
            *ANALYSED,
            Column("law", "%", ".1f", of="found.shares.0"),
            Column("between_classes", "%", ".1f", of="found.class_share"),
            Column("angle", "%", ".1f", of="found.shares.1"),
            Column("interaction", "%", ".1f", of="found.shares.2"),
            Column("sum_of_squares", "dB²", ".1f", of="found.total"),
            Column("cells_without_contact", "", "d", of="lost"),
            Column("governed_by"),
            Column(
                "fastest", "rpm", hidden=True, about="a cell that jumps below it has lost contact"
            ),
        ),
        "laws": (
            Column("law", of="0"),
            Column("continuity", of="1", cell=lambda row: f"C{row[1]}"),
            Column("same_angles", "rpm", ".0f", of="2"),
            Column("same_acceleration", "rpm", ".0f", of="3"),
        ),
        "advantage": (
            Column("over", of="cam"),
            Column("jump", "%", "+.1f", "jump speed", cell=_percent("jump")),
            Column("jump_share", "%", ".0f", "from slopes"),
            Column("acceleration", "%", "+.1f", "peak acceleration", cell=_percent("acceleration")),
            Column("acceleration_share", "%", ".0f", "from slopes"),
            Column(
                "residual",
                "",
                ".1f",
                "residual vibration, divided by",
                cell=lambda row: math.exp(row.residual),
            ),
            Column("noise", "dB", "+.1f", cell=lambda row: -row.noise),
        ),
        "compressed": (Column("span", "°", ".4g", of="angle"), *MEASURES),
        "cams": (Column("cam", of="name"), *MEASURES),
        "cells": (Column("design", of="name"), Column("law"), Column("angle", "°"), *MEASURES),
        "effects": (
            Column("design", of="of.whole.name"),
            Column("effect", of="of.effect.key"),
            Column("in_contact", of=lambda row: row.of.part is not row.of.whole),
            Column("law"),
            Column("angle", "°"),
            Column("above_mean", "dB", of="effect"),
        ),
        "conclusions": (
            *map(Column, ("proposed", "advantage", "ahead", "others")),
            *_pair("jump_share"),
            *_pair("acceleration_share"),
            Column("classes"),
            *(
                Column(f"jump_smooth_{share}", of=f"jump_smooth.{share}")
                for share in ("law", "classes", "slopes")
            ),
            *map(Column, ("step_to_c2", "residual_ratio", "residual_falls")),
            *(
                Column(f"smooth_{field}", of=f"smooth.{field}")
                for field in ("first", "first_rpm", "last", "last_rpm", "falls_with_class")
            ),
            Column("noise_spread", "dB", of="noise_spread_db"),
            *map(Column, ("loudest", "loudest_is_sharpest")),
            *_pair("others_rpm"),
            Column("behind"),
        ),
    }

    def conclusions(self) -> Conclusions:
        """What the study comes to."""
        return conclusions(self)

    def tables(self) -> list[Records]:
        """``variance`` first: a row for each effect in each design."""
        same, alike = self.same_angles, self.same_acceleration
        laws = zip(same.rises, same.classes, mean_jumps(same), mean_jumps(alike), strict=True)
        pressed = sorted(self.squeezed.items(), reverse=True)
        proposed, rows = self.config.proposed, list(self._variance())
        return [
            self.table(
                "variance",
                "Analysis of variance, {design}",
                rows,
                "Shares of the sum of squares. Degrees of freedom: laws − 1, angles − 1, and their "
                "product.",
                "Cells without contact: contact is lost below the effect's fastest speed, where "
                "the model holds the follower on. The row below has the laws and angles that all "
                "keep contact.",
                by="design",
            ),
            self.table("laws", "Jump speed by law, geometric mean over the angles", laws),
            self.table(
                "advantage",
                f"Advantage of {proposed}, and the part of it that comes from the slopes",
                advantages(self),
                "From slopes: what a rigid follower has too, in logarithms; the rest is vibration.",
                "Above 100 %: at its own, higher jump speed the cam excites more vibration.",
            ),
            self.table(
                "compressed",
                f"{proposed} compressed, with a low dwell for the rest of the turn",
                (Cell(proposed, measured, angle=span) for span, measured in pressed),
            ),
            self.table("cams", "The cams", (Cell(*one) for one in self.cams.items()), hidden=True),
            self.table("cells", "Both designs, cell by cell", self._cells(), hidden=True),
            self.table("effects", "Effects about the mean", _levels(rows), hidden=True),
            self.table("conclusions", "In short", [self.conclusions()], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """Where the advantage comes from, and what governs residual vibration."""
        found = self.conclusions()
        lines = [f"advantage of {found.proposed}: {found.advantage} ({found.classes})"]
        if found.jump_share is not None:
            low, high = (f"{100.0 * share:.0f} %" for share in found.jump_share)
            lines[0] += f"; {low} to {high} of its higher jump speed from the slopes"
        residual = found.same_acceleration["residual"]
        lines.append(f"residual vibration at the same acceleration: {residual.governed_by}")
        if residual.lost:
            lines[1] += (
                f"; {sum(residual.lost.values())} of {residual.cells} cells lose contact below "
                f"{residual.fastest_rpm:g} rpm"
            )
        return lines

    def _variance(self) -> Iterator[Variance]:
        for design in self.designs:
            for effect in EFFECTS:
                count = int(contact_lost(design, effect, self.config).sum())
                stay = staying(design, effect, self.config) if count else None
                speed = fastest(effect, self.config)
                rpm = None if speed is None else speed * RPM_PER_RAD_S
                for some in filter(None, (design, stay)):
                    lost = (count if some is design else 0) if effect.speeds else None
                    by = governed_by(some, effect)
                    yield Variance(design, some, effect, some.analysis(effect), by, lost, rpm)

    def _cells(self) -> Iterator[Cell]:
        for design in (self.same_angles, self.same_acceleration):
            for rise, row in zip(design.rises, design.cells, strict=True):
                for angle, measured in zip(design.angles.tolist(), row, strict=True):
                    yield Cell(design.name, measured, rise, angle)


def _levels(rows: list[Variance]) -> Iterator[EffectAt]:
    for row in rows:
        for law, effect in zip(row.part.rises, row.found.row_effects.tolist(), strict=True):
            yield EffectAt(row, law, None, effect)
        columns = row.part.angles.tolist(), row.found.column_effects.tolist()
        for angle, effect in zip(*columns, strict=True):
            yield EffectAt(row, None, angle, effect)


def run_factorial(
    config: FactorialConfig,
    bench: Bench,
    cams: Mapping[str, Law],
    pool: Executor | None = None,
    progress: Progress = SILENT,
) -> FactorialResult:
    """Measure every cell, in a pool if there is one; ``cams``: the proposed one and its rivals."""
    lift, rises = config.lift.si, tuple(config.rises)
    same = [(rise, event) for rise in rises for event in config.events.si_list]
    alike = [
        (rise, as_gentle(rise, config.reference, event))
        for rise in rises
        for event in config.gentle.si_list
    ]
    laws = [up_and_down(rise, event, lift) for rise, event in same + alike]
    pressed = [squeezed(cams[config.proposed], span) for span in config.squeezed.si_list]
    todo = [*laws, *cams.values(), *pressed]
    progress.begin(len(todo), config.name)
    left = (map if pool is None else pool.map)(bench.measure, todo)

    def measured() -> Measures:
        found = next(left)
        progress.advance()
        return found

    def table(name: str, angles: list[float]) -> Design:
        cells = [[measured() for _ in angles] for _ in rises]
        return Design(name, rises, np.array(angles), cells)

    return FactorialResult(
        config=config,
        same_angles=table("same angles", config.events.si_list),
        same_acceleration=table("same acceleration", config.gentle.si_list),
        cams={cam: measured() for cam in cams},
        squeezed={span: measured() for span in config.squeezed.si_list},
    )


@checked
def factorial(
    study: str | Path = "continuity",
    *,
    executor: Executor | None = None,
    progress: Progress = SILENT,
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
    bench = Bench.of(config, cam_set.rig, load_rig(rig_path(config.noise_rig)))
    return run_factorial(config, bench, cam_set.laws, executor, progress)

"""What `cam-rig laws` and `cam-rig law` give: peaks of named rises, curves and extremes of cams."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from cam_rig.arguments import checked
from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.laws import Law, catalogue
from cam_rig.laws.cam import law_of
from cam_rig.laws.catalogue import families
from cam_rig.laws.law import SMOOTHEST, Extreme, Joint, continuity, extremes, joints
from cam_rig.laws.passages import LEVELS, passages
from cam_rig.laws.segments import NAMED_RISES
from cam_rig.schema import CamConfig, load_cam
from cam_rig.schema.load import cam_path, config_root
from cam_rig.show.looks import PER_RADIAN
from cam_rig.show.result import Column, Records, Result
from cam_rig.units import FloatArray


@dataclass(frozen=True)
class RiseRow:
    """A law by name, whence it is, and its figures; None where they depend on the cam's file."""

    law: str
    source: str
    figures: catalogue.Figures | None


RISES = (
    Column("law"),
    Column("source", heading="from, or by", doc="equation, or keys of the cam's file"),
    *(
        Column(f"peak_{order}", "", ".4f", order, f"figures.peak_{order}", missing="any")
        for order in ("velocity", "acceleration", "jerk")
    ),
    Column(
        "continuity",
        heading="joins",
        of="figures.continuity",
        cell=lambda row: "any" if row.figures is None else f"C{row.figures.continuity}",
        doc="order of the highest derivative without a jump",
    ),
)
PEAKS = "Peaks for unit rise and unit span"


def _named(names: Iterable[str]) -> list[RiseRow]:
    return [RiseRow(name, NAMED_RISES[name].source, catalogue.figures(name)) for name in names]


@dataclass(frozen=True, repr=False)
class LawsResult(Result):
    """The named rises of some families; with all of them the laws without fixed figures too."""

    schema = "cam_rig.laws.1"
    plot_function = "cam_rig.studies.laws.figures:laws_figure"
    columns: ClassVar = {"laws": RISES}

    families: tuple[catalogue.RiseFamily, ...]
    free: bool

    def tables(self) -> list[Records]:
        """A row a law, as the catalogue has them."""
        named = {name for family in self.families for name in family.rises}
        rows = _named(name for name in NAMED_RISES if name in named)
        if self.free:
            free = catalogue.free_laws().items()
            rows += [RiseRow(name, keys or "the level before", None) for name, keys in free]
        return [self.table("laws", PEAKS, rows)]


def _curve(key: str) -> Callable[[Any], Any]:
    return lambda found: found.curves[key]


#: Parts of the span at which the curve of a rise is given.
STEPS = 200
#: Orders of the lift in words, and what follows the unit of lift.
WORDS = ("lift", "velocity", "acceleration", "jerk")
SYMBOLS = ("s", "s'", "s''", "s'''")


@dataclass(frozen=True, repr=False)
class RisesResult(Result):
    """Named rises of unit lift over a unit span."""

    schema = "cam_rig.law_rises.1"
    plot_function = "cam_rig.studies.laws.figures:rises_result_figure"
    columns: ClassVar = {
        "curves": (
            Column("rise", of=_curve("rise")),
            Column("u", of=_curve("u"), doc="part of the span"),
            *(Column(key, of=_curve(key), doc="of unit rise and unit span") for key in WORDS),
        ),
        "laws": RISES,
    }

    names: tuple[str, ...]

    @property
    def called(self) -> list[str]:
        """The rises' names, as of a picture's file."""
        return ["rises", *self.names]

    @cached_property
    def curves(self) -> dict[str, Any]:
        """By column, rise after rise."""
        u = np.linspace(0.0, 1.0, STEPS + 1)
        motion = np.hstack([catalogue.rise_values(name, u) for name in self.names])
        rises = np.repeat(self.names, u.size)
        return {"rise": rises, "u": np.tile(u, len(self.names))} | _by_order(motion)

    def tables(self) -> list[Records]:
        """``curves``, and the row of each in ``laws``."""
        return [self.array_table("curves"), self.table("laws", PEAKS, _named(self.names))]


def _by_order(motion: FloatArray) -> dict[str, FloatArray]:
    return dict(zip(WORDS, motion, strict=True))


@dataclass(frozen=True)
class ExtremeRow:
    """The extremes of a derivative of a cam's law; ``unit`` of lift, of ``factor`` m, is shown."""

    cam: str
    law: Law
    order: int
    unit: str
    factor: float
    smallest: Extreme
    largest: Extreme

    @property
    def continuity(self) -> int:
        """Order of the highest derivative without a jump."""
        return continuity(self.law)


@dataclass(frozen=True)
class JointRow:
    """A joint of a cam's law."""

    cam: str
    joint: Joint


def _end(which: str) -> tuple[Column, Column]:
    def shown(row: ExtremeRow) -> float:
        value: float = getattr(row, which).value
        return value / row.factor

    return (
        Column(which, "", ".6g", of=f"{which}.value", cell=shown, doc="in `unit`"),
        Column(f"{which}_at", "°", ".4g", "at", f"{which}.angle", doc="cam angle"),
    )


@dataclass(frozen=True)
class HeightsRow:
    """Cam angles (rad) at which a cam passes heights, by `_passage_key`."""

    cam: str
    angles: dict[str, float]

    @classmethod
    def of(cls, cam: CamConfig, law: Law) -> HeightsRow:
        """Take the first passage upwards and the last downwards through each height."""
        angles = dict[str, float]()
        for passage in passages(law, cam.lift.si):
            key = _passage_key(passage.level, passage.rising)
            if not passage.rising or key not in angles:
                angles[key] = passage.angle
        return cls(cam.name, angles)


def _passage_key(level: float, rising: bool) -> str:
    return f"{'up' if rising else 'down'}_{100.0 * level:g}"


def _passage_column(level: float, rising: bool) -> Column:
    key, way = _passage_key(level, rising), "up" if rising else "down"
    heading = f"{100.0 * level:g} % {way}"
    return Column(key, "°", ".3f", heading, lambda row: row.angles.get(key))


#: Degrees from row to row of a cam's curves.
STEP_DEG = 0.5


@dataclass(frozen=True, repr=False)
class CamLawsResult(Result):
    """The laws of cams over the turn."""

    schema = "cam_rig.law.1"
    plot_function = "cam_rig.studies.laws.figures:cam_laws_figure"
    columns: ClassVar = {
        "curves": (
            Column("cam", of=_curve("cam")),
            Column("angle", "°", of=_curve("angle"), doc="cam angle"),
            *(
                Column(key, f"mm{per}", of=_curve(key))
                for key, per in zip(WORDS, PER_RADIAN, strict=True)
            ),
        ),
        "extremes": (
            Column("cam", hidden=True),
            Column(
                "continuity",
                heading="joins",
                cell=lambda row: f"C{row.continuity}",
                doc="order of the highest derivative without a jump",
                hidden=True,
            ),
            Column(
                "quantity",
                of=lambda row: WORDS[row.order],
                cell=lambda row: f"{WORDS[row.order]} {SYMBOLS[row.order]}",
            ),
            Column(
                "unit",
                of=lambda row: f"m{PER_RADIAN[row.order]}",
                cell=lambda row: f"{row.unit}{PER_RADIAN[row.order]}",
            ),
            *_end("largest"),
            *_end("smallest"),
        ),
        "joints": (
            Column("cam"),
            Column("angle", "°", of="joint.angle", doc="cam angle"),
            Column("continuity", of="joint.continuity", doc="below that of the smoothest joints"),
        ),
        "heights": (
            Column("cam"),
            *(_passage_column(level, True) for level in LEVELS),
            *(_passage_column(level, False) for level in reversed(LEVELS)),
        ),
    }

    cams: tuple[tuple[CamConfig, Law], ...]

    @property
    def called(self) -> list[str]:
        """The cams' names, as of a picture's file."""
        return [cam.name for cam, _ in self.cams]

    @cached_property
    def curves(self) -> dict[str, Any]:
        """By column, cam after cam."""
        angle = np.radians(np.arange(0.0, 360.0, STEP_DEG))
        motion = np.hstack(
            [np.stack([law(angle, i) for i in catalogue.ORDERS]) for _, law in self.cams]
        )
        names = np.repeat([cam.name for cam, _ in self.cams], angle.size)
        return {"cam": names, "angle": np.tile(angle, len(self.cams))} | _by_order(motion)

    @property
    def rough(self) -> list[JointRow]:
        """Joints that are not smooth."""
        every = (JointRow(cam.name, joint) for cam, law in self.cams for joint in joints(law))
        return [row for row in every if row.joint.continuity < SMOOTHEST]

    def tables(self) -> list[Records]:
        """``curves``, ``extremes``, rough ``joints`` and ``heights``; several cams side by side."""
        unit, factor = catalogue.common_unit(cam for cam, _ in self.cams)
        if len(self.cams) == 1:
            unit, factor = self.cams[0][0].lift.unit, self.cams[0][0].lift.factor
        rows = [
            ExtremeRow(cam.name, law, order, unit, factor, *extremes(law, order))
            for cam, law in self.cams
            for order in catalogue.ORDERS
        ]
        return [
            self.array_table("curves"),
            self._extremes(rows),
            self.table("joints", "", self.rough, hidden=True),
            self.table(
                "heights",
                "Cam angles at which the lift passes fractions of itself",
                (HeightsRow.of(*cam) for cam in self.cams),
                "Heights are above the lowest lift, as fractions of the lift in the cam's file: "
                "the first passage upwards, the last downwards.",
            ),
        ]

    def _extremes(self, rows: list[ExtremeRow]) -> Records:
        if len(self.cams) == 1:
            return self.table("extremes", f"Extremes of {self.cams[0][1].name}", rows)
        changed: dict[str, dict[str, Any]] = {
            "quantity": {
                "cell": lambda row: f"{SYMBOLS[row.order]} [{row.unit}{PER_RADIAN[row.order]}]"
            },
            "largest": {"heading": "largest {}", "number_format": ".5g"},
            "smallest": {"heading": "smallest {}", "number_format": ".5g"},
        }
        changed |= {key: {"hidden": False} for key in ("cam", "continuity")}
        changed |= {key: {"hidden": True} for key in ("unit", "largest_at", "smallest_at")}
        columns = tuple(replace(c, **changed[c.key]) for c in self.columns["extremes"])
        caption, is_derivative = "Extremes over the turn", lambda row: row.order > 0
        table = self.table("extremes", caption, rows, pivot="quantity", row_filter=is_derivative)
        return replace(table, columns=columns)

    def summary(self) -> list[str]:
        """Of one cam where it is not smooth."""
        if len(self.cams) > 1:
            return []
        if not self.rough:
            return [f"joins C{SMOOTHEST} or smoother everywhere"]
        places = ", ".join(
            f"{math.degrees(row.joint.angle):.5g}° C{row.joint.continuity}" for row in self.rough
        )
        return [f"joints (others C{SMOOTHEST}): {places}"]


# Laws by name: of cams over the turn, or bare rises, and the catalogue of all.


@checked
def law(
    names: str | Path | CamConfig | Sequence[str | Path | CamConfig], *, rises: bool = False
) -> CamLawsResult | RisesResult:
    """Lift, velocity, acceleration and jerk over the cam angle, their peaks, and the joints.

    Peaks come from the roots of the next derivative. Several laws are laid over each other: as cams
    over the turn if each is a cam's, else as bare rises of unit lift over a unit span.

    The command is ``cam-rig law``.

    Parameters
    ----------
    names : a cam: a name, a path, or what `load_cam` gave; a rise by its name; or several
    rises : names that a cam and a rise have in common mean the rise

    Raises
    ------
    ConfigError : no such cam or rise, one named twice, or cams among rises
    LawError : a cam whose segments do not join

    Examples
    --------
    >>> import cam_rig
    >>> found = cam_rig.law("poly345")
    >>> found.summary()
    ['joints (others C4): 31.25° C2, 148.75° C2, 211.25° C2, 328.75° C2']
    """
    asked = [names] if isinstance(names, str | Path | CamConfig) else list(names)
    if not asked:
        raise ConfigError("names: is an empty list; allowed: a cam or a rise, or several")
    texts = [str(name) for name in asked if not isinstance(name, CamConfig)]
    if texts and _are_rises(texts, rises):
        if len(texts) < len(asked):
            raise ConfigError(f"{texts[0]!r} is a rise; allowed: cams with cams, rises with rises")
        return RisesResult(tuple(texts))
    found = []
    for one in asked:
        path = one.name if isinstance(one, CamConfig) else cam_path(one)
        cam = one if isinstance(one, CamConfig) else load_cam(cam_path(one))
        found.append((cam, law_of(path, cam)))
    return CamLawsResult(tuple(found))


@checked
def list_laws(family: str | None = None) -> LawsResult:
    """Every law by name, with its peaks per unit rise and unit span, and how smoothly it joins.

    The command is ``cam-rig laws``.

    Parameters
    ----------
    family : only one of ``polynomial``, ``start``, ``end`` (half-rises), ``classical``

    Raises
    ------
    ConfigError : no such family

    Examples
    --------
    >>> import cam_rig
    >>> table = cam_rig.list_laws("polynomial").to_pandas()
    >>> table.law.tolist()[:2]
    ['poly345', 'poly4567']
    """
    found = families()
    if family is None:
        return LawsResult(tuple(found.values()), free=True)
    if family not in found:
        hint = did_you_mean(family, found)
        raise ConfigError(f"--family {family!r}: no such family{hint}; allowed: {', '.join(found)}")
    return LawsResult((found[family],), free=False)


def _are_rises(names: Sequence[str], rises: bool) -> bool:
    """Whether the names are drawn as bare rises: when asked for, or when not all are cams."""
    cams = sorted(path.stem for path in (config_root() / "cams").glob("*.yaml"))
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ConfigError(f"{name!r} is named twice; allowed: each law once")
        if not _is_cam(name, cams) and name not in NAMED_RISES:
            hint = did_you_mean(name, [*cams, *NAMED_RISES])
            raise ConfigError(
                f"{name[:40]!r}: no such cam or rise{hint}; cams: {', '.join(cams)}; "
                f"rises: {', '.join(NAMED_RISES)}"
            )
    if not rises and all(_is_cam(name, cams) for name in names):
        return False
    alone = next((name for name in names if name not in NAMED_RISES), None)
    if alone is not None:
        other = next((f"{name!r} is a rise" for name in names if not _is_cam(name, cams)), None)
        raise ConfigError(
            f"{alone!r} is a cam and no rise, {other or '--rises asks for rises'}; allowed: cams "
            f"with cams, rises with rises; rises: {', '.join(NAMED_RISES)}"
        )
    return True


def _is_cam(name: str, cams: Sequence[str]) -> bool:
    """Whether it is a cam's name, or a path, which is a cam's or an error of its own."""
    return name in cams or cam_path(name) == Path(name)

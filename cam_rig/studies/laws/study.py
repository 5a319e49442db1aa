"""Results of ``cam-rig law``: curves, extremes and joints of the laws of cams."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from cam_rig.arguments import check_arguments
from cam_rig.errors import ConfigError
from cam_rig.laws import Law, catalogue
from cam_rig.laws.cam import law_of
from cam_rig.laws.law import MAX_CONTINUITY, Extreme, Joint, continuity, extremes, joints
from cam_rig.laws.passages import LEVELS, passages
from cam_rig.laws.segments import RISES
from cam_rig.laws.tasks import segment_tasks
from cam_rig.schema import CamConfig, load_cam
from cam_rig.schema.law_names import law_name, suggest_law
from cam_rig.schema.load import cam_path, config_root
from cam_rig.show.looks import PER_RADIAN
from cam_rig.show.result import Column, Records, Result
from cam_rig.studies.laws.rises import QUANTITIES, SYMBOLS, RisesResult, by_order, curve_column


@dataclass(frozen=True)
class ExtremeRow:
    """Table row: largest and smallest value of one derivative of a cam's law.

    `order` is that of the derivative, 0 for the lift. The displayed unit of the lift is `unit`,
    which is `factor` m.
    """

    cam: str
    law: Law
    order: int
    unit: str
    factor: float
    smallest: Extreme
    largest: Extreme

    @property
    def continuity(self) -> int:
        """Order of the highest derivative of the law without a jump over the turn."""
        return continuity(self.law)


@dataclass(frozen=True)
class JointRow:
    """Table row: a joint of two pieces of a cam's law, with its continuity."""

    cam: str
    joint: Joint


def _extreme_columns(kind: str) -> tuple[Column, Column]:
    """Return the table columns of an extreme value and of its cam angle.

    ``kind`` is "largest" or "smallest".
    """

    def display_value(row: ExtremeRow) -> float:
        value: float = getattr(row, kind).value
        return value / row.factor

    return (
        Column(kind, "", ".6g", of=f"{kind}.value", cell=display_value, doc="in `unit`"),
        Column(f"{kind}_at", "°", ".4g", "at", f"{kind}.angle", doc="cam angle"),
    )


@dataclass(frozen=True)
class HeightsRow:
    """Table row: cam angles (rad) at which the lift passes given heights.

    ``angles`` has the keys of `_passage_key`, which contain height and direction.
    """

    cam: str
    angles: dict[str, float]

    @classmethod
    def of(cls, cam: CamConfig, law: Law) -> HeightsRow:
        """Return the first upward and the last downward passage of each height.

        The heights are the fractions `LEVELS` of the lift of the cam.
        """
        angles = dict[str, float]()
        for passage in passages(law, cam.lift.si):
            key = _passage_key(passage.level, passage.rising)
            if not passage.rising or key not in angles:
                angles[key] = passage.angle
        return cls(cam.name, angles)


def _passage_key(level: float, rising: bool) -> str:
    """Return the column key for a height and a direction of passage, such as up_50.

    ``level`` is the height as a fraction of the lift.
    """
    return f"{'up' if rising else 'down'}_{100.0 * level:g}"


def _passage_column(level: float, rising: bool) -> Column:
    """Return the table column of the cam angles at which the lift passes a height.

    ``level`` is the height as a fraction of the lift. ``rising`` is True for upward passages.
    """
    key, direction = _passage_key(level, rising), "up" if rising else "down"
    heading = f"{100.0 * level:g} % {direction}"
    return Column(key, "°", ".3f", heading, lambda row: row.angles.get(key))


#: Step of the cam angle in the exported curves of a cam's law, degrees.
STEP_DEG = 0.5


@dataclass(frozen=True, repr=False)
class CamLawsResult(Result):
    """Laws of cams over one turn, with curves, extremes and joints.

    Parameters
    ----------
    cams : tuple
        Pairs of a cam and its law.

    Examples
    --------
    >>> import cam_rig
    >>> cam_rig.law_summary(["poly345", "bezier15"]).labels
    ['poly345', 'bezier15']
    """

    schema = "cam_rig.law.1"
    plot_function = "cam_rig.studies.laws.figures:cam_laws_figure"
    columns: ClassVar = {
        "curves": (
            Column("cam", of=curve_column("cam")),
            Column("angle", "°", of=curve_column("angle"), doc="cam angle"),
            *(
                Column(key, f"mm{per}", of=curve_column(key))
                for key, per in zip(QUANTITIES, PER_RADIAN, strict=True)
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
                of=lambda row: QUANTITIES[row.order],
                cell=lambda row: f"{QUANTITIES[row.order]} {SYMBOLS[row.order]}",
            ),
            Column(
                "unit",
                of=lambda row: f"m{PER_RADIAN[row.order]}",
                cell=lambda row: f"{row.unit}{PER_RADIAN[row.order]}",
            ),
            *_extreme_columns("largest"),
            *_extreme_columns("smallest"),
        ),
        "joints": (
            Column("cam"),
            Column("angle", "°", of="joint.angle", doc="cam angle"),
            Column("continuity", of="joint.continuity", doc="class, below that of smooth joints"),
        ),
        "segments": (
            Column("cam"),
            Column("index", doc="from 0, as in messages"),
            Column("law"),
            Column("start", "°", ".5g", doc="cam angle"),
            Column("span", "°", ".5g"),
            Column("rise", "mm", ".5g"),
            Column("task", doc="ends: R rest, G constant velocity, U reversal, B motion"),
            Column("continuity", heading="joins", cell=lambda row: f"C{row.continuity}"),
        ),
        "heights": (
            Column("cam"),
            *(_passage_column(level, True) for level in LEVELS),
            *(_passage_column(level, False) for level in reversed(LEVELS)),
        ),
    }

    cams: tuple[tuple[CamConfig, Law], ...]

    @property
    def labels(self) -> list[str]:
        """Words for the default file name of the figure: the names of the cams."""
        return [cam.name for cam, _ in self.cams]

    @cached_property
    def curves(self) -> dict[str, Any]:
        """Columns of the exported table of curves by name, one cam after the other."""
        angle = np.radians(np.arange(0.0, 360.0, STEP_DEG))
        motion = np.hstack(
            [np.stack([law(angle, i) for i in catalogue.ORDERS]) for _, law in self.cams]
        )
        names = np.repeat([cam.name for cam, _ in self.cams], angle.size)
        return {"cam": names, "angle": np.tile(angle, len(self.cams))} | by_order(motion)

    @property
    def rough_joints(self) -> list[JointRow]:
        """Joints with a jump in one of the derivatives up to order `MAX_CONTINUITY`."""
        rows = (JointRow(cam.name, joint) for cam, law in self.cams for joint in joints(law))
        return [row for row in rows if row.joint.continuity < MAX_CONTINUITY]

    def tables(self) -> list[Records]:
        """Return `curves`, `extremes`, rough `joints`, `segments` and `heights`."""
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
            self.table("joints", "", self.rough_joints, hidden=True),
            self.table(
                "segments",
                "Tasks of the segments, and the continuity at their starts",
                (task for cam in self.cams for task in segment_tasks(*cam)),
                "Ends: R rest, G constant velocity, U reversal, B motion with both derivatives.",
            ),
            self.table(
                "heights",
                "Cam angles at which the lift passes fractions of itself",
                (HeightsRow.of(*cam) for cam in self.cams),
                "Heights are above the lowest lift, as fractions of the lift in the cam's file: "
                "the first passage upwards, the last downwards.",
            ),
        ]

    def _extremes(self, rows: list[ExtremeRow]) -> Records:
        """Return the table of extremes from one row per cam and derivative.

        For several cams, it is displayed with one row per cam and the derivatives in columns.
        """
        if len(self.cams) == 1:
            return self.table("extremes", f"Extremes of {self.cams[0][1].name}", rows)
        changes: dict[str, dict[str, Any]] = {
            "quantity": {
                "cell": lambda row: f"{SYMBOLS[row.order]} [{row.unit}{PER_RADIAN[row.order]}]"
            },
            "largest": {"heading": "largest {}", "number_format": ".5g"},
            "smallest": {"heading": "smallest {}", "number_format": ".5g"},
        }
        changes |= {key: {"hidden": False} for key in ("cam", "continuity")}
        changes |= {key: {"hidden": True} for key in ("unit", "largest_at", "smallest_at")}
        columns = tuple(replace(c, **changes[c.key]) for c in self.columns["extremes"])
        caption, is_derivative = "Extremes over the turn", lambda row: row.order > 0
        table = self.table("extremes", caption, rows, pivot="quantity", row_filter=is_derivative)
        return replace(table, columns=columns)

    def summary(self) -> list[str]:
        """Return a sentence on the joints that are not smooth, for a single cam only."""
        if len(self.cams) > 1:
            return []
        if not self.rough_joints:
            return [f"joins C{MAX_CONTINUITY} or smoother everywhere"]
        angles = ", ".join(
            f"{math.degrees(row.joint.angle):.5g}° C{row.joint.continuity}"
            for row in self.rough_joints
        )
        return [f"joints (others C{MAX_CONTINUITY}): {angles}"]


# Function of the Python API.


@check_arguments
def law_summary(
    names: str | Path | CamConfig | Sequence[str | Path | CamConfig], *, rises: bool = False
) -> CamLawsResult | RisesResult:
    """Compute lift, velocity, acceleration and jerk of laws, with peaks and joints.

    Peaks come from the roots of the next derivative. Several laws are compared as cams over the
    turn if each name is that of a cam, otherwise as bare rises of unit lift over a unit span. The
    command is ``cam-rig law``.

    Parameters
    ----------
    names : str, Path, Cam or sequence
        A cam as a name, a path or the result of `load_cam`, a rise by its name, or several of them.
    rises : bool
        True to treat names of both a cam and a rise as the rise (default: False).

    Returns
    -------
    CamLawsResult or RisesResult
        Curves, extremes and joints of cams, or curves and peaks of rises.

    Raises
    ------
    ConfigError
        A name is unknown or repeated, or cams and rises are mixed.
    LawError
        The segments of a cam do not join.

    Examples
    --------
    >>> import cam_rig
    >>> result = cam_rig.law_summary("poly345")
    >>> result.summary()
    ['joints (others C4): 31.25° C2, 148.75° C2, 211.25° C2, 328.75° C2']
    """
    requested = [names] if isinstance(names, str | Path | CamConfig) else list(names)
    if not requested:
        raise ConfigError("names must contain at least one cam or rise")
    texts = [str(name) for name in requested if not isinstance(name, CamConfig)]
    if texts and _are_rises(texts, rises):
        if len(texts) < len(requested):
            raise ConfigError(f"cams and rises cannot be combined, got the rise {texts[0]!r}")
        return RisesResult(tuple(map(law_name, texts)))
    cams = []
    for source in requested:
        path = source.name if isinstance(source, CamConfig) else cam_path(source)
        cam = source if isinstance(source, CamConfig) else load_cam(cam_path(source))
        cams.append((cam, law_of(path, cam)))
    return CamLawsResult(tuple(cams))


def _are_rises(names: Sequence[str], rises: bool) -> bool:
    """Return True if all names are to be read as rises, False if as cams.

    A rise is a law from 0 to 1 over a span of 1. The names are rises if `rises` is True, or if not
    all of them are cams. Raises ConfigError for an unknown or repeated name, and if cams and rises
    are mixed.
    """
    cams = sorted(path.stem for path in (config_root() / "cams").glob("*.yaml"))
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ConfigError(f"{name!r} is repeated; remove one")
        if not _is_cam(name, cams) and law_name(name) not in RISES:
            hint = suggest_law(name, [*cams, *RISES])
            raise ConfigError(
                f"{name[:40]!r}: no such cam or rise{hint}; cams: {', '.join(cams)}; "
                f"rises: {', '.join(RISES)}"
            )
    if not rises and all(_is_cam(name, cams) for name in names):
        return False
    cam = next((name for name in names if law_name(name) not in RISES), None)
    if cam is not None:
        other = next((f"{name!r} is a rise" for name in names if not _is_cam(name, cams)), None)
        raise ConfigError(
            f"{cam!r} is a cam, {other or 'and --rises requires rises'}; cams and rises cannot be "
            f"combined; the rises are {', '.join(RISES)}"
        )
    return True


def _is_cam(name: str, cams: Sequence[str]) -> bool:
    """Return True if a name is that of a shipped cam, or a path.

    ``cams`` are the names of the shipped cams. A path is assumed to be that of a cam file. If it is
    not, reading it raises an error later.
    """
    return name in cams or cam_path(name) == Path(name)

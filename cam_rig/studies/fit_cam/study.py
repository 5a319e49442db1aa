"""Readings to a fit, and a fit to files, as `fit_cam` and ``cam-rig new`` are asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, TypedDict, Unpack, overload

from cam_rig.arguments import checked
from cam_rig.errors import ConfigError
from cam_rig.files import new_yaml, write_new
from cam_rig.studies.fit_cam.arcs import FollowerKind, Known
from cam_rig.studies.fit_cam.arcs_fit import ArcsFit, Flank, fit_arcs
from cam_rig.studies.fit_cam.dwells import above_zero
from cam_rig.studies.fit_cam.files import CamFiles, arcs_cam, require_told, spline_cam
from cam_rig.studies.fit_cam.gauge import (
    GaugeColumn,
    GaugeTable,
    Readings,
    gap_note,
    put_in_order,
    read_gauge_table,
)
from cam_rig.studies.fit_cam.spline_fit import SplineFit, fit_spline

#: Of several followers the one that a cam's file has.
FOLLOWERS: tuple[FollowerKind, ...] = ("roller", "point", "flat")


@dataclass(frozen=True)
class FitRequest:
    """What is asked of a fit; ``ask_nothing`` takes the first of several columns, and says so."""

    shape: Literal["spline", "arcs"] = "spline"
    followers: tuple[FollowerKind, ...] = ()
    column: str | None = None
    tolerance: float | None = None
    reverse: bool = False
    roller_radius: float | None = None
    base_radius: float | None = None
    flank: Flank = None
    ask_nothing: bool = False

    def run(self, files: list[Path]) -> SplineFit | ArcsFit:
        """Read the files and fit."""
        arcs = self.shape == "arcs"
        self._require_apart(len(files))
        tables = [read_gauge_table(path, self.column) for path in files]
        taken = [(table, one) for table in tables for one in self._columns(table)]
        readings = [put_in_order(table, column, self.reverse) for table, column in taken]
        notes = [f"{table.file}: {note}" for table in tables for note in table.notes]
        if len(readings) < len(tables[0].columns):
            others = ", ".join(repr(column.name) for column in tables[0].columns[1:])
            notes.append(f"{tables[0].file}: first column of lifts taken, not {others}: --column")
        for one in readings:
            notes += [f"{one.name}: {note}" for note in (*one.notes, *gap_note(one, arcs))]
        if arcs:
            return replace(self._arcs(readings), notes=tuple(notes))
        return replace(fit_spline(readings[0], self.tolerance), notes=tuple(notes))

    def files(self, found: SplineFit | ArcsFit, name: str) -> CamFiles:
        """A fit as a cam of the rig; its follower is as asked, else the roller if there is one."""
        kind = self.followers[0] if len(self.followers) == 1 else None
        if isinstance(found, ArcsFit):
            require_told(found, named=bool(self.followers))
            there = [column.kind for column in found.fitted_columns]
            likely = next(one for one in FOLLOWERS if one in there)
            return arcs_cam(name, found, kind or likely)
        radii = self.base_radius, self.roller_radius
        return spline_cam(name, found, kind or "roller", *radii)

    def _require_apart(self, files: int) -> None:
        """Refuse options that are of the other shape, rather than pass one over."""
        if self.shape == "arcs":
            if self.tolerance is not None:
                raise ConfigError("--tolerance: is for --shape spline; allowed with arcs: none")
            return
        if files > 1:
            raise ConfigError(
                f"{files} files; allowed: one for a spline, several with --shape arcs"
            )
        if self.flank is not None:
            raise ConfigError("--flank: is for --shape arcs; allowed with a spline: none")
        if len(self.followers) > 1:
            raise ConfigError(
                f"--follower: stands {len(self.followers)} times; allowed: once, for a spline "
                "is of one column"
            )

    def _columns(self, table: GaugeTable) -> tuple[GaugeColumn, ...]:
        if self.shape == "arcs":
            return table.columns
        return table.columns[:1] if self.ask_nothing else (table.only_column(),)

    def _arcs(self, readings: list[Readings]) -> ArcsFit:
        columns = tuple(above_zero(one) for one in readings)
        lift = max(float(one.lifts.max()) for one in columns)
        roller = 0.5 * lift if self.roller_radius is None else self.roller_radius
        if "point" in self.followers:
            roller = 0.0
        base = 3.0 * lift if self.base_radius is None else self.base_radius
        known = self._known(roller)
        return fit_arcs(columns, self._kinds(len(columns)), roller, base, known, self.flank)

    def _known(self, roller: float) -> Known:
        """Which radii are given; without a roller the base's is all."""
        if self.base_radius is None:
            return None if self.roller_radius is None else "roller"
        return "base" if self.roller_radius is None and roller else "both"

    def _kinds(self, columns: int) -> tuple[bool | None, ...]:
        """Of each column whether its follower is flat, None where that is to be found."""
        if len(self.followers) == columns:
            return tuple(one == "flat" for one in self.followers)
        if len(self.followers) > 1:
            raise ConfigError(
                f"--follower: stands {len(self.followers)} times; allowed: once, or once for each "
                f"of {columns} columns of lifts"
            )
        return (None,) * columns


class FitOptions(TypedDict, total=False):
    """Options of `fit_cam` but the shape, which says what it gives."""

    follower: FollowerKind | Sequence[FollowerKind] | None
    column: str | None
    tolerance: float | None
    reverse: bool
    roller_radius: float | None
    base_radius: float | None
    flank: Flank
    out: str | Path | None


Files = str | Path | Sequence[str | Path]


@overload
def fit_cam(
    tables: Files, *, shape: Literal["spline"] = ..., **how: Unpack[FitOptions]
) -> SplineFit: ...
@overload
def fit_cam(tables: Files, *, shape: Literal["arcs"], **how: Unpack[FitOptions]) -> ArcsFit: ...
@checked
def fit_cam(
    tables: str | Path | Sequence[str | Path],
    *,
    shape: Literal["spline", "arcs"] = "spline",
    follower: FollowerKind | Sequence[FollowerKind] | None = None,
    column: str | None = None,
    tolerance: float | None = None,
    reverse: bool = False,
    roller_radius: float | None = None,
    base_radius: float | None = None,
    flank: Flank = None,
    out: str | Path | None = None,
) -> SplineFit | ArcsFit:
    r"""``cam-rig fit cam``: a spline with exact dwells, or tangent arcs, through gauge readings.

    Parameters
    ----------
    tables : a file of cam angles and readings, of arcs several
    shape : ``spline`` or ``arcs``
    follower : ``roller``, ``flat`` or ``point``, or one for each column of arcs; None: a roller,
        of arcs as it is found
    column : heading of the column of lifts, the only one that is read
    tolerance : error of the gauge, m; None: the scatter of the readings
    reverse : the cam was turned the other way
    roller_radius, base_radius : m; None: assumed
    flank : ``straight`` or ``curved``, of arcs that are known
    out : a new .yaml file for `load_cam`; ``assumed`` says what of it no reading tells

    Raises
    ------
    ConfigError : a table that cannot be read, or arguments that do not go together
    LawError, OutputError : no law goes through the readings; ``out`` is there already

    Examples
    --------
    >>> import tempfile, cam_rig
    >>> table = "angle [deg],lift [mm]\n" + "".join(f"{5 * i},{i % 36}\n" for i in range(72))
    >>> with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
    ...     _ = file.write(table), file.flush()
    ...     found = cam_rig.fit_cam(file.name, tolerance=1e-3)
    >>> round(found.smoothed.rms, 6)  # m
    0.001
    """
    target = new_yaml(out)
    files = [tables] if isinstance(tables, str | Path) else tables
    if not files:
        raise ConfigError("tables: is an empty list; allowed: a file, of arcs several")
    kinds = (follower,) if isinstance(follower, str) else tuple(follower or ())
    for name, length in (("roller_radius", roller_radius), ("base_radius", base_radius)):
        if length is not None and length < 0.0:
            raise ConfigError(f"{name}: is {length:g} m; allowed: at least 0 m")
    radii = roller_radius, base_radius
    request = FitRequest(shape, kinds, column, tolerance, reverse, *radii, flank)
    found = request.run([Path(file) for file in files])
    if target is None:
        return found
    written = request.files(found, target.stem)
    write_new(target.parent, written.texts)
    return replace(found, assumed=written.assumed)

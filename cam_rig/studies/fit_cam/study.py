"""Fit of a cam to tables of gauge readings, and the files of the fitted cam."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, TypedDict, Unpack, overload

from cam_rig.arguments import check_arguments
from cam_rig.errors import ConfigError
from cam_rig.files import new_yaml, write_new
from cam_rig.studies.fit_cam.arcs import FollowerKind, Known
from cam_rig.studies.fit_cam.arcs_fit import ArcsFit, Flank, fit_arcs
from cam_rig.studies.fit_cam.dwells import above_zero
from cam_rig.studies.fit_cam.files import CamFiles, arcs_cam, require_told, spline_cam
from cam_rig.studies.fit_cam.gauge import Readings, gap_note, put_in_order
from cam_rig.studies.fit_cam.gauge_table import (
    GaugeColumn,
    GaugeTable,
    Shaft,
    TableOptions,
    read_gauge_table,
)
from cam_rig.studies.fit_cam.spline_fit import SplineFit, fit_spline
from cam_rig.studies.fit_cam.valve_events import CHECKING_HEIGHTS, ValveTrain

#: Types of followers in order of preference, for the cam file of readings of several followers.
FOLLOWERS: tuple[FollowerKind, ...] = ("roller", "point", "flat")


@dataclass(frozen=True)
class FitRequest:
    """Options of a fit.

    If `take_first` is True, a spline is fitted to the first of several columns of lifts, and a note
    reports it. Otherwise several columns raise ConfigError.
    """

    shape: Literal["spline", "arcs"] = "spline"
    followers: tuple[FollowerKind, ...] = ()
    table: TableOptions = field(default_factory=TableOptions)
    tolerance: float | None = None
    reverse: bool = False
    mirror: bool = False
    roller_radius: float | None = None
    base_radius: float | None = None
    flank: Flank = None
    valve_train: ValveTrain = field(default_factory=ValveTrain)
    take_first: bool = False

    def run(self, files: list[Path]) -> SplineFit | ArcsFit:
        """Return the fit of the readings in the files."""
        arcs = self.shape == "arcs"
        self._require_apart(len(files))
        tables = [read_gauge_table(path, self.table) for path in files]
        taken = [(table, one) for table in tables for one in self._columns(table)]
        for table, column in taken:
            self._require_lifts(table, column)
        readings = [
            put_in_order(table, column, self.reverse, self.mirror) for table, column in taken
        ]
        notes = [f"{table.file}: {note}" for table in tables for note in table.notes]
        if len(readings) < len(tables[0].columns):
            others = ", ".join(repr(column.name) for column in tables[0].columns[1:])
            notes.append(f"{tables[0].file}: first column of lifts taken, not {others}: --column")
        for one in readings:
            notes += [f"{one.name}: {note}" for note in (*one.notes, *gap_note(one, arcs))]
        request = self._with_stated_base_radius(tables)
        is_radius = request.base_radius is None and taken[0][1].is_radius
        if arcs:
            if is_radius:
                request = replace(request, base_radius=above_zero(readings[0]).zero)
            return replace(request._arcs(readings), notes=tuple(notes))
        found = fit_spline(readings[0], self.tolerance)
        radius = found.zero if is_radius else request.base_radius
        if is_radius:
            notes.append(f"base radius {found.zero * 1e3:.6g} mm, the least of the radii")
        return replace(found, notes=tuple(notes), base_radius=radius, valve_train=self.valve_train)

    def files(self, found: SplineFit | ArcsFit, name: str) -> CamFiles:
        """Return the files of a fitted cam.

        Without a given follower, the type is the first of `FOLLOWERS` that a fit of arcs has, or a
        roller for a spline.
        """
        kind = self.followers[0] if len(self.followers) == 1 else None
        if isinstance(found, ArcsFit):
            require_told(found, named=bool(self.followers))
            there = [column.kind for column in found.fitted_columns]
            likely = next(one for one in FOLLOWERS if one in there)
            return arcs_cam(name, found, kind or likely)
        return spline_cam(name, found, kind or "roller", found.base_radius, self.roller_radius)

    def _with_stated_base_radius(self, tables: list[GaugeTable]) -> FitRequest:
        """Return the request with the base radius that a table states.

        The request is unchanged if it has a base radius, or if no table states one.
        """
        stated = [table.base_radius for table in tables if table.base_radius is not None]
        if self.base_radius is not None or not stated:
            return self
        return replace(self, base_radius=stated[0])

    def _require_lifts(self, table: GaugeTable, column: GaugeColumn) -> None:
        """Raise ConfigError for radii of a follower other than a point follower.

        The lift of a point follower is the radius minus the base radius.
        """
        if column.is_radius and self.followers != ("point",):
            raise ConfigError(
                f"{table.file}: {column.name!r} is a radius, which is a lift for a point follower "
                "only; allowed: --follower point, or cam-rig profile CAM --from for the contour "
                "of a roller or a flat follower"
            )

    def _require_apart(self, files: int) -> None:
        """Raise ConfigError for arguments that apply only to the other shape."""
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
        return table.columns[:1] if self.take_first else (table.only_column(),)

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
        """Return the name of the given radii: ``base``, ``roller`` or ``both``, or None.

        Without a roller, a given base radius counts as both.
        """
        if self.base_radius is None:
            return None if self.roller_radius is None else "roller"
        return "base" if self.roller_radius is None and roller else "both"

    def _kinds(self, columns: int) -> tuple[bool | None, ...]:
        """Return for each column True if its follower is flat.

        The entries are None if the fit determines the types.
        """
        if len(self.followers) == columns:
            return tuple(one == "flat" for one in self.followers)
        if len(self.followers) > 1:
            raise ConfigError(
                f"--follower: stands {len(self.followers)} times; allowed: once, or once for each "
                f"of {columns} columns of lifts"
            )
        return (None,) * columns


class FitOptions(TypedDict, total=False):
    """Options of `fit_cam` except the shape, which selects the class of the result."""

    follower: FollowerKind | Sequence[FollowerKind] | None
    column: str | None
    angle_column: str | None
    angle: Shaft | None
    counts: float | None
    tolerance: float | None
    reverse: bool
    mirror: bool
    roller_radius: float | None
    base_radius: float | None
    flank: Flank
    rocker_ratio: float
    lash: float
    checking_height: float | Sequence[float]
    out: str | Path | None


Files = str | Path | Sequence[str | Path]


@overload
def fit_cam(
    tables: Files, *, shape: Literal["spline"] = ..., **how: Unpack[FitOptions]
) -> SplineFit: ...
@overload
def fit_cam(tables: Files, *, shape: Literal["arcs"], **how: Unpack[FitOptions]) -> ArcsFit: ...
@check_arguments
def fit_cam(
    tables: str | Path | Sequence[str | Path],
    *,
    shape: Literal["spline", "arcs"] = "spline",
    follower: FollowerKind | Sequence[FollowerKind] | None = None,
    column: str | None = None,
    angle_column: str | None = None,
    angle: Shaft | None = None,
    counts: float | None = None,
    tolerance: float | None = None,
    reverse: bool = False,
    mirror: bool = False,
    roller_radius: float | None = None,
    base_radius: float | None = None,
    flank: Flank = None,
    rocker_ratio: float = 1.0,
    lash: float = 0.0,
    checking_height: float | Sequence[float] = CHECKING_HEIGHTS,
    out: str | Path | None = None,
) -> SplineFit | ArcsFit:
    r"""Fit a spline with exact dwells, or tangent arcs, to gauge readings.

    The command is ``cam-rig fit cam``.

    Parameters
    ----------
    tables : file of cam angles and readings, or several files for arcs
    shape : ``spline`` or ``arcs``
    follower : ``roller``, ``flat`` or ``point``, or for arcs a list with the type of each column
        (default: a roller for a spline, the type that fits for arcs)
    column, angle_column : headings of the columns of lifts and of angles (default: recognised by
        their words)
    angle : ``cam`` or ``crank``, the shaft whose angle is read (default: from the heading,
        otherwise cam)
    counts : counts of an encoder per turn of that shaft, for a column of counts
    tolerance : error of the gauge, m (default: the scatter of the readings)
    reverse : True if the cam was turned in the opposite sense
    mirror : True if the table contains half a lobe, with its nose at one end
    roller_radius, base_radius : radii in m (default: assumed, or identified from the readings)
    flank : ``straight`` or ``curved``, for arcs whose flank is known
    rocker_ratio : lift of the valve per lift of the cam, for the valve events
    lash : clearance of the valve, m
    checking_height : lift of the valve in m, or several, at which opening and closing are reported
    out : new .yaml file for `load_cam`. ``assumed`` of the result lists the assumptions that no
        reading supports

    Returns
    -------
    SplineFit of a spline, or ArcsFit of arcs.

    Raises
    ------
    ConfigError : a table that cannot be read, or arguments that cannot be combined
    LawError : no law fits the readings
    OutputError : ``out`` exists already, or cannot be written

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
    lengths = {"roller_radius": roller_radius, "lash": lash}
    for name, length in lengths.items():
        if length is not None and length < 0.0:
            raise ConfigError(f"{name}: is {length:g} m; allowed: at least 0 m")
    positive = {"counts": counts, "rocker_ratio": rocker_ratio, "base_radius": base_radius}
    heights = (checking_height,) if isinstance(checking_height, float | int) else checking_height
    positive["checking_height"] = min(heights, default=1.0)
    for name, value in positive.items():
        if value is not None and not 0.0 < value < math.inf:
            raise ConfigError(f"{name}: is {value:g}; allowed: above 0")
    request = FitRequest(
        shape=shape,
        followers=kinds,
        table=TableOptions(column, angle_column, angle, counts),
        tolerance=tolerance,
        reverse=reverse,
        mirror=mirror,
        roller_radius=roller_radius,
        base_radius=base_radius,
        flank=flank,
        valve_train=ValveTrain(rocker_ratio, lash, tuple(heights)),
    )
    found = request.run([Path(file) for file in files])
    if target is None:
        return found
    written = request.files(found, target.stem)
    write_new(target.parent, written.texts)
    return replace(found, assumed=written.assumed)

"""Fit of a cam to tables of gauge readings, and the files of the fitted cam."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, Protocol, TypedDict, Unpack, overload, runtime_checkable

from cam_rig.arguments import check_arguments
from cam_rig.errors import ConfigError
from cam_rig.files import new_yaml, temporary_folder, write_new
from cam_rig.studies.fit_cam.arcs.cam_file import arcs_cam, require_identifiable
from cam_rig.studies.fit_cam.arcs.contour import FollowerKind
from cam_rig.studies.fit_cam.arcs.radii import GivenRadii
from cam_rig.studies.fit_cam.arcs.result import ArcsFit, Flank
from cam_rig.studies.fit_cam.arcs.selection import fit_arcs
from cam_rig.studies.fit_cam.cam_files import CamFiles, spline_cam
from cam_rig.studies.fit_cam.dwells import subtract_zero
from cam_rig.studies.fit_cam.gauge import Readings, gap_note, order_readings
from cam_rig.studies.fit_cam.gauge_table import (
    GaugeColumn,
    GaugeTable,
    Shaft,
    TableOptions,
    read_gauge_table,
)
from cam_rig.studies.fit_cam.recognition import recognise as recognise_laws
from cam_rig.studies.fit_cam.spline_fit import SplineFit, fit_spline
from cam_rig.studies.fit_cam.valve_events import CHECKING_HEIGHTS, ValveTrain

#: Types of followers in order of preference. The cam file gets the first type for which there are
#: readings.
FOLLOWER_ORDER: tuple[FollowerKind, ...] = ("roller", "point", "flat")


@dataclass(frozen=True)
class FitRequest:
    """Options of a fit of a cam to gauge readings.

    ``shape`` is that of the fitted cam. ``followers`` are the follower types of the columns, empty
    if not given. ``tolerance`` (m) is the error of the gauge. ``reverse`` and ``mirror`` are True
    for a cam turned in the opposite sense and for a table with half a lobe. The radii are in m.
    ``flank`` is the shape of the flanks of arcs, if known. If `take_first` is True, a spline is
    fitted to the first of several columns of lifts, and a note reports it. Otherwise several
    columns raise ConfigError.
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
    recognise: bool = False

    def __post_init__(self) -> None:
        """Raise ConfigError if a numeric option is out of range."""
        train = self.valve_train
        for name, length in {"roller_radius": self.roller_radius, "lash": train.lash}.items():
            if length is not None and length < 0.0:
                raise ConfigError(f"{name}: is {length:g} m; allowed: at least 0 m")
        positive = {
            "counts": self.table.counts,
            "rocker_ratio": train.rocker_ratio,
            "base_radius": self.base_radius,
            "checking_height": min(train.checking_heights, default=1.0),
        }
        for name, value in positive.items():
            if value is not None and not 0.0 < value < math.inf:
                raise ConfigError(f"{name}: is {value:g}; allowed: above 0")

    def run(self, files: list[Path]) -> SplineFit | ArcsFit:
        """Read the files of gauge readings, and return the fit to them."""
        self._require_compatible(len(files))
        tables = [read_gauge_table(path, self.table) for path in files]
        selected = [(table, column) for table in tables for column in self._select_columns(table)]
        readings = [
            order_readings(table, column, self.reverse, self.mirror) for table, column in selected
        ]
        notes = self._notes(tables, readings)
        base_radius, base_notes = _option_or_table_length(tables, "base radius", self.base_radius)
        roller_radius, roller_notes = _option_or_table_length(
            tables,
            "roller radius",
            self.roller_radius,
            not self.followers or "roller" in self.followers,
        )
        notes += [*base_notes, *roller_notes]
        is_radius = base_radius is None and selected[0][1].is_radius
        if self.shape == "arcs":
            arcs = self._fit_arcs(readings, base_radius, roller_radius, is_radius)
            return replace(arcs, notes=tuple(notes))
        spline = fit_spline(readings[0], self.tolerance)
        if self.recognise:
            laws = recognise_laws(spline.readings, spline.dwells, spline.scatter)
            spline = replace(spline, recognised=laws)
        if is_radius:
            base_radius = spline.zero
            notes.append(f"base radius {base_radius * 1e3:.6g} mm, the smallest of the radii")
        return replace(
            spline,
            notes=tuple(notes),
            base_radius=base_radius,
            roller_radius=roller_radius,
            valve_train=self.valve_train,
        )

    def files(self, fit: SplineFit | ArcsFit, name: str) -> CamFiles:
        """Return the files of a fitted cam called ``name``.

        The follower type is the requested one. If no type or several types were requested, it is a
        roller for a spline, and for arcs the first of `FOLLOWER_ORDER` among the fitted columns.
        """
        kind = self.followers[0] if len(self.followers) == 1 else None
        if isinstance(fit, ArcsFit):
            require_identifiable(fit, is_kind_given=bool(self.followers))
            fitted = [column.kind for column in fit.fitted_columns]
            first = next(follower for follower in FOLLOWER_ORDER if follower in fitted)
            return arcs_cam(name, fit, kind or first)
        return spline_cam(name, fit, kind or "roller", fit.base_radius, fit.roller_radius)

    def _require_compatible(self, file_count: int) -> None:
        """Raise ConfigError for options that the requested shape does not support.

        ``file_count`` is the number of files.
        """
        if self.shape == "arcs":
            if self.tolerance is not None:
                raise ConfigError("--tolerance cannot be combined with --shape arcs")
            if self.recognise:
                raise ConfigError("--recognise cannot be combined with --shape arcs")
            return
        if file_count > 1:
            raise ConfigError(
                f"{file_count} files; allowed: one for a spline, several with --shape arcs"
            )
        if self.flank is not None:
            raise ConfigError("--flank requires --shape arcs")
        if len(self.followers) > 1:
            raise ConfigError(
                f"--follower: is given {len(self.followers)} times; allowed: once, because a "
                "spline is fitted to one column"
            )

    def _select_columns(self, table: GaugeTable) -> tuple[GaugeColumn, ...]:
        """Return the columns of a table to fit: all for arcs, and one for a spline.

        Raises ConfigError for several columns if a spline is fitted. Raises it too for radii,
        unless the follower is a point. The lift of a point follower is the radius minus the base
        radius.
        """
        columns = table.columns
        if self.shape == "spline" and len(columns) > 1 and not self.take_first:
            names = ", ".join(repr(column.name) for column in columns)
            raise ConfigError(
                f"{table.file}: has {len(columns)} columns of lifts; allowed: one, so name it "
                f"with --column ({names}), or take all with --shape arcs"
            )
        columns = columns if self.shape == "arcs" else columns[:1]
        for column in columns:
            if column.is_radius and self.followers != ("point",):
                raise ConfigError(
                    f"{table.file}: {column.name!r} is a radius, which is a lift for a point "
                    "follower only; allowed: --follower point, or cam-rig profile CAM --from for "
                    "the contour of a roller or a flat follower"
                )
        return columns

    def _notes(self, tables: list[GaugeTable], readings: list[Readings]) -> list[str]:
        """Return the notes on the interpretation of the tables and of their readings."""
        first = tables[0]
        notes = [f"{table.file}: {note}" for table in tables for note in table.notes]
        if len(readings) < len(first.columns):
            others = ", ".join(repr(column.name) for column in first.columns[1:])
            notes.append(f"{first.file}: first column of lifts taken, not {others}: --column")
        for column in readings:
            gap = gap_note(column, arcs=self.shape == "arcs")
            notes += [f"{column.name}: {note}" for note in (*column.notes, *gap)]
        return notes

    def _fit_arcs(
        self,
        readings: list[Readings],
        base_radius: float | None,
        roller_radius: float | None,
        is_radius: bool,
    ) -> ArcsFit:
        """Fit tangent arcs to the readings of all columns.

        The radii are in m, or None if not given. Unknown radii get usual start values.
        ``is_radius`` is True if the readings are radii of the contour. Their zero is then the base
        radius.
        """
        columns = tuple(subtract_zero(column) for column in readings)
        if is_radius:
            base_radius = columns[0].zero
        lift = max(float(column.lifts.max()) for column in columns)
        roller = 0.5 * lift if roller_radius is None else roller_radius
        if "point" in self.followers:
            roller = 0.0
        given: GivenRadii = None if roller_radius is None else "roller"
        # If only the base radius is given, the roller radius follows from the sum of both. A point
        # follower has no roller.
        if base_radius is not None:
            given = "base" if roller_radius is None and roller else "both"
        base = 3.0 * lift if base_radius is None else base_radius
        return fit_arcs(columns, self._flats(len(columns)), roller, base, given, self.flank)

    def _flats(self, column_count: int) -> tuple[bool | None, ...]:
        """Return for each column True if its follower is flat, or None if it is unknown.

        The fit determines an unknown type. Raises ConfigError if the number of requested follower
        types does not match the number of columns.
        """
        if len(self.followers) == column_count:
            return tuple(follower == "flat" for follower in self.followers)
        if len(self.followers) > 1:
            raise ConfigError(
                f"--follower: is given {len(self.followers)} times; allowed: once, or once for "
                f"each of {column_count} columns of lifts"
            )
        return (None,) * column_count


def _option_or_table_length(
    tables: list[GaugeTable], name: str, given: float | None, is_used: bool = True
) -> tuple[float | None, list[str]]:
    """Return a length (m) from an option or else from a table, and notes.

    ``name`` is the length in `GaugeTable.stated`, ``given`` the value of the option or None.
    Without an option, the first table that states the length determines it, unless ``is_used`` is
    False. The notes report the source, and the statements that are not used.
    """
    stated = [(table.file, *table.stated[name]) for table in tables if name in table.stated]
    if given is None and is_used and stated:
        file, length, note = stated[0]
        return length, [f"{file}: {note}"]
    reason = "another is given" if given is not None else "the follower is no roller"
    return given, [f"{file}: {note}, not used: {reason}" for file, _, note in stated]


class FitOptions(TypedDict, total=False):
    """Keyword options of `fit_cam` except ``shape``, for its overloaded signatures.

    The shape selects the type of the result.
    """

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
    recognise: bool
    out: str | Path | None


@runtime_checkable
class DataFrame(Protocol):
    """Data frame of pandas, or another class with its method `to_csv`."""

    def to_csv(self, path: Path, *, index: bool) -> object:
        """Write the columns with their headings as CSV."""


Files = str | Path | DataFrame | Sequence[str | Path]
#: Name of the table of a data frame in notes and messages.
FRAME_FILE = "data_frame.csv"


@overload
def fit_cam(
    tables: Files, *, shape: Literal["spline"] = ..., **how: Unpack[FitOptions]
) -> SplineFit: ...
@overload
def fit_cam(tables: Files, *, shape: Literal["arcs"], **how: Unpack[FitOptions]) -> ArcsFit: ...
@check_arguments
def fit_cam(
    tables: Files,
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
    recognise: bool = False,
    out: str | Path | None = None,
) -> SplineFit | ArcsFit:
    r"""Fit a spline with exact dwells, or tangent arcs, to gauge readings.

    The command is ``cam-rig fit cam``.

    Parameters
    ----------
    tables : str, Path, DataFrame or sequence of str or Path
        File of cam angles and readings, or a data frame of pandas with the same headings, or
        several files for arcs.
    shape : {'spline', 'arcs'}, optional
        Shape of the cam (default: spline).
    follower : {'roller', 'flat', 'point'} or sequence of them, optional
        Type of the follower, or for arcs a list with the type of each column (default: a roller for
        a spline, the type that fits for arcs).
    column, angle_column : str, optional
        Headings of the columns of lifts and of angles (default: recognised by their words).
    angle : {'cam', 'crank'}, optional
        Shaft whose angle is read (default: from the heading, otherwise cam).
    counts : float, optional
        Counts of an encoder per turn of that shaft, for a column of counts.
    tolerance : float, optional
        Error of the gauge, m (default: the scatter of the readings).
    reverse : bool, optional
        True if the cam was turned in the opposite sense (default: False).
    mirror : bool, optional
        True if the table contains half a lobe, with its nose at one end (default: False).
    roller_radius, base_radius : float, optional
        Radii in m (default: assumed, or identified from the readings).
    flank : {'straight', 'curved'}, optional
        Shape of the flanks, for arcs whose flank is known.
    rocker_ratio : float, optional
        Lift of the valve per lift of the cam, for the valve events (default: 1).
    lash : float, optional
        Clearance of the valve, m (default: 0).
    checking_height : float or sequence of float, optional
        Lift of the valve in m, or several, at which opening and closing are reported
        (default: 1 mm and 0.05 in).
    recognise : bool, optional
        True to list the named laws that explain the events between dwells (default: False).
    out : str or Path, optional
        New .yaml file for `load_cam`. ``assumed`` of the result lists the assumptions that no
        reading supports.

    Returns
    -------
    SplineFit or ArcsFit
        Fit of a spline, or of arcs.

    Raises
    ------
    ConfigError
        If a table cannot be read, or arguments cannot be combined.
    LawError
        If no law fits the readings.
    OutputError
        If ``out`` exists already, or cannot be written.

    Examples
    --------
    >>> import tempfile, cam_rig
    >>> table = "angle [deg],lift [mm]\n" + "".join(f"{5 * i},{i % 36}\n" for i in range(72))
    >>> with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
    ...     _ = file.write(table), file.flush()
    ...     fit = cam_rig.fit_cam(file.name, tolerance=1e-3)
    >>> round(fit.smoothed.rms, 6)  # m
    0.001
    """
    target = new_yaml(out)
    if not isinstance(tables, DataFrame) and not tables:
        raise ConfigError("tables: is an empty list; allowed: a file, or several for arcs")
    kinds = (follower,) if isinstance(follower, str) else tuple(follower or ())
    heights = (checking_height,) if isinstance(checking_height, float | int) else checking_height
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
        recognise=recognise,
    )
    if isinstance(tables, DataFrame):
        with temporary_folder("cam_rig-fit-") as folder:
            tables.to_csv(folder / FRAME_FILE, index=False)
            fit = request.run([folder / FRAME_FILE])
    else:
        files = [tables] if isinstance(tables, str | Path) else tables
        fit = request.run([Path(file) for file in files])
    if target is None:
        return fit
    written = request.files(fit, target.stem)
    write_new(target.parent, written.texts)
    return replace(fit, assumed=written.assumed)

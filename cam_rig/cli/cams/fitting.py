"""What ``cam-rig fit cam`` and ``cam-rig new`` share: readings to a fit, a fit to files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cam_rig.cli.common.console import say, show

if TYPE_CHECKING:
    from cam_rig.schema.bench_tables.gauge_table import GaugeColumn, GaugeTable
    from cam_rig.studies.cam_fit.arcs_fit import ArcsFit
    from cam_rig.studies.cam_fit.cam_file import CamFiles, FollowerKind, Known
    from cam_rig.studies.cam_fit.readings import Readings
    from cam_rig.studies.cam_fit.spline_fit import SplineFit
    from cam_rig.tables import DataTable


class Shape(Enum):
    """What is laid through the readings."""

    spline = "spline"
    arcs = "arcs"


class OwnFollower(Enum):
    """Kind of follower that was read."""

    roller = "roller"
    flat = "flat"
    point = "point"


ShapeOption = Annotated[
    Shape,
    typer.Option(help="A smooth spline with exact dwells, or one contour of tangent arcs."),
]
FollowerOption = Annotated[
    OwnFollower | None,
    typer.Option(
        help="Follower of the readings and of the cam's file; by default a roller, and with arcs "
        "the kind of each column is found."
    ),
]
ColumnOption = Annotated[
    str | None, typer.Option(help="Heading of the column of lifts, where there are several.")
]
ToleranceOption = Annotated[
    float | None,
    typer.Option(metavar="MM", help="Error of the gauge; by default the scatter of the readings."),
]
ReverseOption = Annotated[
    bool, typer.Option("--reverse", help="The cam was turned the other way: take -angle.")
]
RollerOption = Annotated[
    float | None, typer.Option(metavar="MM", min=0.0, help="Roller radius; by default assumed.")
]
BaseOption = Annotated[
    float | None, typer.Option(metavar="MM", min=0.0, help="Base radius; by default assumed.")
]


@dataclass(frozen=True)
class FitRequest:
    """What is asked of a fit; lengths in mm.

    ``ask_nothing`` takes the first column for a spline where there are several, and says so.
    """

    shape: Shape = Shape.spline
    follower: OwnFollower | None = None
    column: str | None = None
    tolerance: float | None = None
    reverse: bool = False
    roller_radius: float | None = None
    base_radius: float | None = None
    ask_nothing: bool = False

    def run(self, files: list[Path]) -> FitResult:
        """Read the files and fit.

        Raises
        ------
        ConfigError : a file cannot be read, or its readings are none of a cam
        LawError : nothing of the shape comes near them
        """
        from cam_rig.errors import ConfigError
        from cam_rig.schema.bench_tables.gauge_table import read_gauge_table
        from cam_rig.studies.cam_fit.readings import gap_note, put_in_order
        from cam_rig.studies.cam_fit.spline_fit import fit_spline

        tables = [read_gauge_table(path) for path in files]
        if self.shape is Shape.spline:
            if len(tables) > 1:
                raise ConfigError(
                    f"{len(tables)} files; allowed: one for a spline, several with --shape arcs"
                )
            readings = [put_in_order(tables[0], self._column(tables[0]), self.reverse)]
        else:
            readings = [
                put_in_order(table, column, self.reverse)
                for table in tables
                for column in ([table.column(self.column)] if self.column else table.columns)
            ]
        notes = [f"{table.file}: {note}" for table in tables for note in table.notes]
        if self.shape is Shape.spline and self.column is None and len(tables[0].columns) > 1:
            others = ", ".join(repr(column.name) for column in tables[0].columns[1:])
            notes.append(f"{tables[0].file}: first column of lifts taken, not {others}: --column")
        notes += [
            f"{one.name}: {note}" for one in readings for note in (*one.notes, *gap_note(one))
        ]
        if self.shape is Shape.spline:
            asked = None if self.tolerance is None else 1e-3 * self.tolerance
            return FitResult(self, tuple(notes), fit_spline(readings[0], asked))
        return FitResult(self, tuple(notes), self._arcs(readings))

    def _column(self, table: GaugeTable) -> GaugeColumn:
        first = self.ask_nothing and self.column is None
        return table.columns[0] if first else table.column(self.column)

    def _arcs(self, readings: list[Readings]) -> ArcsFit:
        from cam_rig.errors import ConfigError
        from cam_rig.studies.cam_fit.arcs_fit import fit_arcs
        from cam_rig.studies.cam_fit.zero import above_zero

        if self.tolerance is not None:
            raise ConfigError("--tolerance: is for --shape spline; allowed with arcs: none")
        columns = tuple(above_zero(one) for one in readings)
        lift = max(float(one.lifts.max()) for one in columns)
        roller = 0.5 * lift if self.roller_radius is None else 1e-3 * self.roller_radius
        if self.follower is OwnFollower.point:
            roller = 0.0
        base = 3.0 * lift if self.base_radius is None else 1e-3 * self.base_radius
        named = self.follower is not None and len(columns) == 1
        kinds = (self.follower is OwnFollower.flat if named else None,) * len(columns)
        found = fit_arcs(columns, kinds, roller, base)
        if self.base_radius is None or all(column.kind == "flat" for column in found.columns):
            return found
        return self._with_base(found, columns)

    def _with_base(self, found: ArcsFit, columns: tuple[Readings, ...]) -> ArcsFit:
        """The fit again with the roller that leaves the base radius asked for."""
        from cam_rig.errors import ConfigError
        from cam_rig.studies.cam_fit.arcs_fit import fit_arcs

        base, prime = 1e-3 * (self.base_radius or 0.0), found.numbers[0]
        if self.roller_radius is not None or not found.roller_radius:
            raise ConfigError(
                f"--base-radius: is {base * 1e3:g} mm; allowed without --roller-radius and under a "
                f"roller, for the readings tell their sum, {prime * 1e3:.4g} mm"
            )
        if not 0.0 < base < prime:
            raise ConfigError(
                f"--base-radius: is {base * 1e3:g} mm; allowed: below base and roller radius "
                f"together, {prime * 1e3:.4g} mm"
            )
        kinds = tuple(column.kind == "flat" for column in found.columns)
        return fit_arcs(columns, kinds, prime - base, base)


@dataclass(frozen=True)
class FitResult:
    """A fit with what was asked of it and how its files were read."""

    request: FitRequest
    notes: tuple[str, ...]
    fit: SplineFit | ArcsFit

    @property
    def kind(self) -> OwnFollower:
        """Follower of the cam's file: as asked, else the roller if there is one among them."""
        from cam_rig.studies.cam_fit.arcs_fit import ArcsFit

        if self.request.follower is not None:
            return self.request.follower
        if isinstance(self.fit, ArcsFit) and all(one.kind == "flat" for one in self.fit.columns):
            return OwnFollower.flat
        return OwnFollower.roller

    def tables(self) -> list[DataTable]:
        """What was found."""
        from cam_rig.studies.cam_fit import tables
        from cam_rig.studies.cam_fit.arcs_fit import ArcsFit

        found = self.fit
        return (
            tables.arcs_tables(found) if isinstance(found, ArcsFit) else tables.spline_tables(found)
        )

    def to_json(self) -> dict[str, Any]:
        """What was found, as plain data."""
        from cam_rig.studies.cam_fit import tables
        from cam_rig.studies.cam_fit.arcs_fit import ArcsFit

        found = self.fit
        data = tables.arcs_json(found) if isinstance(found, ArcsFit) else tables.spline_json(found)
        return {**data, "notes": list(self.notes), "conclusions": list(self._conclusions())}

    def tell(self) -> None:
        """Print how the files were read, the tables, and the conclusions."""
        say(*self.notes)
        show(*self.tables())
        say(*self._conclusions())

    def files(self, name: str) -> CamFiles:
        """The fit as a cam of the rig.

        Raises
        ------
        ConfigError : the name is not one of a cam
        LawError : the follower asked for cannot stay on the contour
        """
        from cam_rig.studies.cam_fit.arcs_fit import ArcsFit
        from cam_rig.studies.cam_fit.cam_file import arcs_cam, spline_cam

        kind: FollowerKind = self.kind.value
        if isinstance(self.fit, ArcsFit):
            known: Known = None if self.request.roller_radius is None else "roller"
            known = known if self.request.base_radius is None else "base"
            return arcs_cam(name, self.fit, kind, known, self.notes)
        base = self.request.base_radius
        base, roller = (
            None if one is None else 1e-3 * one for one in (base, self.request.roller_radius)
        )
        return spline_cam(name, self.fit, kind, base, roller, self.notes)

    def _conclusions(self) -> Iterator[str]:
        from cam_rig.studies.cam_fit import conclusions
        from cam_rig.studies.cam_fit.arcs_fit import ArcsFit

        if isinstance(self.fit, ArcsFit):
            return conclusions.arcs_conclusions(self.fit)
        return conclusions.spline_conclusions(self.fit)


def write_new(folder: Path, texts: dict[str, str]) -> None:
    """Write files into a folder, none over another.

    Raises
    ------
    OutputError : one is there already, or cannot be written
    """
    from cam_rig.cli.common.outputs import writing

    for name in texts:
        require_new(folder / name)
    for name, text in texts.items():
        with writing(folder / name) as part:
            part.write_text(text, encoding="utf-8")


def require_new(target: Path) -> None:
    """Refuse a file that is there already, or a place that cannot be written.

    Raises
    ------
    OutputError : with what to do
    """
    from cam_rig.cli.common.outputs import check_place
    from cam_rig.errors import OutputError

    if target.exists():
        raise OutputError(f"{target}: exists already, not overwriting; name another or move it")
    check_place(target)


def say_assumed(assumed: Iterable[str]) -> None:
    """Print what no reading tells."""
    say(*(f"assumed: {words}" for words in assumed))

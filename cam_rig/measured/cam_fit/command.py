"""What ``cam-rig fit cam`` and ``cam-rig new`` share: readings to a fit, a fit to files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cam_rig.measured.options import (
    BaseOption,
    ColumnOption,
    FlankOption,
    FollowerOption,
    OwnFlank,
    OwnFollower,
    ReverseOption,
    RollerOption,
    Shape,
    ShapeOption,
    ToleranceOption,
)
from cam_rig.show.command import (
    Rig,
    say_assumed,
    user_errors,
    write_new,
)
from cam_rig.show.terminal import say, show

if TYPE_CHECKING:
    from cam_rig.measured.cam_fit.arcs_fit import ArcsFit, Flank, Known
    from cam_rig.measured.cam_fit.files import CamFiles, FollowerKind
    from cam_rig.measured.cam_fit.gauge import GaugeColumn, GaugeTable, Readings
    from cam_rig.measured.cam_fit.spline_fit import SplineFit
    from cam_rig.show.tables import DataTable


@dataclass(frozen=True)
class FitRequest:
    """What is asked of a fit; lengths in mm.

    ``ask_nothing`` takes the first column for a spline where there are several, and says so.
    """

    shape: Shape = Shape.spline
    followers: tuple[OwnFollower, ...] = ()
    column: str | None = None
    tolerance: float | None = None
    reverse: bool = False
    roller_radius: float | None = None
    base_radius: float | None = None
    flank: OwnFlank | None = None
    ask_nothing: bool = False

    def run(self, files: list[Path]) -> FitResult:
        """Read the files and fit.

        Raises
        ------
        ConfigError : a file cannot be read, or its readings are none of a cam
        LawError : nothing of the shape comes near them
        """
        from cam_rig.measured.cam_fit.gauge import gap_note, put_in_order, read_gauge_table
        from cam_rig.measured.cam_fit.spline_fit import fit_spline

        arcs = self.shape is Shape.arcs
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
            return FitResult(self, tuple(notes), self._arcs(readings))
        asked = None if self.tolerance is None else 1e-3 * self.tolerance
        return FitResult(self, tuple(notes), fit_spline(readings[0], asked))

    def _require_apart(self, files: int) -> None:
        """Refuse options that are of the other shape, rather than pass one over."""
        from cam_rig.errors import ConfigError

        if self.shape is Shape.arcs:
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
        if self.shape is Shape.arcs:
            return table.columns
        return table.columns[:1] if self.ask_nothing else (table.only_column(),)

    def _arcs(self, readings: list[Readings]) -> ArcsFit:
        from cam_rig.errors import ConfigError
        from cam_rig.measured.cam_fit.arcs_fit import fit_arcs
        from cam_rig.measured.cam_fit.dwells import above_zero

        columns = tuple(above_zero(one) for one in readings)
        lift = max(float(one.lifts.max()) for one in columns)
        roller = 0.5 * lift if self.roller_radius is None else 1e-3 * self.roller_radius
        if OwnFollower.point in self.followers:
            roller = 0.0
        base = 3.0 * lift if self.base_radius is None else 1e-3 * self.base_radius
        known, flank = self._known(roller), self._flank()
        found = fit_arcs(columns, self._kinds(len(columns)), roller, base, known, flank)
        if known != "base" or found.only_flat:
            return found
        prime = found.numbers[0]
        if base >= prime:
            raise ConfigError(
                f"--base-radius: is {base * 1e3:g} mm; allowed: below base and roller radius "
                f"together, {prime * 1e3:.4g} mm, or with --roller-radius"
            )
        kinds = tuple(column.kind == "flat" for column in found.columns)
        return fit_arcs(columns, kinds, prime - base, base, known, flank)

    def _flank(self) -> Flank:
        return None if self.flank is None else self.flank.value

    def _known(self, roller: float) -> Known:
        """Which radii are given; without a roller the base's is all."""
        if self.base_radius is None:
            return None if self.roller_radius is None else "roller"
        return "base" if self.roller_radius is None and roller else "both"

    def _kinds(self, columns: int) -> tuple[bool | None, ...]:
        """Of each column whether its follower is flat, None where that is to be found."""
        from cam_rig.errors import ConfigError

        if len(self.followers) == columns:
            return tuple(one is OwnFollower.flat for one in self.followers)
        if len(self.followers) > 1:
            raise ConfigError(
                f"--follower: stands {len(self.followers)} times; allowed: once, or once for each "
                f"of {columns} columns of lifts"
            )
        return (None,) * columns


@dataclass(frozen=True)
class FitResult:
    """A fit with what was asked of it and how its files were read."""

    request: FitRequest
    notes: tuple[str, ...]
    fit: SplineFit | ArcsFit

    @property
    def kind(self) -> OwnFollower:
        """Follower of the cam's file: as asked, else the roller if there is one among them."""
        from cam_rig.measured.cam_fit.arcs_fit import ArcsFit

        if len(self.request.followers) == 1:
            return self.request.followers[0]
        if isinstance(self.fit, ArcsFit):
            kinds = {column.kind for column in self.fit.columns}
            return OwnFollower(min(kinds, key=("roller", "point", "flat").index))
        return OwnFollower.roller

    def tables(self) -> list[DataTable]:
        """What was found."""
        from cam_rig.measured.cam_fit.arcs_fit import ArcsFit
        from cam_rig.measured.cam_fit.arcs_tables import arcs_tables
        from cam_rig.measured.cam_fit.tables import spline_tables

        found = self.fit
        return arcs_tables(found) if isinstance(found, ArcsFit) else spline_tables(found)

    def to_json(self) -> dict[str, Any]:
        """What was found, as plain data."""
        from cam_rig.measured.cam_fit.arcs_fit import ArcsFit
        from cam_rig.measured.cam_fit.arcs_tables import arcs_json
        from cam_rig.measured.cam_fit.tables import spline_json

        found = self.fit
        data = arcs_json(found) if isinstance(found, ArcsFit) else spline_json(found)
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
        from cam_rig.measured.cam_fit.arcs_file import arcs_cam
        from cam_rig.measured.cam_fit.arcs_fit import ArcsFit
        from cam_rig.measured.cam_fit.files import spline_cam
        from cam_rig.measured.cam_fit.tables import require_told

        kind: FollowerKind = self.kind.value
        if isinstance(self.fit, ArcsFit):
            require_told(self.fit, named=bool(self.request.followers))
            return arcs_cam(name, self.fit, kind, self.notes)
        base = self.request.base_radius
        base, roller = (
            None if one is None else 1e-3 * one for one in (base, self.request.roller_radius)
        )
        return spline_cam(name, self.fit, kind, base, roller, self.notes)

    def _conclusions(self) -> Iterator[str]:
        from cam_rig.measured.cam_fit import tables as conclusions
        from cam_rig.measured.cam_fit.arcs_fit import ArcsFit

        if isinstance(self.fit, ArcsFit):
            return conclusions.arcs_conclusions(self.fit)
        return conclusions.spline_conclusions(self.fit)


# cam-rig new: a cam of one's own with a rig and a scene that run as they are.


def new(
    name: Annotated[str, typer.Argument(help="Name of the cam, its rig and its scene.")],
    from_csv: Annotated[
        list[Path],
        typer.Option("--from-csv", help="Table of cam angles and readings; several for arcs."),
    ],
    folder: Annotated[
        Path | None, typer.Option(help="Where cams/, rigs/ and scenes/ go; by default NAME.")
    ] = None,
    shape: ShapeOption = Shape.spline,
    follower: FollowerOption = None,
    column: ColumnOption = None,
    tolerance: ToleranceOption = None,
    reverse: ReverseOption = False,
    roller_radius: RollerOption = None,
    base_radius: BaseOption = None,
    flank: FlankOption = None,
    rig: Rig = "tm21",
) -> None:
    """Write cam, rig and scene files from a table of lifts; they run as they are.

    The cam is fitted as by `cam-rig fit cam`. The rig has another rig's numbers, all marked as
    assumed; the scene goes from 40 to 110 % of the jump speed of a rigid follower.

    Examples
    --------
    cam-rig new mycam --from-csv lifts.csv

    cam-rig new gl110 --from-csv gl110.csv --shape arcs --folder mine
    """
    from cam_rig.schema.load import rig_path

    with user_errors():
        from cam_rig.measured.cam_fit.files import own_rig, own_scene
        from cam_rig.schema.load import load_rig

        kinds = tuple(follower or ())
        request = FitRequest(
            shape, kinds, column, tolerance, reverse, roller_radius, base_radius, flank, True
        )
        like = load_rig(rig_path(rig))
        found = request.run(from_csv)
        files = found.files(name)
        scene, speeds = own_scene(name, files.law, like)
        texts = {f"cams/{file}": text for file, text in files.texts.items()}
        texts |= {f"rigs/{name}.yaml": own_rig(name, like), f"scenes/{name}.yaml": scene}
        place = folder or Path(name)
        write_new(place, texts)
        found.tell()
        say_assumed(files.assumed)
        say_assumed(
            (
                f"rig: mass, spring, damping and sound of {like.name}, none of them measured here",
                f"speeds {', '.join(f'{speed:g}' for speed in speeds)} rpm, one turn to settle and "
                "two to measure",
            )
        )
        say(*(f"wrote {place / file}" for file in texts))
        say(f"run it: cam-rig simulate {place / 'scenes' / name}.yaml")

"""What ``cam-rig fit cam`` and ``cam-rig new`` share: readings to a fit, a fit to files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cam_rig.cli.cams.fit_options import OwnFlank, OwnFollower, Shape
from cam_rig.cli.common.console import say, show

if TYPE_CHECKING:
    from cam_rig.schema.bench_tables.gauge_table import GaugeColumn, GaugeTable
    from cam_rig.studies.cam_fit.arcs_fit import ArcsFit, Flank, Known
    from cam_rig.studies.cam_fit.cam_file import CamFiles, FollowerKind
    from cam_rig.studies.cam_fit.readings import Readings
    from cam_rig.studies.cam_fit.spline_fit import SplineFit
    from cam_rig.tables import DataTable


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
        from cam_rig.schema.bench_tables.gauge_table import read_gauge_table
        from cam_rig.studies.cam_fit.readings import gap_note, put_in_order
        from cam_rig.studies.cam_fit.spline_fit import fit_spline

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
        from cam_rig.studies.cam_fit.arcs_fit import fit_arcs
        from cam_rig.studies.cam_fit.zero import above_zero

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
        from cam_rig.studies.cam_fit.arcs_fit import ArcsFit

        if len(self.request.followers) == 1:
            return self.request.followers[0]
        if isinstance(self.fit, ArcsFit):
            kinds = {column.kind for column in self.fit.columns}
            return OwnFollower(min(kinds, key=("roller", "point", "flat").index))
        return OwnFollower.roller

    def tables(self) -> list[DataTable]:
        """What was found."""
        from cam_rig.studies.cam_fit.arcs_fit import ArcsFit
        from cam_rig.studies.cam_fit.arcs_tables import arcs_tables
        from cam_rig.studies.cam_fit.tables import spline_tables

        found = self.fit
        return arcs_tables(found) if isinstance(found, ArcsFit) else spline_tables(found)

    def to_json(self) -> dict[str, Any]:
        """What was found, as plain data."""
        from cam_rig.studies.cam_fit.arcs_fit import ArcsFit
        from cam_rig.studies.cam_fit.arcs_tables import arcs_json
        from cam_rig.studies.cam_fit.tables import spline_json

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
        from cam_rig.studies.cam_fit.arcs_file import arcs_cam
        from cam_rig.studies.cam_fit.arcs_fit import ArcsFit
        from cam_rig.studies.cam_fit.cam_file import spline_cam
        from cam_rig.studies.cam_fit.conclusions import require_told

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

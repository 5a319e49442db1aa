"""Several laws at once for cam-rig law: what the names mean, the plot, peaks, CSV."""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.extras import require
from cam_rig.show.command import (
    Csv,
    Json,
    Plot,
    check_outputs,
    check_place,
    user_errors,
    write_csv,
    write_json,
    write_plot,
)
from cam_rig.show.terminal import say, show

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from cam_rig.laws import Law
    from cam_rig.laws.catalogue import Figures, RiseFamily
    from cam_rig.show.tables import DataTable

    Row = tuple[str, str, Figures | None]
    from cam_rig.schema import CamConfig
    from cam_rig.show.tables import Cell
    from cam_rig.units import FloatArray

    Loaded = list[tuple[CamConfig, Law]]


# cam-rig law: one cam's law, or several over each other, as a plot, a table and CSV.

Save = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Write the curves as a Rerun recording (.rrd) too."),
]


def law(
    names: Annotated[
        list[str],
        typer.Argument(
            help="Cam files, names in config/cams, or names of rises as `cam-rig laws` lists them.",
        ),
    ],
    rises: Annotated[
        bool,
        typer.Option("--rises", help="Names that a cam and a rise have in common mean the rise."),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="The plot (PNG, SVG, PDF); out/law_NAMES.png if not given."
        ),
    ] = None,
    as_csv: Annotated[
        bool, typer.Option("--csv", help="CSV to stdout; no plot unless --out is given.")
    ] = False,
    save: Save = None,
) -> None:
    """Plot lift, velocity, acceleration and jerk over the cam angle; list peaks and joints.

    Peaks come from the roots of the next derivative, not from samples. Derivatives are in the
    cam angle, per rad: times the cam's speed in rad/s they are those in time.

    Several laws are laid over each other: as cams over the turn if every name is a cam's, else
    as bare rises of unit lift over a unit span.

    Examples
    --------
    cam-rig law poly345

    cam-rig law poly345 cycloidal bezier9 --out out/rises.png

    cam-rig law poly345 cycloidal bezier15 --csv > cams.csv

    cam-rig law poly345 bezier8_start --rises

    cam-rig law poly345 cycloidal bezier15 --save out/laws.rrd

    cam-rig law config/cams/worked_example_quintic.yaml --out quintic.pdf

    cam-rig law bezier15 --csv > bezier15.csv
    """
    with user_errors():
        check_outputs(None, out)
        if save is not None:
            require_recording(save)
        if are_rises(names, rises):
            show_rises(names, out, as_csv)
        elif len(names) > 1:
            show_cams(names, out, as_csv)
        else:
            _show_one(names[0], out, as_csv)
        if save is not None:
            record(names, are_rises(names, rises), save)


def _show_one(name: str, out: Path | None, as_csv: bool) -> None:
    """One cam with its extremes, joints and segments."""
    from cam_rig.laws.cam import law_of
    from cam_rig.schema.load import cam_path
    from cam_rig.simulation.scene import load_cam

    config = load_cam(name)
    built = law_of(cam_path(name), config)
    show(_peaks(built, config.lift.unit, config.lift.factor))
    say(_joints(built))
    if as_csv:
        print_csv(CAM_HEADINGS, [((), *cam_rows(built))])
    if out is not None or not as_csv:
        from cam_rig.laws.figures import figure

        target = out or Path("out") / f"law_{config.name}.png"
        write_plot(target, lambda: figure(config, built))


def _peaks(law: Law, unit: str, factor: float) -> DataTable:
    """Largest and smallest values in the unit of the file's lift."""
    from cam_rig.laws.law import extremes
    from cam_rig.show.tables import Head, tabulate

    units = {"lift s": "", "velocity s'": "/rad", "acceleration s''": "/rad²", "jerk s'''": "/rad³"}
    rows = [(name, unit + per, extremes(law, i)) for i, (name, per) in enumerate(units.items())]
    return tabulate(
        f"Extremes of {law.name}",
        rows,
        (
            (Head("quantity"), lambda row: row[0]),
            (Head("unit"), lambda row: row[1]),
            (Head("largest", "", ".6g"), lambda row: row[2][1].value / factor),
            (Head("at", "°", ".4g"), lambda row: math.degrees(row[2][1].angle)),
            (Head("smallest", "", ".6g"), lambda row: row[2][0].value / factor),
            (Head("at", "°", ".4g"), lambda row: math.degrees(row[2][0].angle)),
        ),
    )


def _joints(law: Law) -> str:
    """The joints that are not smooth, in one line."""
    from cam_rig.laws.law import SMOOTHEST, joints

    rough = [joint for joint in joints(law) if joint.continuity < SMOOTHEST]
    if not rough:
        return f"joins C{SMOOTHEST} or smoother everywhere"
    places = ", ".join(f"{math.degrees(j.angle):.5g}° C{j.continuity}" for j in rough)
    return f"joints (others C{SMOOTHEST}): {places}"


# cam-rig laws: every displacement law, side by side.


def laws(
    family: Annotated[
        str | None,
        typer.Option(help="Only this family of rises: polynomial, start, end (half), classical."),
    ] = None,
    plot: Plot = None,
    json_target: Json = None,
    csv: Csv = None,
) -> None:
    """List the laws with their peaks per unit rise and unit span, and how smoothly they join.

    Continuity Ck: the highest derivative that goes on without a jump where the rise meets a
    dwell (a half-rise: a dwell and constant velocity).

    The plot lays the rises of each family over each other, s to s''' one below the other.

    Examples
    --------
    cam-rig laws

    cam-rig laws --plot out/laws.png

    cam-rig laws --family start --plot out/half_rises.pdf

    cam-rig laws --json -
    """
    with user_errors():
        from cam_rig.laws.catalogue import figures
        from cam_rig.laws.segments import NAMED_RISES

        check_outputs(json_target, plot, csv)
        shown = None if family is None else _family(family)
        names = tuple(NAMED_RISES) if shown is None else shown.rises
        table = rises_table(names, with_free=shown is None)
        show(table)
        write_csv([table], csv)
        write_json({name: asdict(figures(name)) for name in names}, json_target)
        if plot is not None:
            from cam_rig.laws.catalogue import families
            from cam_rig.laws.figures import rises_figure

            columns = families().values() if shown is None else [shown]
            write_plot(plot, lambda: rises_figure(columns))


def rises_table(names: Iterable[str], with_free: bool = False) -> DataTable:
    """Peaks and continuity of named rises; on demand, below them, the laws without fixed ones."""
    from cam_rig.laws.catalogue import figures, free_laws
    from cam_rig.laws.segments import NAMED_RISES
    from cam_rig.show.tables import Head, tabulate

    rows: list[Row] = [(name, NAMED_RISES[name].source, figures(name)) for name in names]
    if with_free:
        rows += [(name, keys or "the level before", None) for name, keys in free_laws().items()]

    def peak(order: str) -> Callable[[Row], Cell]:
        return lambda row: None if row[2] is None else float(getattr(row[2], f"peak_{order}"))

    return tabulate(
        "Peaks for unit rise and unit span",
        rows,
        (
            (Head("law"), lambda row: row[0]),
            (Head("from, or by"), lambda row: row[1]),
            *(
                (Head(order, "", ".4f", "any"), peak(order))
                for order in ("velocity", "acceleration", "jerk")
            ),
            (Head("joins"), lambda row: "any" if row[2] is None else f"C{row[2].continuity}"),
        ),
    )


def _family(name: str) -> RiseFamily:
    """A family by its name.

    Raises
    ------
    ConfigError : there is none of that name
    """
    from cam_rig.errors import ConfigError, did_you_mean
    from cam_rig.laws.catalogue import families

    found = families()
    if name not in found:
        hint = did_you_mean(name, found)
        raise ConfigError(f"--family {name!r}: no such family{hint}; allowed: {', '.join(found)}")
    return found[name]


#: Rows of the CSV: of a cam every so many degrees, of a rise so many steps.
CSV_STEP_DEG, CSV_STEPS = 0.5, 200

CAM_HEADINGS = ("angle_deg", "lift_m", "velocity_m_rad", "acceleration_m_rad2", "jerk_m_rad3")

RISE_HEADINGS = ("u", "lift", "velocity", "acceleration", "jerk")

#: Letters of the names in the name of a plot.
MAX_LETTERS = 60


def are_rises(names: Sequence[str], rises: bool) -> bool:
    """Whether the names are drawn as bare rises: when asked for, or when not all are cams.

    Raises
    ------
    ConfigError : a name that is nothing, or given twice; a rise beside a cam that is no rise
    """
    from cam_rig.laws.segments import NAMED_RISES

    cams = _cam_names()
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ConfigError(f"{name!r} is named twice; allowed: each law once")
        if not _is_cam(name, cams) and name not in NAMED_RISES:
            raise ConfigError(_unknown(name, cams, list(NAMED_RISES)))
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


def show_rises(names: Sequence[str], out: Path | None, as_csv: bool) -> None:
    """Named rises of unit lift over a unit span: peaks, CSV, plot."""
    from cam_rig.laws.catalogue import RiseFamily, rise_values

    show(rises_table(names))
    if as_csv:
        u = np.linspace(0.0, 1.0, CSV_STEPS + 1)
        blocks = (((name,), u, rise_values(name, u)) for name in names)
        print_csv(("rise", *RISE_HEADINGS), blocks)
    if out is not None or not as_csv:
        from cam_rig.laws.figures import rises_figure

        family = RiseFamily("Rises of h over the span β", tuple(names))
        _plot(names, "rises_", out, lambda: rises_figure([family]))


def show_cams(names: Sequence[str], out: Path | None, as_csv: bool) -> None:
    """Cams over the turn: peaks, CSV, plot.

    Raises
    ------
    ConfigError, LawError : one line that names the file and what is wrong in it
    """
    from cam_rig.laws.cam import law_of
    from cam_rig.schema import load_cam
    from cam_rig.schema.load import cam_path

    paths = [cam_path(name) for name in names]
    cams = [load_cam(path) for path in paths]
    loaded = [(cam, law_of(path, cam)) for path, cam in zip(paths, cams, strict=True)]
    show(_cams_table(loaded))
    if as_csv:
        blocks = (((cam.name,), *cam_rows(law)) for cam, law in loaded)
        print_csv(("cam", *CAM_HEADINGS), blocks)
    if out is not None or not as_csv:
        from cam_rig.laws.figures import cams_figure

        _plot([cam.name for cam in cams], "", out, lambda: cams_figure(loaded))


def require_recording(path: Path) -> None:
    """Refuse, before anything is drawn, a recording that could not be written afterwards.

    Raises
    ------
    MissingLibraryError, ConfigError : no rerun; another suffix, or a place that is none
    """
    require("rerun")
    check_place(path)
    if path.suffix != ".rrd":
        raise ConfigError(f"{path}: unknown kind of recording; allowed: .rrd")


def record(names: Sequence[str], rises: bool, path: Path) -> None:
    """Write the curves of cams, in their unit of lift, or of bare rises, for Rerun."""
    from cam_rig.laws.cam import law_of
    from cam_rig.laws.catalogue import cam_curves, common_unit, rise_curves
    from cam_rig.laws.chart import save_laws
    from cam_rig.schema.load import cam_path
    from cam_rig.simulation.scene import load_cam

    if rises:
        curves = [rise_curves(name) for name in names]
        save_laws(curves, "u", ("h", "h/β", "h/β²", "h/β³"), path)
    else:
        cams = [load_cam(name) for name in names]
        unit, factor = common_unit(cams)
        built = [law_of(cam_path(name), cam) for name, cam in zip(names, cams, strict=True)]
        curves = [cam_curves(cam.name, law) for cam, law in zip(cams, built, strict=True)]
        curves = [replace(curve, motion=curve.motion / factor) for curve in curves]
        units = tuple(f"{unit}{per}" for per in ("", "/rad", "/rad²", "/rad³"))
        save_laws(curves, "°", units, path, {cam.name: cam.title for cam in cams})
    say(f"recording: {path}")


def cam_rows(law: Law) -> tuple[FloatArray, FloatArray]:
    """Cam angles in degrees ``(n,)``, and s to s''' there in SI ``(4, n)``."""
    degrees = np.arange(0.0, 360.0, CSV_STEP_DEG)
    return degrees, np.stack([law(np.radians(degrees), order) for order in range(4)])


def print_csv(
    headings: Iterable[str], blocks: Iterable[tuple[tuple[str, ...], FloatArray, FloatArray]]
) -> None:
    """CSV to stdout: of each block its first cells, the abscissa ``(n,)`` and values ``(k, n)``."""
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(headings)
    for first, x, values in blocks:
        for row in zip(x, *values, strict=True):
            writer.writerow([*first, *(f"{value:.12g}" for value in row)])


def _plot(names: Sequence[str], kind: str, out: Path | None, figure: Callable[[], Figure]) -> None:
    write_plot(out or Path("out") / f"law_{kind}{'_'.join(names)[:MAX_LETTERS]}.png", figure)


def _cams_table(loaded: Loaded) -> DataTable:
    """Extremes of the derivatives of each cam, in the unit of lift that the plot has."""
    from cam_rig.laws.catalogue import common_unit
    from cam_rig.laws.law import continuity, extremes
    from cam_rig.show.tables import Head, tabulate

    unit, factor = common_unit(cam for cam, _ in loaded)

    def extreme(order: int, end: int) -> Callable[[tuple[CamConfig, Law]], Cell]:
        return lambda row: extremes(row[1], order)[end].value / factor

    names = {1: ("s'", "/rad"), 2: ("s''", "/rad²"), 3: ("s'''", "/rad³")}
    return tabulate(
        "Extremes over the turn",
        loaded,
        (
            (Head("cam"), lambda row: row[0].name),
            *(
                (Head(f"{word} {name}", unit + per, ".5g"), extreme(order, end))
                for order, (name, per) in names.items()
                for word, end in (("largest", 1), ("smallest", 0))
            ),
            (Head("joins"), lambda row: f"C{continuity(row[1])}"),
        ),
    )


def _cam_names() -> list[str]:
    from cam_rig.schema.load import config_root

    return sorted(path.stem for path in (config_root() / "cams").glob("*.yaml"))


def _is_cam(name: str, cams: Sequence[str]) -> bool:
    """Whether it is a cam's name, or a path, which is a cam's or an error of its own."""
    from cam_rig.schema.load import cam_path

    return name in cams or cam_path(name) == Path(name)


def _unknown(name: str, cams: Sequence[str], rises: Sequence[str]) -> str:
    hint = did_you_mean(name, [*cams, *rises])
    return (
        f"{name[:40]!r}: no such cam or rise{hint}; cams: {', '.join(cams)}; "
        f"rises: {', '.join(rises)}"
    )

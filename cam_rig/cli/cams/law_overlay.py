"""Several laws at once for cam-rig law: what the names mean, the plot, peaks, CSV."""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cam_rig.cli.common.console import say, show
from cam_rig.cli.common.names import cam_path
from cam_rig.cli.common.outputs import check_place, write_plot
from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.extras import require

if TYPE_CHECKING:
    from cam_rig.arrays import FloatArray
    from cam_rig.laws import Law
    from cam_rig.schema import CamConfig
    from cam_rig.tables import Cell, DataTable

    Loaded = list[tuple[CamConfig, Law]]
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
    from cam_rig.laws.named import NAMED_RISES

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
    from cam_rig.cli.cams.laws import rises_table
    from cam_rig.laws.catalogue import RiseFamily
    from cam_rig.laws.curves import rise_values

    show(rises_table(names))
    if as_csv:
        u = np.linspace(0.0, 1.0, CSV_STEPS + 1)
        blocks = (((name,), u, rise_values(name, u)) for name in names)
        print_csv(("rise", *RISE_HEADINGS), blocks)
    if out is not None or not as_csv:
        from cam_rig.plots.laws.overlay import draw_rises

        family = RiseFamily("Rises of h over the span β", tuple(names))
        _plot(names, "rises_", out, lambda part: draw_rises([family], part))


def show_cams(names: Sequence[str], out: Path | None, as_csv: bool) -> None:
    """Cams over the turn: peaks, CSV, plot.

    Raises
    ------
    ConfigError, LawError : one line that names the file and what is wrong in it
    """
    from cam_rig.schema import load_cam
    from cam_rig.simulation.cam_files import law_of

    paths = [cam_path(name) for name in names]
    cams = [load_cam(path) for path in paths]
    loaded = [(cam, law_of(path, cam)) for path, cam in zip(paths, cams, strict=True)]
    show(_cams_table(loaded))
    if as_csv:
        blocks = (((cam.name,), *cam_rows(law)) for cam, law in loaded)
        print_csv(("cam", *CAM_HEADINGS), blocks)
    if out is not None or not as_csv:
        from cam_rig.plots.laws.overlay import draw_cams

        _plot([cam.name for cam in cams], "", out, lambda part: draw_cams(loaded, part))


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
    from cam_rig import load_cam
    from cam_rig.laws.curves import cam_curves, common_unit, rise_curves
    from cam_rig.simulation.cam_files import law_of
    from cam_rig.viewer.laws import save_laws

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


def _plot(names: Sequence[str], kind: str, out: Path | None, draw: Callable[[Path], None]) -> None:
    write_plot(out or Path("out") / f"law_{kind}{'_'.join(names)[:MAX_LETTERS]}.png", draw)


def _cams_table(loaded: Loaded) -> DataTable:
    """Extremes of the derivatives of each cam, in the unit of lift that the plot has."""
    from cam_rig.laws.continuity import continuity
    from cam_rig.laws.curves import common_unit
    from cam_rig.laws.peaks import extremes
    from cam_rig.tables import Column, tabulate

    unit, factor = common_unit(cam for cam, _ in loaded)

    def extreme(order: int, end: int) -> Callable[[tuple[CamConfig, Law]], Cell]:
        return lambda row: extremes(row[1], order)[end].value / factor

    names = {1: ("s'", "/rad"), 2: ("s''", "/rad²"), 3: ("s'''", "/rad³")}
    return tabulate(
        "Extremes over the turn",
        loaded,
        (
            (Column("cam"), lambda row: row[0].name),
            *(
                (Column(f"{word} {name}", unit + per, ".5g"), extreme(order, end))
                for order, (name, per) in names.items()
                for word, end in (("largest", 1), ("smallest", 0))
            ),
            (Column("joins"), lambda row: f"C{continuity(row[1])}"),
        ),
    )


def _cam_names() -> list[str]:
    from cam_rig.schema.load import config_root

    return sorted(path.stem for path in (config_root() / "cams").glob("*.yaml"))


def _is_cam(name: str, cams: Sequence[str]) -> bool:
    """Whether it is a cam's name, or a path, which is a cam's or an error of its own."""
    return name in cams or cam_path(name) == Path(name)


def _unknown(name: str, cams: Sequence[str], rises: Sequence[str]) -> str:
    hint = did_you_mean(name, [*cams, *rises])
    return (
        f"{name[:40]!r}: no such cam or rise{hint}; cams: {', '.join(cams)}; "
        f"rises: {', '.join(rises)}"
    )

"""A noise study as tables, for people."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich.box import SIMPLE
from rich.table import Table

from cam_rig.cli.common.console import console

if TYPE_CHECKING:  # a second of imports, which `--help` should not pay
    from cam_rig.simulation.scene import LoadedScene
    from cam_rig.simulation.settled_turns import Acoustics
    from cam_rig.studies.noise.arc_shape import ArcShape
    from cam_rig.studies.noise.bootstrap import Crossing
    from cam_rig.studies.noise.calibration_methods import Method
    from cam_rig.studies.noise.leave_one_out import LeftOut
    from cam_rig.studies.noise.run import NoiseStudy


def show(study: NoiseStudy, loaded: LoadedScene) -> None:
    """Print every table."""
    console.print(_structures(study))
    for method in study.methods:
        console.print(_method(method, loaded))
        console.print(_crossing_words(method.crossing, loaded))
    console.print(_left_out(study.left_out))
    console.print(_one_rig(study))


def _table(title: str, *columns: str) -> Table:
    """A table for 80 columns: narrow rules, the first column to the left, nothing cut."""
    out = Table(title=title, box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    for i, column in enumerate(columns):
        out.add_column(column, justify="left" if i == 0 else "right", overflow="fold")
    return out


def _structures(study: NoiseStudy) -> Table:
    out = _table(
        "What stands between force and sound: r.m.s. difference in dB",
        "structure, weighting",
        "num-\nbers",
        *(f"{word}\n{cam}" for cam in study.structures for word in ("fitted to", "predicts from")),
    )
    for row in zip(*study.structures.values(), strict=True):
        cells = [f"{v:.2f}" for fit in row for v in (fit.fitted_db, *fit.predicted_db.values())]
        out.add_row(f"{row[0].name}, {row[0].weighting}", str(row[0].numbers), *cells)
    return out


def constants_words(acoustics: Acoustics) -> str:
    """The shared constants in a line."""
    r = acoustics.radiation
    words = f"gain {r.gain:.4g} Pa·s/N, corner {r.corner:.4g} Hz"
    if acoustics.response:
        x, x2, x3 = acoustics.response
        words += f", response {x:+.2f} x {x2:+.2f} x² {x3:+.2f} x³ dB, x = (rpm − 300)/100"
    return words


def shape_words(shape: ArcShape) -> str:
    """An arc cam's numbers in a line."""
    event = math.degrees(shape.event)
    return f"lift {1e3 * shape.lift:.2f} mm, event {event:.1f}°, flank {1 / shape.curvature:.2f} m"


def _method(method: Method, loaded: LoadedScene) -> Table:
    out = _table(
        f"{method.name}: {constants_words(method.acoustics)}",
        "cam",
        "which is",
        "numbers fit-\nted (of 4)",
        "points\ndB RMS",
        "regression\ndB RMS",
        "95 % band\n± dB",
        "published\nwithin",
    )
    for curve in method.curves.values():
        half = 0.5 * float((curve.expected.high - curve.expected.low).mean())
        out.add_row(
            curve.cam,
            curve.role,
            str(curve.numbers) if curve.numbers else "none",
            f"{curve.rms_db:.2f}",
            f"{curve.rms_regression_db:.2f}",
            f"{half:.1f}",
            f"{100 * curve.expected.holds(curve.published_db):.0f} %",
        )
    out.caption = f"arc cam: {shape_words(method.shape)}"
    return out


def _crossing_words(found: Crossing, loaded: LoadedScene) -> str:
    assert loaded.published is not None  # the study has its levels
    names = " and ".join(loaded.published.crossover.between)
    where = "nowhere" if found.rpm is None else f"at {found.rpm:.1f} ± {found.deviation:.1f} rpm"
    points = "nowhere" if found.points_rpm is None else f"at {found.points_rpm:.1f} rpm"
    return (
        f"regressions of {names} cross {where} (± one standard deviation of the draws; 95 %: "
        f"{found.low:.0f} to {found.high:.0f}; published: {loaded.published.crossover.rpm:g}); the "
        f"simulated points themselves {points}"
    )


def _left_out(rows: list[LeftOut]) -> Table:
    out = _table(
        "each cam left out: gain and corner from the other two alone",
        "left out",
        "gain\nPa·s/N",
        "corner\nHz",
        "numbers fitted\nto the others",
        "points\ndB RMS",
        "regression\ndB RMS",
    )
    for row in rows:
        r = row.acoustics.radiation
        out.add_row(
            row.cam,
            f"{r.gain:.3g}",
            f"{r.corner:.2f}",
            str(row.numbers),
            f"{row.rms_db:.2f}",
            f"{row.rms_regression_db:.2f}",
        )
    return out


def _one_rig(study: NoiseStudy) -> Table:
    """Beside the rigid rig whose preload is the follower's weight."""
    base = study.methods[1]
    out = _table(
        "one rig for everything: points to published in dB RMS, and what it costs",
        "rig",
        *base.curves,
        "cross at\nrpm",
    )
    own = {cam: curve.rms_db for cam, curve in base.curves.items()}
    out.add_row(base.name, *(f"{own[cam]:.2f}" for cam in own), _rpm(base.crossing.rpm))
    for rig in study.one_rig:
        cells = [
            f"{rig.rms_db[cam]:.2f} ({rig.rms_db[cam] - own[cam]:+.2f})"
            if cam in rig.rms_db
            else "--one-rig"
            for cam in own
        ]
        out.add_row(rig.name, *cells, _rpm(rig.crossing_rpm))
    return out


def _rpm(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"

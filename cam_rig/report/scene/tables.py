"""The tables of a scene's page: those of the studies, and its laws and levels."""

from __future__ import annotations

from collections.abc import Callable

from pydantic import BaseModel

from cam_rig.laws import Law
from cam_rig.laws.peaks import extremes
from cam_rig.profile.checks.table import checks_table
from cam_rig.report.recorded import recorded_table
from cam_rig.report.scene.results import SceneFindings
from cam_rig.report.scene.summary import answers
from cam_rig.report.summary import summary_table
from cam_rig.report.tables import continuity, origins_table
from cam_rig.simulation.by_speed import speed_table
from cam_rig.simulation.calibrated import RELATIVE_NOTE
from cam_rig.studies.jump.any_rig import TWO_MASSES
from cam_rig.studies.jump.rigid import rigid_jump_speed
from cam_rig.studies.jump.tables import jump_table
from cam_rig.studies.orders.tables import speed_table as orders_table
from cam_rig.studies.vibration.tables import speed_table as vibration_table
from cam_rig.tables import Cell, Column, DataTable, tabulate
from cam_rig.units import RPM


def tables(found: SceneFindings) -> dict[str, list[DataTable]]:
    """Every table of the page, by the section that shows it."""
    loaded, titles = found.loaded, found.cam_set.titles
    rate = int(loaded.scene.sample_rate.si)
    simulated = {cam: curve.level_db for cam, curve in found.run.noise.curves.items()}
    return {
        "summary": [summary_table(answers(found))],
        "cams": [_laws(found)],
        "contour": [
            checks_table(loaded.cams[cam], loaded.laws[cam], checks)
            for cam, checks in found.checks.items()
        ],
        "turn": [speed_table(found.run.by_speed, loaded.scene.title, rate, titles)],
        "jump": [_jumps(found)] if found.jumps else [],
        "vibration": _vibration(found),
        "sound": [
            _levels(found),
            *([recorded_table(found.recorded, simulated, titles)] if found.recorded else []),
            *([orders_table(found.orders, titles)] if found.orders else []),
        ],
        "numbers": [origins_table(name, model) for name, model in files(found).items()],
    }


def files(found: SceneFindings) -> dict[str, BaseModel]:
    """Every file with numbers that the page rests on."""
    loaded = found.loaded
    return {
        f"rig {loaded.rig.name}": loaded.rig,
        **{f"cam {name}": cam for name, cam in loaded.cams.items()},
        f"scene {loaded.scene.name}": loaded.scene,
    }


def _laws(found: SceneFindings) -> DataTable:
    """Lift, smoothness and peaks of each law, from exact roots."""

    def peak(order: int, end: int) -> Callable[[tuple[str, Law]], Cell]:
        return lambda row: 1e3 * extremes(row[1], order)[end].value

    titles = found.cam_set.titles
    return tabulate(
        "Motion laws: lift and extremes of its derivatives in the cam angle",
        found.loaded.laws.items(),
        (
            (Column("cam"), lambda row: titles[row[0]]),
            (Column("lift", "mm", ".4g"), lambda row: 1e3 * row[1].lift),
            (Column("continuity"), lambda row: continuity(row[1])),
            (Column("largest s′", "mm/rad", ".4g"), peak(1, 1)),
            (Column("smallest s′", "mm/rad", ".4g"), peak(1, 0)),
            (Column("largest s″", "mm/rad²", ".4g"), peak(2, 1)),
            (Column("smallest s″", "mm/rad²", ".4g"), peak(2, 0)),
            (Column("largest s‴", "mm/rad³", ".4g"), peak(3, 1)),
            (Column("smallest s‴", "mm/rad³", ".4g"), peak(3, 0)),
        ),
        "Times the cam's speed in rad/s, to the power of the derivative's order, they are those in "
        "time.",
    )


def _jumps(found: SceneFindings) -> DataTable:
    """Jump speeds, with those of one rigid mass beside two."""
    loaded, rigid = found.loaded, {}
    if found.follower == TWO_MASSES:
        rigid = {
            row.cam: rigid_jump_speed(loaded.laws[row.cam], loaded.follower) / RPM
            for row in found.jumps
        }
    caption = f"Jump speed on rig {loaded.rig.name}: {found.jump_run}"
    return jump_table(found.jumps, caption, found.cam_set.titles, rigid)


def _vibration(found: SceneFindings) -> list[DataTable]:
    table = found.vibration
    if table is None:
        return []
    rig, titles = f"rig {found.loaded.rig.name}", found.cam_set.titles
    return [vibration_table(table, rpm, rig, titles) for rpm in table.rpm]


def _levels(found: SceneFindings) -> DataTable:
    """The quietest and the loudest speed of each cam, and what the levels are worth."""
    titles = found.cam_set.titles
    return tabulate(
        "Sound pressure level over the scene's speeds",
        found.run.noise.curves.values(),
        (
            (Column("cam"), lambda curve: titles[curve.cam]),
            (Column("level is"), lambda curve: curve.role),
            (Column("lowest", "dB", ".1f"), lambda curve: float(curve.level_db.min())),
            (Column("at", "rpm", ".6g"), lambda curve: float(curve.rpm[curve.level_db.argmin()])),
            (Column("highest", "dB", ".1f"), lambda curve: float(curve.level_db.max())),
            (Column("at", "rpm", ".6g"), lambda curve: float(curve.rpm[curve.level_db.argmax()])),
            (Column("difference to published", "dB r.m.s.", ".2f"), lambda curve: curve.rmse_db),
        ),
        "" if found.loaded.calibrated else RELATIVE_NOTE,
    )

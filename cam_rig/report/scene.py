"""Sections of the page of a scene, with the results of each study of its cams.

If a study raises an error, the page contains the error. A section without any result is left out,
and the page lists the reason.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from matplotlib.figure import Figure
from pydantic import BaseModel

from cam_rig.errors import CamRigError
from cam_rig.laws.cam import CamSet
from cam_rig.profile.cam_checks import CheckedCam, check_cam
from cam_rig.profile.checks import Check
from cam_rig.report.document import Content, Section
from cam_rig.report.sections import laws_table, origins, read_recorded, recorded_table
from cam_rig.report.sheet import DesignSheet
from cam_rig.show.looks import LONGEST_TITLE
from cam_rig.show.tables import Cell, DataTable, Header, tabulate
from cam_rig.simulation.scene import (
    ORDER_SPEEDS,
    RELATIVE_NOTE,
    VIBRATION_SPEEDS,
    LoadedScene,
    speeds_of,
    spread_speeds,
)
from cam_rig.studies.jump.comparison import JumpResult, find_jumps
from cam_rig.studies.laws import figures as law_figures
from cam_rig.studies.orders.spectrum import HIGHEST, waterfall
from cam_rig.studies.orders.study import OrdersResult
from cam_rig.studies.profile import figures as profile_plot
from cam_rig.studies.profile.study import ProfileResult
from cam_rig.studies.simulate import figures as simulation_figures
from cam_rig.studies.simulate.study import run_scene
from cam_rig.studies.vibration.study import VibrationResult, measure
from cam_rig.units import NS, RPM

StudyResult = TypeVar("StudyResult")

#: Maximum number of cams whose law and contour are drawn.
MAX_DRAWN_CAMS = 6


class SceneStudies:
    """Run of a scene, and the studies of its cams.

    Attributes
    ----------
    loaded : LoadedScene
    titles : dict of str to str
        Displayed name of each cam: the title in its file, or its name if the title is long.
    cam_set : CamSet
    recorded : Recorded or None
        Levels of the recording to compare with the run, if a bag is given.
    run : SceneRun
        Simulation of the scene.
    refused : dict of str to list of str
        Errors of studies by section, each with the title of its cam.
    """

    def __init__(self, loaded: LoadedScene, bag: Path | None) -> None:
        self.loaded = loaded
        self.titles = {
            cam: title if len(title) <= LONGEST_TITLE else cam
            for cam, title in loaded.titles.items()
        }
        self.cam_set = CamSet(loaded.cams, loaded.laws, loaded.rig)
        self.recorded = None if bag is None else read_recorded(bag, loaded)
        self.run = run_scene(loaded)
        self.refused: dict[str, list[str]] = {}

    def study_each_cam(
        self, section: str, study: Callable[[CamSet], StudyResult]
    ) -> dict[str, StudyResult]:
        """Return the result of a study of each cam, and store the errors in `refused`."""
        results = {}
        for cam in self.loaded.cams:
            try:
                results[cam] = study(self.cam_set.select([cam]))
            except CamRigError as error:
                self.refused.setdefault(section, []).append(f"{self.titles[cam]}: {error}")
        return results

    @cached_property
    def checks(self) -> dict[str, list[Check]]:
        """Checks of the contour of each cam."""
        return self.study_each_cam("contour", lambda cam_set: check_cam(*cam_set.pairs[0]))

    @cached_property
    def jumps(self) -> JumpResult:
        """Jump speeds of the cams."""
        results = self.study_each_cam("jump", lambda cam_set: find_jumps(cam_set, {}))
        rows = tuple(row for result in results.values() for row in result.rows)
        return JumpResult(self.cam_set, rows)

    def left_out(self, section: str) -> str:
        """Return the reason why no cam has a result of a section, each error once."""
        prefixes = tuple(f"{title}: " for title in self.titles.values())
        errors = [error for error in self.refused[section] if error.startswith(prefixes)]
        return "; ".join(dict.fromkeys(error.split(": ", 1)[1] for error in errors))


# Section "In short", a table with a summary row for each cam.


def _summary_table(scene: SceneStudies) -> DataTable:
    """Return a table with checks, contact loss, jump speed and levels of each cam."""
    summaries = {row.cam: row for row in scene.run.summaries}

    def checks(cam: str, passed: bool) -> Cell:
        return sum(check.passed is passed for check in scene.checks.get(cam, ()))

    fields: list[tuple[Header, Callable[[str], Cell]]] = [
        (Header("cam"), lambda cam: scene.titles[cam]),
        (Header("checks passed", "", ".0f"), lambda cam: checks(cam, True)),
        (Header("failed", "", ".0f"), lambda cam: checks(cam, False)),
        (Header("speeds", "", ".0f"), lambda cam: summaries[cam].speeds),
        (Header("without contact", "", ".0f"), lambda cam: summaries[cam].lost),
        (
            Header("first at", "rpm", ".6g", missing="–"),
            lambda cam: summaries[cam].first_lost,
        ),
        (Header("longest flight", "ms", ".1f"), lambda cam: 1e3 * summaries[cam].longest_flight),
        (Header("jump speed", "rpm", ".1f", missing="–"), lambda cam: summaries[cam].jump_speed),
        (Header("lowest level", "dB", ".1f"), lambda cam: summaries[cam].lowest_level),
        (Header("highest", "dB", ".1f"), lambda cam: summaries[cam].highest_level),
    ]
    return tabulate(
        "The cams in short",
        scene.loaded.cams,
        fields,
        "Without contact: the follower flies, or the model keeps contact with a negative force.",
        f"Jump speed: {scene.jumps.run}." if scene.jumps.rows else "",
    )


# Sections of the page.


def _sheet(scene: SceneStudies) -> Content:
    """Return the design sheets of the first cams, each on a separate page in print."""
    from cam_rig.report.sheet_figures import contour_figure, curves_figure

    jumps = {row.cam: row.jump.rpm for row in scene.jumps.rows}

    def sheet_of(cam_set: CamSet) -> DesignSheet:
        cam, law = cam_set.pairs[0]
        checks = scene.checks.get(cam.name, ())
        sheet = DesignSheet(scene.loaded, cam, law, jumps.get(cam.name), checks)
        _ = sheet.tables  # here, where an error is reported
        return sheet

    by_cam = scene.study_each_cam("sheet", sheet_of)
    if not by_cam:
        return Content(left_out=scene.left_out("sheet"))
    sheets = dict(list(by_cam.items())[:MAX_DRAWN_CAMS])
    figures: dict[str, Callable[[], Figure]] = {}
    for cam, sheet in sheets.items():
        figures[f"dimensions_{cam}"] = partial(contour_figure, sheet)
        figures[f"curves_{cam}"] = partial(curves_figure, sheet)
    return Content((), figures, {"sheets": sheets})


def _summary(scene: SceneStudies) -> Content:
    values = {
        "model": scene.loaded.scene.model.replace("_", " "),
        "speeds": speeds_of(scene.loaded.scene),
    }
    return Content([_summary_table(scene)], values=values)


def _cams(scene: SceneStudies) -> Content:
    laws = laws_table(
        "Motion laws: lift and extremes of its derivatives in the cam angle",
        scene.cam_set,
        dict.fromkeys((1, 2, 3), ".4g"),
        "For derivatives in time, multiply by the cam speed in rad/s to the power of the order.",
    )
    pairs = scene.cam_set.pairs
    figures = {
        f"law_{cam.name}": partial(law_figures.figure, cam, law)
        for cam, law in pairs[:MAX_DRAWN_CAMS]
    }
    if len(pairs) > 1:
        figures["cams"] = partial(law_figures.cams_figure, pairs)
    return Content([laws], figures)


def _contour(scene: SceneStudies) -> Content:
    pairs = dict(zip(scene.cam_set.laws, scene.cam_set.pairs, strict=True))
    tables, figures, failed = [], {}, []
    for cam, checks in scene.checks.items():
        tables += ProfileResult((CheckedCam(*pairs[cam], checks),)).to_display()
        failed += [(scene.titles[cam], check) for check in checks if not check.passed]
        if cam in list(pairs)[:MAX_DRAWN_CAMS]:
            figures[f"profile_{cam}"] = partial(profile_plot.figure, *pairs[cam], checks)
    return Content(tables, figures, {"failed": failed})


def _turn(scene: SceneStudies) -> Content:
    run = scene.run
    return Content(
        run.tables()[0].to_display(scene.titles),
        {"force": lambda: simulation_figures.over_turn(simulation_figures.force_curves(run))},
        {"seconds": run.ticks[-1].stop_ns / NS},
        {"simulate": run},
    )


def _jump(scene: SceneStudies) -> Content:
    jumps = scene.jumps
    return Content(
        jumps.to_display(scene.titles),
        {"jump": jumps.plot} if jumps.rows else {},
        results={"jump": jumps},
    )


def _vibration(scene: SceneStudies) -> Content:
    rpm = spread_speeds(speeds_of(scene.loaded.scene), VIBRATION_SPEEDS)
    by_cam = scene.study_each_cam("vibration", lambda cam_set: measure(cam_set, rpm))
    if not by_cam:
        return Content(results={"vibration": None}, left_out=scene.left_out("vibration"))
    rows = tuple(row for result in by_cam.values() for row in result.rows)
    vibration = VibrationResult(scene.cam_set.select(by_cam), rows)
    tables = vibration.tables()[0].to_display(scene.titles)
    figure = partial(vibration.plot, published=False)
    return Content(tables, {"vibration": figure}, results={"vibration": vibration})


def _orders(scene: SceneStudies) -> Content:
    """Return the section on orders.

    It is left out if the model has no closed form of its force.
    """
    model, rig = scene.loaded.scene.model, scene.loaded.rig
    speeds = [rpm * RPM for rpm in spread_speeds(speeds_of(scene.loaded.scene), ORDER_SPEEDS)]
    by_cam = scene.study_each_cam(
        "orders", lambda cam_set: waterfall(cam_set.laws, model, rig, speeds)[0]
    )
    if not by_cam:
        return Content(results={"orders": None}, left_out=scene.left_out("orders"))
    orders = OrdersResult(tuple(by_cam.values()), scene.titles)
    tables = orders.speeds.to_display(scene.titles)
    return Content(tables, {"orders": orders.plot}, {"highest": HIGHEST}, {"orders": orders})


def _sound(scene: SceneStudies) -> Content:
    """Return the section on sound: levels over speed, and those of a recording."""
    if note := scene.loaded.no_sound_note:
        return Content(left_out=f"{note[0].upper()}{note[1:]}")
    tables = [_levels(scene)]
    if scene.recorded is not None:
        simulated = {cam: curve.level_db for cam, curve in scene.run.noise.curves.items()}
        published, rpm = scene.loaded.published, np.array(speeds_of(scene.loaded.scene))
        curves = {} if published is None else published.regression_db
        levels = {
            cam: scene.loaded.published_levels(cam, rpm) for cam in simulated if cam in curves
        }
        tables.append(recorded_table(scene.recorded, simulated, scene.titles, levels))
    return Content(tables, {"noise": scene.run.plot})


def _levels(scene: SceneStudies) -> DataTable:
    """Return a table with the lowest and highest level (dB) of each cam.

    It also contains the r.m.s. difference to published levels.
    """
    return tabulate(
        "Sound pressure level over the scene's speeds",
        scene.run.noise.curves.values(),
        (
            (Header("cam"), lambda curve: scene.titles[curve.cam]),
            (Header("level is"), lambda curve: curve.role),
            (Header("lowest", "dB", ".1f"), lambda curve: float(curve.level_db.min())),
            (Header("at", "rpm", ".6g"), lambda curve: float(curve.rpm[curve.level_db.argmin()])),
            (Header("highest", "dB", ".1f"), lambda curve: float(curve.level_db.max())),
            (Header("at", "rpm", ".6g"), lambda curve: float(curve.rpm[curve.level_db.argmax()])),
            (Header("difference to published", "dB r.m.s.", ".2f"), lambda curve: curve.rmse_db),
        ),
        "" if scene.loaded.calibrated else RELATIVE_NOTE,
    )


def _numbers(scene: SceneStudies) -> Content:
    loaded = scene.loaded
    files: dict[str, BaseModel] = {f"rig {loaded.rig.name}": loaded.rig}
    files |= {f"cam {name}": cam for name, cam in loaded.cams.items()}
    files |= {f"scene {loaded.scene.name}": loaded.scene}
    results = {"calibrated": loaded.calibrated, "refused": scene.refused}
    return replace(origins(files, own=True), results=results)


SECTIONS = (
    Section("scene/sheet", "Design sheet", _sheet),
    Section("scene/summary", "In short", _summary),
    Section("scene/cams", "Cams and laws", _cams),
    Section("scene/contour", "Contour and checks", _contour),
    Section("scene/turn", "Contact over the turn", _turn),
    Section("scene/jump", "Jump speed", _jump),
    Section("scene/vibration", "Residual vibration", _vibration),
    Section("scene/sound", "Sound", _sound),
    Section("scene/orders", "Orders of the contact force", _orders),
    Section("numbers", "Given, assumed, identified", _numbers, aside=True),
)

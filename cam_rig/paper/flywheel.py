"""Speed fluctuation over the flywheel's inertia, beside eq. 10 of the paper, its limit I_v → ∞."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure

from cam_rig.dynamics.torsional.model import from_rig as shaft_of
from cam_rig.dynamics.vibration import FlywheelTurn, flywheel_turn
from cam_rig.laws.cam import CamSet
from cam_rig.show.figure import colour, empty, line, logarithmic, styled
from cam_rig.show.looks import title_of
from cam_rig.show.tables import DataTable, Head, tabulate
from cam_rig.units import RPM

#: Inertias of the table, kg·m²; infinity is eq. 10.
INERTIAS = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 20.0, math.inf)

#: The inertia of the rig paper_flywheel, assumed there: a steel disc of 300 mm.
SHOWN = 0.2


@dataclass(frozen=True)
class FlywheelStudy:
    """Turns by cam over `INERTIAS` at one speed (rpm), and eq. 10's twist without preload (rad)."""

    rpm: float
    turns: dict[str, list[FlywheelTurn]]
    without_preload: dict[str, float]

    def at(self, cam: str, inertia: float) -> FlywheelTurn:
        """A cam's turn with one of the inertias."""
        return next(turn for turn in self.turns[cam] if turn.inertia == inertia)


def study_flywheel(cam_set: CamSet, rpm: float) -> FlywheelStudy | None:
    """Every cam behind every flywheel; None for a rig without a shaft."""
    if cam_set.rig.shaft is None:
        return None
    shaft = shaft_of(cam_set.rig)
    slack = replace(shaft, follower=replace(shaft.follower, preload=0.0))
    turns = {
        cam: [flywheel_turn(law, shaft, inertia, rpm * RPM) for inertia in INERTIAS]
        for cam, law in cam_set.laws.items()
    }
    bare = {
        cam: flywheel_turn(law, slack, math.inf, rpm * RPM).twist
        for cam, law in cam_set.laws.items()
    }
    return FlywheelStudy(rpm, turns, bare)


# The limits of the paper's models: a flywheel of any inertia, a stem of any number of masses.

INERTIA = "inertia of the flywheel [kg·m²]"


@styled
def flywheel_figure(study: FlywheelStudy, titles: Mapping[str, str]) -> Figure:
    """Fluctuation of the speed, and twist of the shaft, over the inertia of the flywheel."""
    out = empty(3.3)
    left, right = out.subplots(1, 2)
    for cam, turns in study.turns.items():
        finite = [turn for turn in turns if math.isfinite(turn.inertia)]
        inertia = np.array([turn.inertia for turn in finite])
        shown = 100.0 * np.array([turn.fluctuation for turn in finite])
        left.loglog(inertia, shown, label=title_of(titles, cam), **line(cam))
        twist = np.degrees([turn.twist for turn in finite])
        right.semilogx(inertia, twist, **line(cam))
        limit = math.degrees(study.at(cam, math.inf).twist)
        right.axhline(limit, color=colour(cam), lw=0.8, ls=":")
    left.set(title="(fastest − slowest)/mean speed", ylabel="fluctuation [%]")
    right.set(title="Twist of the shaft", ylabel="twist, peak to peak [°]")
    right.plot([], [], color="0.3", lw=0.8, ls=":", label="the speed held, eq. 10")
    for axes in (left, right):
        axes.set_xlabel(INERTIA)
    logarithmic(left.xaxis, left.yaxis, right.xaxis)
    out.legend(loc="outside lower center", ncols=3, frameon=False)
    out.suptitle(f"Driven by a constant torque, {study.rpm:g} rpm")
    return out


# All findings of a report, and the jobs that compute them.

#: Speed of the flywheel's tables, rpm.
FLYWHEEL_RPM = 300.0


# Speed fluctuation and twist over the flywheel's inertia, as tables.


def flywheel_tables(
    study: FlywheelStudy | None, titles: Mapping[str, str], cam: str
) -> list[DataTable]:
    """One cam over the inertia, and all cams behind one flywheel; nothing without a shaft."""
    if study is None:
        return []
    return [_over_inertia(study, cam, titles[cam]), _over_cams(study, titles)]


def _over_inertia(study: FlywheelStudy, cam: str, title: str) -> DataTable:
    return tabulate(
        f"Fluctuation of the speed over the flywheel's inertia, {title}, {study.rpm:g} rpm",
        study.turns[cam],
        (
            (Head("inertia of the flywheel", "kg·m²"), lambda row: _inertia(row.inertia)),
            (Head("flywheel", "%", ".2f"), lambda row: 100.0 * row.fluctuation),
            (Head("by ΔE/(Iω²)", "%", ".2f"), lambda row: 100.0 * row.formula),
            (Head("cam", "%", ".2f"), lambda row: 100.0 * row.cam_fluctuation),
            (Head("twist", "°", ".4f"), lambda row: math.degrees(row.twist)),
            (Head("motor torque", "N·m", ".4f"), lambda row: row.torque),
        ),
        "Fluctuation: (fastest − slowest)/mean speed. The last row is eq. 10 of the paper.",
        "ΔE/(Iω²): the handbook's formula, shaft rigid, I of flywheel and cam.",
    )


def _over_cams(study: FlywheelStudy, titles: Mapping[str, str]) -> DataTable:
    def held(cam: str) -> float:
        return math.degrees(study.at(cam, math.inf).twist)

    return tabulate(
        f"All laws behind a flywheel of {SHOWN:g} kg·m² (assumed), {study.rpm:g} rpm",
        study.turns,
        (
            (Head("law"), lambda cam: titles[cam]),
            (
                Head("flywheel", "%", ".2f"),
                lambda cam: 100.0 * study.at(cam, SHOWN).fluctuation,
            ),
            (Head("twist", "°", ".4f"), lambda cam: math.degrees(study.at(cam, SHOWN).twist)),
            (Head("twist at held speed", "°", ".4f"), held),
            (
                Head("the same without preload", "°", ".4f"),
                lambda cam: math.degrees(study.without_preload[cam]),
            ),
        ),
        "Held speed without preload is eq. 10 as it is printed; the rig adds its preload to it.",
    )


def _inertia(value: float) -> str:
    return f"{value:g}" if math.isfinite(value) else "∞"

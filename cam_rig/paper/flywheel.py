"""Speed fluctuation over the flywheel's inertia, beside eq. 10 of the paper, its limit I_v → ∞."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from cam_rig.dynamics.torsional.model import from_rig as shaft_of
from cam_rig.dynamics.vibration import FlywheelTurn, flywheel_turn
from cam_rig.laws.cam import CamSet
from cam_rig.show.figure import colour, empty, line, logarithmic, styled
from cam_rig.show.looks import title_of
from cam_rig.show.result import Column, Records, Result
from cam_rig.units import RPM

#: Inertias of the table, kg·m²; infinity is eq. 10.
INERTIAS = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 20.0, math.inf)
#: The inertia of the rig paper_flywheel, assumed there: a steel disc of 300 mm.
SHOWN = 0.2
#: Speed of the report's tables, rpm, and the cam that is shown over the inertia.
FLYWHEEL_RPM, SHOWN_CAM = 300.0, "poly345"


class FlywheelRow(NamedTuple):
    """A cam's turn behind a flywheel."""

    cam: str
    turn: FlywheelTurn


class Behind(NamedTuple):
    """A cam behind the flywheel that is shown, at the held speed of eq. 10, and without preload."""

    cam: str
    shown: FlywheelTurn
    held: FlywheelTurn
    without_preload: float


@dataclass(frozen=True, eq=False, repr=False)
class FlywheelResult(Result):
    """Turns of every cam over `INERTIAS` at one speed (rpm), and eq. 10's twist without preload."""

    schema = "cam_rig.flywheel.1"
    plot_function = "cam_rig.paper.flywheel:figure"
    columns: ClassVar = {
        "flywheel": (
            Column("cam"),
            Column(
                "inertia",
                "kg·m²",
                heading="inertia of the flywheel",
                of="turn.inertia",
                cell=lambda row: f"{row.turn.inertia:g}".replace("inf", "∞"),
            ),
            Column("fluctuation", "%", ".2f", "flywheel", "turn.fluctuation"),
            Column("formula", "%", ".2f", "by ΔE/(Iω²)", "turn.formula"),
            Column("cam_fluctuation", "%", ".2f", "cam", "turn.cam_fluctuation"),
            Column("twist", "°", ".4f", of="turn.twist"),
            Column("motor_torque", "N·m", ".4f", of="turn.torque"),
        ),
        "cams": (
            Column("law", of="cam"),
            Column("fluctuation", "%", ".2f", "flywheel", "shown.fluctuation"),
            Column("twist", "°", ".4f", of="shown.twist"),
            Column("twist_held", "°", ".4f", "twist at held speed", "held.twist"),
            Column("without_preload", "°", ".4f", "the same without preload"),
        ),
    }

    cam_set: CamSet
    rpm: float
    rows: tuple[FlywheelRow, ...]
    without_preload: dict[str, float]

    def at(self, cam: str, inertia: float) -> FlywheelTurn:
        """A cam's turn with one of the inertias."""
        return next(r.turn for r in self.rows if (r.cam, r.turn.inertia) == (cam, inertia))

    def tables(self) -> list[Records]:
        """``flywheel``, of which people read one cam, and ``cams`` behind one flywheel."""
        behind = (
            Behind(cam, self.at(cam, SHOWN), self.at(cam, math.inf), bare)
            for cam, bare in self.without_preload.items()
        )
        return [
            self.table(
                "flywheel",
                f"Fluctuation of the speed over the flywheel's inertia, {{cam}}, {self.rpm:g} rpm",
                self.rows,
                "Fluctuation: (fastest − slowest)/mean speed. The last row is eq. 10 of the paper.",
                "ΔE/(Iω²): the handbook's formula, shaft rigid, I of flywheel and cam.",
                group_by="cam",
                row_filter=lambda row: row.cam == SHOWN_CAM,
            ),
            self.table(
                "cams",
                f"All laws behind a flywheel of {SHOWN:g} kg·m² (assumed), {self.rpm:g} rpm",
                behind,
                "Held speed without preload is eq. 10 as it is printed; the rig adds its preload "
                "to it.",
            ),
        ]


def study_flywheel(cam_set: CamSet, rpm: float) -> FlywheelResult | None:
    """Every cam behind every flywheel; None for a rig without a shaft."""
    if cam_set.rig.shaft is None:
        return None
    shaft, speed = shaft_of(cam_set.rig), rpm * RPM
    slack = replace(shaft, follower=replace(shaft.follower, preload=0.0))
    laws = cam_set.laws.items()
    rows = (
        FlywheelRow(cam, flywheel_turn(law, shaft, inertia, speed))
        for cam, law in laws
        for inertia in INERTIAS
    )
    bare = {cam: flywheel_turn(law, slack, math.inf, speed).twist for cam, law in laws}
    return FlywheelResult(cam_set, rpm, tuple(rows), bare)


@styled
def figure(found: FlywheelResult) -> Figure:
    """Fluctuation of the speed, and twist of the shaft, over the inertia of the flywheel."""
    out = empty(3.3)
    left, right = out.subplots(1, 2)
    for cam in found.cam_set.laws:
        finite = [row.turn for row in found.rows if row.cam == cam and row.turn.inertia < math.inf]
        inertia = np.array([turn.inertia for turn in finite])
        shown = 100.0 * np.array([turn.fluctuation for turn in finite])
        left.loglog(inertia, shown, label=title_of(found.cam_set.titles, cam), **line(cam))
        twist = np.degrees([turn.twist for turn in finite])
        right.semilogx(inertia, twist, **line(cam))
        limit = math.degrees(found.at(cam, math.inf).twist)
        right.axhline(limit, color=colour(cam), lw=0.8, ls=":")
    left.set(title="(fastest − slowest)/mean speed", ylabel="fluctuation [%]")
    right.set(title="Twist of the shaft", ylabel="twist, peak to peak [°]")
    right.plot([], [], color="0.3", lw=0.8, ls=":", label="the speed held, eq. 10")
    for axes in (left, right):
        axes.set_xlabel("inertia of the flywheel [kg·m²]")
    logarithmic(left.xaxis, left.yaxis, right.xaxis)
    out.legend(loc="outside lower center", ncols=3, frameon=False)
    out.suptitle(f"Driven by a constant torque, {found.rpm:g} rpm")
    return out

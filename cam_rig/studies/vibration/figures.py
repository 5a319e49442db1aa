"""Residual and torsional vibration of several cams, as in figs. 4-6 and 9 of the paper.

Small multiples: a column for each cam, in which the other cams are grey.
"""

from __future__ import annotations

from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.torsional.model import from_rig as shaft_of
from cam_rig.dynamics.vibration import LowDwell, low_dwell, steady_turn, steady_twist
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.show.figure import CAM_ANGLE, colour, empty, line, styled, turn_axis, wrapped
from cam_rig.show.looks import title_of
from cam_rig.studies.vibration.study import VibrationResult
from cam_rig.units import RPM, FloatArray

#: What is drawn, row by row; the last only of a rig with a shaft.
LABELS = (
    "displacement x\n(fig. 4) [mm]",
    "x − quasi-static x\n(fig. 5) [µm]",
    "acceleration ẍ\n(fig. 6) [m/s²]",
    "twist of the shaft\n(fig. 9) [°]",
)

#: The row whose abscissa is counted from the middle of the low dwell, and how far it goes, °.
RESIDUAL, AROUND = 1, 60.0
#: Columns before a new block of rows begins; the other cams.
MOST_COLUMNS = 5
#: Letters of a line over a column, which has two.
COLUMN_LETTERS = 14

OTHERS: dict[str, Any] = {"color": "0.8", "lw": 0.6, "zorder": 1.5}

#: Abscissa and values of each row.
Rows = list[tuple[FloatArray, FloatArray]]


@styled
def figure(found: VibrationResult, rpm: float = 0.0) -> Figure:
    """Displacement, residual vibration, acceleration, twist at a speed (rpm), else the last."""
    cam_set, rpm = found.cam_set, rpm or found.rpm[-1]
    rows = {cam: _rows(law, cam_set.rig, rpm * RPM) for cam, law in cam_set.laws.items()}
    cams, count = list(rows), len(LABELS) if cam_set.rig.shaft is not None else len(LABELS) - 1
    columns = min(MOST_COLUMNS, len(cams))
    blocks = -(-len(cams) // columns)
    out = empty(blocks * (1.5 * count + 0.3) + 0.4)
    panels = out.subplots(blocks * count, columns, squeeze=False)
    for place, cam in enumerate(cams):
        top, column = place // columns * count, place % columns
        title, dwell = title_of(cam_set.titles, cam), low_dwell(cam_set.laws[cam])
        _column(panels[top : top + count, column], cam, title, rows, dwell)
        panels[top, column].set_title("\n".join([*wrap(title, COLUMN_LETTERS), ""][:2]))
    for unused in panels[(blocks - 1) * count :, len(cams) - (blocks - 1) * columns :].flat:
        unused.set_visible(False)
    for row, across in enumerate(panels):
        _share(across, LABELS[row % count])
    out.suptitle(wrapped(f"Steady state at {rpm:g} rpm\n{cam_set.rig.title}"))
    out.legend(handles=_legend(cams), loc="outside lower center", ncols=3, frameon=False)
    return out


def _legend(cams: list[str]) -> list[Artist]:
    """What is drawn in every column, whatever its cam."""
    dwell = Patch(color="0.5", alpha=0.12, lw=0, label="low dwell")
    cam = Line2D([], [], color="0.2", label="the cam named above")
    others = [Line2D([], [], **OTHERS, label="the other cams")] if len(cams) > 1 else []
    return [cam, *others, dwell]


def _rows(law: Law, rig: RigConfig, speed: float) -> Rows:
    """The curves of one cam; what is left of the vibration over degrees from its low dwell."""
    turn = steady_turn(law, FollowerParameters.from_rig(rig), speed)
    degrees = np.degrees(turn.angle)
    about = (np.degrees(turn.angle - low_dwell(law).middle) + 180.0) % 360.0 - 180.0
    order = np.argsort(about)
    inside = order[np.abs(about[order]) <= AROUND]
    rows = [
        (degrees, 1e3 * turn.displacement),
        (about[inside], 1e6 * turn.vibration[inside]),
        (degrees, turn.acceleration),
    ]
    if rig.shaft is not None:
        angle, twist = steady_twist(law, shaft_of(rig), speed)
        rows.append((np.degrees(angle), np.degrees(twist)))
    return rows


def _column(
    panels: np.ndarray, cam: str, title: str, rows: dict[str, Rows], dwell: LowDwell
) -> None:
    """One cam over the grey others."""
    for row, axes in enumerate(panels):
        for other in (name for name in rows if name != cam):
            axes.plot(*rows[other][row], **OTHERS)
        axes.plot(*rows[cam][row], color=colour(cam), ls=line(cam)["ls"], label=title)
        if row == RESIDUAL:
            half = 0.5 * float(np.degrees(dwell.span))
            axes.axvspan(-half, half, color="0.5", alpha=0.12, lw=0)
            axes.set(xlim=(-AROUND, AROUND), xticks=(-40, 0, 40), xlabel="from the dwell [°]")
        else:
            turn_axis(axes, 90)
            axes.set_xticks((90, 180, 270))
    panels[-1].set_xlabel(CAM_ANGLE)


def _share(across: np.ndarray, label: str) -> None:
    """One scale for a row, written at its left."""
    shown: list[Axes] = [axes for axes in across if axes.get_visible()]
    limits = np.array([axes.get_ylim() for axes in shown])
    for axes in shown:
        axes.set_ylim(limits[:, 0].min(), limits[:, 1].max())
        axes.tick_params(labelleft=axes is across[0])
    across[0].set_ylabel(label)

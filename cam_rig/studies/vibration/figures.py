"""Figure of residual and torsional vibration, as in figs. 4-6 and 9 of the paper.

It has one column per cam, in which the curves of the other cams are grey.
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
from cam_rig.show.figure import (
    CAM_ANGLE,
    colour,
    empty,
    line,
    logarithmic,
    styled,
    turn_axis,
    wrapped,
)
from cam_rig.show.looks import title_of
from cam_rig.studies.vibration.study import VibrationResult
from cam_rig.units import RPM, FloatArray

#: Quantity, figure of the paper and unit of each row. The last row is only drawn for a rig with a
#: shaft.
LABELS = (
    ("displacement x", "fig. 4", "mm"),
    ("x − quasi-static x", "fig. 5", "µm"),
    ("acceleration ẍ", "fig. 6", "m/s²"),
    ("twist of the shaft", "fig. 9", "°"),
)

#: Index of the row of panels with the residual vibration. Its abscissa is the angle from the middle
#: of the low dwell.
RESIDUAL_ROW = 1
#: Largest angle from the middle of the low dwell that the row `RESIDUAL_ROW` displays, °.
AROUND = 60.0
#: Largest number of columns, one per cam. Further cams are in another block of rows below.
MAX_COLUMNS = 5
#: Largest number of letters in each of the two title lines above a column.
COLUMN_LETTERS = 14

#: Height of the figure of a sweep, in inches.
SWEEP_HEIGHT = 3.8
#: Smallest amplitude that a sweep shows, µm. Smaller ones are below any gauge, or rounding.
MIN_AMPLITUDE_UM = 1e-3

#: Plot options of the curves of the other cams.
OTHERS: dict[str, Any] = {"color": "0.8", "lw": 0.6, "zorder": 1.5}

#: Curves of a cam: abscissa and values for each row of panels.
Rows = list[tuple[FloatArray, FloatArray]]


@styled
def figure(result: VibrationResult, rpm: float = 0.0, published: bool = True) -> Figure:
    """Draw displacement, residual vibration, acceleration and twist at one speed.

    ``rpm`` is one of the speeds of the result (default: the sweep over the speed, or the last). If
    ``published`` is True, the rows name the figures of the paper with the same quantity.
    """
    if result.sweep and not rpm:
        return _sweep_figure(result)
    cam_set, rpm = result.cam_set, rpm or result.rpm[-1]
    rows = {cam: _rows(law, cam_set.rig, rpm * RPM) for cam, law in cam_set.laws.items()}
    cams, count = list(rows), len(LABELS) if cam_set.rig.shaft is not None else len(LABELS) - 1
    columns = min(MAX_COLUMNS, len(cams))
    blocks = -(-len(cams) // columns)
    fig = empty(blocks * (1.5 * count + 0.3) + 0.4)
    panels = fig.subplots(blocks * count, columns, squeeze=False)
    for index, cam in enumerate(cams):
        top, column = index // columns * count, index % columns
        title, dwell = title_of(cam_set.titles, cam), low_dwell(cam_set.laws[cam])
        _column(panels[top : top + count, column], cam, title, rows, dwell)
        panels[top, column].set_title("\n".join([*wrap(title, COLUMN_LETTERS), ""][:2]))
    for unused in panels[(blocks - 1) * count :, len(cams) - (blocks - 1) * columns :].flat:
        unused.set_visible(False)
    for row, axes_row in enumerate(panels):
        quantity, number, unit = LABELS[row % count]
        _share(axes_row, f"{quantity}\n{f'({number}) ' if published else ''}[{unit}]")
    fig.suptitle(wrapped(f"Steady state at {rpm:g} rpm\n{cam_set.rig.title}"))
    fig.legend(handles=_legend(cams), loc="outside lower center", ncols=3, frameon=False)
    return fig


def _sweep_figure(result: VibrationResult) -> Figure:
    """Draw the residual amplitude of each cam over the speed, dotted above its jump speed."""
    fig = empty(SWEEP_HEIGHT)
    axes, lost = fig.subplots(), {row.cam: row.contact_lost_rpm for row in result.rows}
    for row in result.sweep:
        style: dict[str, Any] = {
            "color": colour(row.cam),
            "label": title_of(result.cam_set.titles, row.cam),
        }
        values, lost_contact = (
            np.maximum(1e6 * row.amplitudes, MIN_AMPLITUDE_UM),
            row.speeds > lost[row.cam],
        )
        for shown, dash in ((~lost_contact, line(row.cam)["ls"]), (lost_contact, ":")):
            axes.plot(row.speeds[shown], values[shown], ls=dash, **style)
            style.pop("label", None)
    axes.set(yscale="log", xlabel="cam speed [rpm]", ylabel="residual amplitude [µm]")
    logarithmic(axes.yaxis)
    fig.suptitle(wrapped(f"Residual vibration over the speed\n{result.cam_set.rig.title}"))
    fig.legend(loc="outside lower center", ncols=3, frameon=False)
    return fig


def _legend(cams: list[str]) -> list[Artist]:
    """Return the legend entries that are common to all columns."""
    dwell = Patch(color="0.5", alpha=0.12, lw=0, label="low dwell")
    cam = Line2D([], [], color="0.2", label="the cam named above")
    others = [Line2D([], [], **OTHERS, label="the other cams")] if len(cams) > 1 else []
    return [cam, *others, dwell]


def _rows(law: Law, rig: RigConfig, speed: float) -> Rows:
    """Return abscissa and values of the curve in each row of panels, for one cam.

    ``speed`` is in rad/s. The abscissa is the cam angle in degrees. That of the residual vibration
    is the angle from the middle of the low dwell.
    """
    turn = steady_turn(law, FollowerParameters.from_rig(rig), speed)
    degrees = np.degrees(turn.angle)
    from_dwell = (np.degrees(turn.angle - low_dwell(law).middle) + 180.0) % 360.0 - 180.0
    order = np.argsort(from_dwell)
    inside = order[np.abs(from_dwell[order]) <= AROUND]
    rows = [
        (degrees, 1e3 * turn.displacement),
        (from_dwell[inside], 1e6 * turn.vibration[inside]),
        (degrees, turn.acceleration),
    ]
    if rig.shaft is not None:
        angle, twist = steady_twist(law, shaft_of(rig), speed)
        rows.append((np.degrees(angle), np.degrees(twist)))
    return rows


def _column(
    panels: np.ndarray, cam: str, title: str, rows: dict[str, Rows], dwell: LowDwell
) -> None:
    """Draw the panels of a cam, with the curves of the other cams in grey."""
    for row, axes in enumerate(panels):
        for other in (name for name in rows if name != cam):
            axes.plot(*rows[other][row], **OTHERS)
        axes.plot(*rows[cam][row], color=colour(cam), ls=line(cam)["ls"], label=title)
        if row == RESIDUAL_ROW:
            half = 0.5 * float(np.degrees(dwell.span))
            axes.axvspan(-half, half, color="0.5", alpha=0.12, lw=0)
            axes.set(xlim=(-AROUND, AROUND), xticks=(-40, 0, 40), xlabel="from the dwell [°]")
        else:
            turn_axis(axes, 90)
            axes.set_xticks((90, 180, 270))
    panels[-1].set_xlabel(CAM_ANGLE)


def _share(axes_row: np.ndarray, label: str) -> None:
    """Set the same y limits for all panels of a row, and label the first panel."""
    visible: list[Axes] = [axes for axes in axes_row if axes.get_visible()]
    limits = np.array([axes.get_ylim() for axes in visible])
    for axes in visible:
        axes.set_ylim(limits[:, 0].min(), limits[:, 1].max())
        axes.tick_params(labelleft=axes is axes_row[0])
    axes_row[0].set_ylabel(label)

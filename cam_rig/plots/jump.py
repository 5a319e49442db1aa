"""Minimum contact force against speed: where it reaches zero, contact is lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import TwoMassParameters
from cam_rig.laws import Law
from cam_rig.plots.figures import CAM_SPEED, colour, empty, line, write
from cam_rig.studies.cam_set import CamSet
from cam_rig.studies.jump.any_rig import ONE_MASS, AnyFollower, follower_of, least_force
from cam_rig.studies.jump.comparison import JumpRow
from cam_rig.units import RPM

#: Speeds of a curve.
POINTS = 400


def draw(rows: list[JumpRow], cam_set: CamSet, duration: float | None, path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    write(figure(rows, cam_set, duration), path)


def figure(rows: list[JumpRow], cam_set: CamSet, duration: float | None) -> Figure:
    """The minimum force of a run of ``duration`` s from rest (None: in steady state) by speed."""
    parameters = follower_of(cam_set.rig)
    out = empty(8.0, 4.6)
    axes = out.subplots()
    last = 1.08 * max(row.found.rpm for row in rows)
    rpm = np.linspace(0.35 * min(row.found.rpm for row in rows), last, POINTS)
    for row in rows:
        least = least_force(cam_set.laws[row.cam], parameters, duration, rpm * RPM)
        axes.plot(
            rpm,
            least,
            lw=1.6,
            label=f"{cam_set.titles[row.cam]}: {row.found.rpm:.2f}",
            **line(row.cam),
        )
        _mark(axes, row, colour(row.cam))
    _frame(axes, rpm)
    run = _when(duration) if isinstance(parameters, TwoMassParameters) else ONE_MASS
    axes.set(title=f"Contact is kept while the minimum force is positive ({run})")
    axes.set(ylim=(-0.55 * parameters.preload, 1.15 * parameters.preload))
    if any(row.published_rpm is not None for row in rows):
        axes.plot([], [], "v", color="0.3", ms=7, mfc="none", label="published (paper, Table 2)")
    axes.legend(
        title="jump speed [rpm]",
        fontsize=8.5,
        title_fontsize=8.5,
        loc="lower left",
        handlelength=3.4,
    )
    return out


def one_cam(law: Law, parameters: AnyFollower, duration: float | None, jump: float) -> Figure:
    """The minimum force of one cam up to 8 % above its ``jump`` speed (rpm)."""
    out = empty(8.0, 4.4)
    axes = out.subplots()
    rpm = np.linspace(0.35 * jump, 1.08 * jump, POINTS)
    axes.plot(rpm, least_force(law, parameters, duration, rpm * RPM), **line(law.name), lw=1.6)
    axes.plot(jump, 0.0, "o", color=colour(law.name), label=f"jump speed {jump:.2f} rpm")
    _frame(axes, rpm)
    axes.set(title=f"{law.name}, {_when(duration)}")
    axes.legend(loc="lower left")
    return out


def _when(duration: float | None) -> str:
    return "in steady state" if duration is None else f"{duration:g} s from rest"


def _frame(axes: Axes, rpm: FloatArray) -> None:
    """Both axes, with the line of zero force."""
    axes.set(xlabel=CAM_SPEED, ylabel="minimum contact force [N]", xlim=(rpm[0], rpm[-1]))
    axes.axhline(0.0, color="0.3", lw=0.9)
    axes.grid(alpha=0.25)


def _mark(axes: Axes, row: JumpRow, ink: str) -> None:
    axes.plot(row.found.rpm, 0.0, "o", color=ink, ms=5, zorder=4)
    if row.published_rpm is not None:
        axes.plot(row.published_rpm, 0.0, "v", color=ink, ms=9, mfc="none", zorder=4)

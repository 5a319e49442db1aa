"""Least contact force against speed: where it reaches zero the follower leaves the cam."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.dynamics import TwoMassParameters
from cam_rig.plots.styles import line
from cam_rig.studies.cam_set import CamSet
from cam_rig.studies.jump.comparison import JumpRow
from cam_rig.studies.jump.search import force_run
from cam_rig.units import RPM

#: Speeds of a curve.
POINTS = 400


def draw(rows: list[JumpRow], cam_set: CamSet, duration: float | None, path: Path) -> None:
    """Write the plot as PNG (or any format matplotlib knows by the suffix)."""
    shown = figure(rows, cam_set, duration)
    shown.savefig(path, dpi=130)
    plt.close(shown)


def figure(rows: list[JumpRow], cam_set: CamSet, duration: float | None) -> Figure:
    """The least force of a run of ``duration`` s from rest (None: in steady state) by speed."""
    parameters = TwoMassParameters.from_rig(cam_set.rig)
    out, axes = plt.subplots(figsize=(8.0, 4.6), layout="constrained")
    last = 1.08 * max(row.found.rpm for row in rows)
    rpm = np.linspace(0.35 * min(row.found.rpm for row in rows), last, POINTS)
    for i, row in enumerate(rows):
        least = force_run(cam_set.laws[row.cam], parameters, duration).least(rpm * RPM)
        axes.plot(
            rpm, least, lw=1.6, label=f"{cam_set.titles[row.cam]}: {row.found.rpm:.2f}", **line(i)
        )
        _mark(axes, row, line(i)["color"])
    axes.axhline(0.0, color="0.3", lw=0.9)
    when = "in steady state" if duration is None else f"{duration:g} s from rest"
    axes.set(
        xlabel="cam speed [rpm]",
        ylabel="least contact force [N]",
        title=f"Jump speed: contact holds while the force is above 0 ({when})",
        ylim=(-0.55 * parameters.preload, 1.15 * parameters.preload),
        xlim=(rpm[0], rpm[-1]),
    )
    if any(row.published_rpm is not None for row in rows):
        axes.plot([], [], "v", color="0.3", ms=7, mfc="none", label="published, Table 2")
    axes.grid(alpha=0.25)
    axes.legend(
        title="jump speed [rpm]",
        fontsize=8.5,
        title_fontsize=8.5,
        loc="lower left",
        handlelength=3.4,
    )
    return out


def _mark(axes: Axes, row: JumpRow, colour: str) -> None:
    axes.plot(row.found.rpm, 0.0, "o", color=colour, ms=5, zorder=4)
    if row.published_rpm is not None:
        axes.plot(row.published_rpm, 0.0, "v", color=colour, ms=9, mfc="none", zorder=4)

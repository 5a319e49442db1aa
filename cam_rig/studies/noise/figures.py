"""Figure of the noise study: sound levels with bands, one panel per calibration."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from cam_rig.show.figure import CAM_SPEED, LEVEL, empty, marker, styled
from cam_rig.show.looks import short
from cam_rig.simulation.regression import MIN_SPEEDS
from cam_rig.studies.noise.methods import Method
from cam_rig.studies.noise.study import NoiseStudyResult


@styled
def figure(study: NoiseStudyResult) -> Figure:
    """Draw simulated and published sound levels over speed.

    There is one panel per method of calibration.
    """
    titles = {cam: short(title) for cam, title in study.titles.items()}
    fig = empty(2.5 * len(study.methods) + 0.8)
    axes = fig.subplots(len(study.methods), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for panel, method in zip(axes, study.methods, strict=True):
        _panel(panel, method, titles)
        panel.set_ylabel(LEVEL)
    axes[-1].set_xlabel(CAM_SPEED)
    handles = [
        Line2D([], [], color="k", marker="o", ls="", ms=4, label="simulated"),
        Line2D([], [], color="k", label="cubic regression, simulated"),
        Line2D([], [], color="k", ls="--", label="cubic regression, published"),
        Rectangle((0, 0), 1, 1, color="0.75", label="95 % band for the published regression"),
    ]
    fig.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
    return fig


def _panel(panel: Axes, method: Method, titles: dict[str, str]) -> None:
    for curve in method.curves.values():
        style, rpm = marker(curve.cam), curve.rpm
        colour = style["color"]
        label = f"{titles[curve.cam]}: {curve.role}, r.m.s. difference {curve.rms_db:.2f} dB"
        band = curve.expected
        panel.fill_between(rpm, band.low, band.high, color=colour, alpha=0.16, lw=0)
        panel.plot(rpm, curve.level_db, **style, ls="", ms=4, label=label)
        if rpm.size >= MIN_SPEEDS:
            panel.plot(rpm, curve.regression_db, color=colour)
        panel.plot(rpm, curve.published_db, "--", color=colour)
    crossing = method.crossing
    if crossing.rpm is not None and np.isfinite(crossing.low):
        panel.axvspan(crossing.low, crossing.high, color="0.5", alpha=0.12, lw=0)
        panel.axvline(crossing.rpm, color="0.35", lw=0.9)
        interval = f"95 %: {crossing.low:.0f} to {crossing.high:.0f} rpm"
        offset = dict[str, Any](xycoords=("data", "axes fraction"), textcoords="offset points")
        text = f"equal levels at {crossing.rpm:.1f} rpm\n{interval}"
        panel.annotate(text, (crossing.rpm, 0.02), (-5, 0), ha="right", color="0.25", **offset)
    panel.set_title(method.name)
    panel.legend(loc="upper left")

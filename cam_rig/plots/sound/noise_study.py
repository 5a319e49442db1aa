"""The noise study as a picture: level against speed with bands, one panel a way to calibrate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from cam_rig.plots.figures import CAM_SPEED, LEVEL, empty, marker, write
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.studies.noise.calibration_methods import Method
from cam_rig.studies.noise.run import NoiseStudy


def draw(study: NoiseStudy, loaded: LoadedScene, path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    write(figure(study, loaded), path)


def figure(study: NoiseStudy, loaded: LoadedScene) -> Figure:
    """Level against speed, simulated and published, one panel a way to calibrate."""
    out = empty(15.0, 5.4)
    axes = out.subplots(1, len(study.methods), sharex=True, sharey=True)
    for panel, method in zip(axes, study.methods, strict=True):
        _panel(panel, method, study, loaded)
    axes[0].set_ylabel(LEVEL)
    handles = [
        Line2D([], [], color="k", marker="o", ls="", ms=4, label="simulated"),
        Line2D([], [], color="k", lw=1.6, label="cubic regression, simulated"),
        Line2D([], [], color="k", ls="--", lw=1.2, label="cubic regression, published"),
        Rectangle((0, 0), 1, 1, color="0.75", label="95 % band for the published regression"),
    ]
    out.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    return out


def _panel(panel: Axes, method: Method, study: NoiseStudy, loaded: LoadedScene) -> None:
    rpm = study.rpm
    for curve in method.curves.values():
        style = marker(curve.cam)
        colour = style["color"]
        title = loaded.cams[curve.cam].title
        label = f"{title}: {curve.role}, r.m.s. difference {curve.rms_db:.2f} dB"
        band = curve.expected
        panel.fill_between(rpm, band.low, band.high, color=colour, alpha=0.16, lw=0)
        panel.plot(rpm, curve.level_db, **style, ls="", ms=4, label=label)
        panel.plot(rpm, curve.regression_db, color=colour, lw=1.6)
        panel.plot(rpm, curve.published_db, "--", color=colour, lw=1.2)
    found = method.crossing
    if found.rpm is not None and np.isfinite(found.low):
        panel.axvspan(found.low, found.high, color="0.5", alpha=0.12, lw=0)
        panel.axvline(found.rpm, color="0.35", lw=0.9)
        panel.annotate(
            f"equal levels at {found.rpm:.1f} rpm\n95 %: {found.low:.0f} to {found.high:.0f} rpm",
            (found.rpm, 0.02),
            xycoords=("data", "axes fraction"),
            xytext=(-5, 0),
            textcoords="offset points",
            ha="right",
            fontsize=9,
            color="0.25",
        )
    panel.set(xlabel=CAM_SPEED, title=f"{method.name}")
    panel.grid(alpha=0.3)
    panel.legend(fontsize=8.5, loc="upper left")

"""Noise against speed as in fig. 16 of the paper: simulated points, both regressions."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from cam_rig.plots import styles
from cam_rig.simulation.levels import NoiseResult
from cam_rig.simulation.scene import LoadedScene


def draw(result: NoiseResult, loaded: LoadedScene, path: Path) -> None:
    """Write the plot as PNG (or any format matplotlib knows by the suffix)."""
    shown = figure(result, loaded)
    shown.savefig(path, dpi=130)
    plt.close(shown)


def figure(result: NoiseResult, loaded: LoadedScene) -> Figure:
    """Levels of every cam, their regressions, and those published."""
    out, axes = plt.subplots(figsize=(8.0, 5.2), layout="constrained")
    for index, curve in enumerate(result.curves.values()):
        style = styles.marker(index)
        colour = style["color"]
        title = loaded.cams[curve.cam].title
        note = "" if curve.rmse_db is None else f", {curve.role}, {curve.rmse_db:.2f} dB RMS"
        label = f"{title}{note}"
        axes.plot(curve.rpm, curve.level_db, **style, ls="", ms=5, label=label)
        fine = np.linspace(curve.rpm[0], curve.rpm[-1], 200)
        if np.isfinite(curve.coefficients).all():
            fit = np.polynomial.polynomial.polyval(fine, curve.coefficients)
            axes.plot(fine, fit, color=colour, lw=1.6)
        if curve.rmse_db is not None and loaded.published is not None:
            axes.plot(fine, loaded.published.level(curve.cam, fine), "--", color=colour, lw=1.2)
    axes.plot([], [], "k-", lw=1.6, label="cubic regression of the run")
    if loaded.published is not None:
        axes.plot([], [], "k--", lw=1.2, label="published regression")
    if result.crossover_rpm is not None:
        axes.axvline(result.crossover_rpm, color="0.5", lw=0.8)
        axes.annotate(
            f"{result.crossover_rpm:.0f} rpm",
            (result.crossover_rpm, axes.get_ylim()[0]),
            xytext=(3, 4),
            textcoords="offset points",
            color="0.35",
        )
    axes.set(xlabel="cam speed [rpm]", ylabel="sound level [dB]", title=loaded.scene.title)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="upper left")
    return out

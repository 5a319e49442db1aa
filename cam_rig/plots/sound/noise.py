"""Noise against speed as in fig. 16 of the paper: simulated points, both regressions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from cam_rig.arrays import FloatArray
from cam_rig.drawing.words import short
from cam_rig.plots.figures import CAM_SPEED, LEVEL, empty, marker, series, styled, wrapped, write
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.noise_comparison import NoiseResult

#: A cubic through fewer speeds than this would show what nobody measured.
MIN_SPEEDS = 6
#: Room above and below levels turn by turn, dB, so that the rounding of settled ones is not seen.
MARGIN_DB = 1.0


def draw(result: NoiseResult, loaded: LoadedScene, path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    write(figure(result, loaded), path)


@styled
def figure(result: NoiseResult, loaded: LoadedScene) -> Figure:
    """Level of each cam against speed, its cubic regression, and what is published."""
    out = empty(3.4)
    axes = out.subplots()
    for curve in result.curves.values():
        style = marker(curve.cam)
        ink = style["color"]
        title = short(loaded.cams[curve.cam].title)
        if curve.rmse_db is not None:
            title += f", {curve.role}, r.m.s. difference {curve.rmse_db:.2f} dB"
        axes.plot(curve.rpm, curve.level_db, **style, ls="", ms=5, label=title)
        fine = np.linspace(curve.rpm[0], curve.rpm[-1], 200)
        if len(curve.rpm) >= MIN_SPEEDS and np.isfinite(curve.coefficients).all():
            fit = np.polynomial.polynomial.polyval(fine, curve.coefficients)
            axes.plot(fine, fit, color=ink)
        if curve.rmse_db is not None and loaded.published is not None:
            axes.plot(fine, loaded.published.level(curve.cam, fine), "--", color=ink)
    if any(len(curve.rpm) >= MIN_SPEEDS for curve in result.curves.values()):
        axes.plot([], [], "k-", label="cubic regression, simulated")
    if loaded.published is not None:
        axes.plot([], [], "k--", label="cubic regression, published")
    if result.crossover_rpm is not None:
        axes.axvline(result.crossover_rpm, color="0.5", lw=0.8)
        axes.annotate(
            f"equal levels at {result.crossover_rpm:.0f} rpm",
            (result.crossover_rpm, axes.get_ylim()[0]),
            xytext=(3, 4),
            textcoords="offset points",
            color="0.35",
        )
    worth = "" if loaded.calibrated else "relative "
    axes.set(xlabel=CAM_SPEED, ylabel=worth + LEVEL, title=wrapped(loaded.scene.title))
    axes.legend(loc="upper left")
    return out


@styled
def turn_by_turn(by_turn: FloatArray, settle_turns: int, level: float, title: str) -> Figure:
    """Levels (dB) of turns ``(n,)``, and their energy mean ``level`` after ``settle_turns``."""
    out = empty(3.4)
    axes = out.subplots()
    turn = np.arange(1, by_turn.size + 1)
    axes.plot(turn, by_turn, "o", color=series(0)["color"], label="one turn")
    settled = np.array([settle_turns + 0.5, by_turn.size + 0.5])
    axes.plot(
        settled, [level, level], color=series(1)["color"], label=f"settled turns: {level:.2f} dB"
    )
    axes.set(xlabel="turn", ylabel=LEVEL, title=wrapped(title))
    axes.set_xticks(turn[:: 1 + turn.size // 20])
    axes.set_ylim(by_turn.min() - MARGIN_DB, by_turn.max() + MARGIN_DB)
    axes.legend()
    return out

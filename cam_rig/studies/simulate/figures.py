"""Noise against speed as in fig. 16 of the paper: simulated points, both regressions."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from cam_rig.show import looks as colours
from cam_rig.show.figure import (
    CAM_ANGLE,
    CAM_SPEED,
    LEVEL,
    empty,
    marker,
    series,
    shade,
    styled,
    turn_axis,
    wrapped,
)
from cam_rig.show.looks import MM, short, web
from cam_rig.simulation.regression import MIN_SPEEDS, NoiseResult
from cam_rig.simulation.scene import FORCE_SPEEDS, LoadedScene, speeds_of, spread
from cam_rig.simulation.simulate import TickSamples
from cam_rig.studies.simulate.motion import FollowerMotion
from cam_rig.studies.simulate.sound import SoundLevel
from cam_rig.studies.simulate.study import SceneRun
from cam_rig.units import FloatArray

#: Room above and below levels turn by turn, dB, so that the rounding of settled ones is not seen.
MARGIN_DB = 1.0


@styled
def figure(found: SceneRun) -> Figure:
    """Level of each cam against speed, or the contact force over the turn without levels."""
    if found.loaded.missing_for_sound:
        return over_turn(force_curves(found))
    return noise_figure(found.noise, found.loaded)


@styled
def noise_figure(result: NoiseResult, loaded: LoadedScene) -> Figure:
    """The same of levels alone."""
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
def turn_by_turn(found: SoundLevel) -> Figure:
    """The level turn by turn, and that of the settled ones."""
    by_turn, settle_turns, level = found.by_turn, found.settle_turns, found.level_db
    out = empty(3.4)
    axes = out.subplots()
    turn = np.arange(1, by_turn.size + 1)
    axes.plot(turn, by_turn, "o", color=series(0)["color"], label="one turn")
    settled = np.array([settle_turns + 0.5, by_turn.size + 0.5])
    axes.plot(
        settled, [level, level], color=series(1)["color"], label=f"settled turns: {level:.2f} dB"
    )
    axes.set(xlabel="turn", ylabel=LEVEL, title=wrapped(str(found)))
    axes.set_xticks(turn[:: 1 + turn.size // 20])
    axes.set_ylim(by_turn.min() - MARGIN_DB, by_turn.max() + MARGIN_DB)
    axes.legend()
    return out


#: A speed (rpm), cam angles in the turn (°, rising) and contact forces (N), both ``(n,)``.
ForceCurve = tuple[float, FloatArray, FloatArray]


@styled
def motion_figure(found: FollowerMotion) -> Figure:
    """Lift and contact force over time; where the force is zero, contact is lost: it is shaded."""
    out = empty(4.6)
    lift, force = out.subplots(2, 1, sharex=True)
    time, off = found.time, found.force == 0.0
    lift.plot(time, found.lift * MM, color=web(colours.LIFT), lw=2.2, label="follower")
    lift.plot(time, found.law(found.angle) * MM, "--", color=web(colours.LAW), lw=1.0, label="law")
    force.plot(time, found.force, color=web(colours.FORCE))
    shade(lift, time, off, "contact lost" if off.any() else None)
    shade(force, time, off)
    lift.set(ylabel="lift [mm]", title=wrapped(f"{found.law.name} at {found.rpm:g} rpm"))
    lift.margins(y=0.2)
    lift.legend(loc="upper right", ncols=3)
    force.set(xlabel="time [s]", ylabel="contact force [N]")
    return out


@styled
def over_turn(curves: Mapping[str, Sequence[ForceCurve]]) -> Figure:
    """The contact force over the cam angle: a panel for each cam by its title, a line a speed."""
    out = empty(0.5 + 2.5 * len(curves))
    panels = out.subplots(len(curves), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (title, speeds) in zip(panels, curves.items(), strict=True):
        for i, (rpm, degrees, force) in enumerate(speeds):
            axes.plot(degrees, force, label=f"{rpm:g} rpm", **series(i))
        axes.axhline(0.0, color="0.3", lw=0.9)
        axes.set(ylabel="contact force [N]", title=wrapped(title))
        turn_axis(axes, 30)
        axes.legend()
    panels[-1].set_xlabel(CAM_ANGLE)
    return out


def force_curves(run: SceneRun) -> dict[str, list[ForceCurve]]:
    """The contact force over the last turn at some of the speeds, by the cam's title."""
    scene = run.loaded.scene
    shown = spread(speeds_of(scene), FORCE_SPEEDS)
    last: dict[str, dict[float, deque[TickSamples]]] = {}
    for tick in run.blocks():
        rpm = next((speed for speed in shown if tick.is_of(None, speed)), None)
        if rpm is not None:
            newest = deque[TickSamples](maxlen=scene.program.ticks_per_turn)
            last.setdefault(tick.cam, {}).setdefault(rpm, newest).append(tick)
    return {
        run.loaded.cams[cam].title: [
            _over_turn(rpm, ticks) for rpm, ticks in sorted(by_speed.items())
        ]
        for cam, by_speed in last.items()
    }


def _over_turn(rpm: float, ticks: Iterable[TickSamples]) -> ForceCurve:
    angle = np.concatenate([tick.angle_in_turn for tick in ticks])
    order = np.argsort(angle, kind="stable")
    return rpm, np.degrees(angle[order]), np.concatenate([tick.force for tick in ticks])[order]

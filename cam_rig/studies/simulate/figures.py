"""Figures of runs: noise over speed, motion over time, and force over the turn."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
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
from cam_rig.simulation.scene import FORCE_SPEEDS, LoadedScene, speeds_of, spread_speeds
from cam_rig.simulation.simulate import TickSamples
from cam_rig.studies.simulate.motion import FollowerMotion
from cam_rig.studies.simulate.sound import SoundLevel
from cam_rig.studies.simulate.study import SceneRun
from cam_rig.studies.simulate.summary import is_contact_lost
from cam_rig.units import FloatArray

#: Free space above and below the levels of single turns in a figure, dB. Without it the axis would
#: magnify their rounding.
MARGIN_DB = 1.0


@styled
def figure(run: SceneRun) -> Figure:
    """Draw the sound level of each cam over speed.

    Jump speeds are dotted lines, and speeds with lost contact have a ring. Without levels, plot the
    contact force over the turn.
    """
    if run.loaded.missing_for_sound:
        return over_turn(force_curves(run))
    out = noise_figure(run.noise, run.loaded)
    (axes,) = out.axes
    _mark_lost_contact(axes, run)
    axes.legend(loc="upper left")
    return out


@styled
def noise_figure(result: NoiseResult, loaded: LoadedScene) -> Figure:
    """Draw sound levels over speed as in fig. 16 of the paper.

    The cubic regressions of the simulated levels and, if published, of the measured levels are
    drawn too.
    """
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
    prefix = "" if loaded.calibrated else "relative "
    axes.set(xlabel=CAM_SPEED, ylabel=prefix + LEVEL, title=wrapped(loaded.scene.title))
    axes.legend(loc="upper left")
    return out


def _mark_lost_contact(axes: Axes, run: SceneRun) -> None:
    """Draw a ring at each speed with lost contact, and a line at each jump speed in the range."""
    low, high = axes.get_xlim()
    jumps = [row for row in run.summaries if row.jump_speed and low < row.jump_speed < high]
    for row in jumps:
        axes.axvline(row.jump_speed or 0.0, color=marker(row.cam)["color"], ls=":", lw=1.2)
    if jumps:
        axes.plot([], [], "k:", lw=1.2, label="jump speed, in the colour of its cam")
    rows = [row for row in run.by_speed if is_contact_lost(row)]
    if points := [(row.rpm, row.level_db) for row in rows if row.level_db is not None]:
        rpm, level = zip(*points, strict=True)
        axes.plot(rpm, level, "o", mfc="none", mec="black", mew=0.7, ms=9, label="contact lost")


@styled
def turn_by_turn(result: SoundLevel) -> Figure:
    """Draw the sound level of each turn, and that of all settled turns."""
    by_turn, transient_turns, level = result.by_turn, result.transient_turns, result.level_db
    out = empty(3.4)
    axes = out.subplots()
    turn = np.arange(1, by_turn.size + 1)
    axes.plot(turn, by_turn, "o", color=series(0)["color"], label="one turn")
    settled = np.array([transient_turns + 0.5, by_turn.size + 0.5])
    axes.plot(
        settled, [level, level], color=series(1)["color"], label=f"settled turns: {level:.2f} dB"
    )
    axes.set(xlabel="turn", ylabel=LEVEL, title=wrapped(str(result)))
    axes.set_xticks(turn[:: 1 + turn.size // 20])
    axes.set_ylim(by_turn.min() - MARGIN_DB, by_turn.max() + MARGIN_DB)
    axes.legend()
    return out


#: Speed (rpm), cam angles in the turn (°, rising, ``(n,)``) and contact forces (N, ``(n,)``).
ForceCurve = tuple[float, FloatArray, FloatArray]


@styled
def motion_figure(motion: FollowerMotion) -> Figure:
    """Draw lift and contact force over time.

    Times at which the follower has no contact (zero force) are shaded.
    """
    out = empty(4.6)
    lift, force = out.subplots(2, 1, sharex=True)
    time, lost = motion.time, motion.force == 0.0
    law_lift = motion.law(motion.angle)
    lift.plot(time, motion.lift * MM, color=web(colours.LIFT), lw=2.2, label="follower")
    lift.plot(time, law_lift * MM, "--", color=web(colours.LAW), lw=1.0, label="law")
    force.plot(time, motion.force, color=web(colours.FORCE))
    shade(lift, time, lost, "contact lost" if lost.any() else None)
    shade(force, time, lost)
    lift.set(ylabel="lift [mm]", title=wrapped(f"{motion.law.name} at {motion.rpm:g} rpm"))
    lift.margins(y=0.2)
    lift.legend(loc="upper right", ncols=3)
    force.set(xlabel="time [s]", ylabel="contact force [N]")
    return out


@styled
def over_turn(curves: Mapping[str, Sequence[ForceCurve]]) -> Figure:
    """Draw the contact force over the cam angle: a panel per cam, a line per speed.

    `curves` contains the force curves of each cam by its title.
    """
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
    """Return the contact force over the last turn at some speeds, by the cam's title.

    A curve consists of speed (rpm), cam angles (°) and forces (N). The speeds are evenly chosen
    from those of the scene.
    """
    scene = run.loaded.scene
    speeds = spread_speeds(speeds_of(scene), FORCE_SPEEDS)
    last_turns: dict[str, dict[float, deque[TickSamples]]] = {}
    for tick in run.blocks():
        rpm = next((speed for speed in speeds if tick.is_of(None, speed)), None)
        if rpm is not None:
            empty_turn = deque[TickSamples](maxlen=scene.schedule.ticks_per_turn)
            last_turns.setdefault(tick.cam, {}).setdefault(rpm, empty_turn).append(tick)
    return {
        run.loaded.cams[cam].title: [
            _force_curve(rpm, ticks) for rpm, ticks in sorted(by_speed.items())
        ]
        for cam, by_speed in last_turns.items()
    }


def _force_curve(rpm: float, ticks: Iterable[TickSamples]) -> ForceCurve:
    """Return the contact force over one turn, sorted by the cam angle.

    ``ticks`` contain the samples of the turn. The result is speed (rpm), cam angles (°) and forces
    (N).
    """
    angle = np.concatenate([tick.angle_in_turn for tick in ticks])
    order = np.argsort(angle, kind="stable")
    return rpm, np.degrees(angle[order]), np.concatenate([tick.force for tick in ticks])[order]

"""Figures of the minimum contact force over speed, and of a turn with lift-off."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import CARETUP

from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.any_follower import describe_run, follower_of, min_force
from cam_rig.dynamics.two_mass import Separation, states
from cam_rig.laws.cam import CamSet
from cam_rig.laws.law import peak
from cam_rig.show.figure import (
    CAM_ANGLE,
    CAM_SPEED,
    colour,
    empty,
    line,
    styled,
    turn_axis,
    wrapped,
)
from cam_rig.show.looks import in_words, title_of
from cam_rig.studies.jump.comparison import JumpResult, JumpRow
from cam_rig.studies.jump.jump_speed import JumpSpeed
from cam_rig.units import RPM, TURN, FloatArray

#: Limits (rpm) of the inset in which the curves are magnified. Most cams of Table 2 of the paper
#: lose contact between them.
INSET = (380.0, 420.0)
#: Highest speed to which the curve of a cam is drawn, relative to its jump speed. Beyond it the
#: force is far below the axes, and at ten times the jump speed each point would require a thousand
#: turns.
MAX_SPEED_RATIO = 2.0

#: Plot options of the mark of a published jump speed, a triangle below the axis.
PUBLISHED: dict[str, Any] = {"marker": CARETUP, "ls": "", "ms": 5.5, "zorder": 4}

#: Number of the displayed turn in `lift_off_figure`, counted from the start from rest.
TURN_NUMBER = 3
#: Number of samples of the displayed turn in `lift_off_figure`.
SAMPLES = 3000


@styled
def figure(result: JumpResult) -> Figure:
    """Draw the minimum contact force of each cam over the cam speed.

    It becomes zero at the jump speed of the cam, which is marked.
    """
    rows, cam_set = result.rows, result.cam_set
    parameters = follower_of(cam_set.rig)
    last = 1.08 * max(result.rpm.values())
    rpm = np.linspace(0.35 * min(result.rpm.values()), last, CURVE_POINTS)
    rpm = np.union1d(rpm, np.arange(*INSET)[np.arange(*INSET) < last])
    insets = [row for row in rows if INSET[0] < row.jump.rpm < INSET[1]]
    out = empty(4.8 if len(insets) > 1 else 3.4)
    axes = out.subplots()
    panels = [axes]
    lift = max(peak(cam_set.laws[row.cam], 0).value for row in rows)
    force_scale = parameters.preload or 0.01 * parameters.spring_stiffness * lift
    low, high = -0.55 * force_scale, 1.15 * force_scale
    if len(insets) > 1:
        high = 2.1 * force_scale  # space for the inset above the curves
        panels.append(_inset(axes, 0.12 * force_scale))
    force_axes(axes, rpm)
    for row in rows:
        speeds = rpm[rpm < MAX_SPEED_RATIO * row.jump.rpm]
        forces = min_force(cam_set.laws[row.cam], parameters, result.duration, speeds * RPM)
        label = f"{title_of(cam_set.titles, row.cam)}: {row.jump.rpm:.2f}"
        for panel in panels:
            panel.plot(speeds, forces, label=label, **line(row.cam))
            _mark(panel, row)
    title = f"Contact is kept while the minimum force is positive ({result.run})"
    axes.set(title=wrapped(title), ylim=(low, high))
    if any(row.published_rpm is not None for row in rows):
        axes.plot([], [], label="published (paper, Table 2)", color="0.3", **PUBLISHED)
    axes.legend(title="jump speed [rpm]", loc="upper left" if len(insets) > 1 else "lower left")
    return out


def _inset(axes: Axes, force: float) -> Axes:
    """Return an inset of the axes that magnifies the range of speeds `INSET`.

    Several cams lose contact in this range. The force axis of the inset has the limits -``force``
    and ``force`` (N).
    """
    out = axes.inset_axes((0.54, 0.69, 0.44, 0.29), xlim=INSET, ylim=(-force, force))
    out.axhline(0.0, color="0.3", lw=0.9)
    out.tick_params(axis="x", pad=6.0)
    axes.indicate_inset_zoom(out, edgecolor="0.4")
    return out


def _mark(axes: Axes, row: JumpRow) -> None:
    """Mark the jump speed of a cam, and its published jump speed.

    The mark of the published speed is a triangle below the axes.
    """
    ink = colour(row.cam)
    axes.plot(row.jump.rpm, 0.0, "o", color=ink, ms=4, zorder=4)
    low, high = axes.get_xlim()
    if row.published_rpm is not None and low < row.published_rpm < high:
        foot = axes.get_xaxis_transform()
        axes.plot(row.published_rpm, 0.0, color=ink, transform=foot, clip_on=False, **PUBLISHED)


@styled
def lift_off_figure(cam_set: CamSet, rpm: float) -> Figure:
    """Draw displacement and gap of the roller over a turn of a run from rest.

    It corresponds to fig. 11 of the paper on which the project is based. ``rpm`` is the constant
    cam speed. There is one curve per cam.
    """
    out = empty(4.8)
    upper, lower = out.subplots(2, 1, sharex=True, height_ratios=[1.4, 1.0])
    parameters, speed = TwoMassParameters.from_rig(cam_set.rig), rpm * RPM
    times = (TURN_NUMBER - 1 + np.linspace(0.0, 1.0, SAMPLES)) * TURN / speed
    degrees = np.degrees(speed * times) - 360.0 * (TURN_NUMBER - 1)
    for cam, law in cam_set.laws.items():
        trajectory = Separation(law, parameters, speed)
        trajectory.run(TURN_NUMBER * TURN / speed)
        roller = states(trajectory, times)[0]
        gap_mm = 1e3 * (roller - trajectory.cam(times)[0])
        lift_offs = sum(event.kind == "lift-off" for event in trajectory.events)
        contact = "contact lost" if lift_offs else "contact kept"
        label = f"{title_of(cam_set.titles, cam)}: {contact}"
        upper.plot(degrees, 1e3 * roller, label=label, **line(cam))
        lower.plot(degrees, gap_mm, **line(cam))
    upper.set(ylabel="displacement of the roller [mm]")
    upper.set(title=f"Turn {TURN_NUMBER} from rest at {rpm:g} rpm")
    lower.set(ylabel="gap to the cam [mm]", xlabel=CAM_ANGLE)
    for axes in (upper, lower):
        turn_axis(axes, 30)
    upper.legend(loc="lower center")
    return out


#: Number of cam speeds at which a curve of the minimum contact force is computed.
CURVE_POINTS = 400


def force_axes(axes: Axes, rpm: FloatArray) -> None:
    """Label axes of the minimum force (N) over speed (rpm), and draw the zero line."""
    axes.set(xlabel=CAM_SPEED, ylabel="minimum contact force [N]", xlim=(rpm[0], rpm[-1]))
    axes.axhline(0.0, color="0.3", lw=0.9)
    axes.tick_params(axis="x", pad=6.0)  # space for the marks of published speeds


@styled
def jump_speed_figure(result: JumpSpeed) -> Figure:
    """Draw the minimum contact force (N) of a cam over the speed, with its jump speed.

    The curve extends to 8 % above the jump speed.
    """
    law, parameters = result.law, follower_of(result.rig)
    out = empty(3.4)
    axes = out.subplots()
    rpm = np.linspace(0.35 * result.rpm, 1.08 * result.rpm, CURVE_POINTS)
    axes.plot(rpm, min_force(law, parameters, result.duration, rpm * RPM), **line(law.name))
    label = f"jump speed {result.rpm:.2f} rpm"
    axes.plot(result.rpm, 0.0, "o", color=colour(law.name), label=label)
    force_axes(axes, rpm)
    axes.set(title=wrapped(f"{in_words(law.name)}: {describe_run(parameters, result.duration)}"))
    axes.legend(loc="lower left")
    return out

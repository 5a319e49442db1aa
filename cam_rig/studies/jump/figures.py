"""Where contact is lost: the minimum force by speed, and a turn above the jump speed (fig. 11)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import CARETUP

from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.any_follower import described_run, follower_of, min_force
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

#: Between these speeds (rpm) most of the paper's cams lose contact: an inset.
INSET = (380.0, 420.0)
#: Times its jump speed up to which a cam's curve goes: it has left the axes, and beside a cam that
#: jumps at ten times the speed it would cost a thousand turns a point.
BEYOND = 2.0

#: Marker of a published speed, which points at the axis from below.
PUBLISHED: dict[str, Any] = {"marker": CARETUP, "ls": "", "ms": 5.5, "zorder": 4}

#: The turn shown above the jump speed, counted from rest, and its samples.
SHOWN, SAMPLES = 3, 3000


@styled
def figure(found: JumpResult) -> Figure:
    """The minimum force of each cam's run by speed: zero at its jump speed."""
    rows, cam_set = found.rows, found.cam_set
    parameters = follower_of(cam_set.rig)
    last = 1.08 * max(found.rpm.values())
    rpm = np.linspace(0.35 * min(found.rpm.values()), last, POINTS)
    rpm = np.union1d(rpm, np.arange(*INSET)[np.arange(*INSET) < last])
    insets = [row for row in rows if INSET[0] < row.found.rpm < INSET[1]]
    out = empty(4.8 if len(insets) > 1 else 3.4)
    axes = out.subplots()
    places = [axes]
    lift = max(peak(cam_set.laws[row.cam], 0).value for row in rows)
    shown = parameters.preload or 0.01 * parameters.spring_stiffness * lift
    low, high = -0.55 * shown, 1.15 * shown
    if len(insets) > 1:
        high = 2.1 * shown  # room for it above the curves
        places.append(_inset(axes, 0.12 * shown))
    force_axes(axes, rpm)
    for row in rows:
        near = rpm[rpm < BEYOND * row.found.rpm]
        least = min_force(cam_set.laws[row.cam], parameters, found.duration, near * RPM)
        label = f"{title_of(cam_set.titles, row.cam)}: {row.found.rpm:.2f}"
        for place in places:
            place.plot(near, least, label=label, **line(row.cam))
            _mark(place, row)
    title = f"Contact is kept while the minimum force is positive ({found.run})"
    axes.set(title=wrapped(title), ylim=(low, high))
    if any(row.published_rpm is not None for row in rows):
        axes.plot([], [], label="published (paper, Table 2)", color="0.3", **PUBLISHED)
    axes.legend(title="jump speed [rpm]", loc="upper left" if len(insets) > 1 else "lower left")
    return out


def _inset(axes: Axes, force: float) -> Axes:
    """Where several cams lose contact, enlarged: ``force`` (N) to both sides of zero."""
    out = axes.inset_axes((0.54, 0.69, 0.44, 0.29), xlim=INSET, ylim=(-force, force))
    out.axhline(0.0, color="0.3", lw=0.9)
    out.tick_params(axis="x", pad=6.0)
    axes.indicate_inset_zoom(out, edgecolor="0.4")
    return out


def _mark(axes: Axes, row: JumpRow) -> None:
    """The speed found on the line of zero force; the published one at the foot of the axes."""
    ink = colour(row.cam)
    axes.plot(row.found.rpm, 0.0, "o", color=ink, ms=4, zorder=4)
    low, high = axes.get_xlim()
    if row.published_rpm is not None and low < row.published_rpm < high:
        foot = axes.get_xaxis_transform()
        axes.plot(row.published_rpm, 0.0, color=ink, transform=foot, clip_on=False, **PUBLISHED)


@styled
def lift_off_figure(cam_set: CamSet, rpm: float) -> Figure:
    """Displacement of the roller, and its gap to the cam, over one turn at one speed (rpm)."""
    out = empty(4.8)
    place, gap = out.subplots(2, 1, sharex=True, height_ratios=[1.4, 1.0])
    parameters, speed = TwoMassParameters.from_rig(cam_set.rig), rpm * RPM
    times = (SHOWN - 1 + np.linspace(0.0, 1.0, SAMPLES)) * TURN / speed
    degrees = np.degrees(speed * times) - 360.0 * (SHOWN - 1)
    for cam, law in cam_set.laws.items():
        course = Separation(law, parameters, speed)
        course.run(SHOWN * TURN / speed)
        roller = states(course, times)[0]
        off = 1e3 * (roller - course.cam(times)[0])
        lift_offs = sum(event.kind == "lift-off" for event in course.events)
        contact = "contact lost" if lift_offs else "contact kept"
        label = f"{title_of(cam_set.titles, cam)}: {contact}"
        place.plot(degrees, 1e3 * roller, label=label, **line(cam))
        gap.plot(degrees, off, **line(cam))
    place.set(ylabel="displacement of the roller [mm]")
    place.set(title=f"Turn {SHOWN} from rest at {rpm:g} rpm")
    gap.set(ylabel="gap to the cam [mm]", xlabel=CAM_ANGLE)
    for axes in (place, gap):
        turn_axis(axes, 30)
    place.legend(loc="lower center")
    return out


#: Speeds of a curve.
POINTS = 400


def force_axes(axes: Axes, rpm: FloatArray) -> None:
    """Both axes, with the line of zero force."""
    axes.set(xlabel=CAM_SPEED, ylabel="minimum contact force [N]", xlim=(rpm[0], rpm[-1]))
    axes.axhline(0.0, color="0.3", lw=0.9)
    axes.tick_params(axis="x", pad=6.0)  # beside what is published


@styled
def jump_speed_figure(found: JumpSpeed) -> Figure:
    """The minimum force (N) of one cam's run up to 8 % above its jump speed, where it is zero."""
    law, parameters = found.law, follower_of(found.rig)
    out = empty(3.4)
    axes = out.subplots()
    rpm = np.linspace(0.35 * found.rpm, 1.08 * found.rpm, POINTS)
    axes.plot(rpm, min_force(law, parameters, found.duration, rpm * RPM), **line(law.name))
    label = f"jump speed {found.rpm:.2f} rpm"
    axes.plot(found.rpm, 0.0, "o", color=colour(law.name), label=label)
    force_axes(axes, rpm)
    axes.set(title=wrapped(f"{in_words(law.name)}: {described_run(parameters, found.duration)}"))
    axes.legend(loc="lower left")
    return out

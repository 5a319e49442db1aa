"""Minimum contact force against speed: where it reaches zero, contact is lost."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import CARETUP

from cam_rig.dynamics.jump.any_follower import (
    AnyFollower,
    JumpRow,
    described_run,
    follower_of,
    least_force,
)
from cam_rig.laws import Law
from cam_rig.laws.cam import CamSet
from cam_rig.show.figure import CAM_SPEED, colour, empty, line, styled, wrapped
from cam_rig.show.looks import in_words, title_of
from cam_rig.units import RPM, FloatArray

#: Speeds of a curve; between these (rpm) most of the paper's cams lose contact: an inset.
POINTS, INSET = 400, (380.0, 420.0)

#: Times its jump speed up to which a cam's curve goes: it has left the axes, and beside a cam that
#: jumps at ten times the speed it would cost a thousand turns a point.
BEYOND = 2.0

#: Marker of a published speed, which points at the axis from below.
PUBLISHED: dict[str, Any] = {"marker": CARETUP, "ls": "", "ms": 5.5, "zorder": 4}


@styled
def figure(rows: list[JumpRow], cam_set: CamSet, duration: float | None) -> Figure:
    """The minimum force of a run of ``duration`` s from rest (None: in steady state) by speed."""
    parameters = follower_of(cam_set.rig)
    last = 1.08 * max(row.found.rpm for row in rows)
    rpm = np.linspace(0.35 * min(row.found.rpm for row in rows), last, POINTS)
    rpm = np.union1d(rpm, np.arange(*INSET)[np.arange(*INSET) < last])
    insets = [row for row in rows if INSET[0] < row.found.rpm < INSET[1]]
    out = empty(4.8 if len(insets) > 1 else 3.4)
    axes = out.subplots()
    places = [axes]
    low, high = -0.55 * parameters.preload, 1.15 * parameters.preload
    if len(insets) > 1:
        high = 2.1 * parameters.preload  # room for it above the curves
        places.append(_inset(axes, 0.12 * parameters.preload))
    _frame(axes, rpm)
    for row in rows:
        near = rpm[rpm < BEYOND * row.found.rpm]
        least = least_force(cam_set.laws[row.cam], parameters, duration, near * RPM)
        label = f"{title_of(cam_set.titles, row.cam)}: {row.found.rpm:.2f}"
        for place in places:
            place.plot(near, least, label=label, **line(row.cam))
            _mark(place, row)
    run = described_run(parameters, duration)
    title = f"Contact is kept while the minimum force is positive ({run})"
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


@styled
def one_cam(law: Law, parameters: AnyFollower, duration: float | None, jump: float) -> Figure:
    """The minimum force of one cam up to 8 % above its ``jump`` speed (rpm)."""
    out = empty(3.4)
    axes = out.subplots()
    rpm = np.linspace(0.35 * jump, 1.08 * jump, POINTS)
    axes.plot(rpm, least_force(law, parameters, duration, rpm * RPM), **line(law.name))
    axes.plot(jump, 0.0, "o", color=colour(law.name), label=f"jump speed {jump:.2f} rpm")
    _frame(axes, rpm)
    axes.set(title=wrapped(f"{in_words(law.name)}: {described_run(parameters, duration)}"))
    axes.legend(loc="lower left")
    return out


def _frame(axes: Axes, rpm: FloatArray) -> None:
    """Both axes, with the line of zero force."""
    axes.set(xlabel=CAM_SPEED, ylabel="minimum contact force [N]", xlim=(rpm[0], rpm[-1]))
    axes.axhline(0.0, color="0.3", lw=0.9)
    axes.tick_params(axis="x", pad=6.0)  # beside what is published


def _mark(axes: Axes, row: JumpRow) -> None:
    """The speed found on the line of zero force; the published one at the foot of the axes."""
    ink = colour(row.cam)
    axes.plot(row.found.rpm, 0.0, "o", color=ink, ms=4, zorder=4)
    low, high = axes.get_xlim()
    if row.published_rpm is not None and low < row.published_rpm < high:
        foot = axes.get_xaxis_transform()
        axes.plot(row.published_rpm, 0.0, color=ink, transform=foot, clip_on=False, **PUBLISHED)

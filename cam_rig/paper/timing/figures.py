"""What each ordinate of a cam moves: the law over the turn, and its events."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cam_rig.paper.timing.study import CamTiming, TimingResult, beside_b_spline
from cam_rig.profile import turn_angles
from cam_rig.show.figure import (
    ACROSS,
    CAM_ANGLE,
    empty,
    series,
    series_marker,
    styled,
    turn_axis,
    wrapped,
)

POINTS = 720

#: An ordinate that is free to choose, one that a joint holds, and an event.
FREE: dict[str, Any] = {"color": series(0)["color"], "lw": 1.1}

HELD: dict[str, Any] = {"color": "0.75", "lw": 1.1}

EVENT: dict[str, Any] = {"color": "0.3", "ls": ":", "lw": 1.0}


@styled
def figure(found: TimingResult) -> Figure:
    """The first cam and, with the same axes, the B-spline that goes with it."""
    first = found.timings[0]
    columns = [one.timing for one in found.control or beside_b_spline(first)] or [first]
    out = empty(4.8)
    panels = out.subplots(2, len(columns), sharex=True, sharey="row", squeeze=False)
    for i, timing in enumerate(columns):
        _basis(panels[0, i], timing)
        panels[0, i].set_title(wrapped(timing.cam.title, ACROSS // len(columns)))
        _shifts(panels[1, i], timing)
    panels[0, 0].set(ylabel="change of s /\nchange of the ordinate [1]")
    panels[1, 0].set(ylabel="shift of the event\n[° per 1 % of the lift]")
    panels[1, 0].legend(title="passes, rising")
    names = {"free ordinate": FREE, "held by a joint": HELD, "event": EVENT}
    handles = [Line2D([], [], **style, label=name) for name, style in names.items()]
    out.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
    return out


def _basis(axes: Axes, timing: CamTiming) -> None:
    angle = turn_angles(POINTS)
    for ordinates in timing.ordinates:
        values = np.stack([ordinates.at(at) for at in angle])
        free = range(*ordinates.free.indices(ordinates.values.size))
        for j in range(ordinates.values.size):
            axes.plot(np.degrees(angle), values[:, j], **(FREE if j in free else HELD))
    for event in timing.events:
        axes.axvline(np.degrees(event.angle), **EVENT)
    turn_axis(axes)


def _shifts(axes: Axes, timing: CamTiming) -> None:
    rising = [event for event in timing.events if event.rising]
    for i, event in enumerate(rising):
        for ordinates in timing.ordinates:
            free = ordinates.free
            degrees = 0.01 * np.degrees(ordinates.shifts(event, timing.cam.lift.si))[free]
            at = np.degrees(ordinates.abscissae)[free]
            label = f"{100.0 * event.level:g} %" if ordinates is timing.ordinates[0] else None
            axes.plot(at, degrees, ls="-", lw=1.0, ms=4.0, label=label, **series_marker(i))
    axes.axhline(0.0, color="0.3", lw=0.8)
    axes.set(xlabel=f"{CAM_ANGLE} of the control point")
    turn_axis(axes)

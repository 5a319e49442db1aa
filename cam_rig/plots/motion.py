"""Lift and contact force of a follower over time; the force over a turn, speed by speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from cam_rig.arrays import FloatArray
from cam_rig.drawing import colours
from cam_rig.drawing.colours import web
from cam_rig.drawing.outlines import MM
from cam_rig.dynamics.samples import NamedRows
from cam_rig.plots.figures import CAM_ANGLE, empty, series, shade, styled, turn_axis, wrapped, write

#: A speed (rpm), cam angles in the turn (°, rising) and contact forces (N), both ``(n,)``.
ForceCurve = tuple[float, FloatArray, FloatArray]


@styled
def figure(samples: NamedRows, law_lift: FloatArray, title: str) -> Figure:
    """Both over ``samples.time``; ``law_lift`` ``(n,)`` is the law's lift (m) at the same times.

    Where the contact force is zero, contact is lost, and the time is shaded.
    """
    out = empty(4.6)
    lift, force = out.subplots(2, 1, sharex=True)
    time, off = samples.time, samples.force == 0.0
    lift.plot(time, samples.lift * MM, color=web(colours.LIFT), lw=2.2, label="follower")
    lift.plot(time, law_lift * MM, "--", color=web(colours.LAW), lw=1.0, label="law")
    force.plot(time, samples.force, color=web(colours.FORCE))
    shade(lift, time, off, "contact lost" if off.any() else None)
    shade(force, time, off)
    lift.set(ylabel="lift [mm]", title=wrapped(title))
    lift.margins(y=0.2)
    lift.legend(loc="upper right", ncols=3)
    force.set(xlabel="time [s]", ylabel="contact force [N]")
    return out


def draw_over_turn(curves: Mapping[str, Sequence[ForceCurve]], path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    write(over_turn(curves), path)


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

"""Lift and contact force of a follower over time."""

from __future__ import annotations

from matplotlib.figure import Figure

from cam_rig.arrays import FloatArray
from cam_rig.drawing import colours
from cam_rig.drawing.colours import web
from cam_rig.drawing.outlines import MM
from cam_rig.dynamics.samples import NamedRows
from cam_rig.plots.figures import empty, shade


def figure(samples: NamedRows, law_lift: FloatArray, title: str) -> Figure:
    """Both over ``samples.time``; ``law_lift`` ``(n,)`` is the law's lift (m) at the same times.

    Where the contact force is zero, contact is lost, and the time is shaded.
    """
    out = empty(8.0, 5.4)
    lift, force = out.subplots(2, 1, sharex=True)
    time, off = samples.time, samples.force == 0.0
    lift.plot(time, samples.lift * MM, color=web(colours.LIFT), lw=2.2, label="follower")
    lift.plot(time, law_lift * MM, "--", color=web(colours.LAW), lw=1.0, label="law")
    force.plot(time, samples.force, color=web(colours.FORCE), lw=1.4)
    shade(lift, time, off, "contact lost" if off.any() else None)
    shade(force, time, off)
    for axes in (lift, force):
        axes.grid(alpha=0.3)
    lift.set(ylabel="lift [mm]", title=title)
    lift.margins(y=0.2)
    lift.legend(fontsize=8, loc="upper right", ncols=3)
    force.set(xlabel="time [s]", ylabel="contact force [N]")
    return out

"""Lift and contact force of a follower over time."""

from __future__ import annotations

from matplotlib.figure import Figure

from cam_rig.arrays import FloatArray
from cam_rig.drawing import colours
from cam_rig.drawing.colours import web
from cam_rig.drawing.outlines import MM
from cam_rig.dynamics.samples import NamedRows


def figure(samples: NamedRows, law_lift: FloatArray, title: str) -> Figure:
    """Both over ``samples.time``; ``law_lift`` ``(n,)`` is the law's lift (m) at the same times.

    Where the contact force is zero the follower flies, and the time is shaded.
    """
    out = Figure(figsize=(8.0, 5.4), layout="constrained")
    lift, force = out.subplots(2, 1, sharex=True)
    time, flies = samples.time, (samples.force == 0.0).tolist()
    lift.plot(time, samples.lift * MM, color=web(colours.LIFT), lw=2.2, label="follower")
    lift.plot(time, law_lift * MM, "--", color=web(colours.LAW), lw=1.0, label="law")
    force.plot(time, samples.force, color=web(colours.FORCE), lw=1.4)
    for axes in (lift, force):
        axes.fill_between(
            time,
            0.0,
            1.0,
            where=flies,
            transform=axes.get_xaxis_transform(),
            color=web(colours.GAP),
            alpha=0.18,
            lw=0.0,
            label="off the cam" if axes is lift and any(flies) else None,
        )
        axes.grid(alpha=0.3)
    lift.set(ylabel="lift [mm]", title=title)
    lift.margins(y=0.2)
    lift.legend(fontsize=8, loc="upper right", ncols=3)
    force.set(xlabel="time [s]", ylabel="contact force [N]")
    return out

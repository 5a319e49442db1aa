"""Minimum contact force against speed: where it reaches zero, contact is lost."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.dynamics.jump.any_follower import JumpSpeed, described_run, follower_of, min_force
from cam_rig.show.figure import CAM_SPEED, colour, empty, line, styled, wrapped
from cam_rig.show.looks import in_words
from cam_rig.units import RPM, FloatArray

#: Speeds of a curve.
POINTS = 400


@styled
def figure(found: JumpSpeed) -> Figure:
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


def force_axes(axes: Axes, rpm: FloatArray) -> None:
    """Both axes, with the line of zero force."""
    axes.set(xlabel=CAM_SPEED, ylabel="minimum contact force [N]", xlim=(rpm[0], rpm[-1]))
    axes.axhline(0.0, color="0.3", lw=0.9)
    axes.tick_params(axis="x", pad=6.0)  # beside what is published

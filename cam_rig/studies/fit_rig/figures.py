"""Figures of a fitted rig: measured and fitted values, and their residuals."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.show import looks as colours
from cam_rig.show.figure import CAM_ANGLE, empty, styled, turn_axis
from cam_rig.show.looks import web
from cam_rig.studies.fit_rig.jumps.fit import JumpFit
from cam_rig.studies.fit_rig.run.result import RigFit
from cam_rig.units import TURN

#: Largest number of speeds that the figure of a fitted run shows, one column each.
MAX_SPEEDS = 3
#: Number of cam angles over one turn at which a fitted curve is drawn.
CURVE_POINTS = 1440


@styled
def rig_figure(fit: RigFit) -> Figure:
    """Draw measured and fitted contact force over a turn, with the residuals below.

    There is one column for each of up to `MAX_SPEEDS` cam speeds, from slow to fast. If the run has
    no force, the lift is drawn instead.
    """
    segments = fit.solution.segments
    force = any(segment.force.value.size for segment in segments)
    order = sorted(range(len(segments)), key=lambda i: segments[i].speed)
    picked = sorted(
        {order[round(k)] for k in np.linspace(0, len(order) - 1, MAX_SPEEDS)}, key=order.index
    )
    out = empty(3.8)
    panels = out.subplots(
        2, len(picked), sharex=True, sharey="row", squeeze=False, height_ratios=(2.0, 1.0)
    )
    for column, i in enumerate(picked):
        panels[0, column].set_title(f"{fit.segments[i].rpm:.4g} rpm")
        _draw_segment(panels[0, column], panels[1, column], fit, i, force)
        panels[1, column].set_xlabel(CAM_ANGLE)
    panels[0, 0].set_ylabel("contact force [N]" if force else "lift [mm]")
    panels[1, 0].set_ylabel(f"residual [{'N' if force else 'µm'}]")
    panels[0, 0].legend(loc="upper right")
    return out


def _draw_segment(above: Axes, below: Axes, fit: RigFit, i: int, force: bool) -> None:
    """Draw measured and fitted values of a steady-speed segment, and residuals below.

    The values are contact forces if ``force`` is True, else lifts. ``i`` is the index of the
    segment in the fit.
    """
    predicted = fit.solution.predicted[i]
    assert predicted is not None  # every segment of a solution has a periodic turn
    signal, factor, fine, colour = (
        (predicted.force, 1.0, 1.0, colours.FORCE)
        if force
        else (predicted.lift, 1e3, 1e6, colours.LIFT)
    )
    degrees, measured = np.degrees(np.mod(signal.angle, TURN)), signal.value - signal.residual
    above.plot(degrees, measured * factor, ".", ms=2.5, color=web(colour), label="measured")
    turn = np.linspace(0.0, TURN, CURVE_POINTS, endpoint=False)
    curve = predicted.turn.evaluate(turn)[1 if force else 0]
    above.plot(np.degrees(turn), curve * factor, color="0.1", lw=1.0, label="fitted")
    below.axhline(0.0, color="0.1", lw=0.8)
    below.plot(degrees, -signal.residual * fine, ".", ms=2.0, color=web(colours.LIMIT))
    turn_axis(above)
    turn_axis(below)


@styled
def jump_figure(fit: JumpFit) -> Figure:
    """Draw measured against fitted jump speeds (rpm), with the residuals below."""
    read, fitted = fit.read.rpm, np.array(fit.speeds)
    out = empty(5.4)
    above, below = out.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    ends = [min(read.min(), fitted.min()), max(read.max(), fitted.max())]
    above.plot(ends, ends, color="0.1", lw=0.8, label="as fitted")
    above.errorbar(
        fitted,
        read,
        yerr=fit.error,
        fmt="o",
        ms=4,
        capsize=2,
        color=web(colours.LIFT),
        label="read",
    )
    above.set_ylabel("jump speed, read [rpm]")
    above.legend(loc="upper left")
    below.axhline(0.0, color="0.1", lw=0.8)
    below.errorbar(fitted, read - fitted, yerr=fit.error, fmt="o", ms=4, color=web(colours.LIMIT))
    below.set(xlabel="jump speed, fitted [rpm]", ylabel="residual [rpm]")
    return out

"""What was measured on a rig and what the fit makes of it, speed by speed, or jump by jump."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.show import looks as colours
from cam_rig.show.figure import CAM_ANGLE, empty, styled, turn_axis
from cam_rig.show.looks import web
from cam_rig.studies.fit_rig.jump_fit import JumpFit
from cam_rig.studies.fit_rig.result import RigFit
from cam_rig.units import TURN

#: Speeds that are shown, at most; points of a curve.
MOST_SPEEDS, POINTS = 3, 1440


@styled
def rig_figure(fit: RigFit) -> Figure:
    """Force, or lift where none was measured, of some speeds over one turn; residuals below."""
    holds = fit.solution.holds
    force = any(hold.force.value.size for hold in holds)
    order = sorted(range(len(holds)), key=lambda i: holds[i].speed)
    picked = sorted(
        {order[round(k)] for k in np.linspace(0, len(order) - 1, MOST_SPEEDS)}, key=order.index
    )
    out = empty(3.8)
    panels = out.subplots(
        2, len(picked), sharex=True, sharey="row", squeeze=False, height_ratios=(2.0, 1.0)
    )
    for column, i in enumerate(picked):
        panels[0, column].set_title(f"{fit.holds[i].rpm:.4g} rpm")
        _hold(panels[0, column], panels[1, column], fit, i, force)
        panels[1, column].set_xlabel(CAM_ANGLE)
    panels[0, 0].set_ylabel("contact force [N]" if force else "lift [mm]")
    panels[1, 0].set_ylabel(f"residual [{'N' if force else 'µm'}]")
    panels[0, 0].legend(loc="upper right")
    return out


def _hold(above: Axes, below: Axes, fit: RigFit, i: int, force: bool) -> None:
    predicted = fit.solution.predicted[i]
    assert predicted is not None  # a search ends at steady turns
    shown, factor, fine, colour = (
        (predicted.force, 1.0, 1.0, colours.FORCE)
        if force
        else (predicted.lift, 1e3, 1e6, colours.LIFT)
    )
    degrees, measured = np.degrees(np.mod(shown.angle, TURN)), shown.value - shown.left
    above.plot(degrees, measured * factor, ".", ms=2.5, color=web(colour), label="measured")
    turn = np.linspace(0.0, TURN, POINTS, endpoint=False)
    curve = predicted.turn.at(turn)[1 if force else 0]
    above.plot(np.degrees(turn), curve * factor, color="0.1", lw=1.0, label="fitted")
    below.axhline(0.0, color="0.1", lw=0.8)
    below.plot(degrees, -shown.left * fine, ".", ms=2.0, color=web(colours.LIMIT))
    turn_axis(above)
    turn_axis(below)


@styled
def jump_figure(fit: JumpFit) -> Figure:
    """Jump speeds as read over those of the numbers found; residuals below."""
    read, found = fit.read.rpm, np.array(fit.speeds)
    out = empty(5.4)
    above, below = out.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    ends = [min(read.min(), found.min()), max(read.max(), found.max())]
    above.plot(ends, ends, color="0.1", lw=0.8, label="as fitted")
    above.errorbar(
        found, read, yerr=fit.error, fmt="o", ms=4, capsize=2, color=web(colours.LIFT), label="read"
    )
    above.set_ylabel("jump speed, read [rpm]")
    above.legend(loc="upper left")
    below.axhline(0.0, color="0.1", lw=0.8)
    below.errorbar(found, read - found, yerr=fit.error, fmt="o", ms=4, color=web(colours.LIMIT))
    below.set(xlabel="jump speed, fitted [rpm]", ylabel="residual [rpm]")
    return out

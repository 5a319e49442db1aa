"""Figure of the acceleration of a law and of its controller, and of the follower's vibration."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.vibration import steady_turn
from cam_rig.show.figure import CAM_ANGLE, empty, styled, turn_axis
from cam_rig.studies.electronic.study import BY, ControllerRow, ElectronicResult
from cam_rig.units import RPM, TURN

#: Number of points of a curve of s″. Corners of s″ of thousands of pieces are visible.
CURVE_POINTS = 7200
#: Largest number of forms that are drawn, the exact law included.
MAX_FORMS = 5
#: Lowest difference of vibrations that is drawn, µm. It is below the error of any machine.
MIN_DIFFERENCE_UM = 1e-4
#: Colours of the forms. The exact law is black.
FORM_COLOURS = ("0.0", "#EE6677", "#4477AA", "#228833", "#AA3377")


@styled
def figure(result: ElectronicResult) -> Figure:
    """Draw s″ of the law and of the controller, and the vibration of the follower under each.

    The panels of the vibration are left out if no rig is given. The difference from the vibration
    of the law has a logarithmic axis, because forms differ by orders of magnitude.
    """
    rows = [row for row in result.rows if not row.law.velocity_jumps][: MAX_FORMS - 1]
    if result.rows[-1] not in rows:
        rows = [*rows, result.rows[-1]]
    with_motion = result.rig is not None
    fig = empty(5.6 if with_motion else 3.0)
    panels = fig.subplots(3 if with_motion else 1, 1, sharex=True, squeeze=False)[:, 0]
    _accelerations(panels[0], rows)
    if result.rig is not None:
        follower = FollowerParameters.on_stem(result.rig, BY)
        exact = steady_turn(rows[0].law, follower, result.rpm * RPM)
        degrees = np.degrees(exact.angle)
        panels[1].plot(degrees, 1e6 * exact.vibration, color=FORM_COLOURS[0], lw=0.9, zorder=3)
        for row, colour in zip(rows[1:], FORM_COLOURS[1:], strict=False):
            vibration = steady_turn(row.law, follower, result.rpm * RPM).vibration
            panels[1].plot(degrees, 1e6 * vibration, color=colour, lw=0.8)
            difference = 1e6 * np.abs(vibration - exact.vibration)
            panels[2].semilogy(degrees, difference, color=colour, lw=0.6)
        panels[1].set(ylabel="vibration of\nthe follower [µm]")
        panels[2].set(
            ylabel="difference from\nthat of the law [µm]", ylim=(MIN_DIFFERENCE_UM, None)
        )
        panels[2].yaxis.set_major_formatter(
            lambda value, _: np.format_float_positional(value, trim="-")
        )
    turn_axis(panels[-1])
    panels[-1].set_xlabel(CAM_ANGLE)
    fig.legend(loc="outside lower center", ncols=3, frameon=False)
    return fig


def _accelerations(axes: Axes, rows: list[ControllerRow]) -> None:
    """Draw s″ of each form."""
    angles = np.linspace(0.0, TURN, CURVE_POINTS, endpoint=False)
    for row, colour in zip(rows, FORM_COLOURS, strict=False):
        label = row.form if row.count is None else f"{row.form}, {row.count}"
        axes.plot(np.degrees(angles), 1e3 * row.law(angles, 2), color=colour, lw=0.9, label=label)
    axes.set_ylabel("s″ [mm/rad²]")

"""Figures of a design sheet: the dimensioned contour, and force and torque over the turn.

They are black, so that a grey print is as readable as the screen.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.profile import contours
from cam_rig.profile.shapes import circle
from cam_rig.report.sheet import DesignSheet
from cam_rig.show.figure import CAM_ANGLE, WIDTH, styled, turn_axis
from cam_rig.show.looks import MM
from cam_rig.studies.profile.figures import positions

#: Size of the dimensioned contour in inches: 88 mm is half of the text of an A4 page.
CONTOUR_SIZE_IN = 88.0 / 25.4, 68.0 / 25.4
#: Height of the curves in inches.
CURVES_HEIGHT_IN = 1.5
#: Number of points of the contour.
POINTS = 1440
#: Line style of the contour.
OUTLINE: dict[str, Any] = {"color": "black", "lw": 1.3}
#: Line style of auxiliary circles.
THIN: dict[str, Any] = {"color": "black", "lw": 0.5, "ls": (0, (6, 3))}
#: Line style of centre lines.
CENTRE: dict[str, Any] = {"color": "black", "lw": 0.4, "ls": (0, (12, 2, 2, 2))}
#: Arrow of a dimension.
LEADER: dict[str, Any] = {"arrowprops": {"arrowstyle": "-|>", "lw": 0.5, "color": "black"}}
#: Length of a centre line beyond the largest radius, relative to that radius.
CENTRE_LINE_RATIO = 1.12
#: Least distance of the axis from the side of the drawing, relative to the largest radius. The
#: labels need this space.
EDGE_RATIO = 1.75
#: Direction of the dimension of the base circle, degrees from +x.
BASE_DIRECTION_DEG = 222.0
#: Direction of the dimension of the largest diameter, degrees from +x.
LARGEST_DIRECTION_DEG = 318.0


@styled
def contour_figure(sheet: DesignSheet) -> Figure:
    """Draw the contour with the follower at cam angle 0, and dimensions in mm."""
    follower, (contour, *_) = sheet.cam.follower, contours(sheet.cam.follower, sheet.law, POINTS)
    out = Figure(figsize=CONTOUR_SIZE_IN, layout="constrained")
    axes = out.subplots()
    axes.set_axis_off()
    axes.set_aspect("equal")
    points = np.append(contour.points, contour.points[:, :1], axis=1) * MM
    axes.fill(*points, fc="0.93", lw=0.0)
    axes.plot(*points, **OUTLINE)
    for strip in positions(contour.disc.element, sheet.law, np.zeros(1))[0]:
        axes.plot(*strip.T, color="black", lw=0.8)
    base, largest = follower.base_radius.si * MM, sheet.largest_radius * MM
    axes.plot(*circle(base).T, **THIN)
    axes.plot(*circle(largest).T, **THIN)
    reach = CENTRE_LINE_RATIO * largest
    axes.plot([-reach, reach], [0.0, 0.0], **CENTRE)
    axes.plot([0.0, 0.0], [-reach, reach], **CENTRE)
    edge = max(EDGE_RATIO * largest, *(abs(limit) for limit in axes.get_xlim()))
    axes.set_xlim(-edge, edge)
    _leader(axes, base, BASE_DIRECTION_DEG, f"base circle ⌀ {2.0 * base:.4g}", reach)
    _leader(axes, largest, LARGEST_DIRECTION_DEG, f"largest ⌀ {2.0 * largest:.4g}", reach)
    if follower.roller > 0.0 and contour.pitch is not None:
        x, y = contour.pitch[:, 0] * MM
        rim = x + follower.roller * MM * math.sqrt(0.5), y + follower.roller * MM * math.sqrt(0.5)
        label = f"roller ⌀ {2.0 * follower.roller * MM:.4g}"
        axes.annotate(label, rim, (x + 0.4 * largest, rim[1]), va="center", **LEADER)
    box = {"fc": "0.93", "ec": "none", "pad": 0.6}
    axes.text(0.0, -0.4 * base, "cam turns ↺", ha="center", va="center", bbox=box)
    return out


def _leader(axes: Axes, radius: float, direction: float, label: str, reach: float) -> None:
    """Label a circle about the axis with an arrow to it, from outside the cam."""
    x, y = math.cos(math.radians(direction)), math.sin(math.radians(direction))
    axes.annotate(
        label,
        (radius * x, radius * y),
        (reach * x, reach * y),
        ha="left" if x > 0.0 else "right",
        va="top",
        **LEADER,
    )


@styled
def curves_figure(sheet: DesignSheet) -> Figure:
    """Draw contact force, spring force and torque over the turn at the working speed."""
    out = Figure(figsize=(WIDTH, CURVES_HEIGHT_IN), layout="constrained")
    force, torque = out.subplots(1, 2)
    degrees = np.degrees(sheet.angle)
    force.plot(degrees, sheet.force, color="black", label="contact force F")
    force.plot(degrees, sheet.spring_force, color="0.45", ls="--", label="spring and preload")
    force.set(ylabel="force [N]", title=f"Contact at {sheet.rpm:.6g} rpm")
    force.margins(y=0.15)
    force.legend(loc="best")
    torque.plot(degrees, sheet.torque, color="black")
    torque.axhline(0.0, color="0.3", lw=0.6)
    torque.set(ylabel="torque F s′ [N·m]", title=f"Torque on the cam at {sheet.rpm:.6g} rpm")
    for axes in (force, torque):
        turn_axis(axes)
        axes.set_xlabel(CAM_ANGLE)
    return out

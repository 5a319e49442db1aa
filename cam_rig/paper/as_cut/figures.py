"""Fig. 12 of the paper: the contour that a polar plot of s + R_b gives, and a roller on it."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from cam_rig.paper.as_cut.study import AsCut, AsCutResult
from cam_rig.profile import turn_angles
from cam_rig.profile.contact import Motion
from cam_rig.profile.disc import Contour, Disc
from cam_rig.profile.faces import GuidedCentre
from cam_rig.show.figure import CAM_ANGLE, empty, series, styled, turn_axis, wrapped
from cam_rig.show.looks import MM

POINTS = 1440


@styled
def figure(result: AsCutResult, cam: str = "") -> Figure:
    """The polar plot of a cam, else the first, and beside it what the roller does with it."""
    found = result.of(cam) or result.rows[0]
    out = empty(4.0)
    grid = out.add_gridspec(2, 2, width_ratios=[1.15, 1.0])
    polar = out.add_subplot(grid[:, 0], projection="polar")
    assert isinstance(polar, PolarAxes)
    _polar(polar, found)
    out.legend(*polar.get_legend_handles_labels(), loc="outside lower left", ncols=3)
    lift, angle = out.add_subplot(grid[0, 1]), turn_angles(POINTS)
    above = (found.cut.law(angle) - found.drawn.law(angle)) * MM
    lift.plot(np.degrees(angle), above, **series(0))
    lift.set(ylabel="roller above s [mm]", title="roller on s + $R_b$, less s")
    turn_axis(lift)
    _acceleration(out.add_subplot(grid[1, 1], sharex=lift), found)
    radii = f"base radius {found.base_radius * MM:g} mm, roller radius {found.roller * MM:g} mm"
    out.suptitle(wrapped(f"{result.titles[found.cam]}, {radii}"))
    return out


def _polar(axes: PolarAxes, found: AsCut) -> None:
    law, angle = found.drawn.law, np.append(turn_angles(POINTS), 0.0)
    drawn = (found.base_radius + law(angle)) * MM
    axes.plot(angle, drawn, lw=2.0, label="s + $R_b$, as fig. 12", **series(0))
    axes.fill(angle, drawn, color=series(0)["color"], alpha=0.10, lw=0.0)
    element = GuidedCentre.on_base(found.base_radius, found.roller, 0.0)
    contour = Contour.of(Disc("", element), Motion.at(law, angle))
    x, y = contour.points  # at cam angle 0 the guide is +y and the follower runs clockwise
    radius = np.hypot(x, y) * MM
    axes.plot(np.arctan2(x, y), radius, label="cut for the roller", **series(1))
    base = np.full_like(angle, found.base_radius * MM)
    axes.plot(angle, base, color="0.25", ls=":", label="base circle")
    axes.set(rmin=0.0)
    axes.set_rlabel_position(68.0)
    axes.set_title("contour, radius in mm")


def _acceleration(axes: Axes, found: AsCut) -> None:
    angle = turn_angles(POINTS)
    for i, (cam, name) in enumerate(((found.drawn, "s"), (found.cut, "roller on s + $R_b$"))):
        label = f"{name}: jump speed {cam.jump_rpm:.1f} rpm"
        axes.plot(np.degrees(angle), cam.law(angle, 2) * MM, label=label, **series(i))
    axes.set(ylabel="s″ [mm/rad²]", xlabel=CAM_ANGLE)
    turn_axis(axes)
    axes.set_ylim(top=1.7 * axes.get_ylim()[1])
    axes.legend(loc="upper center")

"""Figures of the design study: designed law and start law, and Pareto front."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.dynamics.kinetostatic import force_weights
from cam_rig.laws import Law
from cam_rig.laws.catalogue import cam_curves
from cam_rig.profile.disc import contours
from cam_rig.show.figure import CAM_ANGLE, empty, series, styled, turn_axis
from cam_rig.show.looks import DERIVATIVE_NAMES, MM, PER_RADIAN, short
from cam_rig.studies.design.result import Front, LawDesign
from cam_rig.units import TURN, to_rpm

#: Height of the figure of a designed law, inches.
HEIGHT = 8.6
#: Number of points per turn at which the curves of laws are drawn.
SAMPLES = 1441
#: Line style of curves of the start law (the law that the design starts from), and of bounds.
START: dict[str, Any] = {"color": "0.45", "ls": "--", "lw": 1.2}
#: Line style of curves of the designed law.
DESIGNED: dict[str, Any] = {"color": series(0)["color"], "lw": 1.4}


@styled
def figure(design: LawDesign) -> Figure:
    """Draw the start law and the designed law for comparison.

    The panels are lift, velocity, acceleration, jerk, contact force and cam contour.
    """
    out = empty(HEIGHT)
    names = [[f"order {k}"] * 2 for k in range(4)] + [["force", "contour"]] * 2
    panels = out.subplot_mosaic(names, height_ratios=[1.0, 1.0, 1.0, 1.0, 0.9, 0.9])  # type: ignore[arg-type]
    laws = ((design.start, "start", START), (design.law, "designed", DESIGNED))
    for law, label, style in laws:
        curves = cam_curves(label, law)
        for order in range(4):
            axes = panels[f"order {order}"]
            axes.plot(curves.x, curves.motion[order] * MM, label=label, **style)
            axes.set_ylabel(f"{DERIVATIVE_NAMES[order]}\n[mm{PER_RADIAN[order]}]")
            turn_axis(axes, 30)
            axes.tick_params(labelbottom=order == 3)
    _force(panels["force"], design, laws)
    _contour(panels["contour"], design, laws)
    panels["order 0"].legend(loc="upper left", frameon=False)
    panels["order 0"].set_title(f"{short(design.cam.title)}: {design.request.words}", wrap=True)
    panels["order 3"].set_xlabel(CAM_ANGLE)
    return out


@styled
def front_figure(front: Front) -> Figure:
    """Draw a Pareto front: the best goal over the limited other quantity.

    If the goal is convex, the proved bound of the class of laws is drawn too.
    """
    out = empty(4.0)
    axes = out.subplots()
    goal, other = front.designs[0].goal, front.other
    x = np.array(front.allowed) / other.quantity.factor
    values = [(design.goal.result, design.goal.bound) for design in front.designs]
    result, bound = np.array(values, dtype=np.float64).T / goal.term.quantity.factor
    if not np.isnan(bound).all():  # only a convex goal has bounds
        axes.plot(x, bound, label="bound of the class", **START)
    axes.plot(x, result, "o", ms=3.5, label="designed", **DESIGNED)
    axes.set_xlabel(f"{other.words} [{other.quantity.typeset}]")
    axes.set_ylabel(f"{goal.term.words}\n[{goal.term.quantity.typeset}]")
    axes.legend(frameon=False)
    return out


def _force(axes: Axes, design: LawDesign, laws: tuple[tuple[Law, str, Any], ...]) -> None:
    """Draw the contact force (N) of one rigid mass for the start and the designed law.

    The speed is the jump speed (lowest speed with loss of contact) of the designed law, or that of
    the start law if the former is infinite. ``laws`` contains law, label and line style.
    """
    follower = FollowerParameters.from_rig(design.rig)
    speed = rigid_jump_speed(design.law, follower)
    if not np.isfinite(speed):
        speed = rigid_jump_speed(design.start, follower)
    angle = np.linspace(0.0, TURN, SAMPLES)
    for law, _, style in laws:
        force = force_weights(follower, speed) @ law.motion_at(angle) + follower.preload
        axes.plot(np.degrees(angle), force, **style)
    axes.axhline(0.0, color="0.3", lw=0.8)
    axes.set_ylabel("contact force [N]")
    axes.set_xlabel(CAM_ANGLE)
    axes.set_title(f"rigid, {to_rpm(speed):.4g} rpm")
    turn_axis(axes, 90)


def _contour(axes: Axes, design: LawDesign, laws: tuple[tuple[Law, str, Any], ...]) -> None:
    for law, _, style in laws:
        for contour in contours(design.cam.follower, law, SAMPLES - 1):
            x, y = contour.points * MM
            axes.plot(np.append(x, x[0]), np.append(y, y[0]), **style)
    axes.plot(0.0, 0.0, "+", color="0.3")
    axes.set_aspect("equal")
    axes.set_title("contour [mm]")

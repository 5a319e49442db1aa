"""Drawings of cam, follower, gap and force at one time, and of curves over a turn.

They use matplotlib.
"""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from cam_rig.profile.contact import Motion
from cam_rig.profile.outlines import follower_shape
from cam_rig.profile.shapes import circle, close_outline, rotate
from cam_rig.show import looks as colours
from cam_rig.show.figure import CAM_ANGLE, shade, turn_axis
from cam_rig.show.looks import MM, of_cam, web
from cam_rig.simulation.scene import FORCE_ARROW_RATIO, LoadedScene, max_contact_force
from cam_rig.units import FloatArray
from cam_rig.viewer.timeline import Turn
from tools.docs.turn_archive import TurnArchive, gap


def draw_rig(axes: Axes, archive: TurnArchive, turn: Turn, sample: int) -> list[Artist]:
    """Draw cam and follower at a sample of a turn (mm), and return the artists."""
    loaded, cam = archive.loaded, archive.loaded.cams[turn.cam]
    law = loaded.laws[turn.cam]
    shape = follower_shape(cam, law)
    angle, lift = turn.angle[sample : sample + 1], turn.lift[sample : sample + 1]
    motion = Motion.at(law, angle)
    point, normal = shape.contact(motion)
    drawn: list[Artist] = []

    def line(points: FloatArray, colour: int, width: float = 1.4) -> None:
        drawn.extend(axes.plot(*(points * MM).T, color=web(colour), lw=width))

    outline = rotate(close_outline(archive.profiles[turn.cam]), float(angle[0]))
    line(outline, of_cam(turn.cam), 2.0)
    line(np.stack([np.zeros(2), outline[0]]), of_cam(turn.cam), 0.8)
    line(circle(cam.follower.base_radius.si), colours.GREY, 0.6)
    for strip in shape.support():
        line(strip, colours.GREY, 0.8)
    for strip in shape.outline():
        tilt, origin = float(shape.turn(lift)[0]), shape.origin(lift)[0]
        line(rotate(strip, tilt) + origin, colours.FOLLOWER, 1.6)
    force = float(turn.force[sample])
    if force == 0.0:
        line(np.concatenate([point, shape.carried(point, motion.s, lift)]), colours.GAP, 4.0)
    else:
        along = float(np.sum(normal * shape.upward(motion.s)))
        most = max_contact_force(loaded, turn.cam, turn.speed)
        arrow = normal[0] * force / along * FORCE_ARROW_RATIO * shape.reach / most
        drawn.append(
            axes.annotate(
                "",
                (point[0] + arrow) * MM,
                point[0] * MM,
                annotation_clip=False,
                arrowprops={"arrowstyle": "-|>", "color": web(colours.FORCE), "lw": 2.0},
            )
        )
    return drawn


def frame_rig(axes: Axes, archive: TurnArchive, turn: Turn) -> None:
    """Set the limits to the complete cam and follower, and hide the axes."""
    law = archive.loaded.laws[turn.cam]
    side = follower_shape(archive.loaded.cams[turn.cam], law).reach * MM
    low = 1.05 * float(np.hypot(*archive.profiles[turn.cam].T).max()) * MM
    axes.set(xlim=(-1.1 * side, 1.1 * side), ylim=(-low, 1.55 * side), aspect="equal")
    axes.set_axis_off()


def degrees(turn: Turn) -> FloatArray:
    """Return the cam angles within the turn, from 0, ``(n,)``."""
    return np.asarray(np.degrees(turn.angle - turn.angle[0]))


def draw_curves(lift: Axes, force: Axes, loaded: LoadedScene, turn: Turn) -> list[Line2D]:
    """Draw the lift of law and follower and the contact force over a turn.

    The result is the cursor lines of both plots.
    """
    x, law = degrees(turn), loaded.laws[turn.cam](turn.angle)
    lift.plot(x, turn.lift * MM, color=web(colours.LIFT), lw=2.4, label="follower")
    lift.plot(x, law * MM, "--", color=web(colours.LAW), lw=1.0, label="law")
    force.plot(x, turn.force, color=web(colours.FORCE), lw=1.4)
    off = gap(loaded, turn) > 0.0
    for axes in (lift, force):
        shade(axes, x, off)
        turn_axis(axes, 90)
    force.axhline(0.0, color=web(colours.ZERO), lw=0.8)
    lift.set(ylabel="lift s [mm]")
    lift.set_ylim(top=1.45 * MM * float(turn.lift.max()))  # room for the legend
    lift.legend(loc="upper center", ncols=2, handlelength=1.8)
    force.set(ylabel="contact force [N]", xlabel=CAM_ANGLE)
    return [axes.axvline(0.0, color="0.3", lw=1.0) for axes in (lift, force)]

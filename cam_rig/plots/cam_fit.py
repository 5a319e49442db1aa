"""A fit over the cam angle: readings and lift, what is between them, and the acceleration."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.drawing.colours import CAMS, web
from cam_rig.plots.figures import CAM_ANGLE, empty, turn_axis, write
from cam_rig.studies.cam_fit.arcs_fit import ArcsFit
from cam_rig.studies.cam_fit.spline_fit import SplineFit
from cam_rig.units import TURN

#: Points of a drawn curve over the turn.
POINTS = 3601
GREY = "0.8"


def draw(fit: SplineFit | ArcsFit, path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    write(_arcs(fit) if isinstance(fit, ArcsFit) else _spline(fit), path)


def _spline(fit: SplineFit) -> Figure:
    """Lift, distance and acceleration; dwells are shaded."""
    out = empty(8.0, 8.0)
    lift, away, bend = out.subplots(3, 1, sharex=True)
    angles, colour = np.linspace(0.0, TURN, POINTS), web(CAMS[0])
    degrees, readings = np.degrees(angles), fit.readings
    lift.plot(degrees, fit.law(angles) * 1e3, color=colour)
    lift.plot(np.degrees(readings.angles), readings.lifts * 1e3, ".", color="k", ms=3)
    for slip in readings.slips:
        lift.plot(np.degrees(slip.angle), (slip.lift - fit.zero) * 1e3, "x", color="r")
    distance = (readings.lifts - fit.law(readings.angles)) * 1e3
    away.plot(np.degrees(readings.angles), distance, ".", color="k", ms=3)
    away.axhspan(-fit.tolerance * 1e3, fit.tolerance * 1e3, color=GREY, lw=0)
    bend.plot(degrees, fit.law(angles, 2) * 1e3, color=colour)
    for axes in (lift, bend):
        for dwell in fit.dwells:
            start, stop = np.degrees([dwell.rest.start, dwell.rest.start + dwell.rest.span])
            axes.axvspan(start, min(stop, 360.0), color=GREY, lw=0, zorder=0)
            axes.axvspan(0.0, max(stop - 360.0, 0.0), color=GREY, lw=0, zorder=0)
    _name((lift, "lift [mm]"), (away, "reading − law [mm]"), (bend, "acceleration s″ [mm/rad²]"))
    lift.set_title(f"{readings.name}: dwells shaded; below, the distance allowed")
    turn_axis(bend, 30)
    bend.set_xlabel(CAM_ANGLE)
    return out


def _arcs(fit: ArcsFit) -> Figure:
    """Lift of each follower, and distance of its readings; the nose is at 180°."""
    out = empty(8.0, 6.4)
    lift, away = out.subplots(2, 1, sharex=True)
    angles = np.linspace(0.0, TURN, POINTS)
    for i, column in enumerate(fit.columns):
        colour, readings = web(CAMS[i % len(CAMS)]), column.readings
        own = -readings.angles if column.reverse else readings.angles
        from_nose = np.degrees((own - fit.arcs.nose_angle + 0.5 * TURN) % TURN)
        curve = fit.arcs.lifts(column.follower, angles + fit.arcs.nose_angle - 0.5 * TURN)
        lift.plot(np.degrees(angles), curve * 1e3, color=colour, label=column.kind)
        lift.plot(from_nose, readings.lifts * 1e3, ".", color=colour, ms=4)
        away.plot(from_nose, -column.away * 1e3, ".", color=colour, label=readings.name)
    away.axhline(0.0, color=GREY, zorder=0)
    _name((lift, "lift [mm]"), (away, "reading − arcs [mm]"))
    for axes in (lift, away):
        axes.legend(frameon=False)
    turn_axis(away, 30)
    away.set_xlabel(CAM_ANGLE)
    return out


def _name(*panels: tuple[Axes, str]) -> None:
    for axes, label in panels:
        axes.set_ylabel(label)

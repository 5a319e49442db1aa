"""Figures of a fit: lift over the cam angle, readings and residuals."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from cam_rig.show.figure import CAM_ANGLE, empty, series, styled, turn_axis, wrapped
from cam_rig.studies.fit_cam.arcs_fit import ArcsFit
from cam_rig.studies.fit_cam.spline_fit import SplineFit
from cam_rig.units import TURN

#: Number of points of a fitted curve over one turn, and the grey level of shaded areas.
FIT_POINTS, SHADE = 3601, "0.8"


@styled
def spline_figure(fit: SplineFit) -> Figure:
    """Return the figure of a spline: lift, residuals and acceleration.

    Dwells are shaded, and so is the range of residuals within the tolerance.
    """
    out = empty(6.7)
    lift, away, acceleration = out.subplots(3, 1, sharex=True)
    angles, colour = np.linspace(0.0, TURN, FIT_POINTS), series(0)["color"]
    degrees, readings = np.degrees(angles), fit.readings
    lift.plot(degrees, fit.law(angles) * 1e3, color=colour)
    lift.plot(np.degrees(readings.angles), readings.lifts * 1e3, ".", color="k", ms=3)
    for outlier in readings.outliers:
        lift.plot(np.degrees(outlier.angle), (outlier.lift - fit.zero) * 1e3, "x", color="r")
    distance = (readings.lifts - fit.law(readings.angles)) * 1e3
    away.plot(np.degrees(readings.angles), distance, ".", color="k", ms=3)
    away.axhspan(-fit.tolerance * 1e3, fit.tolerance * 1e3, color=SHADE, lw=0)
    acceleration.plot(degrees, fit.law(angles, 2) * 1e3, color=colour)
    for axes in (lift, acceleration):
        for dwell in fit.dwells:
            start, stop = np.degrees([dwell.rest.start, dwell.rest.start + dwell.rest.span])
            axes.axvspan(start, min(stop, 360.0), color=SHADE, lw=0, zorder=0)
            axes.axvspan(0.0, max(stop - 360.0, 0.0), color=SHADE, lw=0, zorder=0)
    lift.set_ylabel("lift [mm]")
    away.set_ylabel("reading − law [mm]")
    acceleration.set_ylabel("acceleration s″ [mm/rad²]")
    lift.set_title(wrapped(f"{readings.name}: dwells shaded; below, the distance allowed"))
    turn_axis(acceleration, 30)
    acceleration.set_xlabel(CAM_ANGLE)
    return out


@styled
def arcs_figure(fit: ArcsFit) -> Figure:
    """Return the figure of tangent arcs: lift and residuals of each follower.

    The nose is at 180°.
    """
    out = empty(5.4)
    lift, away = out.subplots(2, 1, sharex=True)
    angles = np.linspace(0.0, TURN, FIT_POINTS)
    for i, column in enumerate(fit.fitted_columns):
        colour, readings = series(i)["color"], column.readings
        own = -readings.angles if column.reverse else readings.angles
        from_nose = np.degrees((own - fit.arcs.nose_angle + 0.5 * TURN) % TURN)
        curve = fit.arcs.lifts(column.follower, angles + fit.arcs.nose_angle - 0.5 * TURN)
        lift.plot(np.degrees(angles), curve * 1e3, color=colour, label=column.kind)
        lift.plot(from_nose, readings.lifts * 1e3, ".", color=colour, ms=4)
        away.plot(from_nose, -column.away * 1e3, ".", color=colour, label=readings.name)
    away.axhline(0.0, color=SHADE, zorder=0)
    lift.set_ylabel("lift [mm]")
    away.set_ylabel("reading − arcs [mm]")
    for axes in (lift, away):
        axes.legend(frameon=False)
    turn_axis(away, 30)
    away.set_xlabel(CAM_ANGLE)
    return out

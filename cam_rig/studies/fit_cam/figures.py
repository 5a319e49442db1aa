"""Figures of a fitted cam over the cam angle: lift, readings and residuals."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from cam_rig.show.figure import CAM_ANGLE, empty, series, styled, turn_axis, wrapped
from cam_rig.studies.fit_cam.arcs.result import ArcsFit
from cam_rig.studies.fit_cam.spline_fit import SplineFit
from cam_rig.units import TURN

#: Number of points of a fitted curve over one turn: ten per degree.
CURVE_POINTS = 3601
#: Grey level of shaded areas (0 black, 1 white), on which curves and readings are visible.
SHADE_GREY = "0.8"


@styled
def spline_figure(fit: SplineFit) -> Figure:
    """Draw lift, residuals and acceleration of a fitted spline over the cam angle.

    Dwells are shaded, and so is the range of residuals within the tolerance.
    """
    figure = empty(6.7)
    lift, residual, acceleration = figure.subplots(3, 1, sharex=True)
    angles, colour = np.linspace(0.0, TURN, CURVE_POINTS), series(0)["color"]
    degrees, readings = np.degrees(angles), fit.readings
    lift.plot(degrees, fit.law(angles) * 1e3, color=colour)
    lift.plot(np.degrees(readings.angles), readings.lifts * 1e3, ".", color="k", ms=3)
    for outlier in readings.outliers:
        lift.plot(np.degrees(outlier.angle), (outlier.lift - fit.zero) * 1e3, "x", color="r")
    distances = (readings.lifts - fit.law(readings.angles)) * 1e3
    residual.plot(np.degrees(readings.angles), distances, ".", color="k", ms=3)
    residual.axhspan(-fit.tolerance * 1e3, fit.tolerance * 1e3, color=SHADE_GREY, lw=0)
    acceleration.plot(degrees, fit.law(angles, 2) * 1e3, color=colour)
    for axes in (lift, acceleration):
        for dwell in fit.dwells:
            start, stop = np.degrees([dwell.rest.start, dwell.rest.start + dwell.rest.span])
            axes.axvspan(start, min(stop, 360.0), color=SHADE_GREY, lw=0, zorder=0)
            axes.axvspan(0.0, max(stop - 360.0, 0.0), color=SHADE_GREY, lw=0, zorder=0)
    lift.set_ylabel("lift [mm]")
    residual.set_ylabel("reading − law [mm]")
    acceleration.set_ylabel("acceleration s″ [mm/rad²]")
    lift.set_title(wrapped(f"{readings.name}: dwells shaded; below, the residual allowed"))
    turn_axis(acceleration, 30)
    acceleration.set_xlabel(CAM_ANGLE)
    return figure


@styled
def arcs_figure(fit: ArcsFit) -> Figure:
    """Draw lift and residuals of fitted tangent arcs for each follower.

    The nose is at 180°.
    """
    figure = empty(5.4)
    lift, residual = figure.subplots(2, 1, sharex=True)
    angles = np.linspace(0.0, TURN, CURVE_POINTS)
    for i, column in enumerate(fit.fitted_columns):
        colour, readings = series(i)["color"], column.readings
        angles_as_turned = -readings.angles if column.is_reversed else readings.angles
        from_nose = np.degrees((angles_as_turned - fit.arcs.nose_angle + 0.5 * TURN) % TURN)
        curve = fit.arcs.lifts(column.follower, angles + fit.arcs.nose_angle - 0.5 * TURN)
        lift.plot(np.degrees(angles), curve * 1e3, color=colour, label=column.kind)
        lift.plot(from_nose, readings.lifts * 1e3, ".", color=colour, ms=4)
        residual.plot(from_nose, -column.residuals * 1e3, ".", color=colour, label=readings.name)
    residual.axhline(0.0, color=SHADE_GREY, zorder=0)
    lift.set_ylabel("lift [mm]")
    residual.set_ylabel("reading − arcs [mm]")
    for axes in (lift, residual):
        axes.legend(frameon=False)
    turn_axis(residual, 30)
    residual.set_xlabel(CAM_ANGLE)
    return figure

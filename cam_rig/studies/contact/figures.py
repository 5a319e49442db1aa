"""Figures of Hertz pressure and sliding, and nomogram of base radius over event angle."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.profile.contact import turn_angles
from cam_rig.show.figure import CAM_ANGLE, empty, line, logarithmic, styled, turn_axis
from cam_rig.show.looks import LIMIT, in_words, short, web
from cam_rig.studies.contact import surfaces
from cam_rig.studies.contact.study import CamContact, ContactResult
from cam_rig.studies.contact.surfaces import Measure, measured, peak_pressure, peak_sliding
from cam_rig.units import FloatArray

#: Number of cam angles of a drawn curve over one turn.
CURVE_POINTS = 1440
#: Number of base radii at which a curve over the base radius is computed.
RADII = 36
#: Smallest base radius of a curve over the base radius, relative to that of the cam.
MIN_RATIO = 0.25
#: Largest base radius of a curve over the base radius, relative to that of the cam.
MAX_RATIO = 3.0
#: Largest number of letters of a legend entry with which the legend has three columns. With longer
#: entries it has two.
LETTERS = 32
#: Event angles (spans of a rise) of the nomogram, degrees.
EVENTS = np.linspace(30.0, 180.0, 151)


@styled
def figure(result: ContactResult) -> Figure:
    """Draw pressure and sliding over the turn, and their maxima over the base radius.

    The base radius of each cam is marked. Dashed lines are the permissible values.
    """
    rows = result.rows
    fig = empty(5.6)
    panels = fig.subplots(2, 2)
    for row in rows:
        style = line(row.case.cam.name)
        _over_turn(panels[:, 0], row, style)
        _over_base(panels[0, 1], row, style, peak_pressure, 1e-6)
        if not row.case.surfaces.rolls:
            _over_base(panels[1, 1], row, style, peak_sliding, 1.0)
    for axes in panels[:, 0]:
        turn_axis(axes)
    parts = [row.case.cam.parts for row in rows]
    _limit(panels[0, 1], {1e-6 * part.most_pressure.si for part in parts}, "most pressure", "MPa")
    if not all(row.case.surfaces.rolls for row in rows):
        _limit(
            panels[1, 1],
            {part.most_sliding_speed.si for part in parts},
            "most sliding speed",
            "m/s",
        )
    else:
        panels[1, 1].text(0.5, 0.5, "rollers roll", ha="center", transform=panels[1, 1].transAxes)
    panels[0, 0].set(ylabel="Hertz pressure p₀ [MPa]", title="over the turn")
    panels[1, 0].set(ylabel="surface speed [m/s]", xlabel=CAM_ANGLE)
    panels[0, 1].set(ylabel="largest p₀ [MPa]", yscale="log", title="over the base radius")
    logarithmic(panels[0, 1].yaxis)
    panels[1, 1].set(ylabel="largest sliding speed [m/s]", xlabel="base radius $R_b$ [mm]")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    columns = 3 if max(map(len, labels)) <= LETTERS else 2
    fig.legend(handles, labels, loc="outside lower center", ncols=columns)
    fig.suptitle(f"Contact at {result.rpm:g} rpm, rig: {in_words(result.rig)}")
    return fig


def _over_turn(panels: FloatArray, row: CamContact, style: dict[str, Any]) -> None:
    """Draw pressure (MPa) and sliding speed (m/s) of a cam over the turn."""
    motion_touch = row.case.at(turn_angles(CURVE_POINTS))
    surfaces, degrees = row.case.surfaces, np.degrees(motion_touch[0].angle)
    name = f"{short(row.case.cam.title)} ({row.case.cam.follower.type.replace('_', ' ')})"
    panels[0].plot(degrees, 1e-6 * surfaces.pressure(*motion_touch), label=name, **style)
    panels[1].plot(degrees, surfaces.sliding(*motion_touch), **style)


def _over_base(
    axes: Axes, row: CamContact, style: dict[str, Any], measure: Measure, factor: float
) -> None:
    """Draw the largest value of a quantity over the base radius of a cam.

    ``measure`` returns the value over a turn in SI, and ``factor`` converts it to the displayed
    unit. A mark shows the present base radius of the cam.
    """
    cam_radius = row.case.cam.follower.base_radius.si
    base = cam_radius * np.geomspace(MIN_RATIO, MAX_RATIO, RADII)
    values = [measured(row.case, measure, float(radius)) for radius in base]
    displayed = [math.nan if v is None or math.isinf(v) else factor * v for v in values]
    axes.plot(1e3 * base, displayed, **style)
    cam_value = measured(row.case, measure, cam_radius)
    assert cam_value is not None
    axes.plot(1e3 * cam_radius, factor * cam_value, "o", color=style["color"], ms=5)


def _limit(axes: Axes, values: set[float], name: str, unit: str) -> None:
    """Draw permissible values as dashed lines, with an entry in the legend.

    ``values`` are in the displayed unit ``unit``, and ``name`` is the name of the limited quantity.
    """
    for value in sorted(values):
        axes.axhline(value, color=web(LIMIT), ls="--", label=f"{name}, {value:g} {unit}")
    axes.legend(loc="best")


@styled
def events_figure(most: float, radius: float) -> Figure:
    """Draw the nomogram of cam sizes: smallest base radius over the span of a rise, by law.

    Radii are multiples of the lift h. An event is a rise or a fall. ``most`` is the largest allowed
    pressure angle in rad. ``radius`` is the sum of roller radius and smallest allowed radius of
    curvature of the contour, in lifts.
    """
    event = np.radians(EVENTS)
    fig = empty(3.6)
    panels = fig.subplots(1, 3)
    for name in surfaces.RISES:
        curves = (
            surfaces.by_pressure_angle(name, event, most),
            surfaces.by_curvature(name, event, radius),
            surfaces.by_face(name, event),
        )
        for axes, curve in zip(panels, curves, strict=True):
            axes.plot(EVENTS, curve, label=in_words(name), **line(name))
    titles = (
        f"roller: pressure angle\nat most {math.degrees(most):g}°",
        f"roller: pitch curve\nnot sharper than {radius:g} h",
        "flat: radius of curvature\nat least $ρ_{min}$",
    )
    names = ("least ($R_b + R_r$) / h", "least ($R_b + R_r$) / h", "least ($R_b − ρ_{min}$) / h")
    for axes, title, name in zip(panels, titles, names, strict=True):
        axes.set(title=title, ylabel=name, xlabel="event angle β [°]", xlim=(30.0, 180.0))
        axes.set(xticks=range(30, 181, 30), ylim=(-0.5, 8.0))
    fig.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return fig

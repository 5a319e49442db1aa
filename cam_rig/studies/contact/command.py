"""Command ``cam-rig contact``: Hertz pressure and sliding of cams."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from cam_rig.errors import ConfigError
from cam_rig.show.command import CamsOrScene, RigOfScene, check_outputs, command, write_plot
from cam_rig.show.result import Result

#: Default speed of the cam, rpm. It is below the jump speed of every cam of the default set.
CONTACT_RPM = 300.0


Events = Annotated[
    Path | None,
    typer.Option("--events", help="Draw the least base radius over the event angle, by law."),
]


Rpm = Annotated[float, typer.Option(min=0.0, max=1e5, help="Speed of the cam.")]


PressureAngle = Annotated[
    float,
    typer.Option(metavar="DEG", min=1.0, max=89.0, help="Pressure angle of --events."),
]


MinRadius = Annotated[
    float,
    typer.Option(
        metavar="LIFTS",
        min=0.0,
        max=100.0,
        help="Roller radius plus least radius of --events, in lifts.",
    ),
]


#: Default largest allowed pressure angle of the nomogram (radii over the span of a rise), degrees.
MAX_PRESSURE_ANGLE = 30.0
#: Default sum of roller radius and smallest allowed radius of curvature of the cam contour in the
#: nomogram, in units of the lift.
MIN_RADIUS = 2.0


@command("json", "csv", "plot")
def contact(
    cams: CamsOrScene = None,
    rig: RigOfScene = None,
    rpm: Rpm = CONTACT_RPM,
    events: Events = None,
    pressure_angle: PressureAngle = MAX_PRESSURE_ANGLE,
    min_radius: MinRadius = MIN_RADIUS,
) -> Result:
    """Find Hertz pressure, sliding speed and bounds on the base radius.

    The follower is rigid, in contact and without friction. Face width, material, tip radius of a
    point and permissible values are under contact in the cam file. Missing values are assumed and
    listed. Pressure, curvature and pressure angle give lower bounds on the base radius, and sliding
    gives an upper bound. --events draws the nomogram: least radii in lifts over the event angle.

    In Python: cam_rig.contact_stress(cams, rig, rpm, pressure_angle)

    Examples
    --------
    cam-rig contact flat oscillating_point --rpm 400

    cam-rig contact --events out/events.png --plot out/contact.png
    """
    from cam_rig.studies.contact import study

    check_outputs(None, events)
    if events is None and (pressure_angle, min_radius) != (MAX_PRESSURE_ANGLE, MIN_RADIUS):
        raise ConfigError("--pressure-angle and --min-radius require --events")
    max_angle = math.radians(pressure_angle)
    nomogram_angle = None if events is None else max_angle
    result = study.contact_stress(cams, rig, rpm, pressure_angle=nomogram_angle)
    if events is not None:
        from cam_rig.studies.contact.figures import events_figure

        write_plot(events, lambda: events_figure(max_angle, min_radius))
    return result

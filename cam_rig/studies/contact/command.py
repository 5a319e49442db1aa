"""The command ``cam-rig contact``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from cam_rig.errors import ConfigError
from cam_rig.show.command import CamsOrScene, RigOfScene, check_outputs, command, write_plot
from cam_rig.show.result import Result

#: Speed of contact: below every jump speed of the paper's laws.
CONTACT_RPM = 300.0


Events = Annotated[
    Path | None,
    typer.Option("--events", help="Draw the least base radius over the event angle, law by law."),
]


Rpm = Annotated[float, typer.Option(min=0.0, max=1e5, help="Speed of the cam.")]


Steepest = Annotated[
    float, typer.Option(metavar="DEG", min=1.0, max=89.0, help="Most pressure angle of --events.")
]


Sharpest = Annotated[
    float,
    typer.Option(
        metavar="LIFTS", min=0.0, max=100.0, help="Roller and least radius of --events, in lifts."
    ),
]


#: Pressure angle (degrees) of the nomogram, and its roller and least radius in lifts.
STEEPEST, SHARPEST = 30.0, 2.0


@command("json", "csv", "plot")
def contact(
    cams: CamsOrScene = None,
    rig: RigOfScene = None,
    rpm: Rpm = CONTACT_RPM,
    events: Events = None,
    pressure_angle: Steepest = STEEPEST,
    sharpest: Sharpest = SHARPEST,
) -> Result:
    """Find Hertz pressure and sliding speed over the turn, and the bounds on the base radius.

    A rigid follower in contact, without friction. Face width, material, tip radius of a point and
    what is permissible stand under contact in the cam file; what it does not give is assumed, and
    is listed. From below the base radius is bounded by pressure, curvature and pressure angle, from
    above by sliding. --events draws the nomogram: least radii in lifts over the event angle.

    In Python: cam_rig.contact(cams, rig, rpm, pressure_angle)

    Examples
    --------
    cam-rig contact flat oscillating_point --rpm 400

    cam-rig contact --events out/events.png --plot out/contact.png
    """
    from cam_rig.studies.contact import study

    check_outputs(None, events)
    if events is None and (pressure_angle, sharpest) != (STEEPEST, SHARPEST):
        raise ConfigError(
            "--pressure-angle, --sharpest: are of the nomogram; needed: --events PATH"
        )
    most = math.radians(pressure_angle)
    steepest = None if events is None else most
    found = study.contact(cams, rig, rpm, pressure_angle=steepest)
    if events is not None:
        from cam_rig.studies.contact.figures import events_figure

        write_plot(events, lambda: events_figure(most, sharpest))
    return found

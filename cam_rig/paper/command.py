"""Commands of the general experiments; that of noise is next to its study."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from cam_rig.errors import ConfigError
from cam_rig.paper.orders import MAX_ORDERS
from cam_rig.show.command import (
    CamsOrScene,
    RigOfScene,
    check_outputs,
    check_recording,
    command,
    write_plot,
)
from cam_rig.show.result import Progress, Result
from cam_rig.show.terminal import say

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
    from cam_rig.paper.contact import comparison

    check_outputs(None, events)
    if events is None and (pressure_angle, sharpest) != (STEEPEST, SHARPEST):
        raise ConfigError(
            "--pressure-angle, --sharpest: are of the nomogram; needed: --events PATH"
        )
    most = math.radians(pressure_angle)
    steepest = None if events is None else most
    found = comparison.contact(cams, rig, rpm, pressure_angle=steepest)
    if events is not None:
        from cam_rig.paper.contact.figures import events_figure

        write_plot(events, lambda: events_figure(most, sharpest))
    return found


@command("json", "csv", "plot")
def jump(
    cams: CamsOrScene = None,
    rig: RigOfScene = None,
    from_rest: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS", help="Length of the run from rest, at one speed: 1.7, to 60 s."
        ),
    ] = None,
    steady: Annotated[bool, typer.Option("--steady", help="In steady state instead.")] = False,
    ramp: Annotated[
        float | None, typer.Option(metavar="RPM/S", help="Along a ramp instead, 1 to 1e5.")
    ] = None,
    refit: Annotated[
        bool, typer.Option("--refit", help="Fit the rig's unprinted numbers anew (a minute).")
    ] = False,
    *,
    plot: Path | None,
    progress: Progress,
) -> Result:
    """Find the jump speed of cams to 0.01 rpm, beside the paper's Table 2.

    The follower is two masses where the rig says how they split, else one rigid mass: from rest at
    cam angle 0, in steady state, or along a ramp. Angle and time are of the first lift-off.

    In Python: cam_rig.jump(cams, rig, from_rest, steady, ramp, refit)

    Examples
    --------
    cam-rig jump --plot out/jump.png

    cam-rig jump poly345 bezier15 --steady --json -

    cam-rig jump quick --rig tm21 --ramp 350
    """
    from cam_rig.paper.jump import refit as study

    if plot is not None and ramp is not None:
        raise ConfigError(
            "--plot shows the least force of speeds that are held, and --ramp holds none; "
            "allowed: one of them"
        )
    if plot is not None and refit:
        raise ConfigError("--refit: is not drawn; allowed: without --plot")
    return study.jump(
        cams, rig, from_rest=from_rest, steady=steady, ramp=ramp, refit=refit, progress=progress
    )


@command("json", "csv", "plot")
def vibration(
    cams: CamsOrScene = None,
    rig: RigOfScene = None,
    rpm: Annotated[list[float] | None, typer.Option(help="Speed; may be given often.")] = None,
    *,
    progress: Progress,
) -> Result:
    """Measure residual vibration in the low dwell, peak acceleration, and twist of the shaft.

    Eq. 5 and eq. 10 of the paper, in steady state. The residual amplitude is of the free vibration
    that a law's joints excite; a law without a low dwell is read within 31.25° of its lowest lift.
    † marks cams whose follower loses contact below a speed: the model holds it on, and the paper's
    claims are tested without that speed. The plot shows the last speed. By default up to four
    speeds of a scene; 200, 250, 300 and 350 rpm, below every jump speed of the paper's laws.

    In Python: cam_rig.vibration(cams, rig, rpm)

    Examples
    --------
    cam-rig vibration --plot out/vibration.png

    cam-rig vibration poly345 poly4567 --rig tm21 --rpm 300 --json -

    cam-rig vibration quick --rig paper_table2
    """
    from cam_rig.paper.vibration import study

    return study.vibration(cams, rig, rpm or None, progress=progress)


Source = Annotated[
    str, typer.Argument(metavar="CAM|SCENE", help="Cam or scene: a file, or a name in config.")
]
Speeds = Annotated[
    str | None, typer.Option(help="Speeds: 300, or 200,300, or 200:400:10; by default the scene's.")
]
OneCam = Annotated[str | None, typer.Option(help="One cam of a scene; by default all.")]
OwnRig = Annotated[
    str | None,
    typer.Option(
        help="Rig file, or a name in config/rigs; by default the scene's, for a cam the only one "
        "in rigs beside it, else tm21."
    ),
]
OwnModel = Annotated[
    str | None, typer.Option(help="Model, as in a scene (two_mass); by default the scene's.")
]
Highest = Annotated[int, typer.Option("--orders", min=1, max=MAX_ORDERS, help="Highest order.")]
Save = Annotated[
    Path | None, typer.Option(help="Write a Rerun recording (.rrd): diagram and spectra.")
]


@command("json", "csv", "plot")
def orders(
    source: Source,
    rpm: Speeds = None,
    cam: OneCam = None,
    rig: OwnRig = None,
    model: OwnModel = None,
    highest: Highest = 100,
    save: Save = None,
    *,
    progress: Progress,
) -> Result:
    """Find the spectrum of force and sound by orders of the cam: exact, without leakage.

    An order is a frequency as a multiple of the cam's. The Fourier coefficients of the steady
    turn are closed forms, those of landings too. A cam alone is put on one mass, at 200 to 400
    rpm. The plot has the orders as rays over speed (Campbell diagram), of one speed as lines; the
    CSV has every order.

    In Python: cam_rig.orders(source, rpm, cam, rig, model, orders)

    Examples
    --------
    cam-rig orders poly345 --rpm 400

    cam-rig orders tm21_sweep --cam tm21 --rpm 200:400:5 --plot out/orders.png --csv out/orders.csv

    cam-rig orders poly345 --rig paper_table2 --model two_mass --rpm 300:500:5 --save out/orders.rrd
    """
    from cam_rig.paper.orders import study
    from cam_rig.simulation.asked import speeds_in

    if save is not None:
        check_recording(save)
    speeds = None if rpm is None else speeds_in(rpm)
    found = study.orders(
        source, speeds, cam=cam, rig=rig, model=model, orders=highest, progress=progress
    )
    if save is not None:
        from cam_rig.paper.orders.chart import save_orders

        save_orders(found.studies, save, found.titles)
        say(f"recording: {save}")
    return found

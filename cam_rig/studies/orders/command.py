"""Command ``cam-rig orders``: spectrum of force and sound by orders of the cam."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cam_rig.show.command import check_recording, command
from cam_rig.show.result import Progress, Result
from cam_rig.show.terminal import say
from cam_rig.studies.orders import MAX_ORDERS

Source = Annotated[
    str, typer.Argument(metavar="CAM|SCENE", help="Cam or scene: a file, or a name in config.")
]
Speeds = Annotated[
    str | None, typer.Option(help="Speeds: 300, or 200,300, or 200:400:10 (default: the scene's).")
]
OneCam = Annotated[str | None, typer.Option(help="One cam of a scene (default: all).")]
OwnRig = Annotated[
    str | None,
    typer.Option(
        help="Rig file, or a name in config/rigs (default: the scene's, for a cam the only one "
        "in rigs next to it, else tm21)."
    ),
]
OwnModel = Annotated[
    str | None, typer.Option(help="Model, as in a scene (two_mass) (default: the scene's).")
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
    """Compute the spectrum of force and sound by orders of the cam, without leakage.

    An order is a frequency as a multiple of the cam's rotational frequency. The Fourier
    coefficients of the steady turn, including its landings, are closed forms. A cam alone is placed
    on one mass, at 200 to 400 rpm. The plot shows the orders as rays over speed (Campbell diagram),
    or as lines at one speed. The CSV file contains every order.

    In Python: cam_rig.order_spectrum(source, rpm, cam, rig, model, orders)

    Examples
    --------
    cam-rig orders poly345 --rpm 400

    cam-rig orders tm21_sweep --cam tm21 --rpm 200:400:5 --plot out/orders.png --csv out/orders.csv

    cam-rig orders poly345 --rig paper_table2 --model two_mass --rpm 300:500:5 --save out/orders.rrd
    """
    from cam_rig.simulation.inputs import parse_speeds
    from cam_rig.studies.orders import study

    if save is not None:
        check_recording(save)
    speeds = None if rpm is None else parse_speeds(rpm)
    result = study.order_spectrum(
        source, speeds, cam=cam, rig=rig, model=model, orders=highest, progress=progress
    )
    if save is not None:
        from cam_rig.studies.orders.chart import save_orders

        save_orders(result.studies, save, result.titles)
        say(f"recording: {save}")
    return result

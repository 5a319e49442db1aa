"""Command ``cam-rig compare``: comparison of a recorded run with its model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cam_rig.show.command import RigOfBag, Scene, check_recording, command
from cam_rig.show.result import Result
from cam_rig.show.terminal import say

Topics = Annotated[
    str | None,
    typer.Option(
        metavar="LINE",
        help="Topic fields in a bag of another program: QUANTITY=/TOPIC.FIELD:UNIT of angle, lift, "
        "force, level. SI without a unit.",
    ),
]
Offset = Annotated[
    float | None,
    typer.Option(
        metavar="DEG", help="Cam angle minus encoder angle (default: identified from the lift)."
    ),
]


@command("json", "csv", "plot")
def compare(
    bag: Annotated[Path, typer.Argument(help="Bag of a real run: a folder, .mcap or .db3.")],
    scene: Scene,
    topics: Topics = None,
    cam: Annotated[
        str | None,
        typer.Option(help="Cam to compare (default in a bag of another program: the mounted cam)."),
    ] = None,
    namespace: RigOfBag = None,
    offset: Offset = None,
    save: Annotated[
        Path | None, typer.Option(help="Write a Rerun recording (.rrd) of run and model.")
    ] = None,
) -> Result:
    """Compare a real run with a model that is driven with the recorded cam angle.

    The tables show lift and force, lift-offs and their time, and sound level per speed. Differences
    within the noise of the readings are marked. A bag of the rig is compared sample by sample, with
    the recorded states of the cam. In a bag of another program, each quantity is a number of a ROS
    2 message. Messages without that number, and wrong angles, are dropped and counted. The motion
    of the cam is a smooth curve through the encoder's counts. The encoder's zero and an error of
    the sensors' clock are identified from the lift. Only settled turns at steady speed are
    compared. In --topics, "-" before a topic changes the sign, and "@bag" after an item uses the
    bag's time.

    In Python: cam_rig.compare(bag, scene, topics, cam, namespace, offset_deg)

    Examples
    --------
    cam-rig compare bags/golden quick --plot out/compare.png

    cam-rig compare bench.mcap my_scene --topics "angle=/encoder.position[0] lift=/lvdt.data:mm"

    cam-rig compare two_rigs.mcap quick --namespace /rig2 --cam tm21 --save out/compare.rrd
    """
    from cam_rig.studies.compare import study

    if save is not None:
        check_recording(save)
    result = study.compare(
        bag, scene, topics=topics, cam=cam, namespace=namespace, offset_deg=offset
    )
    if save is not None:
        from cam_rig.studies.compare.chart import save_real_run

        save_real_run(result, save)
        say(f"recording: {save}")
    return result

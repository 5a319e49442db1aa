"""cam-rig compare: a recorded run beside the model, driven with the run's own cam angle."""

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
        help="Where the quantities are in a bag of another program: QUANTITY=/TOPIC.FIELD:UNIT of "
        "angle, lift, force, level; SI without a unit.",
    ),
]
Offset = Annotated[
    float | None,
    typer.Option(
        metavar="DEG", help="Cam angle less the encoder's; by default found from the lift."
    ),
]


@command("json", "csv", "plot")
def compare(
    bag: Annotated[Path, typer.Argument(help="Bag of a real run: a folder, .mcap or .db3.")],
    scene: Scene,
    topics: Topics = None,
    cam: Annotated[
        str | None, typer.Option(help="One cam; of another program's bag, the scene's that ran.")
    ] = None,
    namespace: RigOfBag = None,
    offset: Offset = None,
    save: Annotated[
        Path | None, typer.Option(help="Write a Rerun recording (.rrd): both side by side.")
    ] = None,
) -> Result:
    """Drive a scene's model with the cam angle of a real run, and show where the two part.

    By speed: lift and force, lift-offs and their time, sound level; what the readings' noise
    explains is marked. A bag of the rig itself is compared sample by sample, with the recorded
    states of the cam. In a bag of another program, each quantity is a number of a ROS 2 message.
    Messages without that number, and wrong angles, are dropped and counted. The cam follows a
    smooth motion through the encoder's counts, and the encoder's zero and an error of the sensors'
    clock are found from the lift. Only settled turns at steady speed are compared. In --topics, "-"
    before a topic turns the sign, and "@bag" behind an item takes the bag's time.

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
    found = study.compare(
        bag, scene, topics=topics, cam=cam, namespace=namespace, offset_deg=offset
    )
    if save is not None:
        from cam_rig.studies.compare.chart import save_real_run

        save_real_run(found, save)
        say(f"recording: {save}")
    return found

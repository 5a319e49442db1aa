"""cam-rig compare: a recorded run beside the model, driven with the run's own cam angle."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.cli.common.console import say, show, user_errors
from cam_rig.cli.common.names import scene_path
from cam_rig.cli.common.options import Csv, Json, Plot, Scene
from cam_rig.cli.common.outputs import (
    check_outputs,
    check_recording,
    write_csv,
    write_json,
    write_plot,
)
from cam_rig.errors import BagError, ConfigError

if TYPE_CHECKING:  # a second of imports, which `--help` should not pay
    from cam_rig.simulation.loaded_scene import LoadedScene
    from cam_rig.studies.real_run.comparison import SpeedDeparture

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
Rig = Annotated[
    str | None, typer.Option("--namespace", help="One rig of a bag that holds several: /rig2.")
]


def compare(
    bag: Annotated[Path, typer.Argument(help="Bag of a real run: a folder, .mcap or .db3.")],
    scene: Scene,
    topics: Topics = None,
    cam: Annotated[
        str | None, typer.Option(help="One cam; of another program's bag, the scene's that ran.")
    ] = None,
    namespace: Rig = None,
    offset: Offset = None,
    plot: Plot = None,
    save: Annotated[
        Path | None, typer.Option(help="Write a Rerun recording (.rrd): both side by side.")
    ] = None,
    csv: Csv = None,
    json_target: Json = None,
) -> None:
    """Drive a scene's model with the cam angle of a real run, and show where the two part.

    By speed: lift and force, lift-offs and their time, sound level; what the readings' noise
    explains is marked. A bag of the rig itself is compared sample by sample, with the recorded
    states of the cam. In a bag of another program, each quantity is a number of a standard
    message; the cam follows a smooth motion through the encoder's counts, and the encoder's zero
    and an error of the sensors' clock are found from the lift. Only settled turns at steady speed
    are compared. Behind a topic, "-" before it turns the sign, "@bag" takes the bag's time.

    Examples
    --------
    cam-rig compare bags/golden quick --plot out/compare.png

    cam-rig compare bench.mcap my_scene --topics "angle=/encoder.position[0] lift=/lvdt.data:mm"

    cam-rig compare two_rigs.mcap quick --namespace /rig2 --cam tm21 --save out/compare.rrd
    """
    with user_errors():
        from cam_rig.simulation.loaded_scene import open_scene

        check_outputs(json_target, plot, csv)
        if save is not None:
            check_recording(save)
        loaded = open_scene(scene_path(scene))
        if topics is None:
            if offset is not None:
                raise ConfigError(
                    f"--offset {offset:g}: the rig's bags have exact angles; allowed: with --topics"
                )
            rows, said = _recorded(bag, loaded, cam, namespace)
        elif namespace is not None:
            raise ConfigError(f"--namespace {namespace}: --topics names whole topics; allowed: one")
        else:
            rows, said = _measured(bag, loaded, topics, cam, offset)
        _show(rows, said, loaded, plot, save, csv, json_target)


def _recorded(
    bag: Path, loaded: LoadedScene, cam: str | None, namespace: str | None
) -> tuple[list[SpeedDeparture], list[str]]:
    """The rows of a bag of the rig, and what it lacks."""
    from cam_rig.bag.measured import own_namespace
    from cam_rig.bag.reader import read_ticks
    from cam_rig.bag.recorded_states import read_pressures, read_states
    from cam_rig.studies.real_run.comparison import compare_steps
    from cam_rig.studies.real_run.recorded_pairs import RecordedPairs

    if cam is not None:
        loaded.law_of(cam)
    rig = own_namespace(bag, namespace)
    pairs = RecordedPairs(loaded, cam)
    steps = pairs.steps(read_ticks(bag, rig), read_states(bag, rig), read_pressures(bag, rig))
    rows = compare_steps(steps, loaded.laws)
    if not rows:
        what = "settled turn" if cam is None else f"settled turn of cam {cam}"
        raise BagError(f"{bag}: holds no {what} at a steady speed to compare; run one whole step")
    lost = f"{pairs.lost} ticks have no samples in the bag: they are left out."
    return rows, [lost] if pairs.lost else []


def _measured(
    bag: Path, loaded: LoadedScene, topics: str, cam: str | None, offset: float | None
) -> tuple[list[SpeedDeparture], list[str]]:
    """The rows of a bag of another program, and what was found and done."""
    import math

    from cam_rig.bag.foreign.topic_map import parse_topics
    from cam_rig.bag.measured import read_measured
    from cam_rig.studies.real_run.comparison import compare_steps
    from cam_rig.studies.real_run.conclusions import done
    from cam_rig.studies.real_run.measured_pairs import pair_measured

    mapping = parse_topics(topics)
    there = list(loaded.laws)
    if cam is None and len(there) > 1:
        raise ConfigError(
            f"{loaded.scene_file}: has cams {', '.join(there)}; say with --cam which one ran"
        )
    known = loaded.law_of(cam or there[0]).name
    run = read_measured(bag, mapping, known)
    pairs = pair_measured(run, loaded, known, None if offset is None else math.radians(offset))
    return compare_steps(pairs.steps(), loaded.laws), [*run.notes, *done(pairs)]


def _show(
    rows: list[SpeedDeparture],
    said: list[str],
    loaded: LoadedScene,
    plot: Path | None,
    save: Path | None,
    csv: Path | None,
    json_target: str | None,
) -> None:
    from cam_rig.studies.real_run import tables
    from cam_rig.studies.real_run.conclusions import sentences

    both = [
        tables.departure_table(rows, loaded.scene.title),
        tables.event_table(rows, loaded.calibrated),
    ]
    said = [*said, *sentences(rows)]
    show(*both)
    say(*said)
    if plot is not None:
        from cam_rig.plots.measured.real_run import draw

        write_plot(plot, lambda part: draw(rows, part))
    if save is not None:
        from cam_rig.viewer.real_run import save_real_run

        save_real_run(rows, save)
        say(f"recording: {save}")
    write_csv(both, csv)
    write_json(tables.to_json(rows, said), json_target)

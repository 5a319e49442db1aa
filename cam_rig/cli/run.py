"""Commands cam-rig run and cam-rig replay, which start the node graph.

The first runs a scene and records a bag, the second replays a bag. The nodes start in the order of
`cam_rig.runner.node_table`: recorder, viewer (if requested), microphone, follower, law_server,
cam_drive. They end in reverse order.
"""

from __future__ import annotations

import os
import shlex
import shutil
import time
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.files import atomic_write, temporary_folder
from cam_rig.runner.fork_server import ForkServer
from cam_rig.show.command import (
    DEFAULT_SCENE,
    Namespace,
    OtherRig,
    Scene,
    SceneOfBag,
    command,
    make_progress_bar,
    user_errors,
    write_outputs,
)
from cam_rig.show.result import Progress, Result
from cam_rig.show.terminal import say

if TYPE_CHECKING:
    from cam_rig.bag.replay import Difference
    from cam_rig.runner.node_process import Arguments
    from cam_rig.viewer.page import PageTime

Pacing = Annotated[
    str,
    typer.Option(
        help="Real-time factor: free (as fast as possible), real_time, or a multiple such as 20x."
    ),
]
View = Annotated[bool, typer.Option("--view", help="Show the run in Rerun.")]
Web = Annotated[bool, typer.Option("--web", help="Show the run in a browser on this machine.")]
WaitForClient = Annotated[
    bool,
    typer.Option(
        "--wait-for-client", help="With --web or --view: start when the viewer is connected."
    ),
]
#: Choices of the option --discovery.
Discovery = Enum("Discovery", {"LOCALHOST": "localhost", "SUBNET": "subnet"})
DiscoveryRange = Annotated[
    Discovery,
    typer.Option("--discovery", help="Machines that discover the nodes: this one, or the subnet."),
]
MaxBagSize = Annotated[
    str | None,
    typer.Option(metavar="SIZE", help="Size after which a new file of the bag starts: 100MB."),
]
MaxBagDuration = Annotated[
    str | None,
    typer.Option(
        metavar="TIME", help="Rig time after which a new file of the bag starts: 60s, 10min."
    ),
]


def run(
    scene: Scene = DEFAULT_SCENE,
    rig: OtherRig = None,
    bag: Annotated[
        Path | None, typer.Option(help="Folder to record into, which must not exist.")
    ] = None,
    analyze: Annotated[
        bool,
        typer.Option(
            "--analyze", help="Analyse the bag after the run, and plot its noise in the folder."
        ),
    ] = False,
    view: View = False,
    web: Web = False,
    wait_for_client: WaitForClient = False,
    pacing: Pacing = "free",
    discovery: DiscoveryRange = Discovery.LOCALHOST,
    namespace: Namespace = "",
    max_bag_size: MaxBagSize = None,
    max_bag_duration: MaxBagDuration = None,
) -> None:
    """Run a scene through the node graph and record it.

    Five nodes, each in a process, run as fast as the slowest of them, or at the given pace. All of
    them end with the run, after Ctrl-C as well. Exit codes: 0 done, 1 a node failed, 2 the scene is
    wrong, 128 plus the number of a signal that ended the run (130 for Ctrl-C).

    Examples
    --------
    cam-rig run

    cam-rig run config/scenes/quick.yaml --bag bags/mine --analyze

    cam-rig run quick --rig mine/rigs/bench.yaml

    cam-rig run --view

    cam-rig run quick --web --wait-for-client --pacing real_time

    cam-rig run quick --namespace /rig1

    cam-rig run --max-bag-size 100MB
    """
    options = dict(locals())  # before any other name is assigned
    with (
        user_errors(),
        ForkServer().begin() as server,  # it imports during the checks below
        temporary_folder("cam_rig-run-") as folder,
    ):
        from cam_rig.bag.files import require_new_bag
        from cam_rig.bag.split import Split
        from cam_rig.live.flow_control import factor_of, pacing_of
        from cam_rig.runner.node_process import live_nodes
        from cam_rig.runner.resources import parse_namespace
        from cam_rig.schema.load import scene_path
        from cam_rig.viewer.command import open_screen

        path = scene_path(scene) if rig is None else _scene_on_rig(scene, rig, folder)
        factor_of(pacing := str(pacing_of(pacing)))
        limits = Split.parse(max_bag_size, max_bag_duration)
        namespace = parse_namespace(namespace)
        target = bag or Path(time.strftime(f"bags/{path.stem}_%Y-%m-%d_%H-%M-%S"))
        require_new_bag(target, limits.last_number)
        with open_screen(view, web, wait_for_client) as screen:
            nodes = live_nodes(path, target, screen.address, limits, pacing=pacing)
            repeat = _command_line(options)
            subnet = discovery == Discovery.SUBNET
            _run(path, target, nodes, subnet, namespace, server, screen.page, repeat)
            if analyze:
                print_analysis(target)
            else:
                say(f"next: cam-rig analyze {quote(target)}")
            screen.stay()


def print_analysis(bag: Path) -> None:
    """Print the summary of a bag and the next steps, and write picture and table into the bag."""
    from cam_rig.studies.simulate.bag_command import read_run

    run, picture, table = read_run(bag), bag / "noise.png", bag / "by_speed.csv"
    write_outputs(run, picture, None, None)
    with atomic_write(table) as part:
        part.write_text(run.tables()[0].to_csv(), encoding="utf-8")
    say(f"bag: {bag}", f"table by speed: {table}")
    say(f"next: cam-rig view {quote(bag)}", f"      cam-rig analyze {quote(bag)} --table")


def quote(path: Path) -> str:
    """Return a path as an argument of a shell command."""
    return shlex.quote(str(path))


def _scene_on_rig(scene: str, rig: str, folder: Path) -> Path:
    """Write the files of a scene on another rig to a folder, and return the new scene file."""
    from cam_rig.schema.load import read_yaml, to_yaml
    from cam_rig.simulation.inputs import resolve_scene

    loaded = resolve_scene(scene, rig)
    for file, kind in loaded.files.items():
        (folder / kind).mkdir(exist_ok=True)
        shutil.copy(file, folder / kind)
    target = folder / "scenes" / loaded.scene_file.name
    data = read_yaml(target) | {"rig": loaded.rig_file.stem}
    target.write_text(to_yaml(data), encoding="utf-8")
    return target


def _command_line(options: Mapping[str, Path | str | bool | Enum | None]) -> str:
    """Return the command that repeats a run with these options, into a new bag."""
    parts = ["cam-rig", "run", str(options["scene"])]
    for name, value in options.items():
        if value and name not in ("scene", "bag"):
            option = f"--{name.replace('_', '-')}"
            text = value.value if isinstance(value, Enum) else str(value)
            parts += [option] if value is True else [option, text]
    return shlex.join(parts)


def _run(
    path: Path,
    target: Path,
    nodes: dict[str, Arguments],
    subnet: bool,
    namespace: str,
    server: ForkServer,
    page: PageTime | None,
    repeat: str,
) -> None:
    """Run the nodes until the end of the run and report the recorded messages.

    The error of a node names `repeat`, the command that repeats the run.
    """
    from cam_rig.bag.completeness import require_complete
    from cam_rig.errors import RunError
    from cam_rig.messages.topics import FOLLOWER_SAMPLES
    from cam_rig.runner.graph import Graph
    from cam_rig.runner.node_process import PROFILE_VARIABLE
    from cam_rig.runner.resources import reserve_domain
    from cam_rig.simulation.scene import open_scene
    from cam_rig.simulation.schedule import tick_count
    from cam_rig.viewer.command import delay_report

    loaded = open_scene(path)
    loaded.require_numbers()
    if PROFILE_VARIABLE in os.environ and not subnet:
        say(
            f"the profile in {PROFILE_VARIABLE} is ignored without --discovery subnet; "
            "no socket leaves this machine"
        )
    start = time.perf_counter()

    with (
        reserve_domain(namespace),
        make_progress_bar() as bar,
        delay_report(page) as delayed,
        Graph(nodes, subnet, say, namespace, server) as graph,
    ):
        task = bar.add_task("starting the nodes", total=tick_count(loaded.scene))
        try:
            for report in graph.progress():
                text = f"{report['cam']} {report['rpm']:.0f} rpm"
                text = delayed(float(report["time"]), text)
                bar.update(task, completed=int(report["tick"]), description=text)
        except RunError as error:
            raise RunError(f"{error}; repeat the run with: {repeat}") from None
    for name, node in graph.processes.items():
        if node.warnings:
            say(f"{name} logged {len(node.warnings)} warnings, last: {node.warnings[-1]}")
    graph.require_closed()
    counts = require_complete(target, loaded.scene)
    say(
        f"{counts[FOLLOWER_SAMPLES.name]} ticks, {sum(counts.values())} messages, none missing, "
        f"in {time.perf_counter() - start:.1f} s: {target}"
    )


@command("json", "csv")
def replay(
    bag: Annotated[Path, typer.Argument(help="Bag whose cam states and laws are replayed.")],
    tolerance: Annotated[
        float,
        typer.Option(help="Largest allowed difference, relative to the largest value.", min=0.0),
    ] = 1e-12,
    output: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "--output",
            help="Folder for the new recording, which must not exist (default: discarded).",
        ),
    ] = None,
    scene: SceneOfBag = None,
    *,
    progress: Progress,
) -> Result:
    """Feed recorded cam states and laws to live nodes, and compare their messages with the bag.

    This is a regression test for changes of the follower or the microphone: the exit code is 1 if a
    number differs.

    Examples
    --------
    cam-rig replay bags/golden

    cam-rig replay bags/mine --tolerance 1e-9 --out bags/mine_again
    """
    from cam_rig.bag.files import require_new_bag
    from cam_rig.bag.replay import ReplayResult

    if output is not None:
        require_new_bag(output)
    with temporary_folder("cam_rig-replay-") as folder:
        differences = _replay(bag, folder, scene, output, progress)
    return ReplayResult(bag, tuple(differences), tolerance)


def _replay(
    bag: Path, folder: Path, scene: str | None, output: Path | None, progress: Progress
) -> list[Difference]:
    """Replay a bag, and return the differences between its messages and the new ones."""
    from cam_rig.bag.partial_reader import unpack
    from cam_rig.bag.reader import read_counts
    from cam_rig.bag.replay import compare
    from cam_rig.errors import BagError
    from cam_rig.messages.topics import CAM_STATE
    from cam_rig.runner.graph import Graph
    from cam_rig.runner.node_process import replay_nodes
    from cam_rig.runner.resources import reserve_domain
    from cam_rig.schema.load import scene_path

    total = read_counts(bag).get(CAM_STATE.name, 0)
    if total < 2:
        raise BagError(f"{bag}: has {total} cam states; a replay needs at least 2")
    path = scene_path(scene) if scene else unpack(bag, folder)
    # in a subfolder, as `folder` contains the files attached to the bag
    recording = folder / "again" / (output.name if output else "bag")
    with reserve_domain(), Graph(replay_nodes(path, recording, bag)) as graph:
        progress.start(total - 1, "replaying")
        done = 0
        for report in graph.progress():
            progress.advance(int(report["tick"]) - done)
            done = int(report["tick"])
    graph.require_closed()
    differences = compare(bag, recording)
    if output is not None:
        shutil.move(recording, output)
    return differences

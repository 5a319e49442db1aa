"""Commands that read a bag: ``cam-rig analyze`` and ``cam-rig export``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from cam_rig.bag.command import newest_bag
from cam_rig.errors import ConfigError
from cam_rig.files import check_writable
from cam_rig.show.command import SceneOfBag, ShowTable, command
from cam_rig.show.result import Progress, Result
from cam_rig.show.terminal import say
from cam_rig.simulation.simulate import TickSamples
from cam_rig.studies.simulate.study import SceneRun


@command("json", "csv", "plot")
def analyze(
    bag: Annotated[
        Path | None, typer.Argument(help="Bag to analyse (default: the newest in bags/).")
    ] = None,
    scene: SceneOfBag = None,
    table: ShowTable = False,
) -> Result:
    """Analyse a recorded run: levels, jump speed and lost contact of each cam, and each speed.

    The tables are those of cam-rig simulate. More than 12 rows by speed are displayed with --table
    only. --csv writes all rows.

    In Python: cam_rig.read_bag(bag, scene)

    Examples
    --------
    cam-rig analyze

    cam-rig analyze --table --csv out/sweep.csv

    cam-rig analyze bags/tm21_sweep_2026-01-31_12-00-00 --plot out/sweep.png --json out/sweep.json

    cam-rig analyze recorded_by_ros2 --scene quick
    """
    return replace(read_run(bag or newest_bag(), scene), show_table=table)


def read_run(bag: Path, scene: str | None = None) -> SceneRun:
    """Read the run of a bag, and print its size and notes on missing data.

    ``scene`` is needed only for a bag without an attached scene.
    """
    from cam_rig.studies.simulate.recorded import read_bag

    run = read_bag(bag, scene)
    say(f"{bag}: {sum(run.counts.values())} messages, {len(run.ticks)} ticks")
    say(*run.notes)
    return run


#: File name extensions of a bag that consists of a single file. A bag can also be a folder.
BAG_FILES = (".mcap", ".db3")


@command()
def export(
    source: Annotated[
        str,
        typer.Argument(metavar="BAG|SCENE", help="Bag, scene file, or a name in config/scenes."),
    ],
    to: Annotated[Path, typer.Option(help="File: .parquet, .csv, .npz or .wav.")],
    cam: Annotated[str | None, typer.Option(help="One cam of the run (default: all).")] = None,
    rpm: Annotated[
        float | None, typer.Option(min=0.0, help="One speed of the run (default: all).")
    ] = None,
    scene: SceneOfBag = None,
    *,
    progress: Progress,
) -> None:
    """Write every sample of a run to a file, with name, speed and angle of the cam.

    Columns: time_s, cam, rpm, angle_rad, angle_in_turn_rad, lift_m, velocity_m_s,
    acceleration_m_s2, force_N, impulse_N_s, torque_N_m. The schema of a Parquet file contains units
    and meanings; it needs pyarrow. A WAV file has one channel of 32-bit floats for each quantity
    that changes within a turn, and its comment names them. Memory does not grow with the run.

    Examples
    --------
    cam-rig export bags/golden --to out/golden.parquet

    cam-rig export tm21_sweep --cam tm21 --rpm 380 --to out/tm21_380.csv
    """
    from cam_rig.schema.load import file_exists, scene_path
    from cam_rig.simulation.export import export as write_samples
    from cam_rig.simulation.export import require_format
    from cam_rig.simulation.scene import open_scene
    from cam_rig.simulation.schedule import tick_count
    from cam_rig.simulation.simulate import simulate_ticks

    require_format(to)
    check_writable(to)
    if Path(source).is_dir() or source.endswith(BAG_FILES):
        from cam_rig.bag.reader import read_counts, read_ticks, scene_of, shortcomings
        from cam_rig.messages.topics import FOLLOWER_SAMPLES

        bag = Path(source)
        loaded = scene_of(bag, None if scene is None else scene_path(scene))
        ticks = read_ticks(bag)
        say(*shortcomings(bag, loaded, read_counts(bag).get(FOLLOWER_SAMPLES.name, 0)))
    else:
        path = scene_path(source)
        try:
            loaded = open_scene(path)
        except ConfigError as error:
            if file_exists(path):
                raise
            raise ConfigError(f"{source}: is neither a bag nor a scene: {error}") from None
        ticks = simulate_ticks(loaded)
    progress.start(tick_count(loaded.scene), loaded.scene.name)
    contents = write_samples(to, _track(ticks, progress), loaded, cam, rpm)
    gaps = f", {contents.gaps} gaps between them" if contents.gaps else ""
    say(f"{to}: {contents.rows} samples, {contents.start:.6g} to {contents.end:.6g} s{gaps}")


def _track(ticks: Iterable[TickSamples], progress: Progress) -> Iterator[TickSamples]:
    """Yield the ticks of a run unchanged, and report the progress after each tick.

    A tick contains the samples between two cam states, one turn by default.
    """
    for tick in ticks:
        yield tick
        progress.advance()

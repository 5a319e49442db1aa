"""cam-rig export: the samples of a run as named columns in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cam_rig.cli.common.console import progress_bar, say, user_errors
from cam_rig.cli.common.names import scene_path
from cam_rig.cli.common.options import SceneOfBag
from cam_rig.cli.common.outputs import check_place

#: Endings of a bag's file; a folder is a bag too.
BAG_FILES = (".mcap", ".db3")


def export(
    source: Annotated[
        str,
        typer.Argument(metavar="BAG|SCENE", help="Bag, scene file, or a name in config/scenes."),
    ],
    to: Annotated[Path, typer.Option(help="File: .parquet, .csv, .npz or .wav.")],
    cam: Annotated[str | None, typer.Option(help="One cam of the run; by default all.")] = None,
    rpm: Annotated[
        float | None, typer.Option(min=0.0, help="One speed of the run; by default all.")
    ] = None,
    scene: SceneOfBag = None,
) -> None:
    """Write every sample of a run with the cam that turned under it.

    Columns: time_s, cam, rpm, angle_rad, angle_in_turn_rad, lift_m, velocity_m_s,
    acceleration_m_s2, force_N, impulse_N_s. Parquet has units and meanings in its schema too, and
    needs pyarrow. A WAV has a channel of 32-bit floats for each quantity that changes within a
    turn, named in its comment. Memory stays bounded however long the run is.

    Examples
    --------
    cam-rig export bags/golden --to out/golden.parquet

    cam-rig export tm21_sweep --cam tm21 --rpm 380 --to out/tm21_380.csv
    """
    with user_errors():
        from cam_rig.export.write import export as write_samples
        from cam_rig.export.write import require_format
        from cam_rig.simulation.loaded_scene import open_scene
        from cam_rig.simulation.schedule import tick_count
        from cam_rig.simulation.simulate import turned_ticks

        require_format(to)
        check_place(to)
        if Path(source).is_dir() or source.endswith(BAG_FILES):
            from cam_rig.bag.reader import read_scene, read_ticks

            bag = Path(source)
            loaded = read_scene(bag) if scene is None else open_scene(scene_path(scene))
            ticks = read_ticks(bag)
        else:
            loaded = open_scene(scene_path(source))
            ticks = turned_ticks(loaded)
        with progress_bar() as bar:
            ticks = iter(bar.track(ticks, tick_count(loaded.scene), description=loaded.scene.name))
            written = write_samples(to, ticks, loaded, cam, rpm)
        gaps = f", {written.gaps} gaps between them" if written.gaps else ""
        say(f"{to}: {written.rows} samples, {written.begin:.6g} to {written.end:.6g} s{gaps}")

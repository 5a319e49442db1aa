"""cam-rig noise: the paper's noise regressions, reproduced and taken further."""

from __future__ import annotations

from typing import Annotated

import typer

from cam_rig.cli.common.console import progress_bar, show, user_errors
from cam_rig.cli.common.names import DEFAULT_SCENE, scene_path
from cam_rig.cli.common.options import Csv, Json, Plot, Scene
from cam_rig.cli.common.outputs import check_outputs, write_csv, write_json, write_plot


def noise(
    scene: Scene = DEFAULT_SCENE,
    rig: Annotated[
        str, typer.Option(help="The rig identified from the jump speeds, a name in config/rigs.")
    ] = "paper_table2",
    one_rig: Annotated[
        bool, typer.Option("--one-rig", help="Fit the arc cam on that rig too: takes minutes.")
    ] = False,
    json_target: Json = None,
    csv: Csv = None,
    plot: Plot = None,
) -> None:
    """Calibrate on one cam, predict another, identify the third, with confidence intervals.

    The transfer functions between force and sound; three ways of calibrating, with 95 % bands and
    the speed at which two cams are equally loud; each cam left out in turn; and the one rig that
    the jump speeds gave. Some ten seconds.

    Examples
    --------
    cam-rig noise --plot out/noise_study.png

    cam-rig noise --json - | jq '.methods["by substitution"].crossing.rpm'
    """
    with user_errors():
        from cam_rig.schema import Library, load_rig
        from cam_rig.simulation.loaded_scene import open_scene
        from cam_rig.studies.noise import tables
        from cam_rig.studies.noise.run import PARTS, study_noise

        check_outputs(json_target, plot, csv)
        path = scene_path(scene)
        loaded, other = open_scene(path), load_rig(Library.beside(path).path("rigs", rig))
        with progress_bar() as bar:
            task = bar.add_task("", total=len(PARTS), completed=-1)
            found = study_noise(
                loaded,
                other,
                one_rig,
                lambda part: bar.update(task, advance=1, description=part),
                lambda best: bar.update(task, description=f"one rig, best {best:.1f} dB"),
            )
        assert loaded.published is not None  # the study has its levels
        shown = tables.tables(found, loaded.published)
        show(*shown)
        write_csv(shown, csv)
        if plot is not None:
            from cam_rig.plots.sound.noise_study import draw

            write_plot(plot, lambda part: draw(found, loaded, part))
        write_json(tables.to_json(found), json_target)

"""cam-rig simulate: the scene without ROS."""

from __future__ import annotations

from cam_rig.cli.common.console import console, progress_bar, user_errors
from cam_rig.cli.common.level_table import show
from cam_rig.cli.common.names import DEFAULT_SCENE
from cam_rig.cli.common.options import Csv, Json, Plot, Scene
from cam_rig.cli.common.outputs import check_outputs


def simulate(
    scene: Scene = DEFAULT_SCENE,
    json_target: Json = None,
    csv: Csv = None,
    plot: Plot = None,
) -> None:
    """Run a scene without ROS, on the same core: a row each speed, and its noise compared.

    A row has level, peak and least force, lift-offs a turn, longest flight, hardest landing, and
    torque, of the settled turns.

    Examples
    --------
    cam-rig simulate

    cam-rig simulate config/scenes/tm21_sweep.yaml --plot out/sweep.png --csv out/sweep.csv --json -
    """
    with user_errors():
        import time

        from cam_rig import load_scene, run_scene
        from cam_rig.simulation.schedule import tick_count
        from cam_rig.units import NS

        check_outputs(json_target, plot, csv)
        loaded = load_scene(scene)
        begun = time.perf_counter()
        with progress_bar() as bar:
            task = bar.add_task(loaded.scene.name, total=tick_count(loaded.scene))
            run = run_scene(loaded, on_tick=lambda: bar.advance(task))
        took = time.perf_counter() - begun
        rig_time = run.ticks[-1].stop_ns / NS
        console.print(
            f"{len(run.ticks)} ticks, {rig_time:.1f} s of rig time in {took:.2f} s "
            f"({rig_time / took:.0f} x real time)"
        )
        show(run, json_target, plot, csv)

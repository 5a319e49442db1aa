"""cam-rig simulate: the scene without ROS."""

from __future__ import annotations

from cam_rig.cli.common.console import console, progress_bar, user_errors
from cam_rig.cli.common.level_table import show
from cam_rig.cli.common.names import DEFAULT_SCENE, scene_path
from cam_rig.cli.common.options import Json, Plot, Scene
from cam_rig.cli.common.outputs import check_outputs


def simulate(
    scene: Scene = DEFAULT_SCENE,
    json_target: Json = None,
    plot: Plot = None,
) -> None:
    """Run a scene without ROS, on the same core, and compare its noise.

    Examples
    --------
    cam-rig simulate

    cam-rig simulate config/scenes/tm21_sweep.yaml --plot out/sweep.png --json -
    """
    with user_errors():
        import time

        from cam_rig.simulation.levels import compare, require_ticks, step_levels
        from cam_rig.simulation.scene import open_scene
        from cam_rig.simulation.schedule import tick_count
        from cam_rig.simulation.simulate import simulate as run

        check_outputs(json_target, plot)
        path = scene_path(scene)
        loaded = open_scene(path)
        begun = time.perf_counter()
        with progress_bar() as bar:
            ticks = list(
                bar.track(
                    run(loaded), total=tick_count(loaded.scene), description=loaded.scene.name
                )
            )
        took = time.perf_counter() - begun
        rig_time = ticks[-1].stop_ns * 1e-9
        console.print(
            f"{len(ticks)} ticks, {rig_time:.1f} s of rig time in {took:.2f} s "
            f"({rig_time / took:.0f} x real time)"
        )
        levels = step_levels(ticks, loaded.scene.program.settle_turns.si)
        require_ticks(levels, str(path))
        result = compare(levels, {cam: loaded.role(cam) for cam in levels}, loaded.published)
        show(result, loaded, {}, json_target, plot)

"""cam-rig calibrate: the acoustic constants, from one cam's published curve alone."""

from __future__ import annotations

from typing import Annotated

import typer

from cam_rig.cli.common.console import console, user_errors
from cam_rig.cli.common.names import DEFAULT_SCENE, scene_path
from cam_rig.cli.common.options import Scene


def calibrate(
    scene: Scene = DEFAULT_SCENE,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Show, write nothing.")] = False,
) -> None:
    """Fit gain and cut-off of the rig's radiation to the published noise of one cam.

    They are ``radiation.gain`` and ``corner`` of the rig file, the cam is its ``calibrated_on``.
    Two numbers are fitted, by least squares in dB over the scene's speeds, and written into the
    rig file with the fit error and the follower they hold for: with another one levels are
    relative. Every other cam's curve is then a prediction.

    Examples
    --------
    cam-rig calibrate --dry-run

    cam-rig calibrate tm21_sweep
    """
    with user_errors():
        import numpy as np

        from cam_rig.cli.common.edit import set_identified
        from cam_rig.simulation.calibrated import FITTED_WITH, MODEL, fitted_with
        from cam_rig.simulation.loaded_scene import open_scene
        from cam_rig.studies.noise.calibration import calibrate as fit
        from cam_rig.units import to_rpm

        loaded = open_scene(scene_path(scene))
        cam = loaded.rig.calibrated_on
        speeds = np.array(loaded.scene.program.speeds.si_list)
        levels = loaded.published_levels(cam, to_rpm(speeds))
        found, rmse = fit(loaded.law_of(cam), loaded.follower, loaded.radiation, speeds, levels)
        console.print(
            f"{cam}: gain {found.gain:.4g} Pa·s/N, corner {found.corner:.4g} "
            f"Hz; {rmse:.3f} dB RMS over {speeds.size} speeds (2 numbers fitted)"
        )
        if not dry_run:
            numbers: dict[tuple[str | int, ...], float] = {
                ("radiation", "gain"): _round(found.gain),
                ("radiation", "corner"): _round(found.corner),
            }
            held = FITTED_WITH + fitted_with(loaded.rig, MODEL)
            source = f"cam-rig calibrate, published noise of {cam} alone{held}"
            residual = f"{rmse:.3f} dB RMS over {speeds.size} speeds, 2 numbers fitted"
            set_identified(loaded.rig_file, numbers, source, residual)
            console.print(f"written to {loaded.rig_file}")


def _round(value: float) -> float:
    """Five digits: far finer than the residual supports, and a file stays readable."""
    return float(f"{value:.5g}")

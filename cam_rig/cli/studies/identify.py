"""cam-rig identify: the geometry of an arc cam, from its published noise."""

from __future__ import annotations

from typing import Annotated

import typer

from cam_rig.cli.common.console import console, user_errors
from cam_rig.cli.common.names import DEFAULT_SCENE, scene_path
from cam_rig.cli.common.options import SceneOption


def identify(
    cam: Annotated[str, typer.Argument(help="The cam to identify.")] = "tm21",
    scene: SceneOption = DEFAULT_SCENE,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the global search.")] = 1,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Show, write nothing.")] = False,
) -> None:
    """Search lift, event and nose angle of a tangent-arc cam that fit its published noise.

    Takes a few minutes. The acoustic constants stay as they were calibrated on another cam.
    What comes out is identified: a cam that sounds like the published one, not its drawing.

    Examples
    --------
    cam-rig identify --dry-run

    cam-rig identify tm21 --seed 7
    """
    with user_errors():
        from cam_rig.cli.common.edit import set_identified
        from cam_rig.errors import ConfigError
        from cam_rig.simulation.loaded_scene import open_scene
        from cam_rig.studies.noise.identify import identify as search

        loaded = open_scene(scene_path(scene))
        if cam not in loaded.cams or not loaded.cams[cam].identified_from:
            raise ConfigError(
                f"{scene}: {cam!r} cannot be identified; allowed: a tangent-arc cam of the scene "
                "whose file has identified_from"
            )
        with console.status("searching") as status:
            found = search(loaded, cam, seed, lambda rmse: status.update(f"best {rmse:.2f} dB RMS"))
        console.print(
            f"{cam}: lift {found.lift_mm:.3f} mm, event {found.event_deg:.2f}°, nose "
            f"{found.nose_deg:.2f}°: {found.rmse_db:.2f} dB RMS, {found.evaluations} trials"
        )
        if not dry_run:
            numbers: dict[tuple[str | int, ...], float] = {
                ("lift",): found.lift_mm,
                ("segments", 0, "span"): found.dwell_deg,
                ("segments", 1, "span"): found.event_deg,
                ("segments", 1, "nose_span"): found.nose_deg,
                ("segments", 2, "span"): found.dwell_deg,
            }
            source = "cam-rig identify, its published noise curve"
            residual = f"{found.rmse_db:.2f} dB RMS, 3 numbers fitted to one cubic"
            set_identified(loaded.cam_files[cam], numbers, source, residual)
            console.print(f"written to {loaded.cam_files[cam]}")

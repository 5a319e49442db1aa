"""Commands that run a scene without ROS: ``cam-rig simulate`` and ``listen``."""

from __future__ import annotations

import time
import wave
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from cam_rig.errors import ConfigError
from cam_rig.files import atomic_write, check_writable
from cam_rig.show.command import DEFAULT_SCENE, OtherRig, Scene, ShowTable, command
from cam_rig.show.result import Progress, Result
from cam_rig.show.terminal import say

#: Sample rate (Hz) of the sound file, which is common in audio equipment.
RATE = 48_000
#: Default duration (s) of the sound at one speed.
SECONDS = 5.0


@command("json", "csv")
def listen(
    scene: Scene,
    out: Annotated[Path, typer.Option(help="Sound file to write (WAV).")],
    cam: Annotated[str | None, typer.Option(help="One cam of the scene (default: all).")] = None,
    rpm: Annotated[
        float | None,
        typer.Option(min=1.0, max=1e5, help="One speed (default: the schedule)."),
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(min=0.1, max=3600.0, help="Duration of --rpm in s, whole turns (default: 5)."),
    ] = None,
    rig: OtherRig = None,
    *,
    progress: Progress,
) -> Result:
    """Write the sound pressure at the microphone to a sound file (48 kHz, 16 bit).

    The numbers in the file are proportional to the pressure. They are not weighted or filtered, so
    they contain the lowest harmonics of a cam, which are inaudible. The pressure of the largest
    number is printed: the smallest of 1, 2 or 5 times a power of ten that does not clip.

    Examples
    --------
    cam-rig listen quick --out out/quick.wav

    cam-rig listen tm21_sweep --cam tm21 --rpm 380 --out out/tm21_380.wav --json -
    """
    from cam_rig.acoustics.sound_level_meter import pcm
    from cam_rig.simulation.inputs import resolve_scene
    from cam_rig.studies.simulate.sound import audition
    from cam_rig.studies.simulate.sound import listen as record

    if out.suffix.lower() != ".wav":
        raise ConfigError(f"the sound file must end in .wav, got {out}")
    check_writable(out)
    if seconds is not None and rpm is None:
        raise ConfigError("--seconds requires --rpm")
    loaded = audition(resolve_scene(scene, rig), cam, rpm, seconds or SECONDS, RATE)
    result = record(loaded, RATE, out, progress)
    with atomic_write(out) as part, wave.open(str(part), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE)
        file.writeframes(pcm(result.pressure, result.full_scale))
    return result


@command("json", "csv", "plot")
def simulate(
    scene: Scene = DEFAULT_SCENE,
    rig: OtherRig = None,
    table: ShowTable = False,
    *,
    progress: Progress,
) -> Result:
    """Run a scene without ROS: levels, jump speed and lost contact of each cam, and each speed.

    A row by speed contains level, peak and least force, lift-off rate, longest flight, fastest
    landing and torque of the settled turns. More than 12 rows are displayed with --table only.

    In Python: cam_rig.run_scene(scene, rig)

    Examples
    --------
    cam-rig simulate

    cam-rig simulate quick --rig mine/rigs/bench.yaml

    cam-rig simulate config/scenes/tm21_sweep.yaml --plot out/sweep.png --csv out/sweep.csv --json -
    """
    from cam_rig.simulation.inputs import resolve_scene
    from cam_rig.simulation.schedule import tick_count
    from cam_rig.studies.simulate.study import run_scene
    from cam_rig.units import NS

    loaded = resolve_scene(scene, rig)
    start = time.perf_counter()
    progress.start(tick_count(loaded.scene), loaded.scene.name)
    run = run_scene(loaded, on_tick=progress.advance)
    duration = time.perf_counter() - start
    rig_time = run.ticks[-1].stop_ns / NS
    say(
        f"{len(run.ticks)} ticks, {rig_time:.1f} s of rig time in {duration:.2f} s "
        f"({rig_time / duration:.0f} x real time)"
    )
    return replace(run, show_table=table)

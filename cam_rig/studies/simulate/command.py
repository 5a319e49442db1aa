"""cam-rig listen: a scene as a sound file; cam-rig simulate: a scene without ROS."""

from __future__ import annotations

import time
import wave
from pathlib import Path
from typing import Annotated

import typer

from cam_rig.errors import ConfigError
from cam_rig.files import check_place, writing
from cam_rig.show.command import DEFAULT_SCENE, OtherRig, Scene, command
from cam_rig.show.result import Progress, Result
from cam_rig.show.terminal import say

#: Hz, the rate of audio equipment.
RATE = 48_000
#: s, how long one speed is held by default.
SECONDS = 5.0


@command("json", "csv")
def listen(
    scene: Scene,
    out: Annotated[Path, typer.Option(help="Sound file to write (WAV).")],
    cam: Annotated[str | None, typer.Option(help="One cam of the scene; by default all.")] = None,
    rpm: Annotated[
        float | None, typer.Option(min=1.0, max=1e5, help="One speed; by default the program's.")
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(min=0.1, max=3600.0, help="How long --rpm is held, in whole turns; 5."),
    ] = None,
    rig: OtherRig = None,
    *,
    progress: Progress,
) -> Result:
    """Write what the microphone hears: 48 kHz, 16 bit, sound pressure in proportion.

    Nothing is weighted or filtered, so a cam's lowest harmonics are in it though nobody hears
    them. The largest number stands for a round pressure that is printed: 1, 2 or 5 times a power
    of ten, the smallest that does not clip.

    Examples
    --------
    cam-rig listen quick --out out/quick.wav

    cam-rig listen tm21_sweep --cam tm21 --rpm 380 --out out/tm21_380.wav --json -
    """
    from cam_rig.acoustics.sound_level_meter import pcm
    from cam_rig.simulation.asked import asked_scene
    from cam_rig.studies.simulate.sound import audition
    from cam_rig.studies.simulate.sound import listen as record

    if out.suffix.lower() != ".wav":
        raise ConfigError(f"{out}: unknown kind of sound file; allowed: .wav")
    check_place(out)
    if seconds is not None and rpm is None:
        raise ConfigError(
            f"--seconds is {seconds:g} without --rpm, and the scene's program has its own "
            "times; allowed: both, or neither"
        )
    loaded = audition(asked_scene(scene, rig), cam, rpm, seconds or SECONDS, RATE)
    found = record(loaded, RATE, out, progress)
    with writing(out) as part, wave.open(str(part), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE)
        file.writeframes(pcm(found.pressure, found.full_scale))
    return found


@command("json", "csv", "plot")
def simulate(scene: Scene = DEFAULT_SCENE, *, progress: Progress) -> Result:
    """Run a scene without ROS, on the same core: a row each speed, and its noise compared.

    A row has level, peak and least force, lift-offs a turn, longest flight, hardest landing, and
    torque, of the settled turns.

    In Python: cam_rig.run_scene(scene)

    Examples
    --------
    cam-rig simulate

    cam-rig simulate config/scenes/tm21_sweep.yaml --plot out/sweep.png --csv out/sweep.csv --json -
    """
    from cam_rig.simulation.scene import load_scene
    from cam_rig.simulation.schedule import tick_count
    from cam_rig.studies.simulate.study import run_scene
    from cam_rig.units import NS

    loaded = load_scene(scene)
    begun = time.perf_counter()
    progress.start(tick_count(loaded.scene), loaded.scene.name)
    run = run_scene(loaded, on_tick=progress.advance)
    took = time.perf_counter() - begun
    rig_time = run.ticks[-1].stop_ns / NS
    say(
        f"{len(run.ticks)} ticks, {rig_time:.1f} s of rig time in {took:.2f} s "
        f"({rig_time / took:.0f} x real time)"
    )
    return run

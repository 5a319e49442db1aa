"""cam-rig listen: the sound of a scene as a sound file, and what a meter shows for it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cam_rig.errors import ConfigError
from cam_rig.files import writing
from cam_rig.show.command import (
    DEFAULT_SCENE,
    Csv,
    Json,
    OtherRig,
    Plot,
    Scene,
    check_outputs,
    check_place,
    progress_bar,
    user_errors,
    write_json,
)
from cam_rig.show.terminal import console, say

if TYPE_CHECKING:
    from cam_rig.acoustics.sound_level_meter import Measurement

#: Hz, the rate of audio equipment.
RATE = 48_000

#: s, how long one speed is held by default.
SECONDS = 5.0

#: The frequency weightings of the levels, in words.
WEIGHTED = {"A": "A-weighted", "C": "C-weighted", "Z": "unweighted (Z), as in tables"}


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
    json_target: Json = None,
) -> None:
    """Write what the microphone hears: 48 kHz, 16 bit, sound pressure in proportion.

    Nothing is weighted or filtered, so a cam's lowest harmonics are in it though nobody hears
    them. The largest number stands for a round pressure that is printed: 1, 2 or 5 times a power
    of ten, the smallest that does not clip.

    Examples
    --------
    cam-rig listen quick --out out/quick.wav

    cam-rig listen tm21_sweep --cam tm21 --rpm 380 --out out/tm21_380.wav --json -
    """
    with user_errors():
        import numpy as np

        from cam_rig.acoustics import SoundSource
        from cam_rig.acoustics.sound_level_meter import full_scale, measure, pcm
        from cam_rig.simulation.asked import asked_scene
        from cam_rig.simulation.schedule import tick_count
        from cam_rig.simulation.sound import audition, sounds

        check_outputs(json_target, None)
        if out.suffix.lower() != ".wav":
            raise ConfigError(f"{out}: unknown kind of sound file; allowed: .wav")
        check_place(out)
        if seconds is not None and rpm is None:
            raise ConfigError(
                f"--seconds is {seconds:g} without --rpm, and the scene's program has its own "
                "times; allowed: both, or neither"
            )
        loaded = audition(asked_scene(scene, rig), cam, rpm, seconds or SECONDS, RATE)
        source = SoundSource(loaded.radiation, RATE, least_rate=RATE)
        with progress_bar() as bar:
            ticks = bar.track(
                sounds(loaded, source),
                total=tick_count(loaded.scene),
                description=loaded.scene.name,
            )
            pressure = np.concatenate(list(ticks))
        measured = measure(pressure, RATE)
        scale = full_scale(measured.peak_pa)
        with writing(out) as part:
            _write(part, pcm(pressure, scale))
        lasts = pressure.size / RATE
        _show(measured, out, scale, lasts, loaded.calibrated)
        write_json(_to_json(measured, scale, lasts, loaded.calibrated), json_target)


def _write(path: Path, samples: bytes) -> None:
    import wave

    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE)
        file.writeframes(samples)


def _show(measured: Measurement, out: Path, scale: float, seconds: float, calibrated: bool) -> None:
    from cam_rig.simulation.scene import RELATIVE_NOTE

    console.print(
        f"{out}: {seconds:.1f} s; full scale is {scale:g} Pa, peak {measured.peak_pa:.3g} Pa"
    )
    for weighting, words in WEIGHTED.items():
        own = {name: x for name, x in measured.levels.items() if name.startswith(f"L{weighting}")}
        levels = ", ".join(f"{name} {level:.1f}" for name, level in own.items())
        console.print(f"{words}: {levels} dB")
    console.print(f"class 1 up to {measured.class_1_up_to_hz / 1000.0:g} kHz")
    if measured.overload:
        console.print("[bold]overload:[/] beyond the meter's 130 dB")
    if measured.under_range:
        console.print("[bold]under range:[/] a level is below the meter's 30 dB")
    if not calibrated:
        say(RELATIVE_NOTE)


def _to_json(
    measured: Measurement, scale: float, seconds: float, calibrated: bool
) -> dict[str, Any]:
    return {
        "seconds": seconds,
        "full_scale_pa": scale,
        "peak_pa": measured.peak_pa,
        "levels_db": measured.levels,
        "calibrated": calibrated,
        "class_1_up_to_hz": measured.class_1_up_to_hz,
        "third_octaves_db": dict(
            zip(measured.bands.names, measured.bands.level_db.tolist(), strict=True)
        ),
        "overload": measured.overload,
        "under_range": measured.under_range,
    }


# cam-rig simulate: the scene without ROS.


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
    from cam_rig.simulation.tables import show

    with user_errors():
        import time

        from cam_rig.simulation.scene import load_scene
        from cam_rig.simulation.scene_run import run_scene
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

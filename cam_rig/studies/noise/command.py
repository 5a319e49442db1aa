"""Writing identified numbers back into a YAML file, keeping its comments and layout."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer
import yaml

from cam_rig.errors import ConfigError
from cam_rig.schema.quantity import ORIGINS
from cam_rig.show.command import DEFAULT_SCENE, Scene, SceneOption, command
from cam_rig.show.result import Progress, Result
from cam_rig.show.terminal import say

#: Where in a text (first and last character) something else is to stand, and what.
Edit = tuple[int, int, str]


def set_identified(
    path: Path, numbers: dict[tuple[str | int, ...], float], source: str, residual: str
) -> None:
    """Put numbers in as ``identified``, with source and residual; the file is replaced whole.

    Nothing else of the text changes. ``numbers`` are by key path, in the unit the file has there.
    """
    text = path.read_bytes().decode("utf-8")
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    edits = {
        edit
        for keys, number in numbers.items()
        for edit in _edits(_at(root, keys), text, number, {"source": source, "residual": residual})
    }
    for begin, end, words in sorted(edits, reverse=True):
        text = text[:begin] + words + text[end:]
    part = path.with_suffix(".yaml.part")
    try:
        part.write_bytes(text.encode("utf-8"))
        os.replace(part, path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written ({error.strerror})") from None
    finally:
        part.unlink(missing_ok=True)


def _at(node: yaml.Node, keys: tuple[str | int, ...]) -> yaml.MappingNode:
    """The mapping at a key path."""
    for key in keys:
        node = (
            node.value[key]
            if isinstance(node, yaml.SequenceNode)
            else next(value for name, value in node.value if name.value == key)
        )
    return node


def _edits(
    node: yaml.MappingNode, text: str, number: float, words: dict[str, str]
) -> Iterator[Edit]:
    """What changes in the text of one number's mapping."""
    pairs = {name.value: (name, value) for name, value in node.value}
    origin, old = next(pairs[key] for key in ORIGINS if key in pairs)
    yield *_span(origin), "identified"
    between = ", " if node.flow_style else "\n" + " " * origin.start_mark.column
    missing = [key for key in words if key not in pairs]
    added = "".join(f"{between}{key}: {_quoted(words[key])}" for key in missing)
    yield *_span(old), f"{number!r}{added}"
    for key in words.keys() - missing:
        begin, end = _span(pairs[key][1])
        after = text[begin:end]
        yield begin, end, _quoted(words[key]) + after[len(after.rstrip()) :]


def _span(node: yaml.Node) -> tuple[int, int]:
    return node.start_mark.index, node.end_mark.index


def _quoted(text: str) -> str:
    """A text as YAML has it in double quotes, which is as JSON has it."""
    return json.dumps(text, ensure_ascii=False)


# cam-rig calibrate: the acoustic constants, from one cam's published curve alone.


@command()
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
    import numpy as np

    from cam_rig.schema.load import scene_path
    from cam_rig.simulation.scene import FITTED_WITH, MODEL, fitted_with, open_scene
    from cam_rig.studies.noise.calibration import calibrate as fit
    from cam_rig.units import to_rpm

    loaded = open_scene(scene_path(scene))
    cam = loaded.rig.calibrated_on
    speeds = np.array(loaded.scene.program.speeds.si_list)
    levels = loaded.published_levels(cam, to_rpm(speeds))
    found, rmse = fit(loaded.law_of(cam), loaded.follower, loaded.radiation, speeds, levels)
    say(
        f"{cam}: gain {found.gain:.4g} Pa·s/N, corner {found.corner:.4g} "
        f"Hz; {rmse:.3f} dB RMS over {speeds.size} speeds (2 numbers fitted)"
    )
    if not dry_run:
        numbers: dict[tuple[str | int, ...], float] = {
            # Five digits: far finer than the residual supports, and a file stays readable.
            ("radiation", key): float(f"{getattr(found, key):.5g}")
            for key in ("gain", "corner")
        }
        held = FITTED_WITH + fitted_with(loaded.rig, MODEL)
        source = f"cam-rig calibrate, published noise of {cam} alone{held}"
        residual = f"{rmse:.3f} dB RMS over {speeds.size} speeds, 2 numbers fitted"
        set_identified(loaded.rig_file, numbers, source, residual)
        say(f"written to {loaded.rig_file}")


# cam-rig identify: the geometry of an arc cam, from its published noise.


@command()
def identify(
    cam: Annotated[str, typer.Argument(help="The cam to identify.")] = "tm21",
    scene: SceneOption = DEFAULT_SCENE,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the global search.")] = 1,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Show, write nothing.")] = False,
    *,
    progress: Progress,
) -> None:
    """Search lift, event and nose angle of a tangent-arc cam that fit its published noise.

    Takes a few minutes. The acoustic constants stay as they were calibrated on another cam.
    What comes out is identified: a cam that sounds like the published one, not its drawing.

    Examples
    --------
    cam-rig identify --dry-run

    cam-rig identify tm21 --seed 7
    """
    from cam_rig.schema.load import scene_path
    from cam_rig.simulation.scene import open_scene
    from cam_rig.studies.noise.arc_cam import identify as search

    loaded = open_scene(scene_path(scene))
    if cam not in loaded.cams or not loaded.cams[cam].identified_from:
        raise ConfigError(
            f"{scene}: {cam!r} cannot be identified; allowed: a tangent-arc cam of the scene "
            "whose file has identified_from"
        )
    found = search(loaded, cam, seed, progress)
    say(
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
        say(f"written to {loaded.cam_files[cam]}")


# cam-rig noise: the paper's noise regressions, reproduced and taken further.


@command("json", "csv", "plot")
def noise(
    scene: Scene = DEFAULT_SCENE,
    rig: Annotated[
        str, typer.Option(help="Rig identified from jump speeds, beside the scene's: file or name.")
    ] = "paper_table2",
    one_rig: Annotated[
        bool, typer.Option("--one-rig", help="Fit the arc cam on that rig too: takes minutes.")
    ] = False,
    *,
    progress: Progress,
) -> Result:
    """Calibrate on one cam, predict another, identify the third, with confidence intervals.

    The transfer functions between force and sound; three ways of calibrating, with 95 % bands and
    the speed at which two cams are equally loud; each cam left out in turn; and the one rig that
    the jump speeds gave. Some ten seconds.

    In Python: cam_rig.noise(scene, rig, one_rig)

    Examples
    --------
    cam-rig noise --plot out/noise_study.png

    cam-rig noise --json - | jq '.methods[] | {calibration, named_crossing}'
    """
    from cam_rig.studies.noise import study

    return study.noise(scene, rig, one_rig, progress=progress)

"""The pictures of the documents, drawn from a run, and a note of what they were drawn from."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from types import ModuleType
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from PIL import Image
from pydantic import BaseModel

mpl.use("Agg")
import matplotlib.pyplot as plt

from cam_rig.drawing import colours, swinging, translating
from cam_rig.drawing import follower as follower_shape
from cam_rig.drawing import outlines as shapes
from cam_rig.plots import noise as noise_plot
from cam_rig.plots import styles
from cam_rig.simulation.scene import LoadedScene
from cam_rig.viewer import album as albums
from cam_rig.viewer import blueprint, scene2d, stills, viewer_picture
from cam_rig.viewer.album import TurnArchive, gap
from cam_rig.viewer.charts import axes, band_chart, bands, noise_chart, results, series
from cam_rig.viewer.turns import Turn

ANIMATION, STILL, NOTE = "turning.webp", "side_by_side.png", "made_from.json"
#: The viewer's picture has a note of its own, for it is not made where there is no browser.
VIEWER, VIEWER_NOTE = "viewer.png", "viewer_made_from.json"
#: Frames of the animation, one turn, and how long each is shown, ms.
FRAMES, FRAME_MS = 72, 50
#: Whose text decides how the pictures look.
DRAWN_BY = (
    stills,
    noise_plot,
    styles,
    albums,
    colours,
    shapes,
    follower_shape,
    translating,
    swinging,
)
#: Whose text decides how the viewer looks.
LAID_OUT_BY = (
    blueprint,
    scene2d,
    series,
    axes,
    bands,
    band_chart,
    noise_chart,
    results,
    colours,
    shapes,
    follower_shape,
    translating,
    swinging,
    viewer_picture,
)


def draw_pictures(album: TurnArchive, noise: Callable[[Path], None], folder: Path) -> list[Path]:
    """Write the animation, the still, the noise plot and the note; gives their paths.

    Parameters
    ----------
    noise : draws noise against rpm into a file
    folder : must exist
    """
    rpm = blueprint.compared_rpm(album.loaded, None)
    turns = [album.turn(cam, rpm) for cam in album.loaded.cams]
    jumps = max(turns, key=lambda turn: float(gap(album.loaded, turn).max()))
    animate(album, jumps, folder / ANIMATION)
    side_by_side(album, turns, folder / STILL)
    plot = folder / f"{album.loaded.scene.name}.png"
    noise(plot)
    note = {
        **inputs(album.loaded),
        "numbers": {turn.cam: numbers(album.loaded, turn) for turn in turns},
    }
    (folder / NOTE).write_text(json.dumps(note, indent=2) + "\n", encoding="utf-8")
    return [folder / ANIMATION, folder / STILL, plot, folder / NOTE]


def photograph_run(bag: Path, loaded: LoadedScene, folder: Path) -> list[Path]:
    """Write a picture of the viewer that shows a bag, and its note; gives their paths.

    Raises
    ------
    CamRigError : there is no browser, or it does not show it all
    """
    viewer_picture.photograph_viewer(bag, folder / VIEWER)
    note = json.dumps(inputs(loaded, LAID_OUT_BY), indent=2)
    (folder / VIEWER_NOTE).write_text(note + "\n", encoding="utf-8")
    return [folder / VIEWER, folder / VIEWER_NOTE]


def inputs(loaded: LoadedScene, modules: tuple[ModuleType, ...] = DRAWN_BY) -> dict[str, Any]:
    """What pictures depend on: digests of what the config says, and of the code that draws."""
    config: dict[str, BaseModel] = {"scene": loaded.scene, "rig": loaded.rig, **loaded.cams}
    if loaded.published is not None:
        config["published"] = loaded.published
    code = [Path(str(module.__file__)) for module in modules]
    return {
        "config": {name: _digest(c.model_dump_json().encode()) for name, c in config.items()},
        "code": {path.name: _digest(path.read_bytes()) for path in (*code, Path(__file__))},
    }


def numbers(loaded: LoadedScene, turn: Turn) -> dict[str, float]:
    """What a picture of a turn shows, in figures."""
    lift, acceleration, force = turn.lift, turn.acceleration, turn.force
    figures = {
        "rpm": turn.rpm,
        "greatest_lift_mm": lift.max() * 1e3,
        "greatest_force_n": force.max(),
        "least_acceleration_m_s2": acceleration.min(),
        "greatest_gap_mm": gap(loaded, turn).max() * 1e3,
    }
    return {name: round(float(value), 6) for name, value in figures.items()}


def animate(album: TurnArchive, turn: Turn, path: Path) -> None:
    """One turn: the rig left, lift and contact force with a cursor right."""
    figure = plt.figure(figsize=(8.0, 4.0), dpi=90, layout="constrained")
    parts = figure.add_gridspec(2, 2, width_ratios=[2, 3])
    rig, lift, force = (
        figure.add_subplot(parts[where]) for where in (np.s_[:, 0], np.s_[0, 1], np.s_[1, 1])
    )
    stills.frame_rig(rig, album, turn)
    title = album.loaded.cams[turn.cam].title
    rig.set_title(f"{title}, {turn.rpm:.0f} rpm", fontsize=10)
    cursors = stills.draw_curves(lift, force, album.loaded, turn)
    figure.canvas.draw()
    figure.set_layout_engine("none")  # it would be laid out anew for every frame
    frames = []
    for sample in np.linspace(0, turn.angle.size, FRAMES, endpoint=False).astype(int):
        drawn = stills.draw_rig(rig, album, turn, int(sample))
        for cursor in cursors:
            cursor.set_xdata([stills.degrees(turn)[sample]] * 2)
        frames.append(_rendered(figure))
        for part in drawn:
            part.remove()
    plt.close(figure)
    frames[0].save(
        path,
        save_all=True,
        append_images=frames[1:],
        duration=FRAME_MS,
        loop=0,
        quality=70,
        method=4,
    )


def side_by_side(album: TurnArchive, turns: list[Turn], path: Path) -> None:
    """All cams at one speed, each where its contact force is greatest, and their curves."""
    size = (3.6 * len(turns), 7.0)
    figure, axes = plt.subplots(
        3, len(turns), figsize=size, height_ratios=[3, 2, 2], layout="constrained", squeeze=False
    )
    for (rig, lift, force), turn in zip(axes.T, turns, strict=True):
        sample = int(turn.force.argmax())
        stills.frame_rig(rig, album, turn)
        stills.draw_rig(rig, album, turn, sample)
        rig.set_title(f"{album.loaded.cams[turn.cam].title}, {turn.rpm:.0f} rpm", fontsize=10)
        for cursor in stills.draw_curves(lift, force, album.loaded, turn):
            cursor.set_xdata([stills.degrees(turn)[sample]] * 2)
    figure.savefig(path, dpi=90)
    plt.close(figure)


def _rendered(figure: Figure) -> Image.Image:
    data = BytesIO()
    figure.savefig(data, format="png", dpi=figure.dpi)
    return Image.open(data).convert("RGB")


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()

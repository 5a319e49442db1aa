"""Pictures of the documents: an animation of a turn, and cams side by side."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from cam_rig.show.figure import empty, styled, write
from cam_rig.viewer.blueprint import compared_rpm
from cam_rig.viewer.timeline import Turn
from tools.docs import stills
from tools.docs.turn_archive import TurnArchive, gap

#: File of the animation.
ANIMATION = "turning.webp"
#: File of the cams side by side.
SIDE_BY_SIDE = "side_by_side.png"
#: Number of frames of the animation of one turn.
FRAMES = 72
#: Duration of a frame (ms).
FRAME_MS = 50
#: Dots per inch of the animation.
DPI = 108


def draw_pictures(archive: TurnArchive, noise: Callable[[Path], None], folder: Path) -> list[Path]:
    """Write animation, cams side by side and noise plot, and return their paths.

    The animation shows the cam with the largest gap at the highest speed. ``archive`` contains the
    last turn of every cam at every speed of a run. ``noise`` draws the sound level against rpm into
    a file. ``folder`` must exist.
    """
    rpm = compared_rpm(archive.loaded.scene.schedule.speeds.si_list, None)
    turns = [archive.turn(cam, rpm) for cam in archive.loaded.cams]
    highest = max(turns, key=lambda turn: float(gap(archive.loaded, turn).max()))
    plot = folder / f"{archive.loaded.scene.name}.png"
    animate(archive, highest, folder / ANIMATION)
    side_by_side(archive, turns, folder / SIDE_BY_SIDE)
    noise(plot)
    return [folder / ANIMATION, folder / SIDE_BY_SIDE, plot]


@styled
def animate(archive: TurnArchive, turn: Turn, path: Path) -> None:
    """Draw a turn: rig on the left, lift and contact force with a cursor on the right."""
    figure = empty(3.35)
    parts = figure.add_gridspec(2, 2, width_ratios=[2, 3])
    rig, lift, force = (
        figure.add_subplot(parts[where]) for where in (np.s_[:, 0], np.s_[0, 1], np.s_[1, 1])
    )
    stills.frame_rig(rig, archive, turn)
    title = archive.loaded.cams[turn.cam].title
    rig.set_title(f"{title}, {turn.rpm:.0f} rpm")
    cursors = stills.draw_curves(lift, force, archive.loaded, turn)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # otherwise the layout is computed for every frame
    frames = []
    for sample in np.linspace(0, turn.angle.size, FRAMES, endpoint=False).astype(int):
        drawn = stills.draw_rig(rig, archive, turn, int(sample))
        for cursor in cursors:
            cursor.set_xdata([stills.degrees(turn)[sample]] * 2)
        frames.append(_render(figure))
        for part in drawn:
            part.remove()
    frames[0].save(
        path,
        save_all=True,
        append_images=frames[1:],
        duration=FRAME_MS,
        loop=0,
        quality=70,
        method=4,
    )


@styled
def side_by_side(archive: TurnArchive, turns: list[Turn], path: Path) -> None:
    """Draw all cams at one speed, at their largest contact force, with their curves."""
    figure = empty(4.5)
    axes = figure.subplots(3, len(turns), height_ratios=[3, 2, 2], squeeze=False)
    for (rig, lift, force), turn in zip(axes.T, turns, strict=True):
        sample = int(turn.force.argmax())
        stills.frame_rig(rig, archive, turn)
        stills.draw_rig(rig, archive, turn, sample)
        rig.set_title(f"{archive.loaded.cams[turn.cam].title}, {turn.rpm:.0f} rpm")
        for cursor in stills.draw_curves(lift, force, archive.loaded, turn):
            cursor.set_xdata([stills.degrees(turn)[sample]] * 2)
    write(figure, path)


def _render(figure: Figure) -> Image.Image:
    data = BytesIO()
    figure.savefig(data, format="png", dpi=DPI)
    return Image.open(data).convert("RGB")

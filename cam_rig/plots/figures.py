"""What all figures on paper share: an empty figure, the axis of the cam angle, styles of cams.

Figures are made without pyplot: they need no screen and change nothing of matplotlib's state.
Styles can be told apart in print and by the colour-blind.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray
from cam_rig.drawing.cam_looks import DASHES, MARKERS, cam_look
from cam_rig.drawing.colours import (
    BLACK,
    BLUE,
    GAP,
    GREEN,
    ORANGE,
    PURPLE,
    SKY_BLUE,
    VERMILION,
    web,
)

CAM_ANGLE, CAM_SPEED = "cam angle θ [°]", "cam speed [rpm]"
LEVEL = "sound pressure level [dB re 20 µPa]"
#: Dots per inch of a picture made of pixels.
DPI = 130
#: Curves that are no cam's, such as one cam at several speeds: in none of the cams' colours.
SERIES = tuple(map(web, (BLUE, VERMILION, GREEN, BLACK, PURPLE, ORANGE, SKY_BLUE)))
#: Of the side of a panel, between two markers of a curve.
MARKER_GAP = 0.14


def empty(width: float, height: float) -> Figure:
    """A figure without axes; sides in inches."""
    return Figure(figsize=(width, height), layout="constrained")


def write(figure: Figure, path: Path, dpi: float = DPI) -> None:
    """Write a figure as PNG, or as any format that matplotlib knows by the suffix."""
    figure.savefig(path, dpi=dpi)


def turn_axis(axes: Axes, step: int = 60) -> None:
    """One turn along x, marked every ``step`` degrees, with a grid."""
    axes.set(xlim=(0.0, 360.0), xticks=range(0, 361, step))
    axes.grid(alpha=0.25)


def shade(axes: Axes, x: FloatArray, where: NDArray[np.bool_], label: str | None = None) -> None:
    """Shade the whole height of the axes along ``x`` ``(n,)``, as where contact is lost."""
    axes.fill_between(
        x,
        0.0,
        1.0,
        where=where.tolist(),
        transform=axes.get_xaxis_transform(),
        color=web(GAP),
        alpha=0.15,
        lw=0.0,
        label=label,
    )


def line(cam: str) -> dict[str, Any]:
    """What a line of a cam, or of a named rise, is drawn with, by its name."""
    look = cam_look(cam)
    style = {"color": web(look.colour), "ls": look.dash}
    if look.marked:
        style |= {"marker": look.marker, "ms": 4.0, "markevery": MARKER_GAP}
    return style


def marker(cam: str) -> dict[str, Any]:
    """What points of a cam are drawn with, by its name."""
    return {"color": colour(cam), "marker": cam_look(cam).marker}


def colour(cam: str) -> str:
    """Colour of a cam by its name, the same as in the viewer."""
    return web(cam_look(cam).colour)


def series(index: int) -> dict[str, Any]:
    """Colour and dash of the index-th of several curves that are no cams."""
    return {"color": SERIES[index % len(SERIES)], "ls": DASHES[index % len(DASHES)]}


def series_marker(index: int) -> dict[str, Any]:
    """Colour and marker of the index-th of several curves that are no cams."""
    return {"color": SERIES[index % len(SERIES)], "marker": MARKERS[index % len(MARKERS)]}

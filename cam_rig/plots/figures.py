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
from cam_rig.drawing.colours import CAMS, GAP, web

CAM_ANGLE, CAM_SPEED = "cam angle θ [°]", "cam speed [rpm]"
LEVEL = "sound pressure level [dB re 20 µPa]"
#: Dots per inch of a picture made of pixels.
DPI = 130
#: A dash for each colour of a cam.
DASHES: tuple[Any, ...] = (
    "-",
    (0, (6, 2)),
    (0, (5, 1.5, 1, 1.5)),
    (0, (2, 1.2)),
    (0, (9, 2, 1, 2, 1, 2)),
    (0, (1, 1)),
)
#: Markers in the same order.
MARKERS = ("o", "s", "^", "D", "v", "P")


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


def line(index: int) -> dict[str, Any]:
    """Colour and dash of the index-th cam."""
    return {"color": colour(index), "ls": DASHES[index % len(DASHES)]}


def marker(index: int) -> dict[str, Any]:
    """Colour and marker of the index-th cam."""
    return {"color": colour(index), "marker": MARKERS[index % len(MARKERS)]}


def colour(index: int) -> str:
    """Colour of the index-th cam, the same as in the viewer."""
    return web(CAMS[index % len(CAMS)])

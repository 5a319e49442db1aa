"""Line styles of several cams in one plot: readable in print and by the colour-blind."""

from __future__ import annotations

from typing import Any

from cam_rig.drawing.colours import CAMS, web

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


def line(index: int) -> dict[str, Any]:
    """Colour and dash of the index-th cam."""
    return {"color": colour(index), "ls": DASHES[index % len(DASHES)]}


def marker(index: int) -> dict[str, Any]:
    """Colour and marker of the index-th cam."""
    return {"color": colour(index), "marker": MARKERS[index % len(MARKERS)]}


def colour(index: int) -> str:
    """Colour of the index-th cam, the same as in the viewer."""
    return web(CAMS[index % len(CAMS)])

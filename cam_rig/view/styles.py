"""Line styles of several cams in one plot: readable in print and by the colour-blind."""

from __future__ import annotations

from typing import Any

#: Okabe-Ito colours without the yellow, each with a dash of its own.
LINES: tuple[dict[str, Any], ...] = (
    {"color": "#0072B2", "ls": "-"},
    {"color": "#D55E00", "ls": (0, (6, 2))},
    {"color": "#009E73", "ls": (0, (5, 1.5, 1, 1.5))},
    {"color": "#CC79A7", "ls": (0, (2, 1.2))},
    {"color": "#000000", "ls": (0, (9, 2, 1, 2, 1, 2))},
    {"color": "#E69F00", "ls": (0, (1, 1))},
)
#: Markers in the same order.
MARKERS = ("o", "s", "^", "D", "v", "P")


def line(index: int) -> dict[str, Any]:
    """Colour and dash of the index-th cam."""
    return dict(LINES[index % len(LINES)])


def marker(index: int) -> dict[str, Any]:
    """Colour and marker of the index-th cam."""
    return {"color": LINES[index % len(LINES)]["color"], "marker": MARKERS[index % len(MARKERS)]}

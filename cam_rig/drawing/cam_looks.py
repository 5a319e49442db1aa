"""What a cam is drawn with: one colour, dash and marker by its name, in every picture.

The look follows from the name alone, whatever else is in the picture. Shipped cams have their
place in one table, where those that are shown together have different colours; so have the named
rises, which look like the cam of their name. Any other name is hashed to a look that none of them
has. Colours are Tol's "bright" scheme without its grey, with dark blue and dark red of his "dark"
one, which the colour-blind tell apart; in grey, dash and marker do (Tol, Colour schemes, 2021).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from zlib import crc32

COLOURS = (
    *(0x4477AAFF, 0xEE6677FF, 0x228833FF, 0xCCBB44FF, 0xAA3377FF, 0x66CCEEFF),
    *(0x222255FF, 0x663333FF),
)
#: Offset, and ink and gap in line widths, as matplotlib has them; a marker for each dash.
DASHES: tuple[Any, ...] = (
    "-",
    (0, (6, 2)),
    (0, (5, 1.5, 1, 1.5)),
    (0, (2, 1.2)),
    (0, (9, 2, 1, 2, 1, 2)),
    (0, (1, 1)),
    (0, (12, 3)),
    (0, (4, 1.2, 1, 1.2, 1, 1.2)),
)
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
#: Shipped cams, then rises that no cam is named after. New ones go to the end: places are for ever.
NAMES = (
    *("bezier15", "poly345", "poly4567", "cycloidal", "tm21", "flat", "oscillating_flat"),
    *("point", "arcs_convex", "arcs_straight", "arcs_centres", "gunt_gl110", "bezier_segments"),
    *("b_spline", "measured", "modified_sine", "modified_trapezoid"),
    *("half_rises", "trigonometric", "conjugate", "constant_breadth", "constant_diameter"),
    *("eccentric_roller", "inclined_flat", "oscillating_conjugate", "oscillating_point"),
    *("oscillating_roller", "worked_example_constant_velocity", "worked_example_harmonic"),
    "worked_example_quintic",
    *("constant_velocity", "simple_harmonic", "bezier9"),
    *("bezier4_start", "bezier6_start", "bezier8_start"),
    *("bezier4_end", "bezier6_end", "bezier8_end"),
    "designed",
)
#: Places for shipped names, those to come among them: no look of one's own cam changes with them.
PLACES = 48
#: Rises that are the same curve as another.
SAME = {"bezier5": "poly345", "bezier7": "poly4567"}


@dataclass(frozen=True)
class CamLook:
    """How a cam is drawn.

    Parameters
    ----------
    colour : 0xRRGGBBAA
    dash : of `DASHES`
    marker : of `MARKERS`, for points
    marked : a line carries the marker too, for its dash is another cam's as well
    """

    colour: int
    dash: Any
    marker: str
    marked: bool


def cam_look(name: str) -> CamLook:
    """The look of a cam or a named rise.

    Of a name that is not in `NAMES` the colour is one of eight by its CRC-32, and dash and marker
    are a pair that no name of the table has.

    Examples
    --------
    >>> web(cam_look("bezier15").colour), web(cam_look("poly345").colour)
    ('#4477aa', '#ee6677')
    """
    kinds, name = len(DASHES), SAME.get(name, name)
    if name in NAMES:
        place = NAMES.index(name)
        colour = COLOURS[place % len(COLOURS)]
    else:
        free, code = kinds**2 - PLACES, crc32(name.encode())
        place, colour = PLACES + code % free, COLOURS[code // free % len(COLOURS)]
    marker = MARKERS[(place + place // kinds) % kinds]
    return CamLook(colour, DASHES[place % kinds], marker, marked=place >= kinds)


def of_cam(name: str) -> int:
    """The colour of a cam, 0xRRGGBBAA."""
    return cam_look(name).colour

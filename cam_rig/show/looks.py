"""Colours, dashes and markers of cams by name, colours of quantities, and titles.

A look is a colour, a dash and a marker. The look of a cam depends on its name only, not on the
other contents of a picture. A rise is the motion law of a single segment, and has the look of the
cam with its name. Shipped cams and named rises are in one table, in which cams that are shown
together have different colours. The look of any other name follows from a hash of the name, and is
not in the table.

The colours are Tol's "bright" scheme without its grey, with dark blue and dark red of his "dark"
scheme. Colour-blind readers can distinguish them, and dash and marker differ in grey (Tol, Colour
schemes, 2021).
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from cam_rig.show.tables import typeset_number
from cam_rig.units import FloatArray

#: Colours by which cams are distinguished in pictures, as 0xRRGGBBAA.
COLOURS = (
    *(0x4477AAFF, 0xEE6677FF, 0x228833FF, 0xCCBB44FF, 0xAA3377FF, 0x66CCEEFF),
    *(0x222255FF, 0x663333FF),
)

#: Dashes of cams in matplotlib's form: offset, then dash and gap in line widths.
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

#: Markers by which cams are distinguished in pictures, in matplotlib's notation, one for each dash.
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
#: Names of the shipped cams, then of rises (motion laws of a single segment) without a cam of the
#: same name. The index of a name determines its look, so new names are appended.
LISTED_NAMES = (
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
    *("designed", "polydyne_300", "motion_tasks", "skewed_trapezoid", "shaped_300", "quiet"),
    "poly4567_table",
)

#: Number of looks (colour, dash and marker) that are reserved for listed names, including future
#: names. The look of a user's cam does not change if a name is added.
RESERVED_LOOKS = 48
#: Names of rises that are the same curve as another rise, and the name of that rise. Both have the
#: same look.
EQUAL_RISES = {"bezier5": "poly345", "bezier7": "poly4567"}


@dataclass(frozen=True)
class CamLook:
    """Look of a cam in pictures: its colour, dash and marker."""

    colour: int  #: 0xRRGGBBAA
    dash: Any  #: in matplotlib's form
    marker: str  #: of points
    marked: bool  #: True if a line needs the marker too, because another cam has the same dash


def cam_look(name: str) -> CamLook:
    """Return the look of a cam or a rise: its colour, dash and marker.

    The look of a name that is not listed is computed from its CRC-32, and differs from all listed
    looks.
    """
    count, name = len(DASHES), EQUAL_RISES.get(name, name)
    if name in LISTED_NAMES:
        index = LISTED_NAMES.index(name)
        colour = COLOURS[index % len(COLOURS)]
    else:
        free, code = count**2 - RESERVED_LOOKS, crc32(name.encode())
        index, colour = RESERVED_LOOKS + code % free, COLOURS[code // free % len(COLOURS)]
    marker = MARKERS[(index + index // count) % count]
    return CamLook(colour, DASHES[index % count], marker, marked=index >= count)


def of_cam(name: str) -> int:
    """Return the colour of a cam, 0xRRGGBBAA."""
    return cam_look(name).colour


# Palette of plots and viewer, as 0xRRGGBBAA for Rerun.

SKY_BLUE = 0x56B4E9FF
BLUE = 0x0072B2FF
GREEN = 0x009E73FF
PURPLE = 0xCC79A7FF
ORANGE = 0xE69F00FF
VERMILION = 0xD55E00FF
BLACK = 0x000000FF
LIGHT_GREY = 0xCCCCCCFF
GREY = 0x999999FF
LIFT = SKY_BLUE  #: displacement of the follower
LAW = 0x00426BFF  #: displacement law
VELOCITY = GREEN
ACCELERATION = PURPLE
FORCE = ORANGE  #: contact force
LANDING = VERMILION
LIFT_OFF = 0x882255FF
TWIST = 0x332288FF  #: of the shaft
LEVEL = 0x117733FF  #: sound level
SPEED = 0xAA4499FF  #: cam speed
BANDS = 0x44AA99FF  #: third-octave bands
FOLLOWER = 0x8C6D31FF  #: outline of the follower
GAP = 0xFF0000FF  #: gap between follower and cam
ZERO = 0x661100FF  #: line of zero contact force
#: Colours of curves that do not belong to different cams, such as one cam at several speeds. No cam
#: has one of these colours.
SERIES = (BLUE, VERMILION, GREEN, BLACK, PURPLE, ORANGE, SKY_BLUE)
#: Colour of the background of curves while the follower is in flight.
FLIGHT = 0xF2DADAFF
#: Colours of the curves of lift s and its derivatives s′, s″ and s‴ on paper.
DERIVATIVES = (BLUE, GREEN, VERMILION, BLACK)
#: Displayed names of the lift s and its derivatives s′, s″ and s‴.
DERIVATIVE_NAMES = ("lift s", "velocity s′", "acceleration s″", "jerk s‴")
#: Text that follows the unit of lift in the units of s, s′, s″ and s‴.
PER_RADIAN = ("", "/rad", "/rad²", "/rad³")
#: Colours of the one or two discs of a cam on paper.
DISCS = (BLUE, VERMILION)
#: Colour of the pitch curve of a cam on paper.
PITCH_CURVE = GREEN
#: Colour of the lines that mark limits in figures on paper.
LIMIT = PURPLE


def web(colour: int) -> str:
    """Return a colour as ``#rrggbb``, without its opacity."""
    return f"#{colour >> 8:06x}"


def tokens() -> str:
    """Return the style sheet with colours and sizes of pages in a browser."""
    return Path(__file__).with_name("tokens.css").read_text(encoding="utf-8")


def tint(colour: int) -> int:
    """Return the opaque mixture of a quarter of a colour and white."""
    channels = (colour >> shift & 255 for shift in (24, 16, 8))
    mixed = bytes(round(255 + 0.25 * (channel - 255)) for channel in channels)
    return int.from_bytes(mixed + b"\xff", "big")


#: Millimetres per metre.
MM = 1e3
#: Number of decimals of the coordinates in mm that are sent to a browser page.
DECIMALS = 4


def millimetres(points: FloatArray) -> list[list[float]]:
    """Return points `(n, 2)` in m as lists of mm for a page."""
    rounded: list[list[float]] = np.round(MM * points, DECIMALS).tolist()
    return rounded


# Differences of two signals. Differences that are only rounding errors are plotted on a fixed axis,
# with a text.

#: Difference of two signals (µm for lifts, N for forces) below which it counts as rounding error.
#: It is below the resolution of any gauge.
MIN_DIFFERENCE = 1e-3
#: Text that is displayed for two signals whose difference is rounding error.
EQUAL = "equal to rounding"
#: Half range (µm for lifts, N for forces) of the axis on which a difference is plotted that is only
#: rounding error. The difference then appears as zero.
EQUAL_REACH = 1.0


def is_rounding(largest: float) -> bool:
    """Return True if the difference of two signals counts as rounding error.

    `largest` is the largest difference, in µm for lifts or N for forces.
    """
    return largest < MIN_DIFFERENCE


def reach(largest: float) -> float:
    """Return the half range of an axis on which a difference is plotted.

    The axis is centred on zero. `largest` is the largest difference in µm or N.
    """
    return EQUAL_REACH if is_rounding(largest) else 1.15 * largest


# Texts in pictures.

#: Pattern of the name of a polynomial law, such as poly345.
_POLYNOMIAL = re.compile(r"poly(\d+)")
#: Pattern of the name of a Bézier law, such as bezier4_start.
_BEZIER = re.compile(r"bezier(\d+)(.*)")
#: Largest number of characters of a cam's title in a legend or above a panel.
LONGEST_TITLE = 28
#: Smallest power of ten of a number on a logarithmic axis that is written without an exponent.
MIN_PLAIN_POWER = -3
#: Largest power of ten of a number on a logarithmic axis that is written without an exponent.
MAX_PLAIN_POWER = 3


def in_words(name: str) -> str:
    """Return a title for a cam or a rig, computed from its name.

    For example, the title of poly345 is "Polynomial 3-4-5".
    """
    if match := _POLYNOMIAL.fullmatch(name):
        return f"Polynomial {'-'.join(match[1])}"
    if match := _BEZIER.fullmatch(name):
        return f"Bézier degree {match[1]}{match[2].replace('_', ', ')}"
    words = [_title_word(word) for word in name.split("_")]
    return " ".join([words[0][:1].upper() + words[0][1:], *words[1:]])


def shortened(title: str, max_letters: int) -> str:
    """Return a title of up to `max_letters` characters, with "…" in its middle if cut."""
    if len(title) <= max_letters:
        return title
    half = max_letters // 2
    return f"{title[:half].rstrip()}…{title[1 - half :].lstrip()}"


def title_of(titles: Mapping[str, str], cam: str) -> str:
    """Return the title of a cam for a legend, or a title made from its name."""
    return short(titles.get(cam) or in_words(cam))


def short(title: str) -> str:
    """Return a title shortened for a legend."""
    return shortened(title, LONGEST_TITLE)


def four_digits(value: float) -> str:
    """Return a number with four significant digits and without an exponent."""
    text = f"{value:.4g}"
    return (f"{float(text):.0f}" if "e+" in text else text).replace("-", "−")


def log_tick(value: float) -> str:
    """Return the label of a logarithmic tick, empty if it is not positive."""
    if value <= 0.0:
        return ""
    power = math.floor(math.log10(value) + 1e-9)
    if MIN_PLAIN_POWER <= power <= MAX_PLAIN_POWER:
        return f"{value:g}"
    return typeset_number(float(f"{value:.0e}"), ".0e")


def _title_word(word: str) -> str:
    """Return a word of a title: "TM21" for tm21, and "mark 2" for mark2."""
    match = re.fullmatch(r"([a-z]+)(\d+)", word)
    if match is None:
        return word
    return word.upper() if len(match[1]) <= 3 else f"{match[1]} {match[2]}"

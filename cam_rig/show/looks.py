"""What a cam is drawn with: one colour, dash and marker by its name, in every picture.

The look follows from the name alone, whatever else is in the picture. Shipped cams have their
place in one table, where those that are shown together have different colours; so have the named
rises, which look like the cam of their name. Any other name is hashed to a look that none of them
has. Colours are Tol's "bright" scheme without its grey, with dark blue and dark red of his "dark"
one, which the colour-blind tell apart; in grey, dash and marker do (Tol, Colour schemes, 2021).
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
    """How a cam is drawn, its colour as 0xRRGGBBAA.

    Where it is ``marked`` a line carries the marker too, for its dash is another cam's as well.
    """

    colour: int
    dash: Any
    marker: str
    marked: bool


def cam_look(name: str) -> CamLook:
    """The look of a cam or a rise; of a name not in `NAMES` by its CRC-32, as no name there has."""
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


# The one palette of plots and viewer, 0xRRGGBBAA as Rerun has it.

SKY_BLUE, BLUE, GREEN, PURPLE = 0x56B4E9FF, 0x0072B2FF, 0x009E73FF, 0xCC79A7FF
ORANGE, VERMILION, BLACK, LIGHT_GREY = 0xE69F00FF, 0xD55E00FF, 0x000000FF, 0xCCCCCCFF
LIFT, LAW, VELOCITY, ACCELERATION = SKY_BLUE, 0x00426BFF, GREEN, PURPLE
FORCE, LANDING, LIFT_OFF, TWIST = ORANGE, VERMILION, 0x882255FF, 0x332288FF
LEVEL, SPEED, BANDS = 0x117733FF, 0xAA4499FF, 0x44AA99FF
GREY, FOLLOWER, GAP, ZERO = 0x999999FF, 0x8C6D31FF, 0xFF0000FF, 0x661100FF
#: Curves that are no cam's, such as one cam at several speeds: in none of the cams' colours.
SERIES = (BLUE, VERMILION, GREEN, BLACK, PURPLE, ORANGE, SKY_BLUE)
#: Behind curves, where the follower is off the cam.
FLIGHT = 0xF2DADAFF
#: On paper: s to s''', the discs of a cam, their pitch curve, and what may not be passed.
DERIVATIVES = (BLUE, GREEN, VERMILION, BLACK)
#: Names of s, s′, s″ and s‴, and the suffixes of their units after the unit of lift.
DERIVATIVE_NAMES = ("lift s", "velocity s′", "acceleration s″", "jerk s‴")
PER_RADIAN = ("", "/rad", "/rad²", "/rad³")
DISCS, PITCH_CURVE, LIMIT = (BLUE, VERMILION), GREEN, PURPLE


def web(colour: int) -> str:
    """The colour as ``#rrggbb``, without its opacity."""
    return f"#{colour >> 8:06x}"


def tokens() -> str:
    """Colours and sizes of pages in a browser, light and dark, as variables of a style sheet."""
    return Path(__file__).with_name("tokens.css").read_text(encoding="utf-8")


def tint(colour: int) -> int:
    """A colour as it is seen when a quarter of it lies on white, opaque."""
    parts = (colour >> shift & 255 for shift in (24, 16, 8))
    mixed = bytes(round(255 + 0.25 * (part - 255)) for part in parts)
    return int.from_bytes(mixed + b"\xff", "big")


# Outlines in the plane, in mm, as lists of strips: circles, stems, faces, arms, bearings.

#: mm in a metre, and how many decimals of them a page is sent.
MM, DECIMALS = 1e3, 4


def millimetres(points: FloatArray) -> list[list[float]]:
    """Points (m) as a page draws them."""
    found: list[list[float]] = np.round(MM * points, DECIMALS).tolist()
    return found


# A cam as an instrument: a ring of degrees around it, which way it turns, its body filled.


# How large a difference is drawn: what only rounding makes is drawn as none, and called so.

#: Differences smaller than this, in µm and N, are of rounding: no bench has such gauges.
LEAST_DIFFERENCE = 1e-3
#: What is written where there is no other, and how far (µm, N) the axis goes there.
EQUAL, EQUAL_REACH = "equal to rounding", 1.0


def is_rounding(largest: float) -> bool:
    """Whether a largest difference (µm, N) is only of rounding."""
    return largest < LEAST_DIFFERENCE


def reach(largest: float) -> float:
    """How far to both sides of zero an axis goes for a largest difference (µm, N)."""
    return EQUAL_REACH if is_rounding(largest) else 1.15 * largest


# What is written in pictures: names in words, powers of ten typeset, a true minus.

#: Names that are more than words and digits.
_POLYNOMIAL, _BEZIER = re.compile(r"poly(\d+)"), re.compile(r"bezier(\d+)(.*)")
#: Letters of a cam's title in a legend or over a panel, at most.
LONGEST_TITLE = 28
#: Powers of ten from and to which a number is written out.
PLAIN = (-3, 3)


def in_words(name: str) -> str:
    """The name of a cam, rise or rig in words, where its title is not at hand."""
    if found := _POLYNOMIAL.fullmatch(name):
        return f"Polynomial {'-'.join(found[1])}"
    if found := _BEZIER.fullmatch(name):
        return f"Bézier degree {found[1]}{found[2].replace('_', ', ')}"
    words = [_word(word) for word in name.split("_")]
    return " ".join([words[0][:1].upper() + words[0][1:], *words[1:]])


def shortened(title: str, longest: int) -> str:
    """A title of so many letters at the most: of a long one its beginning and its end."""
    if len(title) <= longest:
        return title
    half = longest // 2
    return f"{title[:half].rstrip()}…{title[1 - half :].lstrip()}"


def title_of(titles: Mapping[str, str], cam: str) -> str:
    """A cam's title, as `short`; its name in words where there is none."""
    return short(titles.get(cam) or in_words(cam))


def short(title: str) -> str:
    """A title that a legend has room for."""
    return shortened(title, LONGEST_TITLE)


def four_digits(value: float) -> str:
    """A number of four significant digits, written out."""
    shown = f"{value:.4g}"
    return (f"{float(shown):.0f}" if "e+" in shown else shown).replace("-", "−")


def log_tick(value: float) -> str:
    """What a tick of a logarithmic axis is called."""
    if value <= 0.0:
        return ""
    power = math.floor(math.log10(value) + 1e-9)
    if PLAIN[0] <= power <= PLAIN[1]:
        return f"{value:g}"
    return typeset_number(float(f"{value:.0e}"), ".0e")


def _word(word: str) -> str:
    """Short letters with digits are a code, TM21; a word with digits is one with a number."""
    found = re.fullmatch(r"([a-z]+)(\d+)", word)
    if found is None:
        return word
    return word.upper() if len(found[1]) <= 3 else f"{found[1]} {found[2]}"

"""What is written in pictures: names in words, powers of ten typeset, a true minus."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from cam_rig.tables import printed

#: Names that are more than words and digits.
_POLYNOMIAL, _BEZIER = re.compile(r"poly(\d+)"), re.compile(r"bezier(\d+)(.*)")
#: Letters of a cam's title in a legend or over a panel, at most.
LONGEST_TITLE = 28
#: Powers of ten from and to which a number is written out.
PLAIN = (-3, 3)


def in_words(name: str) -> str:
    """The name of a cam, rise or rig in words, where its title is not at hand.

    Examples
    --------
    >>> [in_words(name) for name in ("poly345", "bezier15", "bezier4_start", "tm21", "my_cam")]
    ['Polynomial 3-4-5', 'Bézier degree 15', 'Bézier degree 4, start', 'TM21', 'My cam']
    """
    if found := _POLYNOMIAL.fullmatch(name):
        return f"Polynomial {'-'.join(found[1])}"
    if found := _BEZIER.fullmatch(name):
        return f"Bézier degree {found[1]}{found[2].replace('_', ', ')}"
    words = [_word(word) for word in name.split("_")]
    return " ".join([words[0][:1].upper() + words[0][1:], *words[1:]])


def shortened(title: str, longest: int) -> str:
    """A title of so many letters at the most: of a long one its beginning and its end.

    Examples
    --------
    >>> shortened("Polynomial 3-4-5", 16), shortened("Cam of the left inlet valve, v2", 16)
    ('Polynomial 3-4-5', 'Cam of t…lve, v2')
    """
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
    """A number of four significant digits, written out.

    Examples
    --------
    >>> four_digits(28706.4), four_digits(117.04), four_digits(-0.25)
    ('28710', '117', '−0.25')
    """
    shown = f"{value:.4g}"
    return (f"{float(shown):.0f}" if "e+" in shown else shown).replace("-", "−")


def log_tick(value: float) -> str:
    """What a tick of a logarithmic axis is called.

    Examples
    --------
    >>> [log_tick(value) for value in (0.03, 300.0, 1e6, 3e-9)]
    ['0.03', '300', '10⁶', '3·10⁻⁹']
    """
    if value <= 0.0:
        return ""
    power = math.floor(math.log10(value) + 1e-9)
    if PLAIN[0] <= power <= PLAIN[1]:
        return f"{value:g}"
    return printed(float(f"{value:.0e}"), ".0e")


def _word(word: str) -> str:
    """Short letters with digits are a code, TM21; a word with digits is one with a number."""
    found = re.fullmatch(r"([a-z]+)(\d+)", word)
    if found is None:
        return word
    return word.upper() if len(found[1]) <= 3 else f"{found[1]} {found[2]}"

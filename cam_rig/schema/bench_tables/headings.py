"""Headings of tables of readings, in several languages: what a column holds, and in which unit."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from typing import Literal

from cam_rig.units import TURN

Kind = Literal["angle", "lift", "other"]


def _by_word(words: dict[float, str]) -> dict[str, float]:
    return {word: factor for factor, listed in words.items() for word in listed.split()}


#: Word of a heading to the factor of the unit to SI, rad; letters are without their accents.
ANGLE_UNITS = _by_word(
    {
        TURN / 360.0: "° deg degs degree degrees grad grade grado grados gradi grau graus degres",
        1.0: "rad rads radian radians radianes radianti radiant",
        TURN: "turn turns rev revs vuelta vueltas tour tours giri volta",
        TURN / 400.0: "gon gons",
    }
)
#: The same of lengths, m.
LENGTH_UNITS = _by_word(
    {
        1.0: "m",
        1e-2: "cm",
        1e-3: "mm",
        1e-6: "um μm µm micron microns micra micras mikrometer",
        0.0254: 'in inch inches zoll pouce pouces pollice pollici pulgada pulgadas polegadas "',
        2.54e-5: "thou mil mils",
    }
)

#: What words of an angle, and of a lift, begin with or hold, in English, Spanish, German, French,
#: Italian and Portuguese.
ANGLE_WORDS = ("angle", "angul", "angol", "winkel", "theta", "rotat", "rotac", "rotaz", "drehung")
ANGLE_LETTERS = frozenset(("θ", "φ", "phi", "ang", "giro"))
LIFT_WORDS = (
    *("lift", "hub", "elevac", "levant", "alzad", "alzat", "levee", "levage", "erhebung", "weg"),
    *("displac", "desplaz", "deplac", "spost", "carrera", "corsa", "course", "altura", "elevat"),
    *("hauteur", "hohe", "altezza", "curso", "reading", "lectura", "ablesung", "lecture"),
)
LIFT_LETTERS = frozenset(("s", "h", "y", "z"))


@dataclass(frozen=True)
class Heading:
    """What a column holds by its heading; ``factor`` to SI is None where no unit is named."""

    text: str
    kind: Kind
    factor: float | None


def heading(text: str) -> Heading:
    """What a heading says.

    Examples
    --------
    >>> heading("Ángulo de leva (grados)").kind, heading("Nockenhub [mm]")
    ('angle', Heading(text='Nockenhub [mm]', kind='lift', factor=0.001))
    """
    plain = _plain(text)
    words = re.findall(r'[a-zθφμµ]+|°|"', plain)
    angle = next((ANGLE_UNITS[word] for word in reversed(words) if word in ANGLE_UNITS), None)
    length = next((LENGTH_UNITS[word] for word in reversed(words) if word in LENGTH_UNITS), None)
    if any(word in plain for word in ANGLE_WORDS) or not ANGLE_LETTERS.isdisjoint(words):
        return Heading(text, "angle", angle)
    if any(word in plain for word in LIFT_WORDS) or not LIFT_LETTERS.isdisjoint(words):
        return Heading(text, "lift", length)
    if angle is not None:
        return Heading(text, "angle", angle)
    return Heading(text, "other" if length is None else "lift", length)


def plain_words(text: str) -> list[str]:
    """The words of a heading in small letters without accents.

    Examples
    --------
    >>> plain_words("Précharge [N]")
    ['precharge', 'n']
    """
    return re.findall(r"[a-z]+", _plain(text))


def _plain(text: str) -> str:
    """Small letters without accents."""
    parts = unicodedata.normalize("NFD", text.casefold())
    return "".join(part for part in parts if not unicodedata.combining(part))

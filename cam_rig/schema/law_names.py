"""Names of laws in controllers, handbooks and guidelines, which files and commands accept."""

from __future__ import annotations

import re
from dataclasses import dataclass

from cam_rig.errors import did_you_mean


@dataclass(frozen=True)
class LawNames:
    """Other names of a law, joined by commas: of three makers' manuals, and in general use.

    The manuals are those of `MANUALS`.
    """

    law: str
    twincat: str
    codesys: str
    siemens: str
    other: str

    @property
    def names(self) -> list[str]:
        """All other names."""
        texts = (self.twincat, self.codesys, self.siemens, self.other)
        return [name for text in texts if text for name in text.split(", ")]


#: Manuals from which the columns of `LAW_NAMES` are taken.
MANUALS = {
    "twincat": "Beckhoff Infosys, EMotionFunctionType (TF55xx) and MC_MotionFunctionType (TF5050)",
    "codesys": "CODESYS SoftMotion, overview of defined segment types",
    "siemens": "Siemens CamTool, configuration manual 12.2004, section 4.8",
}
#: Table of names: law, TwinCAT, CODESYS, Siemens, others. Each other name belongs to one law.
_TABLE = """
constant_velocity | Linear, POLYNOM1 | Line | | uniform motion
simple_harmonic | Sinusoid | | | simple sinoid, simple sine, SHM
cycloidal | InclinedSinusoid, BESTEHORN | InclinedSine | inclined sine curve | Bestehorn sinoid
modified_sine | ModifiedSinusoid, MODSINUSLINIE | ModifiedSine | modified sine curve |
modified_trapezoid | AccelerationTrapezoid, BESCHLTRAPEZ | | modified acceleration trapezoid | MT
poly345 | POLYNOM5 | | | 3-4-5 polynomial
poly4567 | POLYNOM7 | | | 4-5-6-7 polynomial
poly5 | Polynomial5, POLYNOM5_MM | Poly5 | | 5th polynomial
poly7 | Polynomial7, POLYNOM7_MM | Poly7 | | 7th polynomial
harmonic_combination | HarmonicCombination | | harmonic combination |
sine_line_combination | SinusoidCombination, SINUS_GERADE_KOMBI | | |
parabolic | | | | quadratic parabola, constant acceleration, parabola
scca | | | | sine constant cosine acceleration
modified_constant_velocity | | | | MCV, MCV50, MSC50
low_impact_crossover | | | | 3-4-5-6-7 polynomial
poly8 | | | | eighth-degree polynomial, 8th polynomial
gutman13 | | | | Gutman 1-3
freudenstein13 | | | | Freudenstein 1-3
freudenstein135 | | | | Freudenstein 1-3-5
dwell | | | | rest
"""
#: Rows of the table of names.
LAW_NAMES = [
    LawNames(*(cell.strip() for cell in line.split("|"))) for line in _TABLE.strip().splitlines()
]


def _spelling(name: str) -> str:
    """Return a name in small letters, without marks between them."""
    return re.sub(r"[^a-z0-9]", "", name.lower())


#: Laws by the spelling of their other names.
_ALIASES = {_spelling(name): row.law for row in LAW_NAMES for name in row.names}


def law_name(name: str) -> str:
    """Return the name of a law that files use, from any of its names.

    Case, spaces and hyphens do not matter. A name that is not in the table is returned in small
    letters, with _ between its words.

    Examples
    --------
    >>> law_name("Inclined sine curve"), law_name("Double harmonic")
    ('cycloidal', 'double_harmonic')
    """
    spelling = _spelling(name.removeprefix("MOTIONFUNCTYPE_"))
    return _ALIASES.get(spelling, re.sub(r"\W+", "_", name.lower()))


def suggest_law(name: str, names: list[str]) -> str:
    """Return a suggestion of a name of a law for an error message, "" if none is likely.

    ``names`` are the names that files use.
    """
    others = [other for row in LAW_NAMES for other in row.names]
    return did_you_mean(name, names) or did_you_mean(name, others)

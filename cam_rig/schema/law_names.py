"""Names of laws in controllers, handbooks and guidelines, which files and commands accept."""

from __future__ import annotations

import re
from dataclasses import dataclass

from cam_rig.errors import did_you_mean


@dataclass(frozen=True)
class LawNames:
    """Other names of a law: of three makers' manuals, and of textbooks.

    The manuals are those of `MANUALS`. Names in `other` are in general use.
    """

    law: str
    twincat: tuple[str, ...] = ()
    codesys: tuple[str, ...] = ()
    siemens: tuple[str, ...] = ()
    other: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """All other names."""
        return (*self.twincat, *self.codesys, *self.siemens, *self.other)


#: Manuals from which the columns of `LAW_NAMES` are taken.
MANUALS = {
    "twincat": "Beckhoff Infosys, EMotionFunctionType (TF55xx) and MC_MotionFunctionType (TF5050)",
    "codesys": "CODESYS SoftMotion, overview of defined segment types",
    "siemens": "Siemens CamTool, configuration manual 12.2004, section 4.8",
}
#: Table of names. Each other name belongs to one law.
LAW_NAMES = (
    LawNames("constant_velocity", ("Linear", "POLYNOM1"), ("Line",), (), ("uniform motion",)),
    LawNames("simple_harmonic", ("Sinusoid",), (), (), ("simple sinoid", "simple sine", "SHM")),
    LawNames(
        "cycloidal",
        ("InclinedSinusoid", "BESTEHORN"),
        ("InclinedSine",),
        ("inclined sine curve",),
        ("Bestehorn sinoid", "cycloid"),
    ),
    LawNames(
        "modified_sine",
        ("ModifiedSinusoid", "MODSINUSLINIE"),
        ("ModifiedSine",),
        ("modified sine curve",),
        ("modified sinoid", "MS"),
    ),
    LawNames(
        "modified_trapezoid",
        ("AccelerationTrapezoid", "BESCHLTRAPEZ"),
        (),
        ("modified acceleration trapezoid",),
        ("MT",),
    ),
    LawNames("poly345", ("POLYNOM5",), (), (), ("3-4-5 polynomial",)),
    LawNames("poly4567", ("POLYNOM7",), (), (), ("4-5-6-7 polynomial",)),
    LawNames("poly5", ("Polynomial5", "POLYNOM5_MM"), ("Poly5",), (), ("5th polynomial",)),
    LawNames("poly7", ("Polynomial7", "POLYNOM7_MM"), ("Poly7",), (), ("7th polynomial",)),
    LawNames("harmonic_combination", ("HarmonicCombination",), (), ("harmonic combination",)),
    LawNames("sine_line_combination", ("SinusoidCombination", "SINUS_GERADE_KOMBI")),
    LawNames("parabolic", other=("quadratic parabola", "constant acceleration", "parabola")),
    LawNames("scca", other=("sine constant cosine acceleration",)),
    LawNames("modified_constant_velocity", other=("MCV", "MCV50", "MSC50")),
    LawNames("low_impact_crossover", other=("3-4-5-6-7 polynomial",)),
    LawNames("poly8", other=("eighth-degree polynomial", "8th polynomial")),
    LawNames("gutman13", other=("Gutman 1-3",)),
    LawNames("freudenstein13", other=("Freudenstein 1-3",)),
    LawNames("freudenstein135", other=("Freudenstein 1-3-5",)),
    LawNames("dwell", other=("rest",)),
)


def _spelling(name: str) -> str:
    """Return a name in small letters, without marks between them."""
    return re.sub(r"[^a-z0-9]", "", name.lower())


#: Laws by the spelling of their other names.
_ALIASES = {_spelling(name): row.law for row in LAW_NAMES for name in row.names}


def law_name(name: str) -> str:
    """Return the name of a law that files use, from any of its names.

    Case, spaces and hyphens do not matter. A name that is not in the table is returned unchanged.

    Examples
    --------
    >>> law_name("Inclined sine curve"), law_name("poly345")
    ('cycloidal', 'poly345')
    """
    for text in (name, name.removeprefix("MOTIONFUNCTYPE_")):
        law = _ALIASES.get(_spelling(text))
        if law is not None:
            return law
    return name


def suggest_law(name: str, names: list[str]) -> str:
    """Return a suggestion of a name of a law for an error message, "" if none is likely.

    ``names`` are the names that files use.
    """
    others = [other for row in LAW_NAMES for other in row.names]
    return did_you_mean(name, names) or did_you_mean(name, others)

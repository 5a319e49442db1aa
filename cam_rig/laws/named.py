"""The rises known by a name: one unit rise each, and where it comes from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

from cam_rig.arrays import FloatArray
from cam_rig.laws import fit as analytic
from cam_rig.laws.families import rises
from cam_rig.laws.families.trigonometric_rises import (
    MODIFIED_SINE,
    MODIFIED_TRAPEZOID,
    cycloidal,
    simple_harmonic,
)
from cam_rig.laws.fit import Section
from cam_rig.laws.pieces import Pieces


@dataclass(frozen=True)
class NamedRise:
    """A rise from 0 to 1 over u ∈ [0, 1].

    Parameters
    ----------
    source : where it comes from; equations 3.x are the laws thesis's
    shape : its Bernstein ordinates, or its analytic sections
    slopes : slope of what it joins before and after: 0 for a dwell
    """

    source: str
    shape: FloatArray | list[Section]
    slopes: tuple[float, float] = (0.0, 0.0)


def _bezier(kind: str, degree: int, ordinates: Callable[[int], FloatArray]) -> NamedRise:
    first, equation, slopes = {
        "full": (5, 1, (0.0, 0.0)),
        "start": (4, 4, (0.0, 2.0)),
        "end": (4, 7, (2.0, 0.0)),
    }[kind]
    number = equation + (degree - first) // 2
    return NamedRise(f"eq. 3.{number}", ordinates(degree), slopes)


NAMED_RISES: dict[str, NamedRise] = {
    "constant_velocity": NamedRise("worked example a", rises.constant_velocity()),
    "simple_harmonic": NamedRise("worked example b", [(0.0, 1.0, simple_harmonic)]),
    "cycloidal": NamedRise("paper, section 2", [(0.0, 1.0, cycloidal)]),
    "modified_sine": NamedRise("cam handbooks", MODIFIED_SINE),
    "modified_trapezoid": NamedRise("cam handbooks", MODIFIED_TRAPEZOID),
    "poly345": NamedRise("paper; eq. 3.1", rises.full_rise(5)),
    "poly4567": NamedRise("paper; eq. 3.2", rises.full_rise(7)),
    **{f"bezier{n}": _bezier("full", n, rises.full_rise) for n in (5, 7, 9)},
    **{f"bezier{n}_start": _bezier("start", n, rises.half_rise_start) for n in (4, 6, 8)},
    **{f"bezier{n}_end": _bezier("end", n, rises.half_rise_end) for n in (4, 6, 8)},
}


@lru_cache(maxsize=len(NAMED_RISES))
def unit_rise(name: str) -> Pieces:
    """Bernstein pieces of the rise of that name, over u from 0 to 1."""
    shape = NAMED_RISES[name].shape
    return analytic.fit_sections(shape) if isinstance(shape, list) else ([0.0, 1.0], [shape])

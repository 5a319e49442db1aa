"""The rises known by a name: one unit rise each, and where it comes from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import get_args

from cam_rig.arrays import FloatArray
from cam_rig.laws.families import rises
from cam_rig.laws.families.trigonometric_rises import (
    MODIFIED_SINE,
    MODIFIED_TRAPEZOID,
    cycloidal,
    simple_harmonic,
)
from cam_rig.laws.fit import Section, fit_sections
from cam_rig.laws.pieces import Pieces
from cam_rig.schema.segments.rise import RiseName


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


#: Bézier rises by the end of their name: the lowest degree and its equation, ordinates, slopes.
_BEZIER: dict[str, tuple[int, int, Callable[[int], FloatArray], tuple[float, float]]] = {
    "": (5, 1, rises.full_rise, (0.0, 0.0)),
    "_start": (4, 4, rises.half_rise_start, (0.0, 2.0)),
    "_end": (4, 7, rises.half_rise_end, (2.0, 0.0)),
}


def _bezier(name: str) -> NamedRise:
    """The rise ``bezier<degree>``, or a half-rise ``bezier<degree>_start`` or ``…_end``."""
    degree, part = int(name[6]), name[7:]
    first, equation, ordinates, slopes = _BEZIER[part]
    return NamedRise(f"eq. 3.{equation + (degree - first) // 2}", ordinates(degree), slopes)


_OTHERS = {
    "constant_velocity": NamedRise("worked example a", rises.constant_velocity()),
    "simple_harmonic": NamedRise("worked example b", [(0.0, 1.0, simple_harmonic)]),
    "cycloidal": NamedRise("paper, section 2", [(0.0, 1.0, cycloidal)]),
    "modified_sine": NamedRise("cam handbooks", MODIFIED_SINE),
    "modified_trapezoid": NamedRise("cam handbooks", MODIFIED_TRAPEZOID),
    "poly345": NamedRise("paper; eq. 3.1", rises.full_rise(5)),
    "poly4567": NamedRise("paper; eq. 3.2", rises.full_rise(7)),
}
#: Every name that a cam file may give, `RiseName`, with its rise.
NAMED_RISES: dict[str, NamedRise] = {
    name: _OTHERS.get(name) or _bezier(name) for name in get_args(RiseName)
}


@lru_cache(maxsize=len(NAMED_RISES))
def unit_rise(name: str) -> Pieces:
    """Bernstein pieces of the rise of that name, over u from 0 to 1."""
    shape = NAMED_RISES[name].shape
    return fit_sections(shape) if isinstance(shape, list) else ([0.0, 1.0], [shape])

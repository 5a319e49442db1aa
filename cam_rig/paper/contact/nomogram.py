"""Least base radius over the event angle, law by law: the nomogram of the cam handbooks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cam_rig.laws import bernstein
from cam_rig.laws.bernstein import joined
from cam_rig.laws.segments import NAMED_RISES, unit_rise
from cam_rig.units import FloatArray

#: Laws of the diagram: every full rise without an infinite acceleration, each once.
RISES = (
    "simple_harmonic",
    "modified_trapezoid",
    "modified_sine",
    "cycloidal",
    "poly345",
    "poly4567",
    "bezier9",
)

assert set(RISES) <= set(NAMED_RISES)

#: Halvings of the search for a radius: to 1e-12 of the lift.
HALVINGS = 48
#: Samples of each piece of a rise: a radius comes out to 1e-5 of itself.
SAMPLES = 1001


@dataclass(frozen=True, eq=False)
class SpreadRise:
    """S, s', s'' of a rise over its lift at event angles, ``(m, n)``, and the angles ``(m,)``."""

    s: FloatArray
    slope: FloatArray
    bend: FloatArray

    @classmethod
    def of(cls, name: str, event: FloatArray) -> SpreadRise:
        """The rise of a name over event angles ``(m,)``, rad."""
        s, slope, bend = _unit(name)
        beta = event[:, None]
        return cls(np.broadcast_to(s, (event.size, s.size)), slope / beta, bend / beta**2)


@lru_cache(maxsize=len(NAMED_RISES))
def _unit(name: str) -> FloatArray:
    """``(3, n)``: s, s', s'' of the unit rise, joints with both limits, and of the dwells."""
    breaks, columns = unit_rise(name)
    ordinates, spans = joined(columns), np.diff(breaks)
    u = np.linspace(0.0, 1.0, SAMPLES)
    rows = []
    for _ in range(3):
        rows.append(bernstein.evaluate(ordinates, u).ravel())
        ordinates = bernstein.derivative(ordinates) / spans
    rest = np.array([[0.0, 1.0], [0.0, 0.0], [0.0, 0.0]])
    return np.concatenate([rest, np.stack(rows)], axis=1)


def by_pressure_angle(name: str, event: FloatArray, most: float) -> FloatArray:
    """Least prime radius over h of a roller or point: tan α = s' / (R_p + s), α in rad."""
    rise = SpreadRise.of(name, event)
    return np.asarray((np.abs(rise.slope) / np.tan(most) - rise.s).max(axis=1))


def by_face(name: str, event: FloatArray) -> FloatArray:
    """Least (R_b − ρ_min) / h of a flat follower: ρ = R_b + s + s'' (eq. 2.42)."""
    rise = SpreadRise.of(name, event)
    least = np.maximum(-(rise.s + rise.bend).min(axis=1), 0.0)
    return np.asarray(least + 0.0)  # no negative zero


def by_curvature(name: str, event: FloatArray, radius: float) -> FloatArray:
    """Least prime radius over h at which the pitch curve is nowhere sharper than ``radius`` (/ h).

    Eq. 2.46 with ε = 0. The radius is the roller's and the least one of the contour together.
    """
    rise = SpreadRise.of(name, event)

    def sharp(prime: FloatArray) -> FloatArray:
        high = prime[:, None] + rise.s
        square = high**2 + rise.slope**2
        bent = square + rise.slope**2 - high * rise.bend
        return np.asarray((radius * bent > square**1.5).any(axis=1))

    low = np.full(event.shape, radius)  # the dwell's circle is as sharp
    high = low + 1.0
    while (still := sharp(high)).any():
        high = np.where(still, 2.0 * high, high)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        bad = sharp(middle)
        low, high = np.where(bad, middle, low), np.where(bad, high, middle)
    return high

"""A class of laws: B-splines of a degree in equal pieces of each event, and their Bézier pieces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline

from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError
from cam_rig.laws.families.b_spline import bezier_pieces

#: Pieces and degree of a class, and how smooth its joints may be.
MAX_PIECES, MAX_DEGREE, MAX_JOINTS = 200, 15, 6
#: An event of more ordinates than this is not written to a cam file.
MAX_ORDINATES = 500


@dataclass(frozen=True)
class LawClass:
    """B-splines of a degree in equal pieces of each event, Cᵏ where they meet.

    Parameters
    ----------
    pieces : of each event
    joints : k, derivatives that are continuous at joints and at the ends of events
    degree : of the pieces; by default k + 2

    Raises
    ------
    ConfigError : out of the limits, a degree not above ``joints``, or nothing left to choose

    Examples
    --------
    >>> LawClass(pieces=16, joints=3).free
    28
    """

    pieces: int = 16
    joints: int = 3
    degree: int | None = None

    def __post_init__(self) -> None:
        limits = {"pieces": (1, MAX_PIECES), "joints": (1, MAX_JOINTS), "degree": (2, MAX_DEGREE)}
        for name, (least, most) in limits.items():
            value = self.power if name == "degree" else getattr(self, name)
            if not isinstance(value, int) or not least <= value <= most:
                raise ConfigError(f"class: {name} is {value}; allowed: {least} to {most}")
        if self.power <= self.joints:
            raise ConfigError(
                f"class: degree is {self.power} with joints C{self.joints}; allowed: a degree "
                f"above {self.joints}"
            )
        if self.free < 1:
            raise ConfigError(
                f"class: {self.count} ordinates, of which the ends take {2 * self.joints + 2}; "
                f"allowed: at least {2 * self.joints + 3}, so more pieces or a higher degree"
            )
        if self.count > MAX_ORDINATES:
            raise ConfigError(
                f"class: {self.count} ordinates an event; allowed: {MAX_ORDINATES}, so fewer "
                "pieces, a lower degree or smoother joints"
            )

    @classmethod
    def of(cls, pieces: int, joints: str, degree: int | None) -> LawClass:
        """From words: joints such as C3.

        Raises
        ------
        ConfigError : as the class, or joints that are not written so
        """
        if not (joints[:1] in ("C", "c") and joints[1:].isdecimal()):
            raise ConfigError(f"joints: are {joints!r}; allowed: C1 to C{MAX_JOINTS}")
        return cls(pieces, int(joints[1:]), degree)

    @property
    def power(self) -> int:
        """The degree."""
        return self.joints + 2 if self.degree is None else self.degree

    @property
    def knots(self) -> FloatArray:
        """Of one event of unit length, the ends ``degree + 1`` times."""
        inner = np.repeat(np.arange(1.0, self.pieces) / self.pieces, self.power - self.joints)
        ends = self.power + 1
        return np.concatenate([np.zeros(ends), inner, np.ones(ends)])

    @property
    def count(self) -> int:
        """Ordinates of one event."""
        return (self.pieces - 1) * (self.power - self.joints) + self.power + 1

    @property
    def free(self) -> int:
        """Those that the ends do not take."""
        return self.count - 2 * (self.joints + 1)

    @property
    def words(self) -> str:
        """The class as a table says it."""
        if self.pieces == 1:
            return f"Bézier curves of degree {self.power}"
        return f"B-splines of degree {self.power} in {self.pieces} pieces, C{self.joints} joints"


@lru_cache(maxsize=16)
def to_bezier(law_class: LawClass, order: int = 0) -> sparse.csr_array:
    """Ordinates of a derivative over one event to those of its Bézier pieces."""
    knots, degree = law_class.knots, law_class.power - order
    knots = knots[order : knots.size - order]
    _, columns = bezier_pieces(BSpline(knots, np.eye(knots.size - degree - 1), degree))
    return sparse.csr_array(np.concatenate(columns))


@lru_cache(maxsize=8)
def second_derivative(law_class: LawClass) -> sparse.csr_array:
    """Ordinates over one event of unit length to those of the second derivative."""
    knots, degree = law_class.knots, law_class.power
    found = np.eye(law_class.count)
    for _ in range(2):
        apart = (knots[degree + 1 : -1] - knots[1 : -degree - 1]) / degree
        found = np.diff(found, axis=0) / apart[:, None]
        knots, degree = knots[1:-1], degree - 1
    return sparse.csr_array(found)

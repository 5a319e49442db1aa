"""The law sampled for the profile: s, s', s'' at cam angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws import Law, bernstein
from cam_rig.laws.sampling import sample
from cam_rig.units import TURN

_ONE_EACH = np.eye(3)


@dataclass(frozen=True, eq=False)
class Motion:
    """The follower's displacement at cam angles; all four arrays have one shape.

    Parameters
    ----------
    angle : rad
    s, slope, bend : s, s', s'' in m, m/rad, m/rad²
    """

    angle: FloatArray
    s: FloatArray
    slope: FloatArray
    bend: FloatArray

    @classmethod
    def uniform(cls, law: Law, count: int) -> Motion:
        """``count`` equal steps over one turn, without its end."""
        return cls(
            turn_angles(count), *sample(law, 0.0, TURN / count, count, _ONE_EACH, np.zeros(3))
        )

    @classmethod
    def at(cls, law: Law, angle: FloatArray) -> Motion:
        """Any angles; at a joint the piece that begins there."""
        return cls(angle, *(law(angle, order) for order in range(3)))

    @classmethod
    def on_pieces(cls, law: Law, u: FloatArray) -> Motion:
        """``(len(u), n)``: every piece of the law at ``u`` ∈ [0, 1], both its ends included.

        A quantity that jumps at a joint so has both its limits there.
        """
        values = np.tensordot(bernstein.basis(law.degree, u), law.motion, axes=([1], [1]))
        return cls(law.breaks[:-1] + u[:, None] * law.spans, *np.moveaxis(values, 1, 0))

    @classmethod
    def on_piece(cls, law: Law, piece: int, u: FloatArray) -> Motion:
        """``(len(u),)``: one piece of the law."""
        values = law.motion[:, :, piece] @ bernstein.basis(law.degree, u).T
        return cls(law.breaks[piece] + u * law.spans[piece], *values)


def turn_angles(points: int) -> FloatArray:
    """``points`` cam angles over one turn, without its end."""
    return np.linspace(0.0, TURN, points, endpoint=False)

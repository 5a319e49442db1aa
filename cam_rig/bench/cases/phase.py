"""A phase of a model: one linear differential equation, and the guard that ends it.

    q = (x, ẋ),  ẍ = rows·q + drive·(s, ṡ, s̈, 1),  ends where guard·q + guard_drive·(s, ṡ, s̈, 1)
    crosses zero from above.

Numbers may be floats or any type that computes like them: the peers use floats, the reference
has 50 digits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

#: A float, or a number of more digits.
Number = Any
Vector = Sequence[Number]


@dataclass(frozen=True)
class BenchPhase:
    """One linear phase with m positions, q of length 2m.

    Parameters
    ----------
    rows : ``(m, 2m)`` accelerations of the positions by q
    drive : ``(m, 4)`` accelerations by s, ṡ, s̈ and 1
    show : ``(k, m)`` shown displacements by the positions; shown velocities likewise
    show_lift : ``(k,)`` weight of the lift in them
    guard, guard_drive : ``(2m,)`` and ``(4,)``; None for a phase that never ends
    on_cam : whether this is contact, which may also end by a jump of the law's acceleration
    """

    rows: Sequence[Vector]
    drive: Sequence[Vector]
    show: Sequence[Vector]
    show_lift: Vector
    guard: Vector | None = None
    guard_drive: Vector = (0, 0, 0, 0)
    on_cam: bool = False

    @property
    def size(self) -> int:
        """Length of q."""
        return 2 * len(self.rows)

    def guard_value(self, q: Vector, motion: Vector) -> Number:
        """The guard at state q and at (s, ṡ, s̈, 1)."""
        assert self.guard is not None
        return dot(self.guard, q) + dot(self.guard_drive, motion)

    def shown(self, q: Vector, motion: Vector) -> tuple[list[Number], list[Number]]:
        """Displacements and velocities that are compared."""
        m = self.size // 2
        pairs = list(zip(self.show, self.show_lift, strict=True))
        return (
            [dot(row, q[:m]) + lift * motion[0] for row, lift in pairs],
            [dot(row, q[m:]) + lift * motion[1] for row, lift in pairs],
        )


def dot(one: Vector, other: Vector) -> Number:
    """Scalar product in the numbers' own type."""
    total: Number = 0
    for a, b in zip(one, other, strict=True):
        total = total + a * b
    return total

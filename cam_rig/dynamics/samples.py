"""The columns of a block of samples, and of /follower/samples, by name: ``samples.force``."""

from __future__ import annotations

from dataclasses import dataclass

from cam_rig.arrays import FloatArray

#: Rows of a block, with their units.
COLUMNS = (
    "t [s]",
    "lift [m]",
    "velocity [m/s]",
    "acceleration [m/s^2]",
    "contact_force [N]",
    "contact_impulse [N*s]",
)


class NamedRows:
    """The rows of a ``(6, n)`` array ``rows``, each ``(n,)`` by its name: views, never copies."""

    rows: FloatArray

    def _row(self, index: int) -> FloatArray:
        row: FloatArray = self.rows[index]
        return row

    @property
    def time(self) -> FloatArray:
        """Rig time, s."""
        return self._row(0)

    @property
    def lift(self) -> FloatArray:
        """Follower displacement, m."""
        return self._row(1)

    @property
    def velocity(self) -> FloatArray:
        """Follower velocity, m/s."""
        return self._row(2)

    @property
    def acceleration(self) -> FloatArray:
        """Follower acceleration, m/s²."""
        return self._row(3)

    @property
    def force(self) -> FloatArray:
        """Contact force, N; 0 in flight."""
        return self._row(4)

    @property
    def impulse(self) -> FloatArray:
        """Impulse of the landings since the sample before, N·s."""
        return self._row(5)

    @property
    def motion(self) -> FloatArray:
        """Lift, velocity and acceleration together, ``(3, n)``."""
        return self.rows[1:4]


@dataclass(frozen=True, eq=False)
class Samples(NamedRows):
    """The named rows of an array.

    Examples
    --------
    >>> import numpy as np
    >>> rows = np.zeros((6, 100))
    >>> Samples(rows).force[:10] = 25.0
    >>> float(rows[4, 9])
    25.0
    """

    rows: FloatArray

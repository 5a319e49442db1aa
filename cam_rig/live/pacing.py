"""Rig time against wall time: the real-time factor of a run."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from decimal import Decimal

from cam_rig.errors import ConfigError
from cam_rig.units import NS

#: Wall time (s) that a paced run may be late before it gives that time up and reports so.
MAX_LATENESS_S = 0.1
#: Least and greatest real-time factor.
FACTORS = (1e-3, 1e3)


def pacing_of(value: object) -> object:
    """The pacing that a bare number means, 20x for 20; anything else as it is.

    >>> pacing_of(20), pacing_of(0.5), pacing_of("real_time")
    ('20x', '0.5x', 'real_time')
    """
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return f"{Decimal(repr(value)):f}x" if math.isfinite(value) else str(value)
    is_number = isinstance(value, str) and re.fullmatch(r"\d+(?:\.\d+)?", value)
    return f"{value}x" if is_number else value


def factor_of(pacing: str) -> float | None:
    """Rig seconds a wall second: 1 for ``real_time``, N for ``Nx``, None for ``free``.

    Raises
    ------
    ConfigError : another text
    """
    if pacing == "free":
        return None
    found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*[x×]", pacing)
    factor = 1.0 if pacing == "real_time" else float(found[1]) if found else 0.0
    if not FACTORS[0] <= factor <= FACTORS[1]:
        raise ConfigError(
            f"pacing: is {pacing!r}; allowed: free, real_time, or a factor of "
            f"{FACTORS[0]:g} to {FACTORS[1]:g} such as 20x"
        )
    return factor


@dataclass
class Pacing:
    """Delays each state until its rig time has come.

    A run that is late goes on from where it is: lost time is not made up.

    Parameters
    ----------
    factor : rig seconds a wall second; None never waits
    """

    factor: float | None = None
    #: Wall time (s) given up at the last state; zero while the run is on time.
    late: float = 0.0
    _begin: tuple[int, float] | None = field(default=None, repr=False)
    _stands: bool = field(default=False, repr=False)

    def set(self, pacing: str) -> None:
        """Change the real-time factor from the next state on."""
        self.factor, self._begin, self.late = factor_of(pacing), None, 0.0

    def stand(self) -> None:
        """Hold the next state back no longer: its rig time comes when it is sent."""
        self._stands = True

    def wait(self, rig_ns: int, now: float) -> float:
        """Wall time (s) until the state at a rig time is due, seen from wall time ``now``."""
        if self.factor is None or self._begin is None or self._stands:
            return 0.0
        return max(0.0, self._due(rig_ns) - now)

    def reached(self, now: float) -> int | None:
        """Rig time (ns) that has come by wall time ``now``; None of a free run, or before a state.

        The tick that turns while the run is stopped is finished all the same.
        """
        if self.factor is None or self._begin is None:
            return None
        from_ns, wall = self._begin
        return from_ns + round((now - wall) * self.factor * NS)

    def sent(self, rig_ns: int, now: float) -> None:
        """Note that a state went out."""
        self.late = 0.0
        if self.factor is None:
            return
        if self._begin is None or self._stands:
            self._begin, self._stands = (rig_ns, now), False
        late = now - self._due(rig_ns)
        if late > MAX_LATENESS_S:
            self.late, self._begin = late, (rig_ns, now)

    def _due(self, rig_ns: int) -> float:
        assert self.factor is not None and self._begin is not None
        from_ns, wall = self._begin
        return wall + (rig_ns - from_ns) / NS / self.factor

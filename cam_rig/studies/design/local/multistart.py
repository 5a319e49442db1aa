"""How often a local search begins, from what seed, and how many of its descents agree."""

from __future__ import annotations

from dataclasses import dataclass

from cam_rig.errors import ConfigError

#: Starts, at most, and by default.
MOST_STARTS, STARTS = 1000, 8
#: Descents that end within this part of the best came to the same.
SAME = 1e-3


@dataclass(frozen=True)
class Multistart:
    """A search from several laws.

    Parameters
    ----------
    starts : how many
    seed : of the random ones among them
    near : how many ended within 0.1 % of the best; 0 before it ran

    Raises
    ------
    ConfigError : out of the limits
    """

    starts: int = STARTS
    seed: int = 1
    near: int = 0

    def __post_init__(self) -> None:
        if not 1 <= self.starts <= MOST_STARTS:
            raise ConfigError(f"starts: is {self.starts}; allowed: 1 to {MOST_STARTS}")
        if self.seed < 0:
            raise ConfigError(f"seed: is {self.seed}; allowed: 0 and above")

    @property
    def words(self) -> str:
        """As a table says it."""
        starts = "1 start" if self.starts == 1 else f"{self.starts} starts"
        return f"local ({starts}, {self.near} ended within 0.1 % of the best)"

"""What the paper says of vibration and jump, tried."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from cam_rig.studies.jump.comparison import JumpRow
from cam_rig.studies.vibration.comparison import VibrationTable
from cam_rig.studies.vibration.steady_state import Vibration

#: The cam that the paper proposes, and its two polynomials by degree.
PROPOSED, LOWER, HIGHER = "bezier15", "poly345", "poly4567"
#: What residual vibration may be measured by; the paper does not say which.
RESIDUAL = {"ringing": "by the ringing", "swing": "by the swing in the window"}


@dataclass(frozen=True)
class Claim:
    """Something the paper says, where, and in how many of the cases looked at it holds.

    Cases are the speeds at which all cams are followed. ``measure`` says by what it was tried,
    where there is a choice; ``otherwise`` is the same claim by the other measure.
    """

    words: str
    source: str
    holds: int
    cases: int
    measure: str = ""
    otherwise: Claim | None = None

    @property
    def verdict(self) -> str:
        """Agrees, disagrees, or both."""
        if self.cases == 0:
            return "cannot be told, a cam is left at every speed"
        if self.holds == self.cases:
            return "agrees"
        return "disagrees" if self.holds == 0 else "agrees in part"

    @property
    def told(self) -> str:
        """The verdict with its measure and cases, and that of the other measure."""
        said = f"{self.measure} {self.verdict}".strip()
        if self.cases > 1:
            said += f", {self.holds} of {self.cases}"
        return said if self.otherwise is None else f"{said}; {self.otherwise.told}"


def vibration_claims(table: VibrationTable) -> list[Claim]:
    """What the paper says of vibration, tried at every speed at which no cam is left."""
    found = []
    if PROPOSED in table.measures:
        words = "Bézier 15 accelerates the follower least"
        found.append(_tried(table, words, "fig. 6", _least("acceleration")))
        found.append(
            _by_either(table, "Bézier 15 leaves the least residual vibration", "fig. 5", _least)
        )
        if all(v.twist is not None for row in table.measures.values() for v in row):
            words = "Bézier 15 twists the shaft least"
            found.append(_tried(table, words, "fig. 9", _least("twist")))
    if {LOWER, HIGHER} <= set(table.measures):
        words = "the polynomial of higher degree leaves less residual vibration"
        found.append(_by_either(table, words, "conclusions", _less))
    return found


Test = Callable[[dict[str, Vibration]], bool]


def _least(measure: str) -> Test:
    """Whether the proposed cam has the least of a measure."""
    return lambda at: min(at, key=lambda cam: getattr(at[cam], measure)) == PROPOSED


def _less(measure: str) -> Test:
    """Whether the higher polynomial has less of a measure than the lower."""
    return lambda at: bool(getattr(at[HIGHER], measure) < getattr(at[LOWER], measure))


def _by_either(
    table: VibrationTable, words: str, source: str, test: Callable[[str], Test]
) -> Claim:
    """A claim of residual vibration by its ringing, and by its swing as the other measure."""
    one, other = RESIDUAL
    otherwise = _tried(table, words, source, test(other), RESIDUAL[other])
    return _tried(table, words, source, test(one), RESIDUAL[one], otherwise)


def _tried(
    table: VibrationTable,
    words: str,
    source: str,
    test: Test,
    measure: str = "",
    otherwise: Claim | None = None,
) -> Claim:
    cases = [table.at(table.rpm[i]) for i in table.in_contact]
    return Claim(words, source, sum(map(test, cases)), len(cases), measure, otherwise)


def jump_claims(rows: list[JumpRow]) -> list[Claim]:
    """What the paper says of the jump."""
    speeds = {row.cam: row.found.rpm for row in rows}
    found = []
    if PROPOSED in speeds:
        best = max(speeds, key=lambda cam: speeds[cam]) == PROPOSED
        found.append(Claim("Bézier 15 is left last of all", "Table 2", int(best), 1))
    if {LOWER, HIGHER} <= set(speeds):
        earlier = speeds[HIGHER] < speeds[LOWER]
        words = "the polynomial of higher degree is left earlier"
        found.append(Claim(words, "conclusions", int(earlier), 1))
    return found

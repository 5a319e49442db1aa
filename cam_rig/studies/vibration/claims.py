"""What the paper claims of vibration and jump, tested on the simulated follower."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from cam_rig.studies.jump.comparison import JumpRow
from cam_rig.studies.vibration.comparison import VibrationTable
from cam_rig.studies.vibration.steady_state import Vibration

#: The cam that the paper proposes, and its two polynomials by degree.
PROPOSED, LOWER, HIGHER = "bezier15", "poly345", "poly4567"
#: What residual vibration may be measured by; the paper does not say which.
RESIDUAL = {"residual_amplitude": "residual amplitude", "peak_to_peak": "peak to peak"}


class Verdict(StrEnum):
    """Whether a claim holds in the cases looked at."""

    AGREES = "agrees"
    IN_PART = "agrees in part"
    DISAGREES = "disagrees"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Claim:
    """A claim of the paper, where it stands, and in how many of the cases looked at it holds.

    Cases are the speeds at which all followers keep contact. ``measure`` says by what it was
    tested, where there is a choice; ``otherwise`` is the same claim by the other measure.
    """

    words: str
    source: str
    holds: int
    cases: int
    measure: str = ""
    otherwise: Claim | None = None

    @property
    def verdict(self) -> Verdict:
        """Undecided without a case."""
        if self.cases == 0:
            return Verdict.UNDECIDED
        if self.holds == self.cases:
            return Verdict.AGREES
        return Verdict.DISAGREES if self.holds == 0 else Verdict.IN_PART


def vibration_claims(table: VibrationTable) -> list[Claim]:
    """The paper's claims of vibration, at every speed at which no follower has lost contact."""
    found = []
    if PROPOSED in table.measures:
        words = "Bézier 15 has the least peak acceleration"
        found.append(_tested(table, words, "fig. 6", _least("acceleration")))
        words = "Bézier 15 has the least residual vibration"
        found.append(_by_either(table, words, "fig. 5", _least))
        if all(v.twist is not None for row in table.measures.values() for v in row):
            words = "Bézier 15 has the least twist of the shaft"
            found.append(_tested(table, words, "fig. 9", _least("twist")))
    if {LOWER, HIGHER} <= set(table.measures):
        words = "the polynomial of higher degree has less residual vibration"
        found.append(_by_either(table, words, "conclusions", _less))
    return found


def jump_claims(rows: list[JumpRow]) -> list[Claim]:
    """The paper's claims of the jump."""
    speeds = {row.cam: row.found.rpm for row in rows}
    found = []
    if PROPOSED in speeds:
        best = max(speeds, key=lambda cam: speeds[cam]) == PROPOSED
        found.append(Claim("Bézier 15 has the highest jump speed", "Table 2", int(best), 1))
    if {LOWER, HIGHER} <= set(speeds):
        words = "the polynomial of higher degree has the lower jump speed"
        found.append(Claim(words, "conclusions", int(speeds[HIGHER] < speeds[LOWER]), 1))
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
    """A claim of residual vibration by its amplitude, and by the peak-to-peak value."""
    one, other = RESIDUAL
    otherwise = _tested(table, words, source, test(other), RESIDUAL[other])
    return _tested(table, words, source, test(one), RESIDUAL[one], otherwise)


def _tested(
    table: VibrationTable,
    words: str,
    source: str,
    test: Test,
    measure: str = "",
    otherwise: Claim | None = None,
) -> Claim:
    cases = [table.at(table.rpm[i]) for i in table.in_contact]
    return Claim(words, source, sum(map(test, cases)), len(cases), measure, otherwise)

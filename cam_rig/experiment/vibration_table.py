"""Vibration of several cams at several speeds, and what the paper says of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.torsional_block import from_rig as shaft_of
from cam_rig.errors import DynamicsError
from cam_rig.experiment.jump_search import RPM
from cam_rig.experiment.jump_table import JumpRow
from cam_rig.experiment.lineup import Lineup
from cam_rig.experiment.vibration import Vibration, vibration

#: The cam that the paper proposes, and its two polynomials by degree.
PROPOSED, LOWER, HIGHER = "bezier15", "poly345", "poly4567"


@dataclass(frozen=True)
class VibrationTable:
    """Measures by cam, one for each speed (rpm)."""

    rpm: tuple[float, ...]
    measures: dict[str, list[Vibration]]

    def at(self, rpm: float) -> dict[str, Vibration]:
        """The measures at one of the speeds."""
        return {cam: row[self.rpm.index(rpm)] for cam, row in self.measures.items()}


def vibration_table(
    lineup: Lineup, rpm: tuple[float, ...], on_cam: Callable[[str], None] = lambda _: None
) -> VibrationTable:
    """Measure every cam at every speed (rpm); twist where the rig has a shaft.

    Raises
    ------
    DynamicsError : a speed that is not above 0, or at which there is no steady state
    """
    for speed in rpm:
        if not (np.isfinite(speed) and speed > 0.0):
            raise DynamicsError(f"speed is {speed:g} rpm; allowed: finite and above 0")
    follower = FollowerParameters.from_rig(lineup.rig)
    shaft = None if lineup.rig.shaft is None else shaft_of(lineup.rig)
    found: dict[str, list[Vibration]] = {}
    for cam, law in lineup.laws.items():
        on_cam(cam)
        found[cam] = [vibration(law, follower, shaft, speed * RPM) for speed in rpm]
    return VibrationTable(rpm, found)


@dataclass(frozen=True)
class Claim:
    """Something the paper says, where, and in how many of the cases looked at it holds."""

    words: str
    source: str
    holds: int
    cases: int

    @property
    def verdict(self) -> str:
        """Agrees, disagrees, or both."""
        if self.holds == self.cases:
            return "agrees"
        return "disagrees" if self.holds == 0 else "agrees in part"


def vibration_claims(table: VibrationTable) -> list[Claim]:
    """What the paper says of vibration, tried at every speed of a table with its five laws."""
    found = []
    if PROPOSED in table.measures:
        found.append(_least(table, "acceleration", "accelerates the follower least", "fig. 6"))
        found.append(_least(table, "ringing", "leaves the least residual vibration", "fig. 5"))
        if all(v.twist is not None for row in table.measures.values() for v in row):
            found.append(_least(table, "twist", "twists the shaft least", "fig. 9"))
    if {LOWER, HIGHER} <= set(table.measures):
        pairs = zip(table.measures[HIGHER], table.measures[LOWER], strict=True)
        holds = sum(high.ringing < low.ringing for high, low in pairs)
        words = "the polynomial of higher degree leaves less residual vibration"
        found.append(Claim(words, "conclusions", holds, len(table.rpm)))
    return found


def _least(table: VibrationTable, measure: str, words: str, source: str) -> Claim:
    holds = 0
    for i in range(len(table.rpm)):
        values = {cam: getattr(row[i], measure) for cam, row in table.measures.items()}
        holds += min(values, key=lambda cam: values[cam]) == PROPOSED
    return Claim(f"Bézier 15 {words}", source, holds, len(table.rpm))


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

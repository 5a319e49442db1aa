"""Vibration of cams, and the paper's claims of it: as tables and as plain data."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.any_follower import JumpRow
from cam_rig.dynamics.jump.jump_speed import contact_lost_speed
from cam_rig.dynamics.torsional.model import from_rig as shaft_of
from cam_rig.dynamics.vibration import Vibration, require_speeds, vibration
from cam_rig.laws.cam import CamSet
from cam_rig.show.tables import Column, DataTable, tabulate
from cam_rig.units import RPM

# Vibration of several cams at several speeds, and from which speed on each is left.


@dataclass(frozen=True)
class VibrationTable:
    """Measures by cam, one for each speed (rpm).

    ``contact_lost_rpm`` : by cam the jump speed (rpm), beyond which the model no longer holds
    """

    rpm: tuple[float, ...]
    measures: dict[str, list[Vibration]]
    contact_lost_rpm: dict[str, float]

    def at(self, rpm: float) -> dict[str, Vibration]:
        """The measures at one of the speeds."""
        return {cam: row[self.rpm.index(rpm)] for cam, row in self.measures.items()}

    def lost_contact(self, rpm: float) -> list[str]:
        """The cams on which contact is lost at a speed."""
        return [cam for cam, limit in self.contact_lost_rpm.items() if limit < rpm]

    @property
    def in_contact(self) -> list[int]:
        """Which of the speeds all followers are on their cams at."""
        return [i for i, rpm in enumerate(self.rpm) if not self.lost_contact(rpm)]


#: What is said to need a stem that the rig file leaves out.
BY = "the vibration of a mass on its stem"


def vibration_table(
    cam_set: CamSet, rpm: tuple[float, ...], on_cam: Callable[[str], None] = lambda _: None
) -> VibrationTable:
    """Measure every cam at every speed (rpm), each speed once; twist where the rig has a shaft."""
    follower, rpm = FollowerParameters.on_stem(cam_set.rig, BY), tuple(dict.fromkeys(rpm))
    require_speeds(follower, rpm)
    shaft = None if cam_set.rig.shaft is None else shaft_of(cam_set.rig)
    found: dict[str, list[Vibration]] = {}
    for cam, law in cam_set.laws.items():
        on_cam(cam)
        found[cam] = [vibration(law, follower, shaft, speed * RPM) for speed in rpm]
    contact_lost_rpm = {
        cam: contact_lost_speed(law, cam_set.rig) / RPM for cam, law in cam_set.laws.items()
    }
    return VibrationTable(rpm, found, contact_lost_rpm)


# What the paper claims of vibration and jump, tested on the simulated follower.

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


def speed_table(
    table: VibrationTable, rpm: float, rig: str, titles: Mapping[str, str] | None = None
) -> DataTable:
    """One speed, one row per cam; ``titles`` are what cams are called, where not by name."""
    called, lost, measures = titles or {}, table.lost_contact(rpm), table.at(rpm)
    moving = [cam for cam, v in measures.items() if not v.window.dwell]

    def marked(cam: str) -> str:
        marks = (" *" if cam in moving else "") + (" †" if cam in lost else "")
        return called.get(cam, cam) + marks

    return tabulate(
        f"Steady-state vibration at {rpm:g} rpm, {rig}",
        measures.items(),
        (
            (Column("cam"), lambda row: marked(row[0])),
            (
                Column("residual amplitude", "µm", ".3g"),
                lambda row: 1e6 * row[1].residual_amplitude,
            ),
            (Column("peak to peak", "µm", ".3g"), lambda row: 1e6 * row[1].peak_to_peak),
            (Column("peak acceleration", "m/s²", ".1f"), lambda row: row[1].acceleration),
            (Column("of the law", "m/s²", ".1f"), lambda row: row[1].rigid_acceleration),
            (
                Column("twist", "°", ".4f"),
                lambda row: None if row[1].twist is None else math.degrees(row[1].twist),
            ),
            (Column("flywheel", "%", ".2f"), lambda row: _percent(row[1].fluctuation)),
        ),
        "* No low dwell: read within 31.25° of the lowest lift, where the follower still moves."
        if moving
        else "",
        "† Contact is lost below this speed; the model holds the follower on." if lost else "",
        "Flywheel: (fastest − slowest)/mean speed, driven by a constant torque."
        if any(v.fluctuation is not None for v in measures.values())
        else "",
    )


def _percent(share: float | None) -> float | None:
    return None if share is None else 100.0 * share


def claims_table(by_rig: Mapping[str, list[Claim]], rpm: tuple[float, ...]) -> DataTable:
    """The claims of the first rig, one row for each measure, and each rig's verdict."""
    verdicts = {
        rig: {(c.words, c.measure): _verdict(c) for c in _each(claims)}
        for rig, claims in by_rig.items()
    }
    speeds = ", ".join(f"{speed:g}" for speed in rpm)
    return tabulate(
        "The paper's claims, tested",
        _each(next(iter(by_rig.values()), [])),
        (
            (Column("claim"), lambda claim: claim.words),
            (Column("in the paper"), lambda claim: claim.source),
            (Column("measured by"), lambda claim: claim.measure),
            *(
                (
                    Column(rig, missing="not tested"),
                    lambda claim, known=known: known.get((claim.words, claim.measure)),
                )
                for rig, known in verdicts.items()
            ),
        ),
        f"Cases: those of {speeds} rpm at which every follower keeps contact.",
        "The paper does not say how residual vibration is measured.",
    )


def _each(claims: list[Claim]) -> list[Claim]:
    """Every claim, and after it the same by the other measure."""
    return [c for claim in claims for c in (claim, claim.otherwise) if c is not None]


def _verdict(claim: Claim) -> str:
    cases = f", {claim.holds} of {claim.cases}" if claim.cases > 1 else ""
    return f"{claim.verdict}{cases}"


def to_json(table: VibrationTable) -> dict[str, Any]:
    """The measures as plain data, by cam, lists over the speeds; and the claims."""
    return {
        "rpm": list(table.rpm),
        "cams": {
            cam: {
                "low_dwell": row[0].window.dwell,
                "contact_lost_rpm": table.contact_lost_rpm[cam]
                if math.isfinite(table.contact_lost_rpm[cam])
                else None,
                "contact_lost": [table.contact_lost_rpm[cam] < rpm for rpm in table.rpm],
                "residual_amplitude_m": [v.residual_amplitude for v in row],
                "peak_to_peak_m": [v.peak_to_peak for v in row],
                "acceleration": [v.acceleration for v in row],
                "rigid_acceleration": [v.rigid_acceleration for v in row],
                "twist_deg": [None if v.twist is None else math.degrees(v.twist) for v in row],
                "fluctuation": [v.fluctuation for v in row],
            }
            for cam, row in table.measures.items()
        },
        "claims": [_claim(claim) for claim in vibration_claims(table)],
    }


def _claim(claim: Claim) -> dict[str, Any]:
    otherwise = None if claim.otherwise is None else _claim(claim.otherwise)
    return vars(claim) | {"verdict": claim.verdict, "otherwise": otherwise}


# All findings of a report, and the jobs that compute them.

#: Speeds of the vibration tables, rpm.
VIBRATION_RPM = (200.0, 250.0, 300.0, 350.0)

"""Results that sections of the paper's report share, and its summary table."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import cam_rig
from cam_rig.laws.segments import NAMED_RISES
from cam_rig.schema import load_tables
from cam_rig.schema.load import tables_path
from cam_rig.show.looks import in_words
from cam_rig.simulation.inputs import resolve_cams
from cam_rig.studies.jump.comparison import rms_difference
from cam_rig.studies.vibration.study import HIGHER, LOWER, Claim
from examples.paper import factorial, readings
from examples.paper.common import CAMS, RIG, SCENE, STIFF_RIG, Table

#: Cam that the paper proposes.
PROPOSED = "bezier15"


class Paper:
    """Results that several sections share, each computed only once.

    The result `factorial` is given as a function, because it is computed in other processes.
    """

    def __init__(self, factorial_study: Callable[[], factorial.Study]) -> None:
        self._factorial = factorial_study
        self.printed = load_tables(tables_path())
        self.scene = cam_rig.load_scene(SCENE)
        self.cam_set = resolve_cams(list(CAMS), RIG)
        self.stiff = cam_rig.load_rig(STIFF_RIG)
        self.readings_by_name, self.readings_run = readings.load_readings()
        #: Cam in place of the TM21's cam, whose geometry is identified from the published noise.
        self.arcs = next(
            cam for cam in self.scene.cams if self.scene.fitted_origin(cam) == "identified"
        )

    @cached_property
    def jumps(self) -> Any:
        """Jump speeds compared with table 2."""
        return cam_rig.jump_speeds(list(CAMS), RIG)

    @cached_property
    def readings(self) -> list[readings.Read]:
        """All readings of table 2, with their results."""
        return readings.study()

    @cached_property
    def vibration(self) -> Any:
        """Residual vibration on the rig of the jump speeds."""
        return cam_rig.vibration(list(CAMS), RIG)

    @cached_property
    def stiff_vibration(self) -> Any:
        """Residual vibration with the stem of table 1."""
        return cam_rig.vibration(list(CAMS), STIFF_RIG)

    @cached_property
    def noise(self) -> Any:
        """Result of the noise study."""
        return cam_rig.noise_study(SCENE, RIG)

    @cached_property
    def factorial(self) -> factorial.Study:
        """Result of the factorial study: continuity or slopes."""
        return self._factorial()

    @property
    def stems(self) -> list[float]:
        """Stem stiffness (N/m) of the rig of the jump speeds, and of table 1."""
        rigs = self.cam_set.rig, self.stiff
        return [rig.need("stem_stiffness", "the report").si for rig in rigs]

    @property
    def proposed(self) -> str:
        """Title of the cam that the paper proposes."""
        return self.cam_set.titles[PROPOSED]

    @property
    def titles(self) -> dict[str, str]:
        """Titles of rises, readings and cams by name."""
        rises = {name: in_words(name) for name in NAMED_RISES}
        names = {name: name.replace("_", " ") for name in self.readings_by_name}
        return rises | names | self.cam_set.titles | self.scene.titles


def summary_table(paper: Paper) -> Table:
    """Return a table of the paper's statements and the results of cam_rig."""
    return Table("The report in short", "question | paper | here", list(_summary_rows(paper)))


def _summary_rows(paper: Paper) -> list[tuple[str, str, str]]:
    by_claim = dict[str, list[bool]]()
    for claim in (*paper.vibration.claims, *jump_claims(paper.jumps.rpm, RIG)):
        by_claim.setdefault(claim.claim, []).append(claim.holds == claim.cases > 0)
    first, either = (
        sum(f(outcomes) for outcomes in by_claim.values()) for f in (lambda o: o[0], all)
    )
    jump, rows = paper.jumps.comparison, paper.jumps.rows
    printed = [row.published_rpm for row in rows if row.published_rpm is not None]
    tests = [row for row in rows if row.role == "test"]
    times = sum(reading.times for reading in paper.readings)
    noise, published = paper.noise, paper.scene.published
    assert jump is not None and published is not None
    best, cams = noise.best, paper.scene.titles
    curve, crossing = best.curves[noise.roles.predicted], best.crossing
    rivals = " and ".join(cams[cam] for cam in published.crossover.between)
    shares = [row.jump_share for row in factorial.advantages(paper.factorial) if row.jump > 1.0]
    residual = paper.factorial.same_acceleration.shares("residual")
    lines = [
        (
            "Claims of vibration and jump speed that hold",
            f"{len(by_claim)}",
            f"{first} at every speed compared, {either} by either measure of vibration",
        ),
        (
            "Speeds at which contact is lost",
            f"{min(printed):g} to {max(printed):g} rpm",
            f"within {jump.rms:.2%} r.m.s. on {jump.cams} cams that identified the rig, "
            f"{rms_difference(tests):.2%} on {len(tests)} that did not",
        ),
        (
            "Turns from rest until contact is lost",
            f"{jump.published_turns[0]:.1f} to {jump.published_turns[1]:.1f}",
            f"{jump.turns[0]:.1f} to {jump.turns[1]:.1f}; {times} of the printed times come out, "
            f"in {len(paper.readings)} readings",
        ),
        (
            f"Noise of {cams[noise.roles.predicted]}, predicted from {cams[noise.roles.reference]}",
            "a regression of measured levels",
            f"within {curve.rms_regression_db:.2f} dB r.m.s.; published curve in the 95 % band at "
            f"{curve.expected.holds(curve.published_db):.0%} of the speeds",
        ),
        (
            f"Speed at which {rivals} are equally loud",
            f"{published.crossover.rpm:g} rpm",
            f"{crossing.rpm:.1f} ± {crossing.deviation:.1f} rpm, 95 % interval "
            f"{crossing.low:.1f} to {crossing.high:.1f} rpm",
        ),
        (
            f"Higher jump speed of {paper.proposed} that slopes make",
            "left open",
            f"{min(shares):.0%} to {max(shares):.0%}",
        ),
        (
            "Sum of squares of the residual vibration at the same peak acceleration",
            "left open",
            f"law {residual.law:.0%}, its class of continuity {residual.classes:.0%}, angle "
            f"{residual.angle:.0%}",
        ),
    ]
    if (why := noise.high_dwell) is not None:
        lift, dwell = (100.0 * why.shares[key,] for key in (0, 1))
        row = (
            f"Why {cams[noise.roles.arcs]} is quiet",
            "it has no high dwell",
            f"its lift makes {lift:.1f} % of the variation, the high dwell {dwell:.1f} %",
        )
        lines.insert(5, row)
    return [(name, said, re.sub(r"(?<=\d)%", " %", text)) for name, said, text in lines]


def jump_claims(speeds: Mapping[str, float], rig: str) -> list[Claim]:
    """Return the paper's claims on jump speeds, tested with those (rpm) of a rig."""
    is_highest = max(speeds, key=lambda cam: speeds[cam]) == PROPOSED
    claim = "the polynomial of higher degree has the lower jump speed"
    is_lower = speeds[HIGHER] < speeds[LOWER]
    return [
        Claim(rig, "Bézier 15 has the highest jump speed", "Table 2", int(is_highest), 1),
        Claim(rig, claim, "conclusions", int(is_lower), 1),
    ]

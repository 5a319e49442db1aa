"""What the paper's report is made of: its files, shared studies, answers, misprints."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from cam_rig.dynamics import TwoMassParameters
from cam_rig.laws.cam import law_of, open_cam_set
from cam_rig.laws.segments import NAMED_RISES
from cam_rig.paper.factorial.study import (
    BY_KEY,
    FactorialResult,
    bench_of,
    open_factorial,
    run_factorial,
)
from cam_rig.paper.readings.study import ReadingsResult, read_all
from cam_rig.report.document import Answer, bold, span
from cam_rig.report.sections import read_recorded
from cam_rig.schema import Library, load_readings, load_rig, load_tables
from cam_rig.show.looks import in_words
from cam_rig.show.result import Column, Records
from cam_rig.show.tables import format_number
from cam_rig.simulation.asked import named_cams
from cam_rig.simulation.scene import open_scene
from cam_rig.studies.jump.comparison import JumpResult, find_jumps, references, rms_difference
from cam_rig.studies.noise.study import NoiseStudyResult, study_noise
from cam_rig.studies.vibration.study import (
    RESIDUAL,
    VIBRATION_RPM,
    Verdict,
    VibrationResult,
    jump_claims,
    measure,
)

#: Cams of the contact study besides the paper's: other kinds of follower.
CONTACT_CAMS = ("flat", "oscillating_flat", "point")
#: Cams that move their follower both ways.
FORM_CLOSED = ("constant_breadth", "constant_diameter", "conjugate", "oscillating_conjugate")


class Paper:
    """Every file of the page, read and checked before anything runs, and what sections share.

    ``rig`` is that of the jump speeds, ``stiff`` that of the noise study, whose stem is the paper's
    Table 1; ``touching`` are the cams of the contact study, ``form_closed`` those that move their
    follower both ways. Other files than ``scene`` and ``rig`` are found beside it, or shipped.
    """

    def __init__(self, scene: Path, rig: Path, factorial: str, bag: Path | None) -> None:
        library = Library.beside(scene)
        self.tables = load_tables(library.path("published/tables", "paper"))
        self.loaded = open_scene(scene)
        cams = [library.path("cams", cam) for cam in self.tables.table_2_jump]
        self.cam_set = open_cam_set(cams, rig)
        self.parameters = TwoMassParameters.from_rig(self.cam_set.rig)
        self.asked = open_factorial(library.path("factorials", factorial))
        self.stiff = load_rig(library.path("rigs", self.asked.noise_rig))
        self.recorded = None if bag is None else read_recorded(bag, self.loaded)
        self.table_readings = load_readings(library.path("published/readings", "table2"))
        others = [library.path("cams", cam) for cam in CONTACT_CAMS]
        self.touching = open_cam_set([*cams, *others], rig)
        closed = named_cams([library.path("cams", cam) for cam in FORM_CLOSED])
        self.form_closed = [(cam, law_of(path, cam)) for path, cam in closed]

    def begin(self, pool: Executor) -> None:
        """Begin the two long studies in the processes of a pool."""
        self._noise = pool.submit(study_noise, self.loaded, self.cam_set.rig)
        bench = bench_of(self.asked, self.cam_set.rig, self.stiff)
        self._factorial = pool.submit(run_factorial, self.asked, bench, self.cam_set.laws)

    @cached_property
    def jumps(self) -> JumpResult:
        """Jump speeds beside the paper's."""
        return find_jumps(self.cam_set, references(self.cam_set, self.tables))

    @cached_property
    def readings(self) -> ReadingsResult:
        """Every reading of Table 2."""
        return read_all(self.table_readings, self.cam_set.cams, self.tables.table_2_jump)

    @cached_property
    def vibration(self) -> VibrationResult:
        """On the rig of the jump speeds."""
        return measure(self.cam_set, VIBRATION_RPM)

    @cached_property
    def stiff_vibration(self) -> VibrationResult:
        """On the stem of Table 1."""
        return measure(replace(self.cam_set, rig=self.stiff), VIBRATION_RPM)

    @property
    def noise(self) -> NoiseStudyResult:
        """The noise study, once it is there."""
        return self._noise.result()

    @property
    def factorial(self) -> FactorialResult:
        """Continuity or slopes, once it is there."""
        return self._factorial.result()

    @property
    def stems(self) -> tuple[float, float]:
        """Stiffness (N/m) of the stem on the rig of the jump speeds, and of that of Table 1."""
        rigs = self.cam_set.rig, self.stiff
        soft, stiff = (rig.need("stem_stiffness", "the report").si for rig in rigs)
        return soft, stiff

    @property
    def proposed(self) -> str:
        """What the paper's own cam is called."""
        return self.cam_set.titles[self.asked.proposed]

    @property
    def titles(self) -> dict[str, str]:
        """What is called otherwise than by its name: rises, the readings of Table 2, cams."""
        rises = {name: in_words(name) for name in NAMED_RISES}
        readings = {name: name.replace("_", " ") for name in self.table_readings.readings}
        return rises | readings | self.cam_set.titles | self.loaded.titles


# The report in short: each question, what the paper says, what came out here, and the verdict.
# Every number and every verdict is computed; a number in a cell stands between ``**``, as bold.


def answers(paper: Paper) -> Iterator[Answer]:
    """What the report has to say, in the order of its sections."""
    yield from _claims(paper)
    yield from _jump(paper)
    yield from _noise(paper)
    yield from _question(paper)


def _claims(paper: Paper) -> Iterator[Answer]:
    rig, by_words = paper.cam_set.rig.name, dict[str, list[bool]]()
    for claim in (*paper.vibration.claims, *jump_claims(paper.jumps.rpm, rig)):
        by_words.setdefault(claim.claim, []).append(claim.verdict is Verdict.AGREES)
    claims = list(by_words.values())  # by either measure, where there are two
    holding = [by for by in claims if by[0]]
    either = sum(map(all, holding))
    here = f"{bold(len(holding))} hold at every speed compared"
    if either < len(holding):
        here += f", {bold(either)} of them by either measure of residual vibration"
    verdict = "all agree" if len(holding) == len(claims) else "not all agree"
    if either < len(holding):
        verdict += f" by the {RESIDUAL['residual_amplitude']}"
    yield Answer(
        f"Do the paper's claims of vibration and jump hold on rig {rig}?",
        here,
        verdict,
        f"{bold(len(claims))} claims",
        *("vibration", "fig4", 5),
    )


def _jump(paper: Paper) -> Iterator[Answer]:
    jump = paper.jumps.comparison
    if jump is None:
        return
    printed = [row.published_rpm for row in paper.jumps.rows if row.published_rpm is not None]
    used = "that identified the rig" if jump.fitted else "compared"
    rms = bold(100.0 * jump.rms, ".2f", "%")
    here = f"within {rms} r.m.s. on the {bold(jump.cams)} cams {used}"
    tests = [row for row in paper.jumps.rows if row.role == "test"]
    if tests:
        apart = bold(100.0 * rms_difference(tests), ".2f", "%")
        here += f", {apart} on {bold(len(tests))} that did not"
    yield Answer(
        "At which speeds is contact lost?",
        here,
        f"{'the same' if jump.same_ranking else 'another'} ranking of the cams",
        span((min(printed), max(printed)), ".6g", "rpm"),
        *("jump", "jump"),
    )
    times = sum(read.times for read in paper.readings.found)
    yield Answer(
        "After how many turns from rest?",
        f"{span(jump.turns, '.1f')}; of the printed times {bold(times)} come out, in "
        f"{bold(len(paper.readings.found))} readings",
        "reproduced in part" if times else "not reproduced",
        span(jump.published_turns, ".1f"),
        *("jump", "fig11"),
    )


def _noise(paper: Paper) -> Iterator[Answer]:
    noise, loaded = paper.noise, paper.loaded
    best, published = noise.best, loaded.published
    assert published is not None  # the study has its levels
    curve = best.curves[noise.roles.predicted]
    inside = 100.0 * curve.expected.holds(curve.published_db)
    titles = loaded.titles
    yield Answer(
        f"Does the {titles[noise.roles.reference]} cam predict the noise of "
        f"{titles[noise.roles.predicted]}?",
        f"its curve within {bold(curve.rms_regression_db, '.2f', 'dB')} r.m.s.",
        f"published curve in the 95 % band at {bold(inside, '.0f', '%')} of the speeds",
        "a regression of measured levels",
        *("noise", "fig16", noise.methods.index(best)),
    )
    yield _crossing(paper, " and ".join(titles[cam] for cam in published.crossover.between))
    why = noise.high_dwell
    if why is not None:
        lift, dwell = why.shares[(0,)], why.shares[(1,)]
        yield Answer(
            f"Why is {titles[noise.roles.arcs]} quiet?",
            f"its lift makes {bold(100.0 * lift, '.1f', '%')} of the variation, the high dwell "
            f"{bold(100.0 * dwell, '.1f', '%')}",
            "contradicted" if lift > dwell else "confirmed",
            "it has no high dwell",
            *("cams", "fig1"),
        )


def _crossing(paper: Paper, rivals: str) -> Answer:
    """Where two cams are equally loud, and whether the published speed may be the same."""
    published = paper.loaded.published
    assert published is not None  # the study has its levels
    best, named = paper.noise.best.crossing, published.crossover.rpm
    said = bold(named, ".6g", "rpm")
    asked = f"Where are {rivals} equally loud?"
    if best.rpm is None:
        return Answer(asked, "nowhere", "disagrees", said, "noise", "fig16")
    every = [m.crossing.rpm for m in paper.noise.methods if m.crossing.rpm is not None]
    here = f"at **{format_number(best.rpm, '.1f')} ± {format_number(best.deviation, '.1f')} rpm**; "
    inside = best.low <= named <= best.high
    return Answer(
        asked,
        f"{here}{span((min(every), max(every)), '.1f', 'rpm')} by {bold(len(every))} calibrations",
        f"published speed {'inside' if inside else 'outside'} the 95 % interval",
        said,
        *("noise", "fig16"),
    )


def _question(paper: Paper) -> Iterator[Answer]:
    found, alike = paper.factorial, paper.factorial.same_acceleration
    shares = [row.jump_share for row in found.advantages() if row.jump > 1.0]
    yield Answer(
        f"Is the higher jump speed of {paper.proposed} due to continuity or to lower slopes?",
        f"slopes make {span((100.0 * min(shares), 100.0 * max(shares)), '.0f', '%')} of it"
        if shares
        else "no other cam has a lower one",
        "slopes" if shares and min(shares) > 0.5 else "not by slopes alone",
        "left open",
        *("question", "factorial", 0),
    )
    residual = alike.shares(BY_KEY["residual"])
    yield Answer(
        "What governs residual vibration at the same peak acceleration?",
        f"the law makes {bold(100.0 * residual.law, '.0f', '%')} of the sum of squares, its class "
        f"of continuity {bold(100.0 * residual.classes, '.0f', '%')}, the angle "
        f"{bold(100.0 * residual.angle, '.0f', '%')}",
        residual.governed_by,
        "left open",
        *("question", "factorial", 5),
    )


# Misprints of the sources: what stands there, and what is right.


class Misprint(NamedTuple):
    """One misprint: the source, the place in it, what it prints, and what is right."""

    source: str
    where: str
    printed: str
    correct: str


PAPER, LAWS, PROFILE, EXAMPLE = "paper", "laws thesis", "profile thesis", "worked example"
MISPRINTS = (
    Misprint(PAPER, "eq. 2, two coefficients", "45045, 434434", "4504.5, 4344.34"),
    Misprint(PAPER, "eq. 20, constant", "2593808", "25.93808"),
    Misprint(PAPER, "ordinates of Bézier 15", "…1.5, 15, …", "…1.5, 1.5, …"),
    Misprint(PAPER, "Table 1, mass", "13 kg", "1.3 kg"),
    Misprint(
        LAWS, "eq. 3.6, ordinates", "0, 0, 0, 0, 0, 1/3, 2/3, 1", "0, 0, 0, 0, 0, 1/4, 1/2, 3/4, 1"
    ),
    Misprint(
        LAWS,
        "eq. 3.7, second and third derivative",
        "12u + 12u², 12 + 24u",
        "−12u + 12u², −12 + 24u",
    ),
    Misprint(
        PROFILE, "eq. 2.1, 2.10", "sum from i = 1; N⁰ closed at both ends", "from i = 0; half-open"
    ),
    Misprint(PROFILE, "eq. 2.13", "divides by uᵢ₊₁ − uᵢ", "by uᵢ₊ₙ − uᵢ"),
    Misprint(
        PROFILE,
        "eq. 2.17",
        "components in base 1, 2",
        "in the base turned by the face's inclination",
    ),
    Misprint(
        PROFILE,
        "eq. 2.33, second component",
        "−l₁ cos θ − l₃ cos(θ + d)(1 + d')",
        "−l₁ cos θ + l₃ cos(θ + d)(1 + d')",
    ),
    Misprint(
        PROFILE,
        "eq. 2.39, last component",
        "−(d + d'') cos β − ε sin β",
        "−((d + d'') cos β − ε sin β)",
    ),
    Misprint(EXAMPLE, "part a", "S(π/2) = (π/2)/(π/2) + b", "S(π/2) = a (π/2)/(π/2) + b"),
    Misprint(EXAMPLE, "part b", "½[1 − cos(πθ/β)], θ/β from 1 to 2", "½[1 + cos(πθ/β)]"),
)


def misprints_table() -> Records:
    """All of them, by source."""
    columns = tuple(map(Column, Misprint._fields))
    return Records("misprints", "Misprints in the sources", columns, MISPRINTS)

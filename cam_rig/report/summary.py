"""The report in short: each question, what the paper says, what came out here, and the verdict.

Every number and every verdict is computed; a number in a cell stands between ``**``, which is bold.
"""

from __future__ import annotations

from collections.abc import Iterator

from cam_rig.paper.jump.comparison import rms_difference
from cam_rig.paper.vibration.study import RESIDUAL, Verdict, jump_claims
from cam_rig.report.document import Answer, bold, span
from cam_rig.report.paper import Paper
from cam_rig.show.tables import number


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
    here = f"at **{number(best.rpm, '.1f')} ± {number(best.deviation, '.1f')} rpm**; "
    inside = best.low <= named <= best.high
    return Answer(
        asked,
        f"{here}{span((min(every), max(every)), '.1f', 'rpm')} by {bold(len(every))} calibrations",
        f"published speed {'inside' if inside else 'outside'} the 95 % interval",
        said,
        *("noise", "fig16"),
    )


def _question(paper: Paper) -> Iterator[Answer]:
    question = paper.factorial.conclusions()
    proposed = paper.proposed
    share, residual = question.jump_share, question.same_acceleration["residual"]
    yield Answer(
        f"Is the higher jump speed of {proposed} due to continuity or to lower slopes?",
        "no other cam has a lower one"
        if share is None
        else f"slopes make {span((100.0 * share[0], 100.0 * share[1]), '.0f', '%')} of it",
        str(question.advantage),
        "left open",
        *("question", "factorial", 0),
    )
    part = residual.shares.law if residual.shares.classes is None else residual.shares.classes
    of = "the law" if residual.shares.classes is None else "continuity"
    yield Answer(
        "What governs residual vibration at the same peak acceleration?",
        f"{of} makes {bold(100.0 * part, '.0f', '%')} of the sum of squares, the angle "
        f"{bold(100.0 * residual.shares.slopes, '.0f', '%')}",
        str(residual.governed_by),
        "left open",
        *("question", "factorial", 5),
    )

"""The report in short."""

from __future__ import annotations

from cam_rig.report.blocks import Points, Section, Words
from cam_rig.report.results import Findings
from cam_rig.studies.factorial.conclusions import answer
from cam_rig.studies.jump.comparison import rms_words, same_ranking
from cam_rig.studies.noise.bootstrap import Crossing
from cam_rig.studies.vibration.claims import jump_claims, vibration_claims


def section(results: Findings) -> Section:
    """What was found, a line each."""
    return Section(
        "summary",
        "In short",
        (
            Words(
                "The experiments of the paper on a TecQuipment TM21 cam machine, done again on a "
                "virtual rig and taken further: noise, jump, vibration, and the question the paper "
                "leaves open. Every number here comes out of the run that wrote this page."
            ),
            Points((_question(results), _jump(results), _noise(results), _claims(results))),
        ),
    )


def _question(results: Findings) -> str:
    return f"Continuity, or gentler slopes? {answer(results.factorial)[0]}"


def _jump(results: Findings) -> str:
    tests = [
        f"{row.cam} {100.0 * row.difference:+.2f} %"
        for row in results.jumps
        if row.difference is not None and row.role == "test"
    ]
    ranking = "the paper's ranking" if same_ranking(results.jumps) else "another ranking"
    untouched = f"; not fitted: {', '.join(tests)}" if tests else ""
    return (
        f"Jump speed: {rms_words(results.jumps)}, {ranking}{untouched}. The times of Table 2 do "
        "not come out."
    )


def _noise(results: Findings) -> str:
    """The way with the fewest fitted numbers first, for it claims most; then the crossings."""
    best = results.noise.methods[0]
    curves = ", ".join(
        f"{c.cam} {c.rms_regression_db:.2f} dB ({c.role}, "
        f"{c.numbers or 'no'} number{'' if c.numbers == 1 else 's'} fitted to it)"
        for c in best.curves.values()
    )
    crossed = [f"{m.name} {_crossing(m.crossing)}" for m in results.noise.methods]
    return (
        f"Noise, {best.name}: regressions within {curves} RMS. Bézier 15 and TM21 cross at "
        f"{_crossing(best.crossing)} (± one standard deviation), the published curves at "
        f"{_published(results)}; by the other ways of calibrating: {'; '.join(crossed[1:])}."
    )


def _crossing(found: Crossing) -> str:
    return "no speed" if found.rpm is None else f"{found.rpm:.1f} ± {found.deviation:.1f} rpm"


def _published(results: Findings) -> str:
    published = results.sources.loaded.published
    assert published is not None  # the study has its levels
    return f"{published.crossover.rpm:g} rpm"


def _claims(results: Findings) -> str:
    claims = [*vibration_claims(results.vibration), *jump_claims(results.jumps)]
    agreed = sum(claim.verdict == "agrees" for claim in claims)
    either = "; ".join(f"{c.words}: {c.told}" for c in claims if c.otherwise is not None)
    said = f"What the paper says of vibration and jump: {agreed} of {len(claims)} claims agree"
    return f"{said}, residual vibration measured by the ringing. {either}."

"""The open question answered in words, every number and every judgement taken from the study.

What a study cannot say, for it has one class of continuity only, or too few cells in contact, is
left out or said to be so.
"""

from __future__ import annotations

from collections.abc import Iterable

from cam_rig.studies.factorial.criteria import (
    BY_KEY,
    FOLLOWS,
    class_means,
    decided_by,
    falls_with_class,
    held,
    percent,
    share_of_law,
)
from cam_rig.studies.factorial.decomposition import Advantage, advantages
from cam_rig.studies.factorial.design import Factorial
from cam_rig.studies.factorial.law_conclusions import (
    loudness,
    order_of_jumps,
    price,
    squeezed_words,
)


def answer(found: Factorial) -> list[str]:
    """Sentences, the verdict first."""
    said = [
        _verdict(found),
        order_of_jumps(found),
        _acceleration(found),
        loudness(found),
        _residual(found),
        price(found),
        squeezed_words(found),
    ]
    return [sentence for sentence in said if sentence]


def _verdict(found: Factorial) -> str:
    """What the proposed cam's advantage is made of, and what the rest of the study adds to it."""
    return " ".join(
        part for part in (_advantage(found), _classes(found), _other_effects(found)) if part
    )


def _advantage(found: Factorial) -> str:
    proposed, rows = found.config.proposed, advantages(found)
    later = [row for row in rows if row.jump > 0.0]
    if not later:
        return f"{proposed} is left no later than any other cam: no advantage to explain."
    gentler = [row for row in rows if row.acceleration > 0.0]
    over = "" if len(later) == len(rows) else f" over {len(later)} of {len(rows)} cams"
    told = f"Of {proposed}'s higher jump speed{over} {_range(r.jump_share for r in later)}"
    if gentler:
        told += f", and of its lower acceleration {_range(r.acceleration_share for r in gentler)},"
    return (
        f"{_which(later)}. {told} is there in a follower that cannot ring, and so owed to the "
        "slopes; the rest is ringing, and so owed to continuity."
    )


def _which(rows: list[Advantage]) -> str:
    mostly = [row.jump_share > 0.5 for row in rows]
    if all(mostly):
        return "Mostly the gentler slopes"
    return (
        "The slopes over some cams, continuity over others"
        if any(mostly)
        else ("Mostly the continuity")
    )


def _range(shares: Iterable[float]) -> str:
    values = sorted(shares)
    return f"{percent(values[0])} to {percent(values[-1])}"


def _classes(found: Factorial) -> str:
    """What the choice of laws keeps the study from saying of continuity."""
    classes = found.same_acceleration.classes
    if len(set(classes)) == 1:
        return f"All rises of the study are C{classes[0]}: of continuity they say nothing."
    if len(set(classes)) == len(classes):
        return (
            "Each class of the study has one law: what belongs to the class and what to the law it "
            "cannot tell apart."
        )
    return ""


def _other_effects(found: Factorial) -> str:
    """Residual vibration and noise, and how far their models reach."""
    design, effect = found.same_acceleration, BY_KEY["residual"]
    return (
        f"Residual vibration {FOLLOWS[decided_by(design, effect)]}: with equal acceleration "
        f"{share_of_law(design, effect)}.{held(design, effect, found.config)} Noise is measured on "
        "a rigid follower, which cannot ring: of ringing it says nothing."
    )


def _acceleration(found: Factorial) -> str:
    effect, designs = BY_KEY["acceleration"], (found.same_angles, found.same_acceleration)
    same, gentle = (share_of_law(design, effect) for design in designs)
    return (
        f"Peak acceleration: with equal angles {same}, with equal acceleration of the laws "
        f"themselves {gentle}.{held(found.same_acceleration, effect, found.config)}"
    )


def _residual(found: Factorial) -> str:
    effect, designs = BY_KEY["residual"], (found.same_angles, found.same_acceleration)
    same, gentle = (share_of_law(design, effect) for design in designs)
    means = class_means(found.same_acceleration, effect)
    told = ""
    if len(means) > 1:
        low, high = min(means), max(means)
        factor = 10.0 ** ((means[low] - means[high]) / 20.0)
        change = f"falls to 1/{factor:.3g}" if factor > 1.0 else f"grows {1.0 / factor:.3g} times"
        told = f" From C{low} to C{high}, accelerating alike, it {change}."
    if falls_with_class(found.same_acceleration, effect):
        told += " Only joints ring a stem, and the smoother the joint the less."
    return (
        f"Residual vibration: with equal angles {same}, with equal acceleration {gentle}.{told}"
        f"{held(found.same_angles, effect, found.config)}"
    )

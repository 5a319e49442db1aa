"""What the numbers of a factorial study allow to be concluded, as numbers and verdicts.

What a study cannot tell, because it has one class of continuity only or too few cells in contact,
is None.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from cam_rig.laws.catalogue import figures
from cam_rig.paper.factorial.design import (
    EFFECTS,
    SMOOTH,
    Design,
    Effect,
    Factorial,
    FactorialConfig,
)
from cam_rig.units import RPM_PER_RAD_S

# How much of a cam's advantage is its lower acceleration, and how much less residual vibration.


@dataclass(frozen=True)
class Advantage:
    """By how much the proposed cam is better than ``cam``, as logarithms (0.01 is about 1 %).

    ``jump`` = ``jump_slopes`` + vibration, the same for acceleration; ``residual`` is vibration.
    ``noise`` in dB: of the slopes alone, on a rigid follower.
    """

    cam: str
    jump: float
    jump_slopes: float
    acceleration: float
    acceleration_slopes: float
    residual: float
    noise: float

    @property
    def jump_share(self) -> float:
        """Share of the slopes in the jump speed's advantage."""
        return self.jump_slopes / self.jump

    @property
    def acceleration_share(self) -> float:
        """Share of the slopes in the acceleration's advantage."""
        return self.acceleration_slopes / self.acceleration


def advantages(found: Factorial) -> list[Advantage]:
    """The proposed cam against each other cam of a study."""
    proposed = found.config.proposed
    best = found.cams[proposed]
    return [
        Advantage(
            cam=cam,
            jump=math.log(best.jump / other.jump),
            jump_slopes=math.log(best.rigid_jump / other.rigid_jump),
            acceleration=math.log(other.acceleration / best.acceleration),
            acceleration_slopes=math.log(other.own_acceleration / best.own_acceleration),
            residual=math.log(other.residual / best.residual),
            noise=other.noise - best.noise,
        )
        for cam, other in found.cams.items()
        if cam != proposed
    ]


# Which cells of a factorial design lose contact at the speeds of an effect.


def fastest(effect: Effect, config: FactorialConfig) -> float | None:
    """The fastest speed (rad/s) at which an effect supposes contact; None where it does not."""
    if not effect.speeds:
        return None
    return float(max(np.atleast_1d(getattr(config, effect.speeds).si_list)))


def contact_lost(design: Design, effect: Effect, config: FactorialConfig) -> NDArray[np.bool_]:
    """Which cells leave the cam below the effect's fastest speed, ``(a, b)``."""
    speed = fastest(effect, config)
    jumps = np.array([[m.jump for m in row] for row in design.cells])
    return np.zeros(jumps.shape, bool) if speed is None else np.asarray(jumps < speed)


def staying(design: Design, effect: Effect, config: FactorialConfig) -> Design | None:
    """The laws and angles whose cells all keep contact; None where too few remain.

    Laws and angles are dropped one after the other, those first that most of their cells leave.
    """
    lost = contact_lost(design, effect, config)
    rows, columns = (list(range(n)) for n in lost.shape)
    while (part := lost[np.ix_(rows, columns)]).any():
        by_row, by_column = part.mean(axis=1), part.mean(axis=0)
        if by_row.max() >= by_column.max():
            del rows[int(np.argmax(by_row))]
        else:
            del columns[int(np.argmax(by_column))]
    return design.part("in contact", rows, columns)


BY_KEY = {effect.key: effect for effect in EFFECTS}
JUMP, RESIDUAL, NOISE = BY_KEY["jump"], BY_KEY["residual"], BY_KEY["noise"]
#: A factor with at least this share of the sum of squares governs an effect.
GOVERNS = 0.6


class Cause(StrEnum):
    """What governs an effect, or what an advantage comes from."""

    CONTINUITY = "continuity"
    LAW = "law"
    SLOPES = "slopes"
    BOTH = "no single factor"
    NONE = "no advantage"


class Classes(StrEnum):
    """Whether the laws of a study can tell the effect of continuity from that of a law."""

    ONE = "one class of continuity"
    ONE_LAW_EACH = "one law per class"
    SEVERAL = "several laws per class"


@dataclass(frozen=True)
class Shares:
    """Shares of the sum of squares; ``classes``, a part of ``law``, where laws tell it apart."""

    law: float
    classes: float | None
    slopes: float

    @classmethod
    def of(cls, design: Design, effect: Effect) -> Shares:
        """The shares of one effect."""
        found = design.analysis(effect)
        law, angle, _ = found.shares
        told = classes_of(design) is Classes.SEVERAL
        return cls(law, found.class_share if told else None, angle)


@dataclass(frozen=True)
class EffectConclusion:
    """One effect in one design: what governs it, and how many of its cells lose contact, by law.

    ``fastest_rpm`` is the fastest of the effect's speeds, None where no cell is lost;
    ``in_contact`` the shares over the laws and angles that all keep contact, where enough are left.
    """

    governed_by: Cause
    shares: Shares
    cells: int
    lost: dict[str, int]
    fastest_rpm: float | None
    in_contact: Shares | None


@dataclass(frozen=True)
class Smooth:
    """The laws of C2 and above at the same angles: which lose contact first and last (rpm).

    ``falls_with_class`` says that each class does so earlier than the one below it.
    """

    first: str
    first_rpm: float
    last: str
    last_rpm: float
    falls_with_class: bool


@dataclass(frozen=True)
class Conclusions:
    """The study in short; pairs are the least and the greatest.

    ``advantage`` is what the higher jump speed of the ``proposed`` cam, over so many ``ahead`` of
    the ``others``, mostly comes from. ``jump_share`` and ``acceleration_share`` are of the slopes,
    as a rigid follower has them too. ``jump_smooth`` is of laws of C2 and above at the same
    acceleration; ``residual_ratio`` of the lowest class over the highest; ``noise_spread_db``
    between laws, rigid follower, same acceleration; ``loudest`` at the same angles, perhaps that of
    highest peak acceleration. ``compressed_rpm`` is by the span (degrees) the proposed cam is
    compressed into, at so many of which it is ``behind`` the best of the others.
    """

    proposed: str
    advantage: Cause
    ahead: int
    others: int
    jump_share: tuple[float, float] | None
    acceleration_share: tuple[float, float] | None
    classes: Classes
    same_angles: dict[str, EffectConclusion]
    same_acceleration: dict[str, EffectConclusion]
    jump_smooth: Shares | None
    step_to_c2: bool
    residual_ratio: float | None
    residual_falls: bool
    smooth: Smooth | None
    noise_spread_db: float
    loudest: str
    loudest_is_sharpest: bool
    compressed_rpm: dict[str, float]
    others_rpm: tuple[float, float] | None
    behind: int


def conclusions(found: Factorial) -> Conclusions:
    """What the study comes to."""
    same, alike = found.same_angles, found.same_acceleration
    rows, smoother = advantages(found), alike.smoother
    ahead = [row for row in rows if row.jump > 0.0]
    residual = class_means(alike, RESIDUAL)
    ratio = 10.0 ** ((residual[min(residual)] - residual[max(residual)]) / 20.0)
    loudest = same.rises[int(np.argmax(same.analysis(NOISE).row_effects))]
    proposed = found.config.proposed
    others = [m.jump * RPM_PER_RAD_S for cam, m in found.cams.items() if cam != proposed]
    compressed = {
        f"{math.degrees(span):.6g}": found.squeezed[span].jump * RPM_PER_RAD_S
        for span in sorted(found.squeezed, reverse=True)
    }
    return Conclusions(
        proposed=proposed,
        advantage=_cause(ahead),
        ahead=len(ahead),
        others=len(rows),
        jump_share=_range([row.jump_share for row in ahead]),
        acceleration_share=_range([r.acceleration_share for r in rows if r.acceleration > 0.0]),
        classes=classes_of(alike),
        same_angles=_effects(same, found.config),
        same_acceleration=_effects(alike, found.config),
        jump_smooth=None if smoother is None else Shares.of(smoother, JUMP),
        step_to_c2=smoother is not None and _step_to_c2(alike, smoother),
        residual_ratio=ratio if len(residual) > 1 else None,
        residual_falls=falls_with_class(alike, RESIDUAL),
        smooth=_smooth(same),
        noise_spread_db=float(np.ptp(alike.analysis(NOISE).row_effects)),
        loudest=loudest,
        loudest_is_sharpest=loudest
        == max(same.rises, key=lambda rise: figures(rise).peak_acceleration),
        compressed_rpm=compressed,
        others_rpm=_range(others),
        behind=sum(v < max(others) for v in compressed.values()) if others else 0,
    )


def classes_of(design: Design) -> Classes:
    """Whether the laws of a design tell classes of continuity apart."""
    count = len(set(design.classes))
    if count == 1:
        return Classes.ONE
    return Classes.ONE_LAW_EACH if count == len(design.classes) else Classes.SEVERAL


def governed_by(design: Design, effect: Effect) -> Cause:
    """What explains most; continuity only where classes differ and each has several laws."""
    shares = Shares.of(design, effect)
    if shares.classes is not None and shares.classes >= GOVERNS:
        return Cause.CONTINUITY
    if shares.law >= GOVERNS:
        return Cause.LAW
    return Cause.SLOPES if shares.slopes >= GOVERNS else Cause.BOTH


def class_means(design: Design, effect: Effect) -> dict[int, float]:
    """Mean effect of the laws of each class C^k about the mean of all, as it is analysed."""
    rows, classes = design.analysis(effect).row_effects, np.array(design.classes)
    return {k: float(rows[classes == k].mean()) for k in sorted(set(design.classes))}


def falls_with_class(design: Design, effect: Effect) -> bool:
    """Whether each class of continuity has less of an effect than the one below it."""
    means = list(class_means(design, effect).values())
    return len(means) > 1 and bool((np.diff(means) < 0.0).all())


def mean_jumps(design: Design) -> list[float]:
    """Jump speed of each law, geometric mean over the angles, rpm."""
    return list(map(float, np.exp(np.log(JUMP.values(design.cells)).mean(axis=1))))


def _cause(ahead: list[Advantage]) -> Cause:
    """What the advantage over most cams comes from: a half decides."""
    if not ahead:
        return Cause.NONE
    by_slopes = [row.jump_share > 0.5 for row in ahead]
    if all(by_slopes):
        return Cause.SLOPES
    return Cause.BOTH if any(by_slopes) else Cause.CONTINUITY


def _range(values: list[float]) -> tuple[float, float] | None:
    return (min(values), max(values)) if values else None


def _effects(design: Design, config: FactorialConfig) -> dict[str, EffectConclusion]:
    found = {}
    for effect in EFFECTS:
        counts, speed = contact_lost(design, effect, config).sum(axis=1), fastest(effect, config)
        lost = {rise: n for rise, n in zip(design.rises, counts.tolist(), strict=True) if n}
        stay = staying(design, effect, config) if lost else None
        found[effect.key] = EffectConclusion(
            governed_by=governed_by(design, effect),
            shares=Shares.of(design, effect),
            cells=len(design.rises) * design.angles.size,
            lost=lost,
            fastest_rpm=speed * RPM_PER_RAD_S if lost and speed is not None else None,
            in_contact=None if stay is None else Shares.of(stay, effect),
        )
    return found


def _step_to_c2(design: Design, smooth: Design) -> bool:
    """Whether laws below C2 are all behind, and without them laws differ by less than half."""
    per_law, per_smooth_law = (
        part.analysis(JUMP).rows / len(part.rises) for part in (design, smooth)
    )
    rough = [v for v, k in zip(mean_jumps(design), design.classes, strict=True) if k < SMOOTH]
    return per_smooth_law < 0.5 * per_law and min(mean_jumps(smooth)) > max(rough)


def _smooth(design: Design) -> Smooth | None:
    smooth = design.smooth
    if smooth is None:
        return None
    by_speed = sorted(zip(mean_jumps(smooth), smooth.rises, strict=True))
    (first_rpm, first), (last_rpm, last) = by_speed[0], by_speed[-1]
    return Smooth(first, first_rpm, last, last_rpm, falls_with_class(smooth, JUMP))

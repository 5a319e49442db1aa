"""What the numbers of a factorial study allow to be said of one effect."""

from __future__ import annotations

import numpy as np

from cam_rig.schema import FactorialConfig
from cam_rig.studies.factorial.design import EFFECTS, Design, Effect
from cam_rig.studies.factorial.in_contact import fastest, laws_left, staying
from cam_rig.units import RPM_PER_RAD_S

BY_KEY = {effect.key: effect for effect in EFFECTS}
#: A share of at least this much decides an effect.
DECIDES = 0.6
#: What decides an effect, in words.
FOLLOWS = {
    "continuity": "follows continuity",
    "law": "follows the law, whatever its class of continuity",
    "slopes": "follows the slopes",
    "both": "follows neither continuity nor slopes alone",
}


def decided_by(design: Design, effect: Effect) -> str:
    """What explains most of an effect: one of the keys of `FOLLOWS`.

    Continuity only where classes can be told from laws, and differ where their laws do not.
    """
    found = design.analysis(effect)
    law, angle, _ = found.shares
    if _has_classes(design) and found.classes >= DECIDES * found.total > 0.0:
        return "continuity"
    if law >= DECIDES:
        return "law"
    return "slopes" if angle >= DECIDES else "both"


def _has_classes(design: Design) -> bool:
    """Whether there are several classes of continuity, and one of several laws among them."""
    return 1 < len(set(design.classes)) < len(design.classes)


def share_of_law(design: Design, effect: Effect) -> str:
    """The shares of law, classes (where they can be told from laws) and slopes, in words."""
    found = design.analysis(effect)
    law, angle, _ = found.shares
    between = ""
    if _has_classes(design):
        between = f" ({percent(found.classes / (found.total or 1.0))} between classes)"
    return f"the law makes {percent(law)} of its variance{between}, the slopes {percent(angle)}"


def class_means(design: Design, effect: Effect) -> dict[int, float]:
    """Mean effect of the laws of each class C^k about the mean of all, as it is analysed."""
    rows, classes = design.analysis(effect).row_effects, np.array(design.classes)
    return {k: float(rows[classes == k].mean()) for k in sorted(set(design.classes))}


def falls_with_class(design: Design, effect: Effect) -> bool:
    """Whether each class of continuity has less of an effect than the one below it."""
    means = list(class_means(design, effect).values())
    return len(means) > 1 and bool((np.diff(means) < 0.0).all())


def held(design: Design, effect: Effect, config: FactorialConfig) -> str:
    """How many cells leave the cam at the speeds of an effect, and what those say that stay.

    A sentence with a space before it; empty where all stay.
    """
    gone, speed = laws_left(design, effect, config), fastest(effect, config)
    if not gone or speed is None:
        return ""
    laws = ", ".join(f"{rise} {count}" for rise, count in gone.items())
    stay = staying(design, effect, config)
    said = "too few stay to say more"
    if stay is not None:
        count = f"the {len(stay.rises)} laws at the {stay.angles.size} angles that all stay"
        said = f"over {count} {share_of_law(stay, effect)}"
    return (
        f" Of {len(design.rises) * design.angles.size} cells with {design.name} "
        f"{sum(gone.values())} leave the cam below {speed * RPM_PER_RAD_S:g} rpm, the fastest it "
        f"was measured at ({laws}); {said}."
    )


def percent(share: float) -> str:
    """A share as whole percent, one digit after the point below 1 %."""
    return f"{100.0 * share:.{1 if 0.0005 <= abs(share) < 0.01 else 0}f} %"

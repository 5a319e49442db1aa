"""What the paper claims of noise, tested on its own curves and on those of the study."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from cam_rig.paper.noise.methods import StudiedCurve
from cam_rig.paper.noise.roles import StudyRoles
from cam_rig.units import FloatArray

#: Curves that a claim is tested on: its heading, and which of a studied curve it takes.
TESTED_ON: dict[str, Callable[[StudiedCurve], FloatArray]] = {
    "published curves": lambda curve: curve.published_db,
    "regressions": lambda curve: curve.regression_db,
    "points": lambda curve: curve.level_db,
}


@dataclass(frozen=True)
class NoiseClaim:
    """A claim of the paper on the levels of its cams, and what it was tested on.

    ``holds`` counts the speeds at which it holds, of ``cases``; ``fails_rpm`` are the lowest and
    highest speed at which it does not, None where it always holds.
    """

    words: str
    source: str
    tested_on: str
    holds: int
    cases: int
    fails_rpm: tuple[float, float] | None

    @property
    def verdict(self) -> str:
        """At how many speeds it holds, and between which it does not."""
        share = f"at {self.holds} of {self.cases} speeds"
        if self.fails_rpm is None:
            return share
        return f"{share}, not at {' to '.join(f'{v:g}' for v in dict.fromkeys(self.fails_rpm))} rpm"


def noise_claims(
    roles: StudyRoles, curves: Mapping[str, StudiedCurve], crossover_rpm: float
) -> list[NoiseClaim]:
    """The paper's claims below and above its speed at which its two rivals are equally loud."""
    rpm = curves[roles.arcs].rpm
    below, above = rpm < crossover_rpm, rpm > crossover_rpm
    at = f"{crossover_rpm:g} rpm"
    arcs, conventional, proposed = roles.arcs, roles.reference, roles.predicted
    named = (
        (f"{arcs} is the quietest below {at}", "fig. 16", arcs, (conventional, proposed), below),
        (f"{proposed} is quieter than {arcs} above {at}", "fig. 16", proposed, (arcs,), above),
        (
            f"{proposed} is quieter than {conventional} above {at}",
            "conclusions",
            proposed,
            (conventional,),
            above,
        ),
    )
    found = []
    for words, source, cam, others, where in named:
        for name, take in TESTED_ON.items():
            loudness = [take(curves[other])[where] for other in others]
            holds = take(curves[cam])[where] < np.min(loudness, axis=0)
            against = rpm[where][~holds]
            fails = (float(against[0]), float(against[-1])) if against.size else None
            cases = int(where.sum())
            found.append(NoiseClaim(words, source, name, int(holds.sum()), cases, fails))
    return found

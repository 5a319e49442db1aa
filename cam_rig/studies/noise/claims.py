"""What the paper claims of noise, tested on its own curves and on those of the study."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cam_rig.arrays import FloatArray
from cam_rig.studies.noise.calibration_methods import Method, StudiedCurve
from cam_rig.studies.noise.run import NoiseStudy

#: Levels in dB by cam, at the speeds of the study; and where something is true of them.
Levels = dict[str, FloatArray]
Truth = npt.NDArray[np.bool_]
#: Curves that a claim is tested on: its heading, and which of a studied curve it takes.
TESTED_ON: dict[str, Callable[[StudiedCurve], FloatArray]] = {
    "published curves": lambda curve: curve.published_db,
    "regressions": lambda curve: curve.regression_db,
    "points": lambda curve: curve.level_db,
}


@dataclass(frozen=True)
class NoiseClaim:
    """A claim of the paper on the levels of its cams, by what it was tested on.

    ``holds`` counts the speeds at which it holds, of ``cases``; ``fails_rpm`` are the lowest and
    highest speed at which it does not, None where it always holds.
    """

    words: str
    source: str
    holds: dict[str, int]
    cases: int
    fails_rpm: dict[str, tuple[float, float] | None]


def noise_claims(study: NoiseStudy, crossover_rpm: float) -> list[NoiseClaim]:
    """The paper's claims below and above the speed at which its two rivals are equally loud.

    Parameters
    ----------
    crossover_rpm : that speed, as the paper states it
    """
    roles, method, rpm = study.roles, study.best, study.rpm
    below, above = rpm < crossover_rpm, rpm > crossover_rpm
    at = f"{crossover_rpm:g} rpm"
    arcs, conventional, proposed = roles.arcs, roles.reference, roles.predicted

    def quietest(levels: Levels) -> Truth:
        return levels[arcs] <= np.minimum(levels[conventional], levels[proposed])

    def quieter_than(other: str) -> Callable[[Levels], Truth]:
        return lambda levels: levels[proposed] < levels[other]

    named = (
        (f"{arcs} is the quietest below {at}", "fig. 16", quietest, below),
        (f"{proposed} is quieter than {arcs} above {at}", "fig. 16", quieter_than(arcs), above),
        (
            f"{proposed} is quieter than {conventional} above {at}",
            "conclusions",
            quieter_than(conventional),
            above,
        ),
    )
    return [
        _tested(words, source, method, rpm, where, test) for words, source, test, where in named
    ]


def _tested(
    words: str,
    source: str,
    method: Method,
    rpm: FloatArray,
    where: Truth,
    test: Callable[[Levels], Truth],
) -> NoiseClaim:
    holds, fails = dict[str, int](), dict[str, tuple[float, float] | None]()
    for name, take in TESTED_ON.items():
        found = test({cam: take(curve) for cam, curve in method.curves.items()})[where]
        against = rpm[where][~found]
        holds[name] = int(found.sum())
        fails[name] = (float(against[0]), float(against[-1])) if against.size else None
    return NoiseClaim(words, source, holds, int(where.sum()), fails)

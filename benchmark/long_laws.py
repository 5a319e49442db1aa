"""Cost of a jump search by number of pieces of the law: part of docs/develop/cost.md.

Print it from the project's root: OMP_NUM_THREADS=1 .venv/bin/python -m benchmark.long_laws
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from typing import TypeVar

import numpy as np

from benchmark.speed.cases import law_of
from benchmark.speed.event_cost import form_of_search
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.events.backend import COMPILED, PLAIN
from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.jump.rigid_mass import rigid_jump
from cam_rig.laws import Law
from cam_rig.laws.bernstein import join_pieces
from cam_rig.laws.spline import smooth
from cam_rig.schema import load_rig
from cam_rig.schema.load import config_root
from cam_rig.show.tables import DataTable, Header, tabulate, to_markdown
from cam_rig.units import RPM, TURN

Found = TypeVar("Found")

CAM, RIG, FROM_REST, REPEATS, NOISE_NM = "bezier15", "paper_table2", 1.7, 7, 10.0
PIECES = (1, 12, 36, 90, 180, 360, 720, 1440)
#: Number of pieces from which on the slope is fitted. Below it constant costs dominate.
MANY = 180

SECTION = """\
## Jump search

CPU time of one jump speed against the number of pieces of the law, including the law's tables.
The law is a spline of degree 5 through this number of readings of the Bézier 15 cam. *Noisy*
readings have {noise:g} nm of noise. With existing tables, one rigid mass takes {known} ms.

{table}

From {many} pieces on, the time is proportional to a power of the number of pieces. The exponent is
{slopes}.\
"""


@dataclass(frozen=True)
class JumpCost:
    """CPU times (s) of searches on a law, and the speed found from rest, rpm."""

    pieces: int
    rpm: float
    rest_s: float
    noisy_s: float  #: from rest, with noisy readings
    steady_s: float
    rigid_s: float
    known_s: float  #: of one rigid mass on a law with existing tables


def through(law: Law, count: int, noise: float = 0.0) -> Law:
    """Return the spline through evenly spaced readings of a law, with noise in m.

    A count of 1 returns the law itself.
    """
    if count == 1:
        return law
    angles = np.linspace(0.0, TURN, count, endpoint=False)
    readings = law(angles) + noise * np.random.default_rng(count).standard_normal(count)
    breaks, columns = smooth(angles, readings, 0.0).pieces
    return Law(law.name, np.array(breaks), join_pieces(columns))


def measure() -> list[JumpCost]:
    """Return the costs of the laws with `PIECES`."""
    with form_of_search(COMPILED if find_spec("numba") else PLAIN):
        return _measured()


def _measured() -> list[JumpCost]:
    rig = load_rig(config_root() / "rigs" / f"{RIG}.yaml")
    two, one = TwoMassParameters.from_rig(rig), FollowerParameters.from_rig(rig)
    found = []
    for count in PIECES:
        law = through(law_of(CAM), count)
        rest, jump = _cost(law, partial(find_jump, parameters=two, duration=FROM_REST))
        noisy = through(law_of(CAM), count, 1e-9 * NOISE_NM)
        rough, _ = _cost(noisy, partial(find_jump, parameters=two, duration=FROM_REST))
        steady, _ = _cost(law, partial(find_jump, parameters=two, duration=None))
        rigid, _ = _cost(law, partial(rigid_jump, follower=one))
        known, _ = _cost(law, partial(rigid_jump, follower=one), known=True)
        found.append(JumpCost(law.spans.size, jump.speed / RPM, rest, rough, steady, rigid, known))
    return found


def _cost(law: Law, search: Callable[[Law], Found], known: bool = False) -> tuple[float, Found]:
    """Return the median CPU time (s) of a search.

    Each search uses a new law, or all use the same law with existing tables.
    """
    times = []
    for _ in range(REPEATS + 1):
        own = law if known else Law(law.name, law.breaks, law.ordinates)
        start_time = time.process_time()
        found = search(own)
        times.append(time.process_time() - start_time)
    return statistics.median(times[1:]), found


def cost_table(costs: list[JumpCost]) -> DataTable:
    """Return a table with one row per law."""
    return tabulate(
        "CPU time of a jump speed",
        costs,
        (
            (Header("pieces", "", "d"), lambda cost: cost.pieces),
            (Header("two masses, from rest", "ms", ".2f"), lambda cost: 1e3 * cost.rest_s),
            (Header("the same, noisy", "ms", ".2f"), lambda cost: 1e3 * cost.noisy_s),
            (Header("two masses, steady", "ms", ".2f"), lambda cost: 1e3 * cost.steady_s),
            (Header("one rigid mass", "ms", ".3f"), lambda cost: 1e3 * cost.rigid_s),
            (Header("jump, from rest", "rpm", ".3f"), lambda cost: cost.rpm),
        ),
    )


def section(costs: list[JumpCost]) -> str:
    """Return the section of the page."""
    many = [cost for cost in costs if cost.pieces >= MANY]
    sizes = np.log([cost.pieces for cost in many])
    slopes = [
        f"{np.polyfit(sizes, np.log([getattr(cost, name) for cost in many]), 1)[0]:.2f} ({words})"
        for name, words in (("rest_s", "from rest"), ("steady_s", "steady"), ("rigid_s", "rigid"))
    ]
    listed = ", ".join(slopes)
    table = to_markdown(cost_table(costs))
    least, most = (1e3 * fun(cost.known_s for cost in costs) for fun in (min, max))
    known = f"{least:.2f} to {most:.2f}"
    return SECTION.format(table=table, many=MANY, slopes=listed, noise=NOISE_NM, known=known)


if __name__ == "__main__":
    print(section(measure()))

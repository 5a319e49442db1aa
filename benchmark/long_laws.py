"""CPU time of a jump search by the number of pieces of the law.

It is a part of docs/develop/cost.md. Print it from the root of the repository: OMP_NUM_THREADS=1
.venv/bin/python -m benchmark.long_laws
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
from benchmark.speed.event_cost import force_backend
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

Solution = TypeVar("Solution")

CAM = "bezier15"
RIG = "paper_table2"
#: Duration (s) of a run from rest.
FROM_REST = 1.7
#: Number of timed searches, of which the median counts.
REPEATS = 7
#: Standard deviation of the noisy readings (nm).
NOISE_NM = 10.0
#: Numbers of pieces of the laws.
PIECES = (1, 12, 36, 90, 180, 360, 720, 1440)
#: Smallest number of pieces for the fit of the slope. Below it constant costs dominate.
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
    """CPU times (s) of jump searches on a law, and the jump speed from rest (rpm)."""

    pieces: int
    rpm: float
    rest_s: float
    noisy_s: float  #: from rest, law through noisy readings
    steady_s: float
    rigid_s: float
    known_s: float  #: one rigid mass, on a law with existing tables


def through(law: Law, count: int, noise: float = 0.0) -> Law:
    """Return the spline through evenly spaced readings of a law.

    ``noise`` is the standard deviation of the readings (m). A count of 1 returns the law itself.
    """
    if count == 1:
        return law
    angles = np.linspace(0.0, TURN, count, endpoint=False)
    readings = law(angles) + noise * np.random.default_rng(count).standard_normal(count)
    breaks, columns = smooth(angles, readings, 0.0).pieces
    return Law(law.name, np.array(breaks), join_pieces(columns))


def measure() -> list[JumpCost]:
    """Return the costs for each number of `PIECES`."""
    with force_backend(COMPILED if find_spec("numba") else PLAIN):
        return _measured()


def _measured() -> list[JumpCost]:
    rig = load_rig(config_root() / "rigs" / f"{RIG}.yaml")
    two, rigid_mass = TwoMassParameters.from_rig(rig), FollowerParameters.from_rig(rig)
    costs = []
    for count in PIECES:
        law = through(law_of(CAM), count)
        rest_time, jump = _cost(law, partial(find_jump, parameters=two, duration=FROM_REST))
        noisy = through(law_of(CAM), count, 1e-9 * NOISE_NM)
        noisy_time, _ = _cost(noisy, partial(find_jump, parameters=two, duration=FROM_REST))
        steady_time, _ = _cost(law, partial(find_jump, parameters=two, duration=None))
        rigid_time, _ = _cost(law, partial(rigid_jump, follower=rigid_mass))
        reused_time, _ = _cost(law, partial(rigid_jump, follower=rigid_mass), reuse_tables=True)
        costs.append(
            JumpCost(
                law.spans.size,
                jump.speed / RPM,
                rest_time,
                noisy_time,
                steady_time,
                rigid_time,
                reused_time,
            )
        )
    return costs


def _cost(
    law: Law, search: Callable[[Law], Solution], reuse_tables: bool = False
) -> tuple[float, Solution]:
    """Return the median CPU time (s) of a search, and its result.

    Each search uses a new law, or all use the same law with existing tables.
    """
    times = []
    for _ in range(REPEATS + 1):
        searched = law if reuse_tables else Law(law.name, law.breaks, law.ordinates)
        start_time = time.process_time()
        solution = search(searched)
        times.append(time.process_time() - start_time)
    return statistics.median(times[1:]), solution


def cost_table(costs: list[JumpCost]) -> DataTable:
    """Return a table with a row per law."""
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
    """Return the section of docs/develop/cost.md."""
    many = [cost for cost in costs if cost.pieces >= MANY]
    sizes = np.log([cost.pieces for cost in many])
    slopes = [
        f"{np.polyfit(sizes, np.log([getattr(cost, name) for cost in many]), 1)[0]:.2f} ({title})"
        for name, title in (("rest_s", "from rest"), ("steady_s", "steady"), ("rigid_s", "rigid"))
    ]
    listed = ", ".join(slopes)
    table = to_markdown(cost_table(costs))
    shortest, longest = (1e3 * fun(cost.known_s for cost in costs) for fun in (min, max))
    known = f"{shortest:.2f} to {longest:.2f}"
    return SECTION.format(table=table, many=MANY, slopes=listed, noise=NOISE_NM, known=known)


if __name__ == "__main__":
    print(section(measure()))

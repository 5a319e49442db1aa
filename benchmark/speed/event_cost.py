"""What a lift-off and its landing cost: the search alone, whole solutions, and a peer's."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec

from benchmark.speed import study
from benchmark.speed.cases import CASES
from benchmark.speed.models import Case, OneMass, Solution
from benchmark.speed.peers import PEERS
from benchmark.speed.problem import PeerError
from cam_rig.dynamics.events.search import ALWAYS, PLAIN, VARIABLE
from cam_rig.show.tables import DataTable, Head, tabulate

#: Cases with events, and the tolerances of the peer, of which the most accurate run counts.
NAMES, RTOLS = ("one_mass_arc", "two_mass_soft", "two_mass_stem"), (1e-12, 3e-14)

#: The peer's longest run (s), and the rig's runs, of which the median counts.
SECONDS, REPEATS = 60.0, 21


@dataclass(frozen=True)
class EventCost:
    """A solver's time (s) a landing, and the largest error of an event's time (s)."""

    case: str
    landings: int
    solver: str
    time_s: float
    error_s: float


def event_costs(
    names: tuple[str, ...] = NAMES, peer: str = "CVODE", repeats: int = REPEATS
) -> list[EventCost]:
    """Each case by the rig, in plain Python and compiled, and by a peer."""
    return [cost for name in names for cost in _of_case(name, peer, repeats)]


def event_table(costs: list[EventCost]) -> DataTable:
    """One row a solver; the ratio is to the rig's own most often met, the compiled search."""
    first = {cost.case: cost.time_s for cost in reversed(costs)}
    return tabulate(
        "Events",
        costs,
        (
            (Head("case"), lambda cost: cost.case),
            (Head("landings", "", "d"), lambda cost: cost.landings),
            (Head("solver"), lambda cost: cost.solver),
            (Head("a landing", "µs", ".3g"), lambda cost: 1e6 * cost.time_s),
            (Head("error", "s", ".1e"), lambda cost: cost.error_s),
            (Head("x first", "", ".3g"), lambda cost: cost.time_s / first[cost.case]),
        ),
    )


def _of_case(name: str, peer: str, repeats: int) -> Iterator[EventCost]:
    case = CASES[name]()
    reference = study.read(case)
    landings = sum(kind == "landing" for kind, _ in reference.events)
    forms = [("compiled", ALWAYS)] if find_spec("numba") else []
    for words, form in (*forms, ("plain Python", PLAIN)):
        with form_of_search(form):
            error = _error(study.solve(case), reference)  # compiles, and makes the tables
            alone = _median(lambda: _search(case), repeats)
            whole = _median(lambda: study.solve(case.fresh()), repeats)
        yield EventCost(name, landings, f"rig, the search, {words}", alone / landings, error)
        yield EventCost(name, landings, f"rig, a whole solution, {words}", whole / landings, error)
    found = list(_of_peer(case, reference, peer))
    if found:
        words, taken, error = min(found, key=lambda run: run[2])
        yield EventCost(name, landings, f"{words}, a whole solution", taken / landings, error)


def _search(case: Case) -> None:
    if isinstance(case.model, OneMass):
        study.one_mass_course(case)
    else:
        study.two_mass_course(case)


def _of_peer(case: Case, reference: Solution, name: str) -> Iterator[tuple[str, float, float]]:
    """Words, time (s) and error (s) of each setting that came to an end."""
    for peer in PEERS:
        if peer.name != name or peer.missing() is not None:
            continue
        for rtol in RTOLS:
            begun = time.perf_counter()
            try:
                solution = peer.solve(case, rtol, SECONDS)
            except PeerError:
                continue
            taken = time.perf_counter() - begun
            yield f"{peer.title} {rtol:.0e}", taken, _error(solution, reference)


def _error(solution: Solution, reference: Solution) -> float:
    error = solution.event_error(reference)
    assert error is not None
    return error


def _median(function: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        function()
        times.append(time.perf_counter() - begun)
    return statistics.median(times)


@contextmanager
def form_of_search(form: str) -> Iterator[None]:
    """The search in one form, whatever the environment says of it."""
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = form
    try:
        yield
    finally:
        del os.environ[VARIABLE]
        if before is not None:
            os.environ[VARIABLE] = before

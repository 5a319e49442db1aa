"""Cost of a lift-off and its landing: search, whole solution, and the peer CVODE."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.util import find_spec

from benchmark.speed import study
from benchmark.speed.cases import CASES
from benchmark.speed.models import Case, OneMass, Solution
from benchmark.speed.peers import PEERS
from benchmark.speed.problem import PeerError
from cam_rig.dynamics.events.backend import COMPILED, PLAIN, VARIABLE
from cam_rig.show.tables import DataTable, Header, tabulate

#: Cases with events (lift-offs and landings).
NAMES = ("one_mass_arc", "two_mass_soft", "two_mass_stem")
#: Relative tolerances of the peer. The more accurate run counts.
RTOLS = (1e-12, 3e-14)
#: Number of turns of long runs, in which the constant cost of a run is small.
LONG_TURNS = 100
#: Cases whose long runs the peer completes within the limit.
PEER_NAMES = ("one_mass_arc", "two_mass_soft")
WHOLE = "a whole solution"

#: Longest run of the peer (s).
MAX_PEER_S = 60.0
#: Number of runs of cam_rig, of which the median counts.
REPEATS = 21


@dataclass(frozen=True)
class EventCost:
    """Time (s) of a solver per landing, and the largest error (s) of an event."""

    case: str
    landings: int
    solver: str
    time_s: float
    error_s: float


def event_costs(
    names: tuple[str, ...] = NAMES, peer: str = "CVODE", repeats: int = REPEATS
) -> list[EventCost]:
    """Return the costs of each case: by cam_rig, compiled or not, and by a peer."""
    return [cost for name in names for cost in _of_case(name, peer, repeats)]


def event_table(costs: list[EventCost]) -> DataTable:
    """Return a table with a row per solver.

    The ratio is relative to the first row of the case, the compiled search of cam_rig, which is the
    default.
    """
    first = {cost.case: cost for cost in reversed(costs)}

    def called(cost: EventCost) -> str:
        return f"{cost.case}: {cost.landings}" if cost is first[cost.case] else ""

    return tabulate(
        "Events",
        costs,
        (
            (Header("case, landings"), called),
            (Header("solver"), lambda cost: cost.solver),
            (Header("a landing", "µs", ".3g"), lambda cost: 1e6 * cost.time_s),
            (Header("error", "s", ".1e"), lambda cost: cost.error_s),
            (Header("x first", "", ".3g"), lambda cost: cost.time_s / first[cost.case].time_s),
        ),
    )


def _of_case(name: str, peer: str, repeats: int) -> Iterator[EventCost]:
    case = CASES[name]()
    reference = study.read_reference(case)
    landings = _landings(reference)
    forms = [("compiled", COMPILED)] if find_spec("numba") else []
    for solver, form in (*forms, ("plain Python", PLAIN)):
        with force_backend(form):
            error = _error(case, study.solve(case), reference)  # compiles, and makes the tables
            alone = median_of(lambda: _search(case), repeats)
            whole = median_of(lambda: study.solve(case.fresh()), repeats)
        yield EventCost(name, landings, f"rig, the search, {solver}", alone / landings, error)
        if form != PLAIN or not forms:
            yield EventCost(name, landings, f"rig, {WHOLE}, {solver}", whole / landings, error)
    peer_runs = list(_of_peer(case, case, reference, peer))
    if peer_runs:
        solver, taken, error, _ = min(peer_runs, key=lambda run: run[2])
        yield EventCost(name, landings, f"{solver}, {WHOLE}", taken / landings, error)
    yield from _of_long(case, reference, peer if name in PEER_NAMES else "none", repeats)


def _of_long(case: Case, reference: Solution, peer: str, repeats: int) -> Iterator[EventCost]:
    """Yield the costs of the case for `LONG_TURNS`.

    Errors are those of the turns that the reference contains.
    """
    long, name = case.lasting(LONG_TURNS), f"{case.name}, {LONG_TURNS} turns"
    form = ("compiled", COMPILED) if find_spec("numba") else ("plain Python", PLAIN)
    with force_backend(form[1]):
        solution = study.solve(long)
        alone = median_of(lambda: _search(long), repeats)
        whole = median_of(lambda: study.solve(long.fresh()), repeats)
    landings, error = _landings(solution), _error(case, solution, reference)
    yield EventCost(name, landings, f"rig, the search, {form[0]}", alone / landings, error)
    yield EventCost(name, landings, f"rig, {WHOLE}, {form[0]}", whole / landings, error)
    peer_runs = list(_of_peer(case, long, reference, peer))
    if peer_runs:
        solver, taken, error, landings = min(peer_runs, key=lambda run: run[2])
        yield EventCost(name, landings, f"{solver}, {WHOLE}", taken / landings, error)


def _landings(solution: Solution) -> int:
    return sum(kind == "landing" for kind, _ in solution.events)


def _search(case: Case) -> None:
    if isinstance(case.model, OneMass):
        study.one_mass_trajectory(case)
    else:
        study.two_mass_trajectory(case)


def _of_peer(
    case: Case, run: Case, reference: Solution, name: str
) -> Iterator[tuple[str, float, float, int]]:
    """Yield title, time (s), error (s) and landings of each completed setting."""
    for peer in PEERS:
        if peer.name != name or peer.missing() is not None:
            continue
        for rtol in RTOLS:
            start_time = time.perf_counter()
            try:
                solution = peer.solve(run, rtol, MAX_PEER_S)
            except PeerError:
                continue
            taken = time.perf_counter() - start_time
            error = _error(case, solution, reference)
            yield f"{peer.title} {rtol:.0e}", taken, error, _landings(solution)


def _error(case: Case, solution: Solution, reference: Solution) -> float:
    """Return the error of the events up to the end of the case."""
    within = tuple(event for event in solution.events if event[1] <= case.duration)
    error = replace(solution, events=within).event_error(reference)
    assert error is not None
    return error


def median_of(function: Callable[[], object], repeats: int) -> float:
    """Return the median wall time (s) of several calls."""
    times = []
    for _ in range(repeats):
        start_time = time.perf_counter()
        function()
        times.append(time.perf_counter() - start_time)
    return statistics.median(times)


@contextmanager
def force_backend(form: str) -> Iterator[None]:
    """Use the compiled or the plain search, independent of the environment."""
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = form
    try:
        yield
    finally:
        del os.environ[VARIABLE]
        if before is not None:
            os.environ[VARIABLE] = before

"""Runs the study within a time limit: rig and peers in turn, in one process, on one core.

Every sweep goes from loose to tight and gets its share of the time that is left; a setting that
is predicted to exceed the share is left out, and the result says so.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

from cam_rig.bench import rig
from cam_rig.bench.cases.campaign import campaign_rate
from cam_rig.bench.cases.case import Case, Solution
from cam_rig.bench.cases.cases import CASES
from cam_rig.bench.peers.peers import PEERS, Peer
from cam_rig.bench.peers.problem import PeerError
from cam_rig.bench.rate import rates
from cam_rig.bench.reference import stored
from cam_rig.bench.result import CaseResult, Sweep, WorkPrecisionPoint, WorkPrecisionStudy
from cam_rig.errors import CamRigError

#: Cases in the order they run: cheap ones leave time to the dear ones.
ORDER = (
    "resonance",
    "torsional",
    "two_mass_soft",
    "one_mass_arc",
    "two_mass_stem",
    "elastic_stem",
)
#: A setting takes this many times as long as the one before it, at least and at most.
MIN_GROWTH, MAX_GROWTH = 1.3, 4.0
#: Runs of a peer's setting, as long as they take no more than this fraction of the sweep's share.
PEER_REPEATS, REPEAT_SHARE = 3, 0.15
#: A run may take so many times the time that is left before it is stopped.
OVERRUN = 4.0


@dataclass(frozen=True)
class Effort:
    """How long, how often and how fine: ``seconds`` for all peers together."""

    seconds: float
    rig_repeats: int
    rtols: tuple[float, ...]


QUICK = Effort(32.0, 7, (1e-9, 1e-12, 1e-13))
#: Tolerances of a slow peer in a quick study.
QUICK_AND_SLOW = (1e-4, 1e-6)
FULL = Effort(235.0, 25, (1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 3e-14))


def run(
    quick: bool, advance: Callable[[str], None], names: tuple[str, ...] = ORDER, cores: int = 1
) -> WorkPrecisionStudy:
    """Run the study; ``advance`` is told what comes next, once for each sweep and the campaign."""
    begun = time.perf_counter()
    effort = QUICK if quick else FULL
    deadline = begun + effort.seconds
    left = len(names) * sum(peer.weight for peer in PEERS)
    found: dict[str, CaseResult] = {}
    for name in names:
        case = CASES[name]()
        case = case.first_turns(case.quick_turns) if quick else case
        reference = stored.read(case)
        found[name] = _rig(case, reference, effort.rig_repeats)
        for peer in PEERS:
            advance(f"{name}: {peer.title}")
            share = peer.weight * max(0.0, deadline - time.perf_counter()) / left
            left -= peer.weight
            rtols = QUICK_AND_SLOW if quick and peer.slow else effort.rtols
            found[name].sweeps.append(sweep(case, peer, reference, rtols, share))
    advance("campaign")
    campaign = campaign_rate(cores, quick)
    ordered = {name: found[name] for name in CASES if name in found}
    took = time.perf_counter() - begun
    return WorkPrecisionStudy(ordered, rates(), quick, cores, took, campaign)


def _rig(case: Case, reference: Solution, repeats: int) -> CaseResult:
    """The rig's point; every run starts with a law of which nothing is cached."""
    result = CaseResult(case)
    times: list[float] = []
    try:
        rig.solve(case)  # imports and the tables that do not belong to a law
        for _ in range(repeats):
            fresh = case.fresh()
            begun = time.perf_counter()
            solution = rig.solve(fresh)
            times.append(time.perf_counter() - begun)
    except CamRigError as error:
        result.missing = str(error)
        return result
    result.rig = _point(solution, reference, times)
    return result


def sweep(
    case: Case, peer: Peer, reference: Solution, rtols: tuple[float, ...], share: float
) -> Sweep:
    """One peer from loose to tight within ``share`` seconds."""
    out = Sweep(peer)
    missing = peer.missing()
    if missing is not None:
        out.notes.append(missing)
        return out
    end = time.perf_counter() + share
    for rtol in rtols:
        spare = end - time.perf_counter()
        predicted = _predicted(out.points)
        if predicted > spare:
            words = f"predicted {predicted:.1f} s" if out.points else "no time left"
            out.notes.append(f"rtol {rtol:.0e} and tighter left out: {words}")
            break
        try:
            out.points.append(_measure(case, peer, reference, rtol, REPEAT_SHARE * share, spare))
        except PeerError as error:
            out.notes.append(f"rtol {rtol:.0e} failed: {error}")
    return out


def _predicted(points: list[WorkPrecisionPoint]) -> float:
    if len(points) < 2:
        return MIN_GROWTH * points[0].time_s if points else 0.0
    last, before = points[-1].time_s, points[-2].time_s
    return last * min(max(MIN_GROWTH, last / before), MAX_GROWTH)


def _measure(
    case: Case, peer: Peer, reference: Solution, rtol: float, limit: float, spare: float
) -> WorkPrecisionPoint:
    """Median of up to `PEER_REPEATS` runs, one at least, more only within ``limit`` seconds.

    A run that takes much longer than the ``spare`` seconds it was let in for is given up.
    """
    times: list[float] = []
    while not times or (len(times) < PEER_REPEATS and sum(times) + times[-1] < limit):
        begun = time.perf_counter()
        solution = peer.solve(case, rtol, OVERRUN * spare)
        times.append(time.perf_counter() - begun)
    return _point(solution, reference, times, rtol)


def _point(
    solution: Solution, reference: Solution, times: list[float], rtol: float | None = None
) -> WorkPrecisionPoint:
    return WorkPrecisionPoint(
        statistics.median(times),
        solution.error(reference),
        solution.event_error(reference),
        len(times),
        rtol,
    )

"""Comparison within a time limit: cam_rig and peers in turn, on one core.

The sweep of a peer goes from loose to tight tolerances, and has a share of the remaining time. A
setting that would exceed the share is left out, and the result reports it.
"""

from __future__ import annotations

import json
import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmark.speed.campaign import CampaignRate, campaign_rate
from benchmark.speed.cases import CASES, rates
from benchmark.speed.models import Case, OneMass, Oscillator, Solution, Twist, TwoMasses
from benchmark.speed.peers import PEERS, Peer
from benchmark.speed.problem import PeerError
from cam_rig.dynamics import FollowerParameters, Interval, elastic_stem
from cam_rig.dynamics.free_masses import TwoMassParameters
from cam_rig.dynamics.linear.response import LinearResponse, Outputs, polynomial_part
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.torsional import model as parameters_module
from cam_rig.dynamics.torsional import motion as torsion
from cam_rig.dynamics.two_mass import Separation, states
from cam_rig.errors import CamRigError
from cam_rig.laws import Law, bernstein
from cam_rig.units import NS, FloatArray

# -- results of a comparison: points of error against time


@dataclass(frozen=True)
class WorkPrecisionPoint:
    """Setting of a solver: median wall time (s) of ``repeats`` runs, and error."""

    time_s: float
    error: float
    event_error_s: float | None
    repeats: int
    rtol: float | None = None


@dataclass
class Sweep:
    """Points of a peer at its tolerances. ``notes`` report omitted settings."""

    peer: Peer
    points: list[WorkPrecisionPoint] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


#: Ratio of two errors that counts as equal accuracy, if a peer does not reach the error of cam_rig.
NEARLY_BEST = 10.0


@dataclass
class CaseResult:
    """Results of a case: point of cam_rig or reason for its absence, and sweeps."""

    case: Case
    rig: WorkPrecisionPoint | None = None
    missing: str | None = None
    sweeps: list[Sweep] = field(default_factory=list)

    def best(self, peer: str) -> tuple[Sweep, WorkPrecisionPoint] | None:
        """Return the fastest point of the peer that is as accurate as cam_rig.

        If there is no such point, it is the fastest point whose error is at most `NEARLY_BEST`
        times the smallest error of the peer.
        """
        all_points = [(s, p) for s in self.sweeps if s.peer.name == peer for p in s.points]
        if not all_points:
            return None
        good = [pair for pair in all_points if self.as_good(pair[1])]
        if good:
            return min(good, key=lambda pair: pair[1].time_s)
        limit = NEARLY_BEST * min(point.error for _, point in all_points)
        nearly_best = [pair for pair in all_points if pair[1].error <= limit]
        return min(nearly_best, key=lambda pair: pair[1].time_s)

    def as_good(self, point: WorkPrecisionPoint) -> bool:
        """Return True if the error of a point is at most that of cam_rig."""
        return self.rig is not None and point.error <= self.rig.error

    def ratio(self, point: WorkPrecisionPoint) -> float | None:
        """Return the time relative to that of cam_rig."""
        return None if self.rig is None else point.time_s / self.rig.time_s

    @property
    def peers(self) -> list[str]:
        """Names of the peers in order, without repetition."""
        return list(dict.fromkeys(sweep.peer.name for sweep in self.sweeps))


@dataclass(frozen=True)
class WorkPrecisionStudy:
    """Results by case, samples per second by model, a campaign, and the conditions."""

    cases: dict[str, CaseResult]
    rates: dict[str, float]
    quick: bool
    cores: int
    took_s: float
    campaign: CampaignRate


# -- stored references: small JSON files, with the inputs for which they are valid

FOLDER = Path(__file__).parent

#: Largest relative difference of equal laws that are built on different machines. A changed cam
#: file causes a larger difference.
LAW_RTOL = 1e-12


def write_reference(case: Case, solution: Solution) -> Path:
    """Store a reference with the inputs for which it is valid."""
    data = {
        "case": case.name,
        "numbers": _numbers(case),
        "events": [list(event) for event in solution.events],
        "displacement": solution.displacement.tolist(),
        "velocity": solution.velocity.tolist(),
    }
    path = FOLDER / f"{case.name}.json"
    path.write_text(json.dumps(data) + "\n", encoding="utf-8")
    return path


def read_reference(case: Case) -> Solution:
    """Return the reference at the output times of the case, with its events.

    Raises ------
    CamRigError : no reference is stored, or it is for other inputs
    """
    path = FOLDER / f"{case.name}.json"
    remedy = "run python -m benchmark.make_reference"
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise CamRigError(f"{path}: no such file; {remedy}") from None
    stored, wanted = np.array(data["numbers"]), np.array(_numbers(case))
    if stored.shape != wanted.shape or not np.allclose(stored, wanted, rtol=LAW_RTOL, atol=1e-18):
        raise CamRigError(f"{path}: made for other numbers than case {case.name!r} has; {remedy}")
    count = case.times.size
    events = tuple((str(k), float(t)) for k, t in data["events"] if t <= case.duration)
    return Solution(
        np.array(data["displacement"])[:, :count], np.array(data["velocity"])[:, :count], events
    )


def _numbers(case: Case) -> list[float]:
    """Return all inputs of the solution, except the number of turns."""
    return [
        case.speed,
        *case.law.breaks.tolist(),
        *case.law.ordinates.ravel().tolist(),
        *vars(case.model).values(),
        float(case.times[0]),
    ]


# -- solution of each case by cam_rig, through the public functions of the models

#: Stiffness (N/m) without an influence on the result.
ANY_STIFFNESS = 3.3e8


def solve(case: Case) -> Solution:
    """Solve the case with cam_rig."""
    return ADAPTERS[type(case.model)](case)


def outputs_at(
    model: LinearResponse, start: FloatArray, angle: float, times: FloatArray, out: Outputs
) -> FloatArray:
    """Return outputs ``(k, m)`` at ascending times (s) after a state.

    The state is that at cam angle ``angle`` (rad). State and law use the same piece, even if a time
    is beyond a joint because of rounding.
    """
    free, local, part_of = model.passes(start, angle, times)
    rows = np.asarray(out.state @ free)
    for i in np.unique(part_of):
        inside, part = part_of == i, model.parts[i]
        ordinates = polynomial_part(model, part, out)
        rows[:, inside] += bernstein.evaluate(ordinates.T, local[inside] / part.length).T
    return rows


def stem_motion(
    law: Law,
    follower: FollowerParameters,
    speed: float,
    angle: float,
    start: FloatArray,
    times: FloatArray,
) -> FloatArray:
    """Return the outputs of `elastic_stem.outputs` at ascending times (s).

    The motion starts from (r, ṙ) at ``angle`` (rad).
    """
    model = elastic_stem.response(law, follower, speed)
    return outputs_at(model, start, angle, times, elastic_stem.outputs(follower))


def _oscillator(case: Case) -> Solution:
    p = case.model
    assert isinstance(p, Oscillator)
    follower = FollowerParameters(p.mass, p.spring_stiffness, p.damping, 0.0, p.stem_stiffness)
    rows = stem_motion(case.law, follower, case.speed, 0.0, np.zeros(2), case.times)
    return Solution(rows[:1], rows[1:2])


def two_mass_trajectory(case: Case) -> Separation:
    """Return all phases and events of two masses."""
    p = case.model
    assert isinstance(p, TwoMasses)
    parameters = TwoMassParameters(
        roller_mass=p.roller_mass,
        end_mass=p.stem_mass,
        stem_stiffness=p.stem_stiffness,
        spring_stiffness=p.spring_stiffness,
        stem_damping=p.stem_damping,
        damping=p.spring_damping,
        preload=p.preload,
    )
    trajectory = Separation(case.law, parameters, case.speed)
    trajectory.run(case.duration)
    return trajectory


def _two_masses(case: Case) -> Solution:
    trajectory = two_mass_trajectory(case)
    rows = states(trajectory, case.times)
    events = tuple((event.kind, event.time) for event in trajectory.events)
    return Solution(rows[0:3:2], rows[1:4:2], events)


def one_mass_trajectory(case: Case) -> OneMassTrajectory:
    """Return all phases and events of one mass."""
    p = case.model
    assert isinstance(p, OneMass)
    follower = FollowerParameters(
        p.mass, p.stiffness, p.damping, p.preload, ANY_STIFFNESS, p.restitution
    )
    trajectory = OneMassTrajectory(
        case.law, follower, Interval(0, math.ceil(case.duration * NS), 0.0, case.speed)
    )
    trajectory.run(None)
    return trajectory


def _one_mass(case: Case) -> Solution:
    trajectory = one_mass_trajectory(case)
    angle = case.speed * case.times
    motion = np.stack([case.law(angle), case.speed * case.law(angle, 1)])
    is_flying, starts, since = trajectory.flights_at(case.times)
    motion[:, is_flying] = trajectory.system.motion(starts, since)[:2]
    events = tuple((e.kind, e.time) for e in trajectory.events if e.time <= case.duration)
    return Solution(motion[:1], motion[1:], events)


def _twist(case: Case) -> Solution:
    p = case.model
    assert isinstance(p, Twist)
    follower = FollowerParameters(p.mass, p.stiffness, p.damping, p.preload, ANY_STIFFNESS)
    parameters = parameters_module.TorsionalParameters(follower, p.inertia, p.shaft_stiffness)
    start = parameters_module.TorsionalState(0.0, 0.0, 0.0, case.speed)
    motion = torsion.solve(case.law, parameters, start, 0.0, case.duration)
    rows = motion.at(case.times)
    return Solution(rows[:1], rows[1:2])


ADAPTERS: dict[type, Callable[[Case], Solution]] = {
    Oscillator: _oscillator,
    TwoMasses: _two_masses,
    OneMass: _one_mass,
    Twist: _twist,
}

#: Cases in the order of computation. The fastest are first, to leave time for the others.
ORDER = (
    *("resonance", "torsional", "two_mass_soft", "one_mass_arc", "ball_on_table"),
    *("two_mass_stem", "elastic_stem"),
)

#: Smallest predicted ratio of the times of two consecutive settings.
MIN_GROWTH = 1.3
#: Largest predicted ratio of the times of two consecutive settings.
MAX_GROWTH = 4.0

#: Largest number of runs of a peer's setting.
PEER_REPEATS = 3
#: Share of the time of a sweep that the repeated runs of a setting can use.
REPEAT_SHARE = 0.15

#: Multiple of the remaining time after which a run ends with an error.
OVERRUN = 4.0


@dataclass(frozen=True)
class Effort:
    """Duration, repetitions and tolerances of a comparison.

    ``seconds`` is the time for all peers.
    """

    seconds: float
    rig_repeats: int
    rtols: tuple[float, ...]


QUICK = Effort(32.0, 7, (1e-9, 1e-12, 1e-13))

#: Tolerances of a slow peer in a quick comparison.
QUICK_AND_SLOW = (1e-4, 1e-6)

FULL = Effort(235.0, 25, (1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 3e-14))


def run(
    quick: bool, advance: Callable[[str], None], names: tuple[str, ...] = ORDER, cores: int = 1
) -> WorkPrecisionStudy:
    """Run the comparison. ``advance`` is called for each sweep and the campaign."""
    start_time = time.perf_counter()
    effort = QUICK if quick else FULL
    deadline = start_time + effort.seconds
    left = len(names) * sum(peer.weight for peer in PEERS)
    results: dict[str, CaseResult] = {}
    for name in names:
        case = CASES[name]()
        case = case.first_turns(case.quick_turns) if quick else case
        reference = read_reference(case)
        results[name] = _rig(case, reference, effort.rig_repeats)
        for peer in PEERS:
            advance(f"{name}: {peer.title}")
            share = peer.weight * max(0.0, deadline - time.perf_counter()) / left
            left -= peer.weight
            rtols = QUICK_AND_SLOW if quick and peer.slow else effort.rtols
            results[name].sweeps.append(sweep(case, peer, reference, rtols, share))
    advance("campaign")
    campaign = campaign_rate(cores, quick)
    ordered = {name: results[name] for name in CASES if name in results}
    took = time.perf_counter() - start_time
    return WorkPrecisionStudy(ordered, rates(), quick, cores, took, campaign)


def _rig(case: Case, reference: Solution, repeats: int) -> CaseResult:
    """Return the result of cam_rig. Each run starts with a law without cached results."""
    result = CaseResult(case)
    times: list[float] = []
    try:
        solve(case)  # imports, and tables that are independent of the law
        for _ in range(repeats):
            fresh = case.fresh()
            start_time = time.perf_counter()
            solution = solve(fresh)
            times.append(time.perf_counter() - start_time)
    except CamRigError as error:
        result.missing = str(error)
        return result
    result.rig = _point(solution, reference, times)
    return result


def sweep(
    case: Case, peer: Peer, reference: Solution, rtols: tuple[float, ...], share: float
) -> Sweep:
    """Run a peer from loose to tight tolerances within ``share`` seconds."""
    out = Sweep(peer)
    missing = peer.missing(case)
    if missing is not None:
        out.notes.append(missing)
        return out
    end = time.perf_counter() + share
    for rtol in rtols:
        spare = end - time.perf_counter()
        predicted = _predicted(out.points)
        if predicted > spare:
            reason = f"predicted {predicted:.1f} s" if out.points else "no time left"
            out.notes.append(f"rtol {rtol:.0e} and tighter left out: {reason}")
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
    """Return the median of up to `PEER_REPEATS` runs.

    Further runs than the first are only within ``limit`` seconds. A run that needs much longer than
    the expected ``spare`` seconds ends with an error.
    """
    times: list[float] = []
    while not times or (len(times) < PEER_REPEATS and sum(times) + times[-1] < limit):
        start_time = time.perf_counter()
        solution = peer.solve(case, rtol, OVERRUN * spare)
        times.append(time.perf_counter() - start_time)
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

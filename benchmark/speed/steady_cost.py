"""Cost of a sweep point: steady turns of TM21's follower, compared with CVODE.

cam_rig computes all results of a point of a campaign: level, forces, torque, lift-offs, landings.
The peer (CVODE) only integrates the flights up to their landings, and computes all samples with one
call of cam_rig, as in contact. It computes neither a transient nor a level.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from importlib.util import find_spec

from benchmark.speed.cases import rad_per_s
from benchmark.speed.event_cost import force_backend, median_of
from benchmark.speed.models import Case, OneMass, Solution, output_times
from benchmark.speed.peers import PEERS
from cam_rig.dynamics import Interval
from cam_rig.dynamics.events.backend import COMPILED, PLAIN
from cam_rig.dynamics.events.trajectory import MIN_BOUNCE_RATIO
from cam_rig.dynamics.kinetostatic import contact_samples
from cam_rig.quantities.steady import scene_at, steady_row
from cam_rig.show.tables import DataTable, Header, tabulate
from cam_rig.simulation.scene import LoadedScene, load_scene
from cam_rig.units import NS, TURN

SCENE = "tm21_sweep"
CAM = "tm21"
#: Speeds (rpm) below and above the jump speed. Only above it there are flights.
SPEEDS_RPM = (300.0, 391.37, 450.0)
#: Number of timed runs, of which the median counts.
REPEATS = 21
#: Relative tolerance of the peer.
RTOL = 1e-8

PEER = next(peer for peer in PEERS if peer.title == "CVODE Adams")


@dataclass(frozen=True)
class SteadyCost:
    """Time (s) of a point at a speed, its samples and landings, and the peer's time.

    The time of a peer that is not installed is None.
    """

    rpm: float
    samples: int
    landings: int
    time_s: float
    peer_s: float | None


def steady_costs(
    speeds_rpm: Iterable[float] = SPEEDS_RPM, repeats: int = REPEATS
) -> list[SteadyCost]:
    """Return the costs for each speed, for all turns of the scene's schedule."""
    loaded = load_scene(SCENE)
    loaded = loaded.with_one_cam(CAM, loaded.laws[CAM])
    with force_backend(COMPILED if find_spec("numba") else PLAIN):
        return [_cost(loaded, rpm, repeats) for rpm in speeds_rpm]


def _cost(loaded: LoadedScene, rpm: float, repeats: int) -> SteadyCost:
    law, speed = loaded.laws[CAM], rad_per_s(rpm)

    def point() -> float:
        row, _ = steady_row(law, loaded.rig, scene_at(loaded.scene, speed), speed)
        return row.lift_offs

    landings = round(point() * loaded.scene.schedule.turns.si)
    case, rate = _case(loaded, speed), int(loaded.scene.sample_rate.si)
    peer = None
    if landings and PEER.missing() is None:
        peer = median_of(lambda: _by_peer(case, loaded, rate), max(1, repeats // 7))
    samples = Interval(0, round(case.duration * NS), 0.0, speed).grid(rate).count
    return SteadyCost(rpm, samples, landings, median_of(point, repeats), peer)


def _case(loaded: LoadedScene, speed: float) -> Case:
    """Return the case with the same follower, for the peer."""
    law, p, turns = loaded.laws[CAM], loaded.follower, int(loaded.scene.schedule.turns.si)
    numbers = (p.mass, p.damping, p.spring_stiffness, p.preload, p.restitution or 0.0)
    model = OneMass(*numbers, MIN_BOUNCE_RATIO * law.lift)
    return Case(CAM, CAM, law, model, speed, turns, turns, output_times(speed, turns, 1))


def _by_peer(case: Case, loaded: LoadedScene, rate: int) -> Solution:
    """Integrate the flights with the peer, and compute the samples of all turns."""
    whole = Interval(0, round(case.turns * TURN / case.speed * NS), 0.0, case.speed)
    contact_samples(case.law, loaded.follower, whole, rate)
    return PEER.solve(case, RTOL)


def steady_table(costs: list[SteadyCost]) -> DataTable:
    """Return a table with a row per speed."""
    return tabulate(
        "Settled turns",
        costs,
        (
            (Header("speed", "rpm", "g"), lambda cost: cost.rpm),
            (Header("samples", "", "d"), lambda cost: cost.samples),
            (Header("landings", "", "d"), lambda cost: cost.landings),
            (Header("a point", "ms", ".2f"), lambda cost: 1e3 * cost.time_s),
            (Header("CVODE Adams", "ms", ".0f"), lambda cost: _ms(cost.peer_s)),
            (Header("x rig", "", ".0f"), lambda cost: cost.peer_s and cost.peer_s / cost.time_s),
        ),
    )


def _ms(time_s: float | None) -> float | None:
    return None if time_s is None else 1e3 * time_s

"""Points per second of a campaign, compared with joblib and SUNDIALS CVODE.

Both compute the jump speed of two masses, 1.7 s from rest. Spring, preload and mass of the rigs
vary by 10 %, and the number of processes is equal. The peer (CVODE) integrates the equations of
motion (Adams, rtol 1e-8) up to the first root of the contact force, and bisects a bracket down to
0.05 rpm. The bracket, 1 % wide, is given to the peer: the force is not monotone in speed, and a
scan for its first zero would need many times as long.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmark.speed.cases import rad_per_s
from benchmark.speed.peers import MAX_STEPS, ROOT_FOUND, cvode_class
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.two_masses import REST_DURATION_S
from cam_rig.errors import CamRigError
from cam_rig.extras import friendly_import_errors
from cam_rig.laws import Law
from cam_rig.schema.load import Library, config_root
from cam_rig.show.result import Column, Records
from cam_rig.show.tables import pluralize
from cam_rig.studies.campaign.campaign import campaign_from, make_point, measure_batch
from cam_rig.units import FloatArray

SPREAD = {"uniform": 10, "unit": "%"}

FOLLOWER = ("spring_stiffness", "preload", "mass")

#: Campaign without its number of points.
STUDY: dict[str, Any] = {
    "name": "bench",
    "title": "Jump speed",
    "base": {"cam": "poly345", "rig": "paper_table2"},
    "vary": {f"rig.follower.{name}": SPREAD for name in FOLLOWER},
    "measures": ["jump_speed"],
}

#: Half width of the bracket of the peer, relative to the speed.
BRACKET_FRACTION = 0.005
#: Width of the bracket (rpm) at which the bisection stops.
SPEED_ATOL_RPM = 0.05

#: Number of points per batch.
BATCH = 250
#: Number of batches per process in a quick and in a full comparison.
BATCHES = (2, 8)
#: Number of points of the peer per process in a quick and in a full comparison.
PEER_POINTS = (2, 10)


CAMPAIGN = (
    Column("solver", of="0"),
    Column("points", "1", "d", of="1"),
    Column("points_per_s", "1/s", ".3g", heading="points each second", of="2"),
    Column("ratio", "", ".3g", heading="times as long", of="3"),
)


@dataclass(frozen=True)
class CampaignRate:
    """Points per second of campaign and peer, and the difference of their jump speeds.

    Parameters ----------
    points, peer_points : numbers of timed points
    gap : median difference of the jump speeds, rpm
    beyond : number of differences larger than the tolerance of the peer
    missing : reason for a missing peer, else empty
    """

    processes: int
    points: int
    points_per_s: float
    peer_points: int = 0
    peer_per_s: float | None = None
    gap: float | None = None
    beyond: int = 0
    missing: str = ""

    @property
    def ratio(self) -> float | None:
        """Ratio of the points per second, campaign to peer."""
        return None if self.peer_per_s is None else self.points_per_s / self.peer_per_s


def campaign_rate(processes: int, quick: bool) -> CampaignRate:
    """Time campaign and peer in sequence.

    Without joblib only the campaign is timed, in this process.
    """
    points = BATCH * BATCHES[not quick] * processes
    plan = {"kind": "latin_hypercube", "points": points}
    campaign = campaign_from({**STUDY, "plan": plan}, Library((config_root(),)))
    measure_batch(campaign, 0, 1)  # imports
    try:
        with friendly_import_errors():
            from joblib import Parallel, delayed
        cvode_class()
    except CamRigError as error:
        rows = measure_batch(campaign, 0, BATCH)
        return CampaignRate(1, BATCH, BATCH / rows.seconds, missing=str(error))
    with Parallel(processes) as parallel:
        parallel(delayed(measure_batch)(campaign, 0, 1) for _ in range(processes))  # their imports
        start_time = time.perf_counter()
        batches = parallel(
            delayed(measure_batch)(campaign, i, i + BATCH) for i in range(0, points, BATCH)
        )
        ours = points / (time.perf_counter() - start_time)
        jump_speeds = np.concatenate([batch.measures[:, 0] for batch in batches])
        count = min(points, PEER_POINTS[not quick] * processes)
        inputs = np.concatenate([batch.inputs for batch in batches])[:count]
        masses = [TwoMassParameters.from_rig(make_point(campaign, row).rig) for row in inputs]
        start_time = time.perf_counter()
        theirs = parallel(
            delayed(bisect_jump)(p, campaign.law, rpm)
            for p, rpm in zip(masses, jump_speeds[:count].tolist(), strict=True)
        )
        peer = count / (time.perf_counter() - start_time)
    gaps = np.abs(jump_speeds[:count] - np.array(theirs))
    beyond = int((gaps > SPEED_ATOL_RPM).sum())
    return CampaignRate(processes, points, ours, count, peer, float(np.median(gaps)), beyond)


def bisect_jump(p: TwoMassParameters, law: Law, near: float) -> float:
    """Return the jump speed of the peer close to ``near``, both in rpm."""
    low, high = near * (1.0 - BRACKET_FRACTION), near * (1.0 + BRACKET_FRACTION)
    while high - low > SPEED_ATOL_RPM:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if leaves(p, law, rad_per_s(middle)) else (middle, high)
    return 0.5 * (low + high)


def leaves(p: TwoMassParameters, law: Law, speed: float) -> bool:
    """Return True if the contact force of the peer reaches zero in a run from rest.

    ``speed`` is in rad/s.
    """

    def in_stem(time: float, state: FloatArray) -> tuple[float, float]:
        s, slope, bend = law.at(speed * time)
        force = p.stem_damping * (slope * speed - state[1]) + p.stem_stiffness * (s - state[0])
        return force, bend * speed**2

    def right_side(time: float, state: FloatArray, out: FloatArray) -> None:
        force, _ = in_stem(time, state)
        out[0] = state[1]
        closing = p.spring_stiffness * state[0] + p.damping * state[1] + p.preload
        out[1] = (force - closing) / p.end_mass

    def contact(time: float, state: FloatArray, out: FloatArray) -> None:
        force, acceleration = in_stem(time, state)
        out[0] = force + p.roller_mass * acceleration

    contact.terminal, contact.direction = [True], [-1]  # type: ignore[attr-defined]
    cam = law.motion_at(np.zeros(1)) * np.array([[1.0], [speed], [speed**2]])
    start = p.static_position(cam)[:, 0]  # from rest: without vibration
    options = {"method": "Adams", "rtol": 1e-8, "atol": 1e-12, "max_num_steps": MAX_STEPS}
    solver = cvode_class()(right_side, eventsfn=contact, num_events=1, **options)
    done = solver.solve(np.array([0.0, 0.5 * REST_DURATION_S, REST_DURATION_S]), start)
    return bool(done.status == ROOT_FOUND)


def campaign_records(rate: CampaignRate) -> Records:
    """Return the rows of campaign and peer, or a note on the missing peer."""
    peer_name = "joblib and CVODE"
    rows = [("campaign", rate.points, rate.points_per_s, 1.0)]
    if rate.peer_per_s is not None and rate.ratio is not None:
        rows.append((peer_name, rate.peer_points, rate.peer_per_s, rate.ratio))
    note = f"{peer_name}: {rate.missing}"
    if rate.gap is not None:
        note = (
            f"Half of the jump speeds differ by less than {rate.gap:.2g} rpm. {rate.beyond} of "
            f"{rate.peer_points} differ by more than the peer's tolerance of {SPEED_ATOL_RPM:g} "
            "rpm. If contact is kept again at a slightly higher speed, bisection misses the jump "
            "speed."
        )
    caption = f"A campaign of jump speeds in {pluralize(rate.processes, 'process')}"
    return Records("campaign", caption, CAMPAIGN, rows, (note,))

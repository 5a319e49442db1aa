"""Points a second of a campaign, beside the same study with joblib and scipy's solve_ivp.

    .venv/bin/python benchmark/campaign.py [POINTS_OF_SOLVE_IVP]

Both find the jump speed of two masses, 1.7 s from rest, of rigs whose spring, preload and mass
vary by 10 %. The peer integrates the equations of motion (DOP853, rtol 1e-8), looks at the least
contact force, and halves a bracket down to 0.05 rpm. It is given that bracket, 1 % wide: the force
is not monotone in speed, and a scan for its first zero would take many times as long.
"""

import sys
import time

import numpy as np
from joblib import Parallel, delayed
from scipy.integrate import solve_ivp

import cam_rig
from cam_rig.dynamics import TwoMassParameters
from cam_rig.schema.load import Library, config_root
from cam_rig.studies.campaign.campaign import campaign_from
from cam_rig.studies.campaign.point import make_point, measure_batch
from cam_rig.units import RPM

SPREAD = {"uniform": 10, "unit": "%"}
FOLLOWER = ("spring_stiffness", "preload", "mass")
STUDY = {
    "name": "bench",
    "title": "Jump speed",
    "base": {"cam": "poly345", "rig": "paper_table2"},
    "vary": {f"rig.follower.{name}": SPREAD for name in FOLLOWER},
    "plan": {"kind": "latin_hypercube", "points": 200},
    "measures": ["jump_speed"],
}
RUN_S, BRACKET, FINE = 1.7, 0.005, 0.05


def least_force(p, law, speed):
    """The least contact force (N) of a run from rest, at 40 000 instants."""

    def rate(time, state):
        s, slope, _ = law.at(speed * time)
        y, v = state
        force = p.stem_damping * (slope * speed - v) + p.stem_stiffness * (s - y)
        return [v, (force - p.spring_stiffness * y - p.damping * v - p.preload) / p.end_mass]

    times = np.linspace(0.0, RUN_S, 40_001)
    start = [-p.preload / p.stiffness, 0.0]
    y, v = solve_ivp(rate, (0.0, RUN_S), start, "DOP853", times, rtol=1e-8, atol=1e-12).y
    s, slope, bend = law.motion_at(speed * times)
    force = p.stem_damping * (slope * speed - v) + p.stem_stiffness * (s - y)
    return float((force + p.roller_mass * bend * speed**2).min())


def bisected(p, law, near):
    """The jump speed near one, rpm."""
    low, high = near * (1.0 - BRACKET), near * (1.0 + BRACKET)
    while high - low > FINE:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if least_force(p, law, middle * RPM) < 0.0 else (middle, high)
    return 0.5 * (low + high)


def main(count):
    campaign = campaign_from(STUDY, Library((config_root(),)))
    law = cam_rig.build_law(campaign.cam)
    measure_batch(campaign, 0, 1)  # imports
    start = time.perf_counter()
    rows = Parallel(2)(delayed(measure_batch)(campaign, i, i + 25) for i in range(0, 200, 25))
    ours = 200 / (time.perf_counter() - start)
    found = np.concatenate([batch.measures[:, 0] for batch in rows])
    points = [make_point(campaign, row) for row in rows[0].inputs[:count]]
    masses = [TwoMassParameters.from_rig(point.rig) for point in points]
    start = time.perf_counter()
    near = zip(masses, found[:count], strict=True)
    theirs = Parallel(2)(delayed(bisected)(p, law, rpm) for p, rpm in near)
    peer = count / (time.perf_counter() - start)
    gap = np.abs(found[:count] - theirs).max()
    print(f"campaign {ours:.3g} points/s; joblib and solve_ivp {peer:.3g} points/s")
    print(f"ratio {ours / peer:.3g}; jump speeds differ by {gap:.3g} rpm at most")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 4)

"""Motions of TM21's follower at 50 speeds by Siconos: test/bounce/siconos.csv.

Run it from the root of the repository: .venv/bin/python -m benchmark.siconos_bounce [PYTHON] PYTHON
is an interpreter with Siconos, by default /usr/bin/python3: apt-get install python3-siconos. The
speeds are whole rpm at which the bounce map of cam_rig gives one type of motion, the same as 1 and
2 rpm below and above, without a bifurcation within 2 rpm. The results of Siconos do not influence
the choice.
"""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np

import cam_rig
from cam_rig.studies.bounce.motion import IN_CONTACT, IRREGULAR, PERIODIC, UNDETERMINED
from cam_rig.studies.bounce.result import BounceMap, BounceRow
from cam_rig.units import TURN, FloatArray

TABLE = Path("test/bounce/siconos.csv")
#: Restitution. At this value the speeds include irregular motions.
RESTITUTION = 0.7
#: Lowest speed (rpm).
FIRST_RPM = 300
#: Highest speed (rpm).
LAST_RPM = 600
#: Number of neighbouring speeds on each side, 1 rpm apart, that must have the same motion.
NEIGHBOURS = 2
#: Number of compared speeds.
MAX_SPEEDS = 50
#: Steps per turn. In a step the follower moves by at most 6 µm. With 8000 steps, two of the
#: irregular motions become periodic because of the steps.
STEPS_PER_TURN = 32_000
#: Number of turns.
TURNS = 130
#: Number of last turns that are classified.
LAST_TURNS = 30
#: Largest difference (m) of the gaps at cam angle 0 of equal turns. A landing is late by up to a
#: step, and in the next turn it can be a step earlier.
GAP_ATOL_M = 2.5e-5
#: Smallest distance (m) between the gaps of a compared motion.
MIN_GAP_DIFFERENCE_M = 1e-4


def main() -> None:
    """Choose the speeds, integrate with Siconos, classify the motions, and write them."""
    law, rig = cam_rig.build_law(cam_rig.load_cam("tm21")), cam_rig.load_rig("tm21")
    whole, follower = np.arange(FIRST_RPM, LAST_RPM + 1.0), rig.follower
    find = partial(cam_rig.bounce_map, law, rig, restitution=RESTITUTION)
    own = find(rpm=whole, turns=LAST_TURNS, transient_turns=TURNS - LAST_TURNS, continuation=True)
    theta = np.linspace(0.0, TURN, STEPS_PER_TURN + 1)
    setup = {
        "rpm": chosen(own),
        "turns": TURNS,
        "lift": law(theta).tolist(),
        "slope": law(theta, 1).tolist(),
        "mass": follower.mass.si,
        "damping": follower.damping.si,
        "stiffness": follower.spring_stiffness.si,
        "preload": follower.preload.si,
        "restitution": RESTITUTION,
    }
    program = [*(sys.argv[1:] or ["/usr/bin/python3"]), "benchmark/siconos_stepping.py"]
    stepped = subprocess.run(
        program, input=json.dumps(setup), stdout=subprocess.PIPE, text=True, check=True
    )
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("rpm", "motion", "period", "least_gap_mm", "greatest_gap_mm"))
        for line in stepped.stdout.splitlines():
            rpm, states = json.loads(line)
            last = np.array(states)[-LAST_TURNS:]
            gaps = 1e3 * last[:, 0]
            table.writerow((f"{rpm:g}", *classed(last), f"{gaps.min():z.3f}", f"{gaps.max():z.3f}"))


def chosen(own: BounceMap) -> list[float]:
    """Return the speeds to be compared, without those near a change of the motion.

    These are all speeds with irregular motions or periods of several turns, and evenly spaced
    others.
    """
    rows, away = own.rows, []
    changes = np.array([bifurcation.point.rpm for bifurcation in own.bifurcations])
    for i in range(NEIGHBOURS, len(rows) - NEIGHBOURS):
        kinds = {(row.motion, row.period) for row in rows[i - NEIGHBOURS : i + NEIGHBOURS + 1]}
        is_steady = (rows[i].settled or 0) <= TURNS // 2
        is_classified = len(kinds) == 1 and rows[i].motion != UNDETERMINED and is_steady
        if is_classified and distinct(rows[i]) and np.abs(changes - rows[i].rpm).min() > NEIGHBOURS:
            away.append(rows[i])
    rare = [row for row in away if row.motion == IRREGULAR or (row.period or 1) > 1]
    others = [row for row in away if row not in rare]
    evenly = np.linspace(0, len(others) - 1, MAX_SPEEDS - len(rare)).round().astype(int)
    return sorted(row.rpm for row in [*rare, *(others[i] for i in evenly)])


def distinct(row: BounceRow) -> bool:
    """Return True if the gaps of the turns of a period differ by more than rounding.

    They must differ by more than `MIN_GAP_DIFFERENCE_M`, as must the range of irregular gaps.
    """
    gaps = row.states[:, 0]
    if row.motion == IRREGULAR:
        return float(np.ptp(gaps)) > MIN_GAP_DIFFERENCE_M
    return all(abs(a - b) > MIN_GAP_DIFFERENCE_M for a, b in combinations(gaps.tolist(), 2))


def classed(last: FloatArray) -> tuple[str, int | str]:
    """Return motion and period of last turns ``(n, 3)``: gap, its rate, largest gap."""
    if not last[:, 2].any():
        return IN_CONTACT, ""
    gaps, half = last[:, 0], LAST_TURNS // 2
    for period in range(1, LAST_TURNS // 4 + 1):
        if np.abs(gaps[-half:] - gaps[-half - period : -period]).max() <= GAP_ATOL_M:
            return PERIODIC, period
    return IRREGULAR, ""


if __name__ == "__main__":
    main()

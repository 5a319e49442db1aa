"""Motions of TM21's follower at 50 speeds by Siconos: test/bounce/siconos.csv.

Run it from the project's root: .venv/bin/python -m benchmark.siconos_bounce [PYTHON]
PYTHON is an interpreter with Siconos, by default /usr/bin/python3: apt-get install python3-siconos.
The speeds are whole rpm at which the rig's map gives one motion, the same as 1 and 2 rpm on
either side, without a bifurcation that this map finds within 2 rpm. The results of Siconos do
not influence the choice.
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
RESTITUTION, FROM, TO, WIDE, SPEEDS = 0.7, 300, 600, 2, 50
#: Steps per turn. In one the follower moves by at most 6 µm. With 8000 steps two of the irregular
#: motions fall into cycles of the steps. Number of turns, and of those at the end that are
#: classified.
STEPS, TURNS, KEPT = 32_000, 130, 30
#: A landing is late by up to a step, and the next turn may have it a step earlier. So two turns are
#: equal here if their gaps at cam angle 0 (m) differ by no more than ALIKE. Motions whose gaps all
#: lie within DISTINCT are not compared.
ALIKE, DISTINCT = 2.5e-5, 1e-4


def main() -> None:
    """Choose the speeds, integrate, classify and write the file."""
    law, rig = cam_rig.build_law(cam_rig.load_cam("tm21")), cam_rig.load_rig("tm21")
    whole, follower = np.arange(FROM, TO + 1.0), rig.follower
    find = partial(cam_rig.bounce_map, law, rig, restitution=RESTITUTION)
    own = find(rpm=whole, turns=KEPT, transient_turns=TURNS - KEPT, continuation=True)
    theta = np.linspace(0.0, TURN, STEPS + 1)
    given = {
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
        program, input=json.dumps(given), stdout=subprocess.PIPE, text=True, check=True
    )
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("rpm", "motion", "period", "least_gap_mm", "greatest_gap_mm"))
        for line in stepped.stdout.splitlines():
            rpm, states = json.loads(line)
            kept = np.array(states)[-KEPT:]
            gaps = 1e3 * kept[:, 0]
            table.writerow((f"{rpm:g}", *classed(kept), f"{gaps.min():z.3f}", f"{gaps.max():z.3f}"))


def chosen(own: BounceMap) -> list[float]:
    """Return the speeds to be compared, away from changes of the motion.

    These are all speeds with irregular motions or periods of several turns, and evenly spaced
    others.
    """
    rows, away = own.rows, []
    changes = np.array([one.point.rpm for one in own.bifurcations])
    for i in range(WIDE, len(rows) - WIDE):
        kinds = {(row.motion, row.period) for row in rows[i - WIDE : i + WIDE + 1]}
        settled = (rows[i].settled or 0) <= TURNS // 2
        known = len(kinds) == 1 and rows[i].motion != UNDETERMINED and settled
        if known and distinct(rows[i]) and np.abs(changes - rows[i].rpm).min() > WIDE:
            away.append(rows[i])
    rare = [row for row in away if row.motion == IRREGULAR or (row.period or 1) > 1]
    rest = [row for row in away if row not in rare]
    evenly = np.linspace(0, len(rest) - 1, SPEEDS - len(rare)).round().astype(int)
    return sorted(row.rpm for row in [*rare, *(rest[i] for i in evenly)])


def distinct(row: BounceRow) -> bool:
    """Return True if the gaps of a period's turns can be told apart by rounding.

    Irregular turns must differ by more than `DISTINCT`.
    """
    gaps = row.states[:, 0]
    if row.motion == IRREGULAR:
        return float(np.ptp(gaps)) > DISTINCT
    return all(abs(a - b) > DISTINCT for a, b in combinations(gaps.tolist(), 2))


def classed(kept: FloatArray) -> tuple[str, int | str]:
    """Return motion and period of the last turns ``(n, 3)``: gap, rate, largest gap."""
    if not kept[:, 2].any():
        return IN_CONTACT, ""
    gaps, half = kept[:, 0], KEPT // 2
    for period in range(1, KEPT // 4 + 1):
        if np.abs(gaps[-half:] - gaps[-half - period : -period]).max() <= ALIKE:
            return PERIODIC, period
    return IRREGULAR, ""


if __name__ == "__main__":
    main()

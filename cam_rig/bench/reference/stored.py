"""The stored references: small JSON files, and the law they were made for."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from cam_rig.bench.cases.case import Case, Solution
from cam_rig.errors import CamRigError

FOLDER = Path(__file__).parent
#: Laws built on another machine may differ by rounding; a changed cam file differs by more.
SAME = 1e-12


def write(case: Case, solution: Solution) -> Path:
    """Store a reference with the numbers it belongs to."""
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


def read(case: Case) -> Solution:
    """The reference at the case's output times and with its events.

    Raises
    ------
    CamRigError : no reference is stored, or it belongs to other numbers
    """
    path = FOLDER / f"{case.name}.json"
    remedy = "run benchmark/make_reference.py"
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise CamRigError(f"{path}: no such file; {remedy}") from None
    stored, wanted = np.array(data["numbers"]), np.array(_numbers(case))
    if stored.shape != wanted.shape or not np.allclose(stored, wanted, rtol=SAME, atol=1e-18):
        raise CamRigError(f"{path}: made for other numbers than case {case.name!r} has; {remedy}")
    count = case.times.size
    events = tuple((str(k), float(t)) for k, t in data["events"] if t <= case.duration)
    return Solution(
        np.array(data["displacement"])[:, :count], np.array(data["velocity"])[:, :count], events
    )


def _numbers(case: Case) -> list[float]:
    """Everything the solution depends on but the number of turns."""
    return [
        case.speed,
        *case.law.breaks.tolist(),
        *case.law.ordinates.ravel().tolist(),
        *vars(case.model).values(),
        float(case.times[0]),
    ]

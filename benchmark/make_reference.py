"""Compute the references of the comparison with 50 digits: benchmark/speed/*.json.

Run it from the root of the repository: .venv/bin/python -m benchmark.make_reference [case ...]
"""

from __future__ import annotations

import sys
import time

from benchmark.speed import exact, study
from benchmark.speed.cases import CASES
from benchmark.speed.models import Twist


def main() -> None:
    """Solve the cases and store their references."""
    for name in sys.argv[1:] or CASES:
        case = CASES[name]()
        start_time = time.perf_counter()
        solve = exact.solve_twist if isinstance(case.model, Twist) else exact.solve
        solution = solve(case)
        path = study.write_reference(case, solution)
        took = time.perf_counter() - start_time
        print(f"{path}: {case.times.size} times, {len(solution.events)} events, {took:.0f} s")


if __name__ == "__main__":
    main()

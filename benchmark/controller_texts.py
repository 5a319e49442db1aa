"""Time and errors of the texts that `cam-rig electronic` writes for motion controllers.

    OMP_NUM_THREADS=1 .venv/bin/python -m benchmark.controller_texts

Each shipped cam is written for each target that can pass it. The program runs for a minute.
"""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass

import cam_rig
from cam_rig.schema.load import config_root
from cam_rig.show.tables import Header, tabulate, to_markdown
from cam_rig.studies.electronic.building import Target
from cam_rig.studies.electronic.difference import ErrorBounds

#: Longest time (s) that a text should take.
LIMIT_S = 1.0
#: Number of timed runs, of which the median counts.
REPEATS = 3
#: Cam whose velocity jumps. Targets without straight lines cannot pass it.
CORNERS = "worked_example_constant_velocity"


@dataclass(frozen=True)
class TextCost:
    """Time and errors of the text of a cam."""

    target: str
    cam: str
    median_s: float
    bounds: ErrorBounds


def measure(cam: str, target: Target) -> TextCost:
    """Return the median time and the errors of the text of a cam."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        result = cam_rig.electronic(cam, target.value)
        times.append(time.perf_counter() - start)
    return TextCost(target.value, cam, statistics.median(times), result.rows[-1].bounds)


def slowest(target: Target) -> TextCost:
    """Return the cost of the cam that takes the longest."""
    cams = [path.stem for path in (config_root() / "cams").glob("*.yaml")]
    able = [cam for cam in cams if cam != CORNERS or target.has_lines]
    return max((measure(cam, target) for cam in able), key=lambda cost: cost.median_s)


def main() -> None:
    """Print the slowest cam of each target, with its time and its errors."""
    table = tabulate(
        "Slowest shipped cam of each target",
        [slowest(target) for target in Target],
        (
            (Header("target"), lambda cost: cost.target),
            (Header("cam"), lambda cost: cost.cam),
            (Header("time", "ms", ".0f"), lambda cost: 1e3 * cost.median_s),
            (Header("time / limit", "", ".2f"), lambda cost: cost.median_s / LIMIT_S),
            (Header("error of s", "nm", ".3g"), lambda cost: 1e9 * cost.bounds.lift),
            (Header("error of s″", "µm/rad²", ".3g"), lambda cost: 1e6 * cost.bounds.acceleration),
        ),
    )
    print(to_markdown(table))


if __name__ == "__main__":
    main()

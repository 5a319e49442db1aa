"""Computing time of a run against number of samples, and against stiffness.

It writes docs/cost.png. Run it from the root of the repository: .venv/bin/python -m
benchmark.linear_cost
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy: one thread, so that cost is work
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import platform
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmark.speed.cases import law_of
from cam_rig.dynamics import MODELS, FollowerParameters, Interval
from cam_rig.laws import Law
from cam_rig.show.figure import empty, logarithmic, series_marker, styled, write
from cam_rig.show.looks import in_words
from cam_rig.show.tables import typeset_number
from cam_rig.units import NS

MODELS_SHOWN = ("kinetostatic", "residual")
#: Cam speed (rpm).
RPM = 300.0
#: Samples per second.
SAMPLE_RATE = 48_000
#: Number of timed runs, of which the median counts.
REPEATS = 3
SPEED = RPM * np.pi / 30.0
SAMPLES = (10_000, 30_000, 100_000, 300_000, 1_000_000, 3_000_000, 10_000_000)
#: Stem stiffnesses (N/m).
STEMS = tuple(10.0**power for power in range(4, 11))
#: Stem stiffness (N/m) for different numbers of samples: that of the rig TM21.
USUAL_STEM = 3.3e8
#: Number of samples for different stem stiffnesses.
USUAL_SAMPLES = 1_000_000
#: Number of samples per block.
BLOCK = 240_000


def stream(law: Law, model: str, stem: float, samples: int) -> None:
    """Compute a run in blocks of samples, which are not stored."""
    parameters = FollowerParameters(1.3, 4030.0, 8.642, 12.753, stem)
    state, step = None, NS // SAMPLE_RATE
    for first in range(0, samples, BLOCK):
        last = min(first + BLOCK, samples)
        begin, end = first * NS // SAMPLE_RATE, last * NS // SAMPLE_RATE
        interval = Interval(begin, max(end, begin + step), SPEED * begin / NS, SPEED)
        state, _ = MODELS[model].advance(law, parameters, state, interval, SAMPLE_RATE)


def seconds(work: Callable[[], None]) -> float:
    """Return the median wall time (s), after a run that fills the caches."""
    work()
    times = []
    for _ in range(REPEATS):
        start_time = time.perf_counter()
        work()
        times.append(time.perf_counter() - start_time)
    return statistics.median(times)


def measure() -> tuple[dict[str, list[float]], dict[str, list[float]]]:
    """Return the wall times (s) by model, for each of `SAMPLES` and each of `STEMS`."""
    law = law_of("poly345")
    by_samples: dict[str, list[float]] = {}
    by_stem: dict[str, list[float]] = {}
    for model in MODELS_SHOWN:
        by_samples[model] = [
            seconds(lambda m=model, n=n: stream(law, m, USUAL_STEM, n))  # type: ignore[misc]
            for n in SAMPLES
        ]
        by_stem[model] = [
            seconds(lambda m=model, k=k: stream(law, m, k, USUAL_SAMPLES))  # type: ignore[misc]
            for k in STEMS
        ]
    return by_samples, by_stem


def table(by_samples: dict[str, list[float]], by_stem: dict[str, list[float]]) -> str:
    """Return both measurements as Markdown, with millions of samples per second."""
    lines = ["| samples | " + " | ".join(f"{m} | M/s" for m in MODELS_SHOWN) + " |"]
    lines.append("|---:" * (1 + 2 * len(MODELS_SHOWN)) + "|")
    for i, count in enumerate(SAMPLES):
        lines.append(_line(f"{count:.0e}", [by_samples[m][i] for m in MODELS_SHOWN], count))
    lines += ["", "| stem N/m | " + " | ".join(f"{m} | M/s" for m in MODELS_SHOWN) + " |"]
    lines.append("|---:" * (1 + 2 * len(MODELS_SHOWN)) + "|")
    for i, stem in enumerate(STEMS):
        lines.append(_line(f"{stem:.0e}", [by_stem[m][i] for m in MODELS_SHOWN], USUAL_SAMPLES))
    return "\n".join(lines)


def _line(head: str, times: list[float], count: int) -> str:
    cells = [f"{took * 1e3:.1f} ms | {count / took / 1e6:.1f}" for took in times]
    return f"| {head} | " + " | ".join(cells) + " |"


@styled
def draw(by_samples: dict[str, list[float]], by_stem: dict[str, list[float]], path: Path) -> None:
    """Draw both measurements with logarithmic axes, and a line of slope 1."""
    figure = empty(3.2)
    left, right = figure.subplots(1, 2)
    for i, model in enumerate(MODELS_SHOWN):
        look = {**series_marker(i), "label": in_words(model)}
        left.loglog(SAMPLES, by_samples[model], **look)
        right.loglog(STEMS, by_stem[model], **look)
    guide = np.array([SAMPLES[0], SAMPLES[-1]])
    least = by_samples["kinetostatic"][-1] / SAMPLES[-1]
    left.loglog(guide, 0.4 * least * guide, "--", color="0.5", label="slope 1")
    left.set(
        xlabel="samples",
        ylabel="wall time [s]",
        title=f"{RPM:g} rpm, stem {typeset_number(USUAL_STEM, '.2g')} N/m",
    )
    right.set(
        xlabel="stem stiffness [N/m]",
        ylabel="wall time [s]",
        title=f"{RPM:g} rpm, {typeset_number(USUAL_SAMPLES, '.0e')} samples",
    )
    low = min(min(times) for times in by_stem.values())
    high = max(max(times) for times in by_stem.values())
    right.set_ylim(low / 5.0, high * 5.0)
    for axes in (left, right):
        logarithmic(axes.xaxis, axes.yaxis)
        axes.legend()
    figure.suptitle(f"Cost of a run at {SAMPLE_RATE // 1000} kHz, one thread")
    write(figure, path)


def main() -> None:
    """Measure, print the table and write the figure."""
    by_samples, by_stem = measure()
    print(f"{platform.machine()}, one of {os.cpu_count()} cores, median of {REPEATS}\n")
    print(table(by_samples, by_stem))
    for model in MODELS_SHOWN:
        slope = np.polyfit(np.log(SAMPLES[2:]), np.log(by_samples[model][2:]), 1)[0]
        spread = max(by_stem[model]) / min(by_stem[model])
        print(f"\n{model}: time ~ samples^{slope:.2f}; stiffest to softest within {spread:.2f}")
    draw(by_samples, by_stem, Path("docs/cost.png"))


if __name__ == "__main__":
    main()

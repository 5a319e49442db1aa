"""How many samples the rig makes in a second, beside a copy of the same bytes.

A block has the six rows of /follower/samples. To copy one is as fast as this machine's memory
takes it: samples cannot be made faster, as they are to be written too.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np

from cam_rig.bench.cases.cases import DAMPING, MASS, SPRING, STEM, WEIGHT, law_of, rad_per_s
from cam_rig.dynamics import MODELS, FollowerParameters, Interval
from cam_rig.dynamics.samples import COLUMNS
from cam_rig.tables import Column, DataTable, tabulate
from cam_rig.units import NS

CAM, SAMPLE_RATE = "bezier15", 48_000
SAMPLED = ("kinetostatic", "elastic_stem")
#: At the first a turn is 7200 samples, at the second no whole number of them.
SPEEDS_RPM = (400.0, 391.37)
#: Samples in a block: 6 MB, which a large cache still holds, and 25 MB.
BLOCKS = (1 << 17, 1 << 19)
#: Blocks that are timed, each beside a copy.
REPEATS = 25


@dataclass(frozen=True)
class SampleRate:
    """Samples of six numbers a second of a model at a speed, and of copies, one after each block.

    ``ratio`` is how many times as long as the copy beside it a block takes.
    """

    model: str
    rpm: float
    block: int
    samples_per_s: float
    copied_per_s: float
    ratio: float


def rates() -> dict[str, float]:
    """Samples per second by model, at the first speed, in the shorter blocks."""
    found = sample_rates(SPEEDS_RPM[:1], BLOCKS[:1])
    return {rate.model: rate.samples_per_s for rate in found}


def sample_rates(
    speeds_rpm: Iterable[float] = SPEEDS_RPM, blocks: Iterable[int] = BLOCKS
) -> list[SampleRate]:
    """Each model, speed and block: medians, every run in turn with a copy."""
    law = law_of(CAM)
    follower = FollowerParameters(MASS, SPRING, DAMPING, WEIGHT, STEM)
    speeds, found = tuple(speeds_rpm), []
    for block in blocks:
        source = np.ones((len(COLUMNS), block))
        for rpm in speeds:
            interval = Interval(0, round(block * NS / SAMPLE_RATE), 0.0, rad_per_s(rpm))
            for name in SAMPLED:
                run = partial(MODELS[name].advance, law, follower, None, interval, SAMPLE_RATE)
                pairs = _seconds(run, source.copy)
                made, copied = (statistics.median(times) for times in zip(*pairs, strict=True))
                ratio = statistics.median(one / other for one, other in pairs)
                found.append(SampleRate(name, rpm, block, block / made, block / copied, ratio))
    return found


def rate_table(rates: Iterable[SampleRate]) -> DataTable:
    """A row for each rate."""
    return tabulate(
        "Samples",
        rates,
        (
            (Column("model"), lambda rate: rate.model),
            (Column("speed", "rpm", "g"), lambda rate: rate.rpm),
            (Column("block", "MB", ".0f"), lambda rate: 8e-6 * len(COLUMNS) * rate.block),
            (Column("samples", "10⁶/s", ".0f"), lambda rate: 1e-6 * rate.samples_per_s),
            (Column("a copy", "10⁶/s", ".0f"), lambda rate: 1e-6 * rate.copied_per_s),
            (Column("time over a copy's", "", ".1f"), lambda rate: rate.ratio),
        ),
    )


def _seconds(*works: Callable[[], object]) -> list[tuple[float, ...]]:
    """Wall times of each round, all in turn, after one that fills the caches."""
    times = []
    for _ in range(REPEATS + 1):
        took = []
        for work in works:
            begun = time.perf_counter()
            work()
            took.append(time.perf_counter() - begun)
        times.append(tuple(took))
    return times[1:]

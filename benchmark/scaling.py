"""CPU time and memory against the size of a problem: pieces, events, turns, samples, rigs, cores.

It is a part of docs/develop/cost.md, with a figure. Print it from the root of the repository:
OMP_NUM_THREADS=1 .venv/bin/python -m benchmark.scaling
"""

from __future__ import annotations

import os
import statistics
import time
import tracemalloc
from collections.abc import Callable
from concurrent.futures import wait
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmark.long_laws import through
from benchmark.speed.campaign import STUDY
from benchmark.speed.cases import CASES, law_of
from benchmark.speed.models import OneMass
from benchmark.speed.study import one_mass_trajectory
from cam_rig.dynamics import MODELS, FollowerParameters, Interval, TwoMassParameters
from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.laws import Law
from cam_rig.schema import load_rig
from cam_rig.schema.load import Library, config_root
from cam_rig.show.figure import empty, logarithmic, series_marker, styled, write
from cam_rig.show.tables import DataTable, Header, tabulate, to_markdown, typeset_number
from cam_rig.studies.campaign.campaign import batch_task, campaign_from
from cam_rig.units import NS, RPM, TURN
from cam_rig.workers import workers

#: Figure of docs/develop/cost.md.
PLOT = Path("docs/develop/scaling.png")
#: Numbers of pieces of the law.
PIECES = (5, 30, 100, 300, 1000, 3000, 10_000)
#: Numbers of turns of a run. It is computed in intervals of `TURNS_PER_BLOCK` turns.
TURNS = (10, 100, 1000, 10_000)
TURNS_PER_BLOCK = 10
#: Restitutions of a landing. A larger restitution causes more bounces per turn.
RESTITUTIONS = (0.0, 0.3, 0.6, 0.8, 0.9, 0.95)
#: Numbers of samples of a run. It is computed in intervals of `SAMPLES_PER_BLOCK` samples.
SAMPLES = (100_000, 1_000_000, 10_000_000)
SAMPLES_PER_BLOCK = 100_000
SAMPLE_RATE = 48_000
#: Numbers of rigs of a campaign.
RIGS = (10, 100, 1000)
#: Number of rigs of the campaign that is divided among processes, and their number per batch.
SHARED_RIGS, BATCH = 2000, 100
#: Number of timed runs, of which the median counts.
REPEATS = 3
#: Smallest size for the fit of an exponent, relative to the largest. Below it constant costs
#: dominate.
FIT_RANGE = 1.0 / 300.0

SECTION = """\
## Scaling

Time against the size of a problem. An exponent of 1 means proportional cost. It is fitted to the
sizes within a factor of 300 of the largest one. Memory is the largest amount allocated during the
run, at the smallest and at the largest size.

![time against size, six panels](scaling.png)

{table}

- Pieces of the law: one jump speed of two masses, 1.7 s from rest, on splines through readings.
- Events per turn: 100 turns of one mass on `tm21` at 400 rpm, with restitutions from 0 to 0.95.
- Turns: two masses on `poly345` at 450 rpm, in intervals of {turns} turns, with 1000 samples per s.
- Samples: elastic stem on `poly345` at 300 rpm and 48 kHz, in intervals of {samples} samples.
- Rigs: jump speeds of a campaign. Processes: {shared} of these rigs, wall time.\
"""


@dataclass(frozen=True)
class Scaling:
    """Times (s) for ascending sizes of a problem, and its memory (bytes) at both ends."""

    name: str
    sizes: tuple[float, ...]
    times: tuple[float, ...]
    memory: tuple[int, int] | None
    clock: str = "CPU"

    @property
    def exponent(self) -> float:
        """Exponent of the power of the size to which the time is proportional."""
        sizes, times = np.array(self.sizes), np.array(self.times)
        large = sizes >= FIT_RANGE * sizes.max()
        return float(np.polyfit(np.log(sizes[large]), np.log(times[large]), 1)[0])


def measure() -> list[Scaling]:
    """Return all measurements, in the order of the panels."""
    return [by_pieces(), by_events(), by_turns(), by_samples(), by_rigs(), by_processes()]


def _scaling(name: str, tasks: dict[float, Callable[[], Any]]) -> Scaling:
    """Measure tasks by their sizes, and the memory of the smallest and of the largest."""
    sizes = tuple(sorted(tasks))
    times = tuple(_cpu_time(tasks[size]) for size in sizes)
    low, high = (_memory(tasks[size]) for size in (sizes[0], sizes[-1]))
    return Scaling(name, sizes, times, (low, high))


def _cpu_time(task: Callable[[], Any]) -> float:
    task()  # imports, and tables that do not depend on the size
    times = []
    for _ in range(REPEATS):
        start = time.process_time()
        task()
        times.append(time.process_time() - start)
    return statistics.median(times)


def _memory(task: Callable[[], Any]) -> int:
    tracemalloc.start()
    task()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return peak


def by_pieces() -> Scaling:
    """Measure a jump speed for numbers of pieces of the law, including the law's tables."""
    two = TwoMassParameters.from_rig(load_rig(config_root() / "rigs/paper_table2.yaml"))
    laws = [through(law_of("bezier15"), count) for count in PIECES]

    def search(law: Law) -> None:
        find_jump(Law(law.name, law.breaks, law.ordinates), two, 1.7)

    return _scaling("pieces of the law", {law.spans.size: _bind(search, law) for law in laws})


def by_events() -> Scaling:
    """Measure a run of one mass for numbers of lift-offs and landings per turn."""
    case = CASES["one_mass_arc"]().lasting(100)
    assert isinstance(case.model, OneMass)
    tasks: dict[float, Callable[[], Any]] = {}
    for restitution in RESTITUTIONS:
        changed = replace(case, model=replace(case.model, restitution=restitution))
        events = len(one_mass_trajectory(changed).events) / changed.turns
        tasks[events] = _bind(one_mass_trajectory, changed)
    return _scaling("events per turn", tasks)


def by_turns(counts: tuple[int, ...] = TURNS) -> Scaling:
    """Measure a run of two masses with lift-offs for numbers of turns."""
    rig = load_rig(config_root() / "rigs/paper_table2.yaml")
    law, speed = law_of("poly345"), 450.0 * RPM
    block = round(TURNS_PER_BLOCK * TURN / speed * NS)

    def run(turns: int) -> None:
        _advance("two_mass", law, TwoMassParameters.from_rig(rig), speed, turns, block, 1000)

    return _scaling("turns", {turns: _bind(run, turns // TURNS_PER_BLOCK) for turns in counts})


def by_samples() -> Scaling:
    """Measure a run on an elastic stem for numbers of samples."""
    parameters = FollowerParameters(1.3, 4030.0, 8.642, 12.753, 3.3e8)
    law, speed, block = law_of("poly345"), 300.0 * RPM, SAMPLES_PER_BLOCK * NS // SAMPLE_RATE

    def run(blocks: int) -> None:
        _advance("elastic_stem", law, parameters, speed, blocks, block, SAMPLE_RATE)

    return _scaling("samples", {n: _bind(run, n // SAMPLES_PER_BLOCK) for n in SAMPLES})


def _advance(
    model: str, law: Law, parameters: Any, speed: float, blocks: int, block: int, sample_rate: int
) -> None:
    """Compute a run in ``blocks`` intervals of ``block`` ns, whose samples are not stored."""
    state = None
    for i in range(blocks):
        angle = speed * (i * block / NS)
        interval = Interval(
            i * block, (i + 1) * block, angle % TURN, speed, turns=int(angle / TURN)
        )
        state, _ = MODELS[model].advance(law, parameters, state, interval, sample_rate)


def by_rigs() -> Scaling:
    """Measure a campaign in one process for numbers of rigs."""
    campaign = _campaign(RIGS[-1])
    return _scaling("rigs", {count: batch_task(campaign, 0, count) for count in RIGS})


def by_processes() -> Scaling:
    """Measure the wall time of a campaign for numbers of processes, without their start."""
    campaign, counts = _campaign(SHARED_RIGS), range(1, (os.cpu_count() or 1) + 1)
    times = []
    for count in counts:
        with workers(count) as pool:
            wait([pool.submit(batch_task(campaign, 0, BATCH)) for _ in range(2 * count)])
            start = time.perf_counter()
            batches = range(0, SHARED_RIGS, BATCH)
            wait([pool.submit(batch_task(campaign, i, i + BATCH)) for i in batches])
            times.append(time.perf_counter() - start)
    return Scaling("processes", tuple(map(float, counts)), tuple(times), None, "wall")


def _campaign(points: int) -> Any:
    plan = {"kind": "latin_hypercube", "points": points, "seed": 1}
    return campaign_from({**STUDY, "plan": plan}, Library((config_root(),)))


def _bind(function: Callable[[Any], Any], argument: Any) -> Callable[[], Any]:
    return lambda: function(argument)


def scaling_table(scalings: list[Scaling]) -> DataTable:
    """Return a table with a row per problem."""

    def memory(scaling: Scaling, index: int) -> float | None:
        return None if scaling.memory is None else scaling.memory[index] / 1e6

    return tabulate(
        "Scaling",
        scalings,
        (
            (Header("size"), lambda row: row.name),
            (Header("from", "", "g"), lambda row: row.sizes[0]),
            (Header("to", "", "g"), lambda row: row.sizes[-1]),
            (Header("time, smallest", "ms", ".3g"), lambda row: 1e3 * row.times[0]),
            (Header("time, largest", "ms", ".3g"), lambda row: 1e3 * row.times[-1]),
            (Header("exponent", "", ".2f"), lambda row: row.exponent),
            (Header("memory, smallest", "MB", ".3g"), lambda row: memory(row, 0)),
            (Header("memory, largest", "MB", ".3g"), lambda row: memory(row, 1)),
        ),
    )


@styled
def draw(scalings: list[Scaling], path: Path) -> None:
    """Draw time over size with logarithmic axes, one panel per problem."""
    figure = empty(4.6)
    for panel, scaling in zip(figure.subplots(2, 3).flat, scalings, strict=True):
        panel.loglog(scaling.sizes, scaling.times, linestyle="none", **series_marker(0))
        guide = np.array([FIT_RANGE * scaling.sizes[-1], scaling.sizes[-1]])
        guide[0] = max(guide[0], scaling.sizes[0])
        line = scaling.times[-1] * (guide / guide[-1]) ** scaling.exponent
        panel.loglog(guide, line, "--", color="0.5", label=f"exponent {scaling.exponent:.2f}")
        panel.set(xlabel=scaling.name, ylabel=f"{scaling.clock} time [s]")
        logarithmic(panel.yaxis)
        ticks = scaling.sizes[:: max(1, len(scaling.sizes) // 3)]
        panel.set_xticks(ticks, [typeset_number(size, ".3g") for size in ticks])
        panel.set_xticks([], minor=True)
        panel.legend()
    write(figure, path)


def section(scalings: list[Scaling]) -> str:
    """Return the section of docs/develop/cost.md."""
    return SECTION.format(
        table=to_markdown(scaling_table(scalings)),
        turns=TURNS_PER_BLOCK,
        samples=SAMPLES_PER_BLOCK,
        shared=SHARED_RIGS,
    )


if __name__ == "__main__":
    measured = measure()
    draw(measured, PLOT)
    print(section(measured))

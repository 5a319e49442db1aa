"""Speed and error of the sweep by sample rate: first section of docs/accuracy.md.

Run it from the root of the repository: .venv/bin/python -m benchmark.sample_rate
"""

from __future__ import annotations

import os
import statistics
import time
from dataclasses import replace
from pathlib import Path

from cam_rig.acoustics import level_db, steady_power
from cam_rig.schema import SceneConfig
from cam_rig.simulation.scene import LoadedScene, open_scene
from cam_rig.simulation.simulate import simulate, step_levels

REFERENCE_HZ = 384_000
RATES_HZ = (1_000, 2_000, 4_000, 8_000, 12_000, 24_000, 48_000, 96_000)
REPEATS = 3
#: Number of values per sample.
COLUMNS = 6
#: Bytes per value.
BYTES = 8

HEAD = """\
# Accuracy and speed

This page gives the error of each number of the rig, and the computing time of each number.

## Effect of the sample rate

The follower's motion is exact at any sample rate, because laws, flights and landings are closed
forms. Only the microphone uses samples. It interpolates the contact force linearly between them.
A force that jumps is not linear between samples. For cams with jumps, the level therefore depends
slightly on the sample rate.

The table gives the largest difference between a level and the level at {reference} kHz, over 21
speeds. The time is that of the whole sweep ({rig_time:.0f} s of rig time) with `cam-rig simulate`
on one of {cores} cores, median of {repeats}. The bag size is that of the recording by
`cam-rig run`.

| sample rate | TM21 cam | 3-4-5 | Bézier 15 | time | x real time | bag |
|---:|---:|---:|---:|---:|---:|---:|
"""
#: Last line of the measured section.
LAST_LINE = "Made by `benchmark/sample_rate.py`.\n"
TAIL = """
The shipped sweep runs at 12 kHz. `tm21_sweep_48khz` is the same sweep at 48 kHz.

The exact steady response is computed without samples and without settling, from one linear system
per speed. For the two cams that keep contact, its levels and the levels at {reference} kHz differ
by at most {exact:.1e} dB.

"""


def at_rate(loaded: LoadedScene, rate: int) -> LoadedScene:
    """Return the scene with another sample rate."""
    data = loaded.scene.model_dump(exclude_none=True)
    data["sample_rate"] = {"assumed": rate, "unit": "Hz"}
    return replace(loaded, scene=SceneConfig.model_validate(data))


def measure(loaded: LoadedScene) -> tuple[dict[str, dict[float, float]], float, float]:
    """Return the levels of all speeds, the wall time (s), and the rig time (s)."""
    start_time = time.perf_counter()
    ticks = list(simulate(loaded))
    took = time.perf_counter() - start_time
    settle = loaded.scene.schedule.transient_turns.si
    return step_levels(ticks, settle), took, ticks[-1].stop_ns * 1e-9


def difference(first: dict[float, float], second: dict[float, float]) -> float:
    """Return the largest difference (dB) of two sets of levels."""
    return max(abs(first[speed] - second[speed]) for speed in first)


def exact_levels(loaded: LoadedScene, cam: str, speeds: list[float]) -> dict[float, float]:
    """Return the levels of a cam in contact, computed without samples."""
    power = {
        s: steady_power(loaded.laws[cam], loaded.follower, loaded.radiation, s) for s in speeds
    }
    return {speed: float(level_db(value**0.5)) for speed, value in power.items()}


def main() -> None:
    """Measure all sample rates and write the section."""
    loaded = open_scene(Path("config/scenes/tm21_sweep.yaml"))
    reference, _, rig_time = measure(at_rate(loaded, REFERENCE_HZ))
    lines = []
    for rate in RATES_HZ:
        runs = [measure(at_rate(loaded, rate)) for _ in range(REPEATS)]
        took = statistics.median(run[1] for run in runs)
        errors = [difference(runs[0][0][cam], reference[cam]) for cam in loaded.scene.cams]
        size = rig_time * rate * COLUMNS * BYTES / 1e6
        cells = [f"{rate / 1000:g} kHz", *(f"{error:.5f} dB" for error in errors)]
        cells += [f"{took:.2f} s", f"{rig_time / took:.0f}", f"{size:.0f} MB"]
        lines.append("| " + " | ".join(cells) + " |")
        print(lines[-1])
    exact = max(
        difference(reference[cam], exact_levels(loaded, cam, list(reference[cam])))
        for cam in ("poly345", "bezier15")
    )
    facts = {"reference": REFERENCE_HZ // 1000, "cores": os.cpu_count(), "repeats": REPEATS}
    head = HEAD.format(rig_time=rig_time, **facts)
    tail = TAIL.format(exact=exact, **facts) + LAST_LINE
    page = Path("docs/accuracy.md")
    _, mark, remainder = page.read_text(encoding="utf-8").partition(LAST_LINE)
    assert mark, f"{page}: has no line {LAST_LINE!r}"
    page.write_text(head + "\n".join(lines) + "\n" + tail + remainder, encoding="utf-8")


if __name__ == "__main__":
    main()

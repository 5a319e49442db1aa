"""A long run streams in blocks: memory is that of a block, whatever the length."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LIMIT_MB = 300.0
#: Streams a run in blocks of one second and prints the peak of memory (MB) half-way and at the end.
STREAM = """
import math, sys
from pathlib import Path
from cam_rig.dynamics import MODELS, Interval
from cam_rig.laws import build_law
from cam_rig.schema import load_cam, load_rig
from cam_rig.units import NS

name, seconds = sys.argv[1], int(sys.argv[2])
law = build_law(load_cam(Path("config/cams/poly345.yaml")))
rig = load_rig(Path("config/rigs/paper_table2.yaml"))
model, speed, state = MODELS[name], 400.0 * math.pi / 30.0, None
parameters = model.parameters(rig)
for second in range(seconds):
    interval = Interval(second * NS, (second + 1) * NS, speed * second, speed)
    state, block = model.advance(law, parameters, state, interval, 48_000)
    assert block.rows.shape == (6, 48_000)
    if second in (seconds // 2, seconds - 1):
        # not ru_maxrss, which begins with what the parent had
        status = Path("/proc/self/status").read_text(encoding="ascii")
        print(float(status.split("VmHWM:")[1].split()[0]) / 1024.0)
"""


def peaks(name, seconds):
    """Peak memory in MB half-way and at the end, in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", STREAM, name, str(seconds)],
        cwd=ROOT,
        env={
            **os.environ,
            "OMP_NUM_THREADS": "1",
        },  # as the models are meant to run: small products
        capture_output=True,
        text=True,
        check=True,
        timeout=100,
    )
    half, end = (float(line) for line in done.stdout.split())
    return half, end


@pytest.mark.long
def test_an_hour_at_48_khz():
    """172.8 million samples of six doubles are 8.3 GB; at no time are more than a block's there."""
    half, end = peaks("kinetostatic", 3600)
    assert end < LIMIT_MB
    assert end - half < 5.0


@pytest.mark.parametrize(
    ("name", "seconds"),
    [
        ("kinetostatic", 60),
        ("one_mass", 20),
        ("torsional", 8),
        pytest.param("elastic_stem", 300, marks=pytest.mark.long),
        pytest.param("one_mass", 60, marks=pytest.mark.long),
        pytest.param("two_mass", 60, marks=pytest.mark.long),
        pytest.param("torsional", 20, marks=pytest.mark.long),
    ],
)
def test_memory_does_not_grow(name, seconds):
    """What a model keeps (parts of a turn, chunks) it has after the first turns."""
    half, end = peaks(name, seconds)
    assert end < LIMIT_MB
    assert end - half < 5.0

"""Runs of a hundred thousand turns keep their phase and use constant memory."""

import os
import subprocess
import sys
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest

from cam_rig.dynamics import MODELS, FollowerParameters, Interval
from cam_rig.dynamics.elastic_stem import response
from cam_rig.dynamics.linear.response import LinearResponse
from cam_rig.laws import Law
from cam_rig.units import NS, TURN

from .helpers import exact_law

TURNS = 100_000
RPM = 600.0
SPEED = RPM * np.pi / 30.0
TURN_NS = 60 * NS // 600
EPS = float(np.finfo(float).eps)


@pytest.mark.parametrize("turns", [20_000, pytest.param(TURNS, marks=pytest.mark.long)])
def test_one_call_over_all_turns(laws, follower, turns):
    """Samples of one call over many turns are exact to the rounding of the cam angle."""
    # The angle of 1e5 turns, 6.3e5 rad, is rounded to eps times itself. Multiplied by the slope of
    # the law this is an error of the lift.
    law, rate = laws["poly345"], 7
    interval = Interval(0, turns * TURN_NS, 0.0, SPEED)
    rows = MODELS["kinetostatic"].advance(law, follower, None, interval, rate)[1].rows
    some = np.arange(rows.shape[1] - 1, 0, -997)
    slope = float(np.abs(law.motion[1]).max())
    limit = 4.0 * EPS * turns * TURN * slope
    with mp.workdps(40):
        exact = [float(exact_law(law, mp.mpf(SPEED) * int(k) / rate)[0]) for k in some]
    error = np.abs(rows[1, some] - exact)
    assert error.max() < limit
    assert rows[1, some].max() > 0.04


def test_free_vibration_keeps_its_phase(laws):
    """The free vibration of an undamped stem keeps its phase over 3.2e8 rad.

    It is r₀ cos Ωt with the start value r₀ and the natural frequency Ω.
    """
    # The phase of one turn (1593 rad) is rounded to eps times itself, and the errors of all turns
    # add up.
    flat = Law("flat", laws["poly345"].breaks, 0.0 * laws["poly345"].ordinates)
    follower = FollowerParameters(1.3, 4030.0, 0.0, 0.0, 3.3e8)
    duration = TURNS * TURN / SPEED
    r, v = response(flat, follower, SPEED).end(np.array([1e-4, 0.0]), 0.0, duration)
    with mp.workdps(40):
        rate = mp.sqrt((mp.mpf(4030.0) + mp.mpf(3.3e8)) / mp.mpf(1.3))
        phase = rate * mp.mpf(duration)
        cosine, sine = float(mp.cos(phase)), float(mp.sin(phase))
        limit = 4.0 * EPS * float(phase)
    assert limit < 3e-7
    assert r / 1e-4 == pytest.approx(cosine, abs=limit)
    assert v / (1e-4 * float(rate)) == pytest.approx(-sine, abs=limit)


def test_forced_resonance_grows_for_all_turns(laws):
    """At resonance the vibration after N turns is N times that after one turn."""
    # If the natural frequency is off its harmonic by eps, the phase error after N turns is 9·2π N
    # eps.
    matrix = np.array([[0.0, 1.0], [-((9.0 * SPEED) ** 2), 0.0]])
    drive = np.array([[0.0, 0.0, 0.0], [(9.0 * SPEED) ** 2, 0.0, 0.0]])
    model = LinearResponse(laws["poly345"], SPEED, matrix, drive, np.zeros(2))
    first = model.end(np.zeros(2), 0.0, TURN / SPEED)
    last = model.end(np.zeros(2), 0.0, TURNS * TURN / SPEED)
    size = np.array([1.0, 9.0 * SPEED]) * np.hypot(first[0], first[1] / (9.0 * SPEED))
    assert size[0] > 1e-5
    assert np.abs((last / TURNS - first) / size).max() < 18.0 * np.pi * TURNS * EPS


# -- a long run is computed in blocks, and needs the memory of one block

ROOT = Path(__file__).parents[2]
LIMIT_MB = 300.0
#: Program that computes runs in blocks of one second. It prints the peak memory (MB) after the
#: first half of each run and at its end.
STREAM = """
import sys
import cam_rig
from cam_rig.dynamics import MODELS, Interval
from cam_rig.units import NS, RPM

law, rig = cam_rig.build_law(cam_rig.load_cam("poly345")), cam_rig.load_rig("paper_table2")
speed = 400.0 * RPM
for name, seconds in zip(sys.argv[1::2], map(int, sys.argv[2::2])):
    model, state = MODELS[name], None
    parameters = model.parameters(rig)
    for second in range(seconds):
        interval = Interval(second * NS, (second + 1) * NS, speed * second, speed)
        state, block = model.advance(law, parameters, state, interval, 48_000)
        assert block.rows.shape == (6, 48_000)
        if second in (seconds // 2, seconds - 1):
            # not ru_maxrss, which includes the memory of the parent
            status = open("/proc/self/status", encoding="ascii").read()
            print(float(status.split("VmHWM:")[1].split()[0]) / 1024.0)
"""
RUNS = ("kinetostatic", 60, "one_mass", 20, "torsional", 8)
LONG = ("elastic_stem", 300, "one_mass", 60, "two_mass", 60, "torsional", 20, "kinetostatic", 3600)


@pytest.mark.parametrize("runs", [RUNS, pytest.param(LONG, marks=pytest.mark.long)])
def test_memory_does_not_grow(runs):
    """The memory of a process grows by less than 5 MB in the second half of a run."""
    # The samples of one hour (172.8 million of six floats) would need 8.3 GB.
    done = subprocess.run(
        [sys.executable, "-c", STREAM, *map(str, runs)],
        cwd=ROOT,
        env={**os.environ, "OMP_NUM_THREADS": "1"},  # as in the nodes, because products are small
        capture_output=True,
        text=True,
        check=True,
        timeout=900,
    )
    peaks = np.array([float(line) for line in done.stdout.split()]).reshape(-1, 2)
    assert len(peaks) == len(runs) // 2
    assert peaks.max() < LIMIT_MB
    assert (peaks[:, 1] - peaks[:, 0]).max() < 5.0

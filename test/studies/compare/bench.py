"""Simulated test bench: readings of a follower with known instrument errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from cam_rig.acoustics import level_db
from cam_rig.simulation.instruments import MeasuredRun, Signal
from cam_rig.simulation.simulate import simulate, simulate_ticks
from cam_rig.studies.compare.comparison import compare_steps
from cam_rig.studies.compare.pairs import pair_measured
from cam_rig.units import TURN

#: Number of counts of the bench's encoder per turn.
COUNTS = 1024
#: Number of readings per second of each instrument of the bench.
RATE = 1000.0
#: Cam angle minus encoder angle of the bench, in °.
OFFSET_DEG = 3.0


def with_follower(loaded, **factors):
    """Return a loaded scene with some follower parameters multiplied by factors."""
    follower = loaded.rig.follower
    changed = {name: getattr(follower, name).si * factor for name, factor in factors.items()}
    return replace(loaded, rig=loaded.rig.with_follower(**changed))


def measured(
    loaded,
    seed=1,
    slow=0.0,
    late=0.0,
    force_noise=0.01,
    lift_noise=10e-6,
    counts=COUNTS,
    backlash=0.0,
    sense=None,
):
    """Return the `MeasuredRun` that a bench would record of a scene with one cam.

    The clock of lift, force and level sensors is slow by the fraction `slow`, and their stamps are
    `late` by this time (s). `force_noise` is a fraction of the largest force, and `lift_noise` is
    in m. `counts` is the number of encoder counts per turn, or 0 for an ideal encoder. `backlash`
    is the full width of the hysteresis of the lift in m. `sense(time, force)` returns the reading
    of the load cell.
    """
    rng = np.random.default_rng(seed)
    ticks = list(simulate_ticks(loaded))
    time, angle, lift, force, velocity = (
        np.hstack([getattr(tick, name) for tick in ticks])
        for name in ("time", "angle", "lift", "force", "velocity")
    )
    at = np.arange(time[0], time[-1], 1.0 / RATE)
    encoder = np.interp(at, time, angle) - np.radians(OFFSET_DEG)
    if counts:
        encoder = np.floor(encoder * counts / TURN) * TURN / counts
    seen = np.interp(at, time, force if sense is None else sense(time, force))
    seen += force_noise * force.max() * rng.normal(size=at.size)
    height = np.interp(at, time, lift - 0.5 * backlash * np.sign(velocity))
    height += lift_noise * rng.normal(size=at.size)
    heard = [(tick.stop_ns * 1e-9, float(level_db(tick.pressure))) for tick in simulate(loaded)]
    ends, level = np.array(heard).T
    stamps = at / (1.0 + slow) + late
    return MeasuredRun(
        Path("bench"),
        loaded.scene.cams[0],
        Signal(at, encoder, "/encoder.position[0]"),
        Signal(stamps, height, "/lvdt.data"),
        Signal(stamps, seen, "/cell.wrench.force.z"),
        Signal(ends / (1.0 + slow) + late, level, "/mic.data"),
    )


def compared(run, loaded, offset=None):
    """Compare a measured run with the scene's model at each speed.

    Return the paired measured and model signals, and one result row per speed. `offset` is the cam
    angle minus the encoder angle in rad, or None to find it.
    """
    pairs = pair_measured(run, loaded, loaded.scene.cams[0], offset)
    return pairs, compare_steps(pairs.steps(), loaded.laws)

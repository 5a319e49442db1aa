"""Random simulated machines, to count how many fitted intervals contain the truth.

A machine is a cam and a rig with random parameters. Its force and lift are simulated with noise.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

import cam_rig
from benchmark.simulated_instruments import InstrumentErrors, measured_run
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.studies.fit_rig.estimate import NORMAL_95
from cam_rig.studies.fit_rig.jumps.search import RIGID
from cam_rig.studies.fit_rig.run.fit import fit_run
from cam_rig.units import to_rpm

#: Names of the machines' cams: with and without dwells, smooth or with jumps of acceleration.
CAMS = ("poly345", "cycloidal", "bezier15", "poly4567", "arcs_convex", "tm21", "arcs_straight")
#: Speeds relative to the jump speed of a rigid follower. Near it the contact force is small in
#: parts of the turn.
SPEEDS = {
    ("one_mass", "in contact"): (0.3, 0.5, 0.7, 0.85, 0.95),
    ("one_mass", "mixed"): (0.35, 0.55, 0.75, 0.95, 1.08),
    ("one_mass", "landings"): (0.6, 1.04, 1.08, 1.15),
    ("two_mass", "in contact"): (0.25, 0.35, 0.45, 0.55, 0.65),
    ("two_mass", "mixed"): (0.35, 0.5, 0.65, 1.05),
}
NOISES = ("normal", "Laplace", "correlated")
#: Model and kind of speeds of ten successive machines. Combinations whose fit is quick are more
#: frequent.
TURNS = (
    *(("one_mass", "in contact"), ("one_mass", "mixed"), ("one_mass", "in contact")),
    *(("one_mass", "landings"), ("one_mass", "in contact"), ("two_mass", "in contact")),
    *(("one_mass", "mixed"), ("one_mass", "landings"), ("one_mass", "in contact")),
    ("two_mass", "mixed"),
)
#: Largest random change of a machine's cam speed, relative to its jump speed.
SCATTER = 0.02
#: Range of the correlation between neighbouring samples of noise that is correlated.
CORRELATIONS = (0.5, 0.95)
#: Standard deviation of the noise of the force, relative to the largest force.
FORCE_NOISE = 0.01
#: Standard deviation of the noise of the lift, m.
LIFT_NOISE = 10e-6


class Score(NamedTuple):
    """Error of one fitted parameter of a machine, in standard errors (`errors`).

    `kind` is (model, kind of speeds, kind of noise), and `name` is that of the parameter.
    """

    seed: int
    kind: tuple[str, str, str]
    name: str
    errors: float


def jump_rpm(law, rig):
    """Return the jump speed (rpm) of a rigid follower on a rig.

    It is the lowest cam speed with a loss of contact.
    """
    return to_rpm(rigid_jump_speed(law, FollowerParameters.from_rig(rig)))


def noise_of(kind, random, size):
    """Return random noise of unit standard deviation, shape (size,).

    `kind` is "normal", "Laplace" or another name for correlated noise.
    """
    if kind == "normal":
        return random.standard_normal(size)
    if kind == "Laplace":
        return random.laplace(size=size) / np.sqrt(2.0)
    correlation = random.uniform(*CORRELATIONS)
    white = random.standard_normal(size + 500)
    return np.sqrt(1.0 - correlation**2) * lfilter([1.0], [1.0, -correlation], white)[500:]


def numbers_of(rig, *more):
    """Return the follower parameters of a rig by name, in SI units.

    These are those of a rigid follower and the parameters named in `more`.
    """
    return {name: getattr(rig.follower, name).si for name in (*RIGID, *more)}


def rig_of(model, random):
    """Return a shipped rig whose follower parameters are changed at random.

    `model` is the follower model, which decides what parameters there are.
    """
    rig = cam_rig.load_rig("tm21" if model == "one_mass" else "paper_table2")
    numbers = {n: v * float(random.uniform(0.6, 1.6)) for n, v in numbers_of(rig).items()}
    if model == "one_mass":
        numbers["restitution"] = float(random.uniform(0.1, 0.6))
    else:
        stem = rig.follower.stem_stiffness.si
        numbers["stem_stiffness"] = stem * float(random.uniform(0.5, 2.0))
        numbers["roller_share"] = float(random.uniform(0.25, 0.6))
        numbers["stem_damping"] = float(random.uniform(5.0, 30.0))
    return rig.with_follower(**numbers)


def measured(law, rig, kind, rpms, random, rate):
    """Return a simulated measured run of a machine, with noise of its kind.

    `kind` is (model, kind of speeds, kind of noise). `rpms` are the cam speeds, and `rate` is the
    sample rate in Hz.
    """
    errors = InstrumentErrors(rate=rate, encoder_rate=rate, force_noise=0.0, lift_noise=0.0)
    run = measured_run(law, rig, kind[0], rpms, errors, int(random.integers(1 << 30)))
    size = run.force.value.size
    largest = run.force.value.max()
    force = run.force.value + FORCE_NOISE * largest * noise_of(kind[2], random, size)
    lift = run.lift.value + LIFT_NOISE * noise_of(kind[2], random, size)
    return replace(run, force=replace(run.force, value=force), lift=replace(run.lift, value=lift))


def scores_of(seed: int, rate: int = 500) -> list[Score]:
    """Return the errors of all parameters fitted to a simulated machine.

    The machine, a cam and a rig, is random. `rate` is the sample rate in Hz.
    """
    random = np.random.default_rng(seed)
    kind = (*TURNS[seed % len(TURNS)], NOISES[seed % len(NOISES)])
    law = cam_rig.build_law(cam_rig.load_cam(CAMS[seed % len(CAMS)]))
    rig = rig_of(kind[0], random)
    parts = np.array(SPEEDS[kind[:2]])
    rpms = (parts + random.uniform(-SCATTER, SCATTER, parts.size)) * jump_rpm(law, rig)
    run = measured(law, rig, kind, rpms.tolist(), random, rate)
    fit = fit_run(law, run, cam_rig.load_rig("tm21"), kind[0])
    return [
        Score(seed, kind, n.name, (n.value - getattr(rig.follower, n.name).si) / n.error)
        for n in fit.identified
    ]


def coverage(scores: Iterable[Score]) -> float:
    """Return the fraction of 95 % intervals that contain the truth."""
    return float(np.mean([abs(score.errors) < NORMAL_95 for score in scores]))

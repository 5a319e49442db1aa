"""Where a search begins: the encoder's zero, numbers of a follower on the cam, a stem."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import nnls

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.contact_force import force_weights
from cam_rig.dynamics.two_mass.parameters import contact_response, force_output
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.studies.rig_fit.likelihood import Likelihood
from cam_rig.studies.rig_fit.measured_turns import PRESSED, MeasuredHold
from cam_rig.studies.rig_fit.numbers import Follower, follower_of
from cam_rig.units import TURN

#: Cam angles tried for the encoder's zero.
PHASES = 360
#: Every so manyth sample is looked at here.
EVERY = 8
#: Natural frequencies of the stem that are tried, Hz: from, to, each so many times the one before.
FREQUENCIES = (8.0, 3000.0, 1.1)
#: Parts of a turn over which what is left is averaged, at most; samples in one, at least.
MOST_PARTS, LEAST_IN_PART = 256, 6
#: Samples of a hold beside which a stem is tried, at most.
MOST_LOOKED_AT = 600
#: Shares of the mass on the roller's side, and damping ratios, that are tried.
SHARES, DAMPING_RATIOS = (0.25, 0.5), (0.005, 0.05)


def rough_start(
    law: Law, holds: tuple[MeasuredHold, ...], base: dict[str, float]
) -> tuple[dict[str, float], float, float]:
    """Numbers, the encoder's phase (rad) and the lift's zero (m) to begin with.

    On the cam lift and force are linear in the numbers at a given phase:
    s + zero, and m ω² s'' + c ω s' + k s + preload. The phase is the best of all around.
    """
    best, found = math.inf, (dict(base), 0.0, 0.0)
    lifts = [(h.angle + h.speed * h.lift.since[::EVERY], h.lift.value[::EVERY]) for h in holds]
    angle, lift = (np.concatenate(x) for x in zip(*lifts, strict=True))
    pressed = [_pressed(hold) for hold in holds]
    angles = np.concatenate([h.angle + h.speed * f[0] for h, f in zip(holds, pressed, strict=True)])
    force = np.concatenate([f[1] for f in pressed])
    speed = np.concatenate(
        [np.full(f[0].size, h.speed) for h, f in zip(holds, pressed, strict=True)]
    )
    for phase in np.arange(PHASES) * (TURN / PHASES):
        missed, zero, numbers = 0.0, 0.0, dict(base)
        if lift.size:
            off = lift - law.motion_at(angle + phase)[0]
            zero = float(np.median(off))
            missed += float(((off - zero) ** 2).sum()) / float(lift.var())
        if force.size:
            s, slope, bend = law.motion_at(angles + phase)
            parts = np.stack([bend * speed**2, slope * speed, s, np.ones_like(s)], axis=1)
            sizes = np.linalg.norm(parts, axis=0)
            sizes[sizes == 0.0] = 1.0  # all that presses is on a dwell, at this phase
            _, triangle = np.linalg.qr(np.column_stack([parts / sizes, force]))
            fitted, off = nnls(triangle[:, :-1], triangle[:, -1])  # none of them is below zero
            fitted /= sizes
            missed += float(off) ** 2 / float(force.var())
            numbers |= _allowed(fitted, base)
        if missed < best:
            best, found = missed, (numbers, float(phase), zero)
    return found


def _pressed(hold: MeasuredHold) -> tuple[FloatArray, FloatArray]:
    """Times and forces of the samples of a follower on the cam, some of a hold."""
    force = hold.force
    if not force.value.size:
        return force.since, force.value
    on = force.value > PRESSED * force.value.max()
    return force.since[on][::EVERY], force.value[on][::EVERY]


def _allowed(fitted: FloatArray, base: dict[str, float]) -> dict[str, float]:
    mass, damping, spring, preload = fitted.tolist()
    return {
        "mass": mass if mass > 0.0 else base["mass"],
        "spring_stiffness": spring if spring > 0.0 else base["spring_stiffness"],
        "preload": max(preload, 0.0),
        "damping": max(damping, 0.0),
    }


def leaves_a_pattern(likelihood: Likelihood, x: FloatArray) -> bool:
    """Whether what is left of the force repeats from turn to turn, beyond what noise does.

    Means over parts of a turn, in standard deviations: the sum of their squares is that of as many
    parts, but for √2 of their number's root.
    """
    squares = parts = 0.0
    for i in range(len(likelihood.holds)):
        predicted = likelihood.predicted(x, i)
        if predicted is None or not predicted.force.size:
            continue
        left = predicted.force_left / likelihood.force_deviation(i)
        count = max(4, min(MOST_PARTS, left.size // LEAST_IN_PART))
        part = (np.mod(predicted.force_angle, TURN) * (count / TURN)).astype(int) % count
        sizes = np.bincount(part, minlength=count)
        sums = np.bincount(part, left, minlength=count)
        squares += float((sums[sizes > 0] ** 2 / sizes[sizes > 0]).sum())
        parts += float(np.count_nonzero(sizes))
    return squares > parts + math.sqrt(2.0 * parts)


def likely_stem(likelihood: Likelihood, x: FloatArray) -> tuple[dict[str, float], float]:
    """The stem that with the numbers of one mass comes nearest to the forces.

    With it the logarithm of how much likelier it makes them than a rigid one. Only as far as the
    follower stays on the cam, where each stem needs one linear solve.

    Parameters
    ----------
    likelihood, x : of one mass, where its search ended
    """
    one, found = likelihood.values(x), list[tuple[float, dict[str, float]]]()
    forces = [_pressing(likelihood, x, i) for i in range(len(likelihood.holds))]
    rigid = sum(_missed_rigid(likelihood, one, *force) for force in forces)
    low, high, factor = FREQUENCIES
    for k in range(round(math.log(high / low) / math.log(factor))):
        rate = TURN * low * factor**k
        for share in SHARES:
            for ratio in DAMPING_RATIOS:
                end = one["mass"] * (1.0 - share)
                stem = {
                    "stem_stiffness": max(end * rate**2 - one["spring_stiffness"], end * rate),
                    "roller_share": share,
                    "stem_damping": 2.0 * ratio * end * rate,
                }
                follower = follower_of(one | stem, likelihood.stem_stiffness)
                missed = sum(_missed(likelihood.law, follower, *force) for force in forces)
                found.append((missed, stem))
    best, stem = min(found, key=lambda pair: pair[0])
    count = sum(force[2].size for force in forces)
    return stem, 0.5 * count * math.log(rigid / best)


def _pressing(
    likelihood: Likelihood, x: FloatArray, i: int
) -> tuple[float, FloatArray, FloatArray]:
    """Speed (rad/s) of a hold, cam angles and forces of some samples that press."""
    force = likelihood.holds[i].force.value[likelihood.kept[i]]
    on = np.flatnonzero(force > PRESSED * force.max(initial=0.0))
    on = on[:: -(-on.size // MOST_LOOKED_AT) or 1]
    return likelihood.speed_of(x, i), likelihood.angles(x, i)[1][on], force[on]


def _missed_rigid(
    likelihood: Likelihood,
    values: dict[str, float],
    speed: float,
    angle: FloatArray,
    force: FloatArray,
) -> float:
    follower = follower_of(values, likelihood.stem_stiffness)
    assert isinstance(follower, FollowerParameters)
    there = force_weights(follower, speed) @ likelihood.law.motion_at(angle) + follower.preload
    return float(((there - force) ** 2).sum())


def _missed(
    law: Law, follower: Follower, speed: float, angle: FloatArray, force: FloatArray
) -> float:
    assert isinstance(follower, TwoMassParameters)
    try:
        return float(((_on_the_cam(law, follower, speed, angle) - force) ** 2).sum())
    except DynamicsError:  # in resonance without damping
        return math.inf


def _on_the_cam(
    law: Law, follower: TwoMassParameters, speed: float, angle: FloatArray
) -> FloatArray:
    """The steady contact force (N) at cam angles (rad), as if the cam could pull."""
    response, outputs = contact_response(law, follower, speed), force_output(follower)
    inside = np.mod(angle, TURN)
    order = np.argsort(inside)
    vibration = response.states(response.periodic(), 0.0, inside[order] / speed)
    motion = law.motion_at(inside[order]) * (speed ** np.arange(3.0))[:, None]
    force = np.empty(angle.size)
    force[order] = (outputs.state @ vibration + outputs.law @ motion)[0] + outputs.constant[0]
    return force

"""Where a search begins: the encoder's zero, numbers of a follower on the cam, a stem."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from cam_rig.dynamics import TwoMassParameters
from cam_rig.laws import Law
from cam_rig.studies.fit_rig.numbers import follower_of
from cam_rig.studies.fit_rig.residuals import FAR, FORCE_ZERO, ZERO, Predicted
from cam_rig.studies.fit_rig.search import (
    MOST_SQUARE,
    Candidate,
    FitSolution,
    continued,
    log_ratio_of_all,
    search,
)
from cam_rig.studies.fit_rig.steady_turn import POINTS
from cam_rig.studies.fit_rig.turns import PRESSED, MeasuredHold
from cam_rig.units import TURN, FloatArray

#: Cam angles tried for the encoder's zero.
PHASES = 360
#: Every so manyth sample is looked at here.
EVERY = 8
#: Natural frequencies of the stem that are tried, Hz: from, to, each so many times the one before.
FREQUENCIES = (8.0, 3000.0, 1.1)
#: Finer ones beside the likeliest, powers of it: what vibrates for long is in step with the
#: forces only where its frequency is right to about its damping ratio.
FINER_RATE, FINER_RATES = 1.01, range(-10, 11)
#: What the numbers of one mass may move of the forces beside a stem, r.m.s., in parts of them.
LITTLE = 0.1
#: Log ratio that three numbers reach by chance once in twenty; the best of n stems by ln n more.
BY_CHANCE = 3.91
#: Parts of a turn over which what is left is averaged, at most; samples in one, at least.
MOST_PARTS, LEAST_IN_PART = 256, 6
#: Samples of a hold beside which a stem is tried, at most.
MOST_LOOKED_AT = 600
#: Points of a turn: in a period of the stem, and at most. Between two its vibration is 0.5 % off,
#: more beyond 2048 periods a turn.
IN_A_PERIOD, MOST_POINTS = 32, 2**16
#: Shares of the mass on the roller's side, and damping ratios, that are tried.
SHARES, DAMPING_RATIOS = (0.25, 0.5), (0.005, 0.05)
#: The numbers whose parts of the force are fitted, in the columns' order.
FORCE_PARTS = ("mass", "damping", "spring_stiffness", "preload")


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
    angles, speed, force = np.hstack([_pressed(hold) for hold in holds])
    for phase in np.arange(PHASES) * (TURN / PHASES):
        missed, zero, numbers = 0.0, 0.0, dict(base)
        if lift.size:
            off = lift - law.motion_at(angle + phase)[0]
            zero = float(np.median(off))
            missed += float(((off - zero) ** 2).sum()) / float(lift.var())
        if force.size:
            parts, sizes = _force_parts(law, speed, angles + phase)
            _, triangle = np.linalg.qr(np.column_stack([parts, force]))
            fitted, off = nnls(triangle[:, :-1], triangle[:, -1])  # none of them is below zero
            missed += float(off) ** 2 / float(force.var())
            known = dict(zip(FORCE_PARTS, (fitted / sizes).tolist(), strict=True))
            numbers |= {n: v for n, v in known.items() if v > 0.0 or n in ("preload", "damping")}
        if missed < best:
            best, found = missed, (numbers, float(phase), zero)
    return found


def _force_parts(law: Law, speed: FloatArray, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``(n, 4)``: unit columns of the force by `FORCE_PARTS`; their sizes."""
    s, slope, curvature = law.motion_at(angle)
    parts = np.stack([curvature * speed**2, slope * speed, s, np.ones_like(s)], axis=1)
    sizes = np.linalg.norm(parts, axis=0)
    sizes[sizes == 0.0] = 1.0  # all that presses is on a dwell
    return parts / sizes, sizes


def _pressed(hold: MeasuredHold) -> FloatArray:
    """Cam angle, speed and force of some samples of a follower on the cam, ``(3, n)``."""
    since, force = hold.force.since, hold.force.value
    on = np.flatnonzero(force > PRESSED * force.max(initial=0.0))[::EVERY]
    return np.stack([hold.angle + hold.speed * since[on], np.full(on.size, hold.speed), force[on]])


def leaves_a_pattern(found: Candidate) -> bool:
    """Whether what is left of the force repeats from turn to turn, beyond what noise does."""
    squares, parts = pattern(found)
    return squares > parts + math.sqrt(2.0 * parts)


def pattern(found: Candidate) -> tuple[float, float]:
    """Of what is left of the force: squares of its means over parts of a turn, and the parts.

    In standard deviations: of noise as many as there are parts, but for √2 of their number's root.
    Of noise that is correlated over some samples so many times as many.
    """
    squares = parts = 0.0
    for i, there in enumerate(found.predicted):
        if there is None or not there.force.left.size:
            continue
        left = there.force.left / found.likelihood.force_deviation(i)
        count = max(4, min(MOST_PARTS, left.size // LEAST_IN_PART))
        part = (np.mod(there.force.angle, TURN) * (count / TURN)).astype(int) % count
        sizes = np.bincount(part, minlength=count)
        sums = np.bincount(part, left, minlength=count)
        squares += float((sums[sizes > 0] ** 2 / sizes[sizes > 0]).sum())
        parts += float(np.count_nonzero(sizes))
    return squares, parts


class TriedStem(NamedTuple):
    """Squares of the forces' errors (N²) with a stem, the numbers as they are or moved with it."""

    missed: float
    moved: float
    rate: float
    numbers: dict[str, float]


#: By which of two errors the best stem is taken.
AS_IT_IS, MOVED = attrgetter("missed"), attrgetter("moved")


def likely_stem(one: Candidate) -> tuple[dict[str, float], float]:
    """The stem that with the numbers of one mass comes nearest to the forces.

    With it the logarithm of how much likelier it makes them than a rigid one. The numbers of one
    mass have taken up part of what a stem does. So one that is far likelier beside others that go
    with it is that stem; one that is by chance, of so many, is none.
    """
    values, forces = one.values, _pressing(one)
    low, high, factor = FREQUENCIES
    steps = range(round(math.log(high / low) / math.log(factor)))
    tried = list(_stems(values, forces, [TURN * low * factor**k for k in steps]))
    for near in {min(tried, key=key).rate for key in (AS_IT_IS, MOVED)}:
        tried += _stems(values, forces, [near * FINER_RATE**k for k in FINER_RATES])
    least, best = min(tried, key=AS_IT_IS), min(tried, key=MOVED)
    half = 0.5 * forces.measured.size
    if half * math.log(least.moved / best.moved) < BY_CHANCE + math.log(len(tried)):
        best = least
    rigid = forces.parts @ [values[name] for name in FORCE_PARTS]
    return best.numbers, half * math.log(forces.missed(rigid)[1] / best.moved)


@dataclass(frozen=True, eq=False)
class PressingSamples:
    """Samples of all holds that press, and what a steady force is made of there."""

    holds: list[tuple[float, FloatArray]]  #: speed (rad/s) and cam angles (rad) of each
    measured: FloatArray  #: N, ``(n,)`` of all holds
    parts: FloatArray  #: ``(n, 4)``: the force by `FORCE_PARTS`
    columns: FloatArray  #: the same orthonormal
    lift: NDArray[np.complex128]  #: Fourier coefficients of the law, m

    @classmethod
    def of(
        cls, law: Law, holds: list[tuple[float, FloatArray]], measured: FloatArray
    ) -> PressingSamples:
        """Those of a law."""
        speeds = np.concatenate([np.full(angle.size, speed) for speed, angle in holds])
        parts, sizes = _force_parts(law, speeds, np.concatenate([angle for _, angle in holds]))
        angles = np.arange(float(MOST_POINTS)) * (TURN / MOST_POINTS)
        lift = np.fft.rfft(law.motion_at(angles)[0], norm="forward")
        return cls(holds, measured, parts * sizes, np.asarray(np.linalg.qr(parts)[0]), lift)

    def on_a_stem(self, p: TwoMassParameters) -> FloatArray:
        """The steady contact force (N) of two masses, as if the cam could pull.

        The roller's is its inertia; to the end mass's, Z₂ s of Z₂ = k₂ + c₂ iΩ − m₂ Ω², the stem is
        in series, Z₁ = k₁ + c₁ iΩ: Z₁ Z₂ / (Z₁ + Z₂) s, by the law's harmonics.
        """
        own, vibrating = math.sqrt(p.stiffness / p.end_mass), []
        for speed, angle in self.holds:
            wanted = min(max(POINTS, IN_A_PERIOD * own / speed), MOST_POINTS)
            lift = self.lift[: 2 ** math.ceil(math.log2(wanted) - 1.0) + 1]
            rate = 1j * speed * np.arange(lift.size)
            stem = p.stem_stiffness + p.stem_damping * rate
            end = p.spring_stiffness + p.damping * rate + p.end_mass * rate**2
            force = np.fft.irfft(lift * (stem * end / (stem + end)), norm="forward")
            force, place = np.append(force, force[0]), np.mod(angle, TURN) * (force.size / TURN)
            vibrating.append(np.interp(place, np.arange(force.size), force))
        inertia = p.roller_mass * self.parts[:, 0]
        return np.asarray(inertia + np.concatenate(vibrating) + p.share * p.preload)

    def missed(self, shown: FloatArray) -> tuple[float, float]:
        """Squares of what forces are off (N²), and but for what numbers of one mass can move.

        By a little: a very soft stem moves a mass so far that nothing is linear, and counts in
        full.
        """
        off = shown - self.measured
        move = self.columns.T @ off
        missed, part, whole = (float(x @ x) for x in (off, move, self.measured))
        return missed, missed - (part if part < LITTLE**2 * whole else 0.0)


def _pressing(one: Candidate) -> PressingSamples:
    """At most `MOST_LOOKED_AT` of each hold."""
    like, holds, forces = one.likelihood, [], []
    for i in range(len(one.holds)):
        _, counted = like.samples(i)
        on = np.flatnonzero(counted.value > PRESSED * counted.value.max(initial=0.0))
        some = counted.where(on[:: -(-on.size // MOST_LOOKED_AT) or 1])
        holds.append((like.speed_of(one.x, i), like.angles(one.x, i, some.since)))
        forces.append(some.value)
    return PressingSamples.of(like.law, holds, np.concatenate(forces))


def _stems(
    values: dict[str, float], forces: PressingSamples, rates: list[float]
) -> Iterator[TriedStem]:
    """Stems of natural frequencies (rad/s)."""
    for rate, share, ratio in product(rates, SHARES, DAMPING_RATIOS):
        end = values["mass"] * (1.0 - share)
        numbers = {
            "stem_stiffness": max(end * rate**2 - values["spring_stiffness"], end * rate),
            "roller_share": share,
            "stem_damping": 2.0 * ratio * end * rate,
        }
        two = follower_of(values | numbers, None)
        assert isinstance(two, TwoMassParameters)
        yield TriedStem(*forces.missed(forces.on_a_stem(two)), rate, numbers)


# The restitution: bounces make valleys of the likelihood, so it is looked for all over first.

#: Restitutions tried, then so many finer ones between those beside the best.
BOUNCES, FINER = (1e-3, *(0.025 * k for k in range(1, 37))), 16
#: A restitution below this is none: it is known by what it is not beyond.
SMALL_BOUNCE = 0.02
#: Steps to the phase of a hold that goes with a restitution, and one of the angle (rad).
PHASE_STEPS, ANGLE_STEP = 4, 1e-6
#: Squares a sample that are still noise, with what a landing beside a sample adds.
EXPLAINED = 1.5
#: Of a sum of squares, what 95 % of one number's errors stay below.
SQUARE_95 = 3.84
#: Samples in flight that show the force's zero, at least: with it flights become longer. It is off
#: where it is beyond so many standard errors.
LEAST_FLYING, OFF = 4, 6.0
#: And beyond this part of the preload.
LEAST_ZERO = 0.005
#: Looks at it, each with the flights of the one before.
ZERO_ROUNDS = 5


def with_bounces(found: Candidate, given: dict[str, float]) -> FitSolution:
    """The restitution beside the other numbers, from the likeliest beside those of ``found`` on."""
    if "restitution" in given:
        return search(continued(found, found.likelihood.sought, found.values))
    likely, _, _ = _likely(found)
    middle = _tried(found, 0.5 * (likely[0].bounce + likely[-1].bounce))
    bounce = {"restitution": max(middle.bounce, BOUNCES[0])}
    start = continued(found, found.smooth, found.values | bounce)
    start.x[start.likelihood.instruments.phases] = middle.phases
    return freed(search(start), (*found.smooth, "restitution"))


def freed(fixed: FitSolution, sought: tuple[str, ...]) -> FitSolution:
    """The restitution too, which was fixed: sought, or as it is where that is likelier.

    Where bounces are lower than the noise of the lift, no slope tells it, and a search drifts off.
    Then it is among what is sought with its slopes, and not moved.
    """
    free = search(continued(fixed, sought, fixed.values))
    if len(free.holds) == len(fixed.holds) and log_ratio_of_all(free, fixed) >= 0.0:
        return free
    start = continued(fixed, sought, fixed.values)
    kept = [fixed.likelihood.kept[i] for i in fixed.steady]
    pressing = [fixed.likelihood.pressing[i] for i in fixed.steady]
    new = replace(start.likelihood, kept=kept, pressing=pressing)
    return FitSolution(new, start.x, new.slopes(start.x), new.residuals(start.x))


def bounce_beside(found: Candidate) -> tuple[float, float] | None:
    """The restitution with its standard error, beside other numbers that stay as they are.

    That is half of what is possible, as the others were not sought with it. None where with none
    of them the flights are as they were measured, to their noise.
    """
    _, possible, step = _likely(found)
    best = min(possible, key=lambda one: one.missed)
    if best.missed >= EXPLAINED * best.samples:
        return None
    low, high = possible[0].bounce, possible[-1].bounce
    return 0.5 * (low + high), 0.5 * (high - low + step)


def _likely(found: Candidate) -> tuple[list[Tried], list[Tried], float]:
    """Restitutions that are likely, that are possible, and the step between two of them."""
    coarse = [_tried(found, bounce) for bounce in BOUNCES]
    least = min(trial.missed for trial in coarse)
    near = [k for k, trial in enumerate(coarse) if trial.missed <= least + MOST_SQUARE]
    ends = BOUNCES[max(0, near[0] - 1)], BOUNCES[min(len(BOUNCES) - 1, near[-1] + 1)]
    fine = [_tried(found, bounce) for bounce in np.linspace(*ends, FINER + 1).tolist()]
    least = min(trial.missed for trial in fine)
    likely, possible = (
        [trial for trial in fine if trial.missed <= least + more]
        for more in (SQUARE_95, MOST_SQUARE)
    )
    return likely, possible, (ends[1] - ends[0]) / FINER


class Tried(NamedTuple):
    """A restitution, what it misses of so many samples, and the phases (rad) of the holds."""

    bounce: float
    missed: float
    phases: FloatArray
    samples: int


def _tried(found: Candidate, bounce: float) -> Tried:
    start = continued(found, found.smooth, found.values | {"restitution": bounce})
    new, x = start.likelihood, start.x
    missed, samples = 0.0, 0
    for i, hold in enumerate(new.holds):  # all forces, for bounces hide them else
        predicted = new.predicted(x, i)
        if predicted is None:
            samples += hold.lift.value.size + hold.force.value.size
            missed += FAR**2 * hold.force.value.size
        elif predicted.turn.events:
            new.pressing[i] = np.abs(predicted.turn.at(predicted.force.angle)[1])
            samples += hold.lift.value.size + hold.force.value.size
            x[new.instruments.phases.start + i], off = _phase(start, i, predicted)
            missed += off
    return Tried(bounce, missed, x[new.instruments.phases], samples)


def _phase(start: Candidate, i: int, predicted: Predicted) -> tuple[float, float]:
    """The phase (rad) of a hold that goes with its turn, and the squares of what is missed."""
    phase = float(start.x[start.likelihood.instruments.phases][i])
    lift, moved = start.holds[i].lift.value.size > 0, 0.0
    for _ in range(PHASE_STEPS):
        off = _off(start, i, predicted, moved, lift)
        rise = (_off(start, i, predicted, moved + ANGLE_STEP, lift) - off) / ANGLE_STEP
        moved -= float(rise @ off) / max(float(rise @ rise), 1e-300)
    squares = [_off(start, i, predicted, moved, which) ** 2 for which in (True, False)]
    # A landing that is off by less than a sample puts one force wrong by all of it.
    return phase + moved, float(sum(np.minimum(part, MOST_SQUARE).sum() for part in squares))


def _off(start: Candidate, i: int, predicted: Predicted, moved: float, lift: bool) -> FloatArray:
    """By how much lift, or force, is missed, in standard deviations, ``moved`` rad further."""
    like, x = start.likelihood, start.x
    measured = like.samples(i)
    if lift:
        shown = predicted.turn.at(predicted.lift.angle + moved)[0] + like.single(x, ZERO)
        return (shown - measured[0].value) / like.lift_noise
    shown = predicted.turn.at(predicted.force.angle + moved)[1] + like.single(x, FORCE_ZERO)
    return (shown - measured[1].value) / like.force_deviation(i)


def with_zero_offset(found: Candidate) -> Candidate:
    """The same with the zero of the force sensor, which shows in flights: where they are low."""
    like, low = found.likelihood, forces_in_flight(found)
    start = continued(found, like.sought, found.values, zero_offset=True)
    if low.size < LEAST_FLYING:
        return found
    x, at = start.x, start.likelihood.instruments.at[FORCE_ZERO]
    x[at] = float(np.median(low))
    if "preload" in like.sought:
        k = like.sought.index("preload")
        x[k] = max(0.0, x[k] - x[at])
    return start


def zero_in_flight(flying: Candidate) -> float | None:
    """By how much (N) the force's zero is off; None where flights do not say that it is."""
    like, x, zero = flying.likelihood, flying.x.copy(), 0.0
    if "preload" not in like.sought:
        return None
    at, low = like.sought.index("preload"), np.empty(0)
    for _ in range(ZERO_ROUNDS):
        low = forces_in_flight(Candidate(like, x.copy()))
        if low.size < LEAST_FLYING:
            return None
        zero = float(np.median(low))
        x[at] = max(0.0, flying.x[at] - zero)
    error = float(np.abs(low - zero).mean()) / math.sqrt(low.size)
    return zero if abs(zero) > OFF * error + LEAST_ZERO * flying.x[at] else None


def forces_in_flight(found: Candidate) -> FloatArray:
    """What the force sensor shows (N) where the follower is off the cam."""
    flying = [
        found.likelihood.samples(i)[1].value[there.turn.at(there.force.angle)[1] == 0.0]
        for i, there in enumerate(found.predicted)
        if there is not None
    ]
    return np.concatenate([np.empty(0), *flying])

"""Inequalities (15) to (37) of docs/proofs.md against samples of random cases.

The search for the jump speed relies on these bounds. P is the part of the output that the law
forces, and V the free vibration. A chord error is the difference of a function of the speed from
the straight line between two speeds.
"""

import math
from functools import partial

import numpy as np
import pytest

from cam_rig.dynamics.events.contact import StemVibration
from cam_rig.dynamics.free_masses import contact_response
from cam_rig.dynamics.jump.rigid_zero import RigidMass, _may_pull
from cam_rig.dynamics.jump.two_masses import force_run
from cam_rig.dynamics.linear.exponential import free_motion
from cam_rig.dynamics.modal import group_error, harmonic_error
from cam_rig.dynamics.modal.first_zero import _prove_by_groups, _prove_by_harmonics
from cam_rig.dynamics.modal.group_error import GROUP_ERROR, Excitation, FadingSums, bound_groups
from cam_rig.dynamics.modal.harmonic_error import ChordError, bound_output
from cam_rig.dynamics.modal.law_series import law_series
from cam_rig.dynamics.modal.min_output import (
    _bound_by_chord,
    _bound_vibration,
    _max_curvature,
    _turn_difference,
    free_at,
)
from cam_rig.dynamics.modal.motion import (
    amplitude,
    flow_over,
    mode_on_law,
    motion_at,
    norm_of,
)
from cam_rig.laws import bernstein
from cam_rig.units import TURN

from .test_first_zero import case, forces, noise, random_law, random_rig

#: Number of random combinations of law, rig and cam speed for each inequality.
CASES = 30
#: Relative excess over a bound that is allowed for rounding errors.
ROUNDING = 1e-9
#: Positions within a step of the cam speed (0 to 1) at which a chord error is sampled.
X = np.linspace(0.0, 1.0, 201)[1:-1]


def norms(norm, states):
    """Return the norm N of free vibrations, one per column of `states`.

    `states` has displacement and velocity, shape (2, n). N is the norm of inequality (16) of
    docs/proofs.md, with the constants ρ and δ of `norm`.
    """
    return np.hypot(norm.rho * states[0], states[1] + norm.delta * states[0])


def random_step(rng):
    """Return two random speeds (rad/s) with a relative difference of 1e-4 to 0.3."""
    low = 10.0 ** rng.uniform(0.0, 2.0)
    return low, low * (1.0 + 10.0 ** rng.uniform(-4.0, -0.5))


def chord_errors(function, low, high):
    """Return the chord errors of a function of the cam speed, at the positions `X`.

    A chord error is the difference from the straight line between the speeds `low` and `high`.
    """
    values = np.array([function(low + x * (high - low)) for x in X])
    first, last = function(low), function(high)
    x = X.reshape(-1, *(1,) * (values.ndim - 1))
    return first + x * (last - first) - values


def test_norm_of_a_free_vibration():
    """(16), (17) and (18) of docs/proofs.md hold for random free vibrations.

    They bound a vibration by its norm N. Some cases reach 99 % of each bound.
    """
    closest = np.zeros(3)
    for seed in range(4 * CASES):
        rng = np.random.default_rng(seed)
        law, rig = random_law(rng), random_rig(rng)
        matrix, mode = contact_response(law, rig, 1.0).matrix, force_run(law, rig, None).mode
        norm, rate = norm_of(mode), math.sqrt(mode.stiffness)
        start = rng.standard_normal(2) * [1.0, rate]
        times = np.linspace(0.0, 4.0 / max(rate, norm.delta), 400)
        states = free_motion(matrix, start, times)
        sizes = norms(norm, states)
        output = mode.per_displacement * states[0] + mode.per_velocity * states[1]
        ratios = (
            sizes / (np.exp(-norm.decay * times) * amplitude(norm, StemVibration(*start))),
            np.abs(output) / (norm.reach * sizes),
            norms(norm, matrix @ states) / (norm.sigma * sizes),
        )
        largest = np.array([ratio.max() for ratio in ratios])
        assert (largest <= 1.0 + ROUNDING).all(), seed
        closest = np.maximum(closest, [np.abs(ratios[0][1:]).max(), *largest[1:]])
    assert (closest > 0.99).all()


def runs(count=CASES):
    """Yield random runs of two masses whose output can be computed to a few digits.

    An item has the seed, law, rig, duration (s), cam speed (rad/s), vibration mode on the law, and
    the motion at that speed.
    """
    for seed in range(count):
        law, rig, duration = case(seed)
        run, table = force_run(law, rig, duration), law_series(law)
        speed = 10.0 ** np.random.default_rng(seed).uniform(1.0, 2.0)
        if run.is_resolved(speed):
            on_law = mode_on_law(table, run.mode)
            yield seed, law, rig, duration, speed, on_law, motion_at(on_law, speed)


def pieces_of(table, motion, duration, rng):
    """Yield random polynomial pieces of the law that are within the duration of a run.

    An item has the index of the piece, the turn, and 300 angles (rad) from the start of the piece.
    """
    turns = len(motion.turn_starts)
    for _ in range(8):
        piece = int(rng.integers(table.span_index.size))
        turn = int(rng.integers(min(turns, 4)))
        low, high = table.breaks[piece : piece + 2]
        end = turn * TURN + high
        if duration is None or end <= motion.speed * duration:
            yield piece, turn, np.linspace(0.0, high - low, 300)


def test_output_in_pieces():
    """(15), (19), (20) and (21) of docs/proofs.md hold in random pieces of the law.

    By (15) the output is that of the exact model, the others are lower bounds of it. Some cases
    must be close to each bound.
    """
    floors = chords = pairs = 0
    for seed, law, rig, duration, speed, on_law, motion in runs():
        table, mode, _ = on_law
        rng, small = np.random.default_rng(seed), noise(law, rig, speed)
        last = len(motion.turn_starts) - 1
        for piece, turn, inside in pieces_of(table, motion, duration, rng):
            free = free_at(motion, piece, turn)
            flows = [flow_over(mode, t / speed) for t in inside.tolist()]
            eta = [flow.eta_eta * free[0] + flow.eta_rate * free[1] for flow in flows]
            rate = [flow.rate_eta * free[0] + flow.rate_rate * free[1] for flow in flows]
            share = mode.per_displacement * np.array(eta) + mode.per_velocity * np.array(rate)
            basis = bernstein.basis(len(motion.forced) - 1, inside / inside[-1])
            output = basis @ motion.forced[:, piece] + share
            angles = turn * TURN + table.breaks[piece] + inside[1:-1]
            size = np.abs(output).max() + np.abs(share).max() + small
            exact = forces(law, rig, speed, duration, angles)
            assert np.abs(exact - output[1:-1]).max() <= ROUNDING * size + small  # (15)
            start = motion.piece_starts[piece]
            assert start["floor"] <= output.min() + ROUNDING * size  # (19)
            chord = _bound_by_chord(table, mode, motion, piece, free)
            assert chord <= output.min() + ROUNDING * size  # (20)
            slack = 0.5 * motion.norm.reach * amplitude(motion.norm, free)
            floors += bool(start["floor"] > output.min() - slack)
            chords += bool(chord > output.min() - 0.1 * np.ptp(output) - small)
            if turn < last:
                other = _bound_by_chord(table, mode, motion, piece, free_at(motion, piece, last))
                difference = _turn_difference(motion, 0, last + 1) * start["remainder"]
                assert other - difference <= output.min() + ROUNDING * size  # (21)
                pairs += 1
    assert min(floors, chords, pairs) > 5


def test_output_in_parts_of_pieces():
    """(22) of docs/proofs.md bounds |V|, |V̈| and |P''| in random pieces of the law.

    V is the free vibration and P the part of the output that the law forces. The bound is often
    within a factor of 2.
    """
    close = 0
    for seed, law, rig, duration, speed, on_law, motion in runs():
        table, mode, _ = on_law
        rng, matrix = np.random.default_rng(seed), contact_response(law, rig, speed).matrix
        weights = np.array([mode.per_displacement, mode.per_velocity])
        for piece, turn, inside in pieces_of(table, motion, duration, rng):
            free = free_at(motion, piece, turn)
            states = free_motion(matrix, np.array(free), inside / speed)
            bounds = np.array(_bound_vibration(mode, motion.norm, free))
            outputs = weights @ states, weights @ matrix @ matrix @ states
            largest = np.abs(outputs).max(axis=1)
            assert (largest <= bounds * (1.0 + ROUNDING)).all()
            ordinates = motion.forced[:, piece].copy()
            second = bernstein.derivative(bernstein.derivative(ordinates)) / inside[-1] ** 2
            values = bernstein.evaluate(second, inside / inside[-1])
            curvature = _max_curvature(ordinates, float(inside[-1]))
            assert np.abs(values).max() <= curvature * (1.0 + ROUNDING)
            close += bool((largest > 0.5 * bounds).all())
    assert close > CASES


def excitations(seed):
    """Return random inputs of a vibration that is excited at a joint of the law.

    They are the random generator, the mode on the law, its norm, two cam speeds (rad/s), and jumps
    of the derivatives s⁽ᵏ⁾ of the lift.
    """
    rng = np.random.default_rng(seed)
    law, rig = random_law(rng), random_rig(rng)
    run = mode_on_law(law_series(law), force_run(law, rig, 1.7).mode)
    low, high = random_step(rng)
    jumps = rng.standard_normal(len(run.series.eta) + 1) * run.law.max_derivatives
    jumps[0] = 0.0
    return rng, run, norm_of(run.mode), low, high, jumps


def excite(run, jumps, speed, order=0):
    """Return the vibration that jumps of s⁽ᵏ⁾ excite: displacement, velocity.

    The shape is (2,). `speed` is the cam speed Ω in rad/s. With `order` above 0 its derivative of
    this order by Ω is returned.
    """
    eta, k = run.series.eta, np.arange(jumps.size)
    factor = np.prod([k - i for i in range(order)], axis=0) * speed ** (k - float(order))
    displacement = (eta * jumps[:-1] * factor[:-1]).sum()
    return np.array([displacement, (eta * jumps[1:] * factor[1:]).sum()])


def vibration_at(run, jumps, angle, speed):
    """Return the free vibration after an excitation: displacement, velocity.

    The shape is (2,). It is evaluated `angle` rad of cam rotation after the joint at which `jumps`
    excite it.
    """
    flow, (eta, rate) = flow_over(run.mode, angle / speed), excite(run, jumps, speed)
    displacement = flow.eta_eta * eta + flow.eta_rate * rate
    return np.array([displacement, flow.rate_eta * eta + flow.rate_rate * rate])


def test_vibration_excited_by_jumps():
    """Inequality (23) bounds the norm of a vibration that jumps of the law excite.

    It also bounds the norms of its first and second derivatives by the cam speed. It applies to all
    speeds up to the higher speed of a step. Some cases reach half the bound.
    """
    closest = 0.0
    for seed in range(4 * CASES):
        _, run, norm, low, high, jumps = excitations(seed)
        weights = group_error._excitation_weights(norm, run.series, high)
        for speed in np.linspace(low, high, 20):
            for order in range(3):
                bound = float(weights[order] @ np.abs(jumps))
                size = float(norms(norm, excite(run, jumps, speed, order)))
                assert size <= bound * (1.0 + ROUNDING), (seed, order)
                closest = max(closest, size / bound)
    assert closest > 0.5


def test_vibrations_that_fade():
    """Inequality (24) bounds the chord error of a decaying vibration after its start.

    A chord error is the difference from the straight line between two cam speeds.
    """
    closest = 0.0
    for seed in range(4 * CASES):
        rng, run, norm, low, high, jumps = excitations(seed)
        weights = group_error._excitation_weights(norm, run.series, high)
        added = Excitation(*(float(row @ np.abs(jumps)) for row in weights))
        angle = low * 10.0 ** rng.uniform(-2.0, 1.5) / math.sqrt(run.mode.stiffness)
        zero = FadingSums(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        sums = group_error._add(zero, added, 0.0)
        sums = group_error._fade(sums, math.exp(-norm.decay * angle / high), angle / low)
        further = angle * rng.uniform(0.0, 2.0)
        age = min(further / low, 1.0 / norm.decay if norm.decay > 0.0 else math.inf)
        bound = group_error._bound_curvature(sums, norm, age, low) * (high - low) ** 2 / 8.0

        for total in (angle, angle + 0.3 * further, angle + further):
            errors = chord_errors(partial(vibration_at, run, jumps, total), low, high)
            largest = norms(norm, errors.T).max()
            size = norms(norm, vibration_at(run, jumps, total, low))
            assert largest <= bound * (1.0 + ROUNDING) + 1e-13 * size, seed
            closest = max(closest, largest / bound)
    assert closest > 0.2


def test_vibrations_of_earlier_turns():
    """Inequality (25) bounds the sum of the vibrations left from all earlier turns.

    The reference adds the contribution of each turn.
    """
    for seed in range(10 * CASES):
        rng = np.random.default_rng(seed)
        law, rig = random_law(rng), random_rig(rng)
        norm, (low, high) = norm_of(force_run(law, rig, 1.7).mode), random_step(rng)
        step = group_error.SpeedStep(low, high, 10.0 ** rng.uniform(0.0, 2.5) * TURN / high)
        one_turn = FadingSums(*(10.0 ** rng.uniform(-3.0, 3.0, 6)))
        all_turns = np.zeros(6)
        remainder, period = math.exp(-norm.decay * TURN / high), TURN / low
        for turn in range(math.floor(step.high * step.duration / TURN)):
            all_turns += group_error._fade(one_turn, remainder**turn, turn * period)
        bound = np.array(group_error._repeat_turn(one_turn, norm, step))
        assert (all_turns <= bound * (1.0 + ROUNDING)).all()


def test_curvature_of_the_polynomial_part():
    """Inequality (26) bounds |d²P/dΩ²|, at random angles and cam speeds Ω.

    P is the part of the output that the law forces. The bound is for groups of pieces of the law.
    """
    closest = 0.0
    for seed in range(CASES):
        rng, run, norm, low, high, _ = excitations(seed)
        table, bounds = run.law, np.zeros(run.law.first_pieces.size - 1, GROUP_ERROR)
        bound_groups(run, norm, low, high, bounds)
        k = np.arange(len(run.series.output))
        for group in rng.integers(0, bounds.size, 10).tolist():
            piece = int(rng.integers(*table.first_pieces[group : group + 2]))
            u = np.array([0.0, *rng.uniform(size=20), 1.0])
            derivatives = table.derivatives[:, :-1, piece]
            values = bernstein.basis(len(derivatives) - 1, u) @ derivatives
            terms = k * (k - 1) * run.series.output * rng.uniform(low, high) ** (k - 2.0)
            largest, bound = np.abs(values @ terms).max(), bounds[group]["forced_curvature"]
            assert largest <= bound * (1.0 + ROUNDING)
            closest = max(closest, largest / bound if bound > 0.0 else 0.0)
    assert closest > 0.5


def test_harmonics_of_a_law():
    """Inequality (28) bounds the Fourier coefficients |cₖ| of random motion laws.

    The reference is a Gaussian quadrature. High harmonics are bounded in blocks.
    """
    points, weights = np.polynomial.legendre.leggauss(16)
    for seed in range(CASES):
        law = random_law(np.random.default_rng(seed))
        table = law_series(law)
        count = table.harmonics.size
        cuts = np.linspace(0.0, TURN, 1 + 3 * count)
        edges = np.unique(np.concatenate([law.breaks, cuts]))
        half = 0.5 * np.diff(edges)[:, None]
        angles = edges[:-1, None] + half * (points + 1.0)
        values = law(angles.ravel()) * (half * weights).ravel() / TURN
        k = np.unique([*range(1, 40), *np.geomspace(40, 3 * count, 60).astype(int)])
        sizes = np.abs(np.exp(-1j * np.outer(k, angles.ravel())) @ values)
        rounding = 1e-14 * law.bounds[0]
        near = k <= count
        assert (sizes[near] <= table.harmonics[k[near] - 1] + rounding).all(), seed
        blocks = np.log(k[~near] / (count + 1.0)) / math.log(harmonic_error.BLOCK_RATIO)
        bound = table.block_maxima[np.floor(blocks + 1e-9).astype(int)]
        assert (sizes[~near] <= bound + rounding).all(), seed
        tails = np.cumsum((table.harmonics / np.arange(1.0, count + 1.0))[::-1])[::-1]
        assert (table.tails >= tails).all()


def resonant_cases():
    """Yield random generator, norm of a lightly damped mode, and two cam speeds."""
    for seed in range(4 * CASES):
        rng = np.random.default_rng(seed)
        low = 10.0 ** rng.uniform(0.0, 2.0)
        high = low * (1.0 + 10.0 ** rng.uniform(-4.0, -0.7))
        rho = low * 10.0 ** rng.uniform(0.3, 1.5)
        delta = rho * 10.0 ** rng.uniform(-3.0, -0.4)
        rig = random_rig(rng)
        norm = norm_of(force_run(random_law(rng), rig, None).mode)
        yield rng, norm._replace(delta=delta, rho=rho, decay=delta), low, high


def harmonic_error_of(k, norm, low, high):
    """Return the complex chord error of 1/(ikΩ − λ₁), at the positions `X`.

    This is the response of a mode with the eigenvalue λ₁ to the harmonic k of the cam speed Ω. The
    chord error is the difference from the straight line between the speeds `low` and `high`.
    """
    rate = norm.delta - 1j * norm.rho
    return chord_errors(lambda speed: 1.0 / (1j * k * speed + rate), low, high)


@pytest.mark.parametrize("from_rest", [False, True])
def test_error_of_one_harmonic(from_rest):
    """Inequalities (29), (30) and (31) bound the chord error of the harmonics ±k.

    A chord error is the difference from the straight line between two cam speeds. The cases are the
    steady state and runs from rest.
    """
    table, closest = law_series(random_law(np.random.default_rng(0))), 0.0
    for rng, norm, low, high in resonant_cases():
        k = max(1, round(norm.rho / low * rng.choice([0.5, 0.9, 1.0, 1.1, 2.0, 5.0])))
        harmonics = np.zeros(k)
        harmonics[-1] = 1.0
        tails = np.cumsum((harmonics / np.arange(1.0, k + 1.0))[::-1])[::-1]
        blocks = np.zeros_like(table.block_maxima)
        single = table._replace(harmonics=harmonics, tails=tails, block_maxima=blocks)
        bound = harmonic_error._bound_harmonics(single, norm, low, high, from_rest)
        error = 0.0
        for sign in (1, -1):
            sizes = np.abs(harmonic_error_of(sign * k, norm, low, high))
            if from_rest:
                times = 10.0 ** rng.uniform(-2.0, 1.0, 50) / norm.delta
                speeds = low + X * (high - low)
                rates = -norm.delta + 1j * norm.rho - 1j * sign * k * speeds
                sizes = sizes * np.abs(1.0 - np.exp(times[:, None] * rates)).max(axis=0)
            error = error + sizes
        assert error.max() <= bound.max_error * (1.0 + ROUNDING) + 1e-15
        assert (error <= 4.0 * X * (1.0 - X) * bound.parabola * (1.0 + ROUNDING) + 1e-15).all()
        closest = max(closest, error.max() / bound.max_error)
    assert closest > 0.5


def test_error_of_blocks_of_harmonics():
    """Inequality (30) bounds the sum of the chord errors of all harmonics in blocks.

    Each Fourier coefficient |cₖ| is at the bound of its block.
    """
    table = law_series(random_law(np.random.default_rng(0)))
    for rng, norm, low, high in resonant_cases():
        first, count = int(rng.integers(1, 6)), 3 * math.ceil(norm.rho / low)
        blocks = np.sort(10.0 ** rng.uniform(-4.0, 0.0, table.block_maxima.size))[::-1]
        k = np.arange(first + 1.0, 2.0 * count + 1.0)
        index = np.log(k / (first + 1.0)) / math.log(harmonic_error.BLOCK_RATIO)
        sizes = blocks[np.floor(index + 1e-9).astype(int)]
        # The bound of high harmonics assumes that |cₖ| decreases as 1/k². Random blocks do not.
        far = k * low > harmonic_error.FAR_RATIO * norm.rho
        sizes = np.where(far, 0.0, sizes)
        zeros = np.zeros(first)
        blocks_only = table._replace(harmonics=zeros, tails=zeros, block_maxima=blocks)
        bound = harmonic_error._bound_harmonics(blocks_only, norm, low, high, False)
        error = np.zeros(X.size)
        for number, size in zip(k.tolist(), sizes.tolist(), strict=True):
            for sign in (1, -1):
                error += size * np.abs(harmonic_error_of(sign * number, norm, low, high))
        assert error.max() <= bound.max_error * (1.0 + ROUNDING) + 1e-15
        assert (error <= 4.0 * X * (1.0 - X) * bound.parabola * (1.0 + ROUNDING) + 1e-15).all()


def missing_vibration(rate, angle, ends, speeds, speed):
    """Return e^{λ₁τ/Ω} times a value that is linear in the cam speed Ω.

    This is the difference between a run from rest and the steady state, τ = `angle` (rad) after the
    start. `rate` is the eigenvalue λ₁, and `ends` are the linear value at the two `speeds`.
    """
    x = (speed - speeds[0]) / (speeds[1] - speeds[0])
    return np.exp(rate * angle / speed) * (ends[0] + x * (ends[1] - ends[0]))


def test_error_of_the_difference_from_steady_state():
    """Inequality (32) bounds the chord error of the difference from the steady state.

    The difference is that of a run from rest, τ rad after its start: e^{λ₁τ/Ω} times a value that
    is linear in the cam speed Ω.
    """
    closest = 0.0
    for seed, _, _, duration, low, on_law, motion in runs(4 * CASES):
        if duration is None or not harmonic_error.can_use_harmonics(on_law.mode, motion.norm):
            continue
        rng, norm = np.random.default_rng(seed), motion.norm
        high = low * (1.0 + 10.0 ** rng.uniform(-4.0, -1.0))
        factor = rng.uniform(0.5, 2.0)
        ends = motion.steady_start, StemVibration(*(factor * x for x in motion.steady_start))
        bound = bound_output(on_law, motion, ChordError(0.0, 0.0, 0.0), ends[1], high)
        m2, width = abs(on_law.mode.cam.acceleration), high - low
        direct = 0.25 * m2 * on_law.law.max_derivatives[2] * width**2
        rate = -norm.delta + 1j * norm.rho
        first, last = (v + (norm.delta + 1j * norm.rho) * eta for eta, v in ends)
        largest = 0.0
        for angle in high / norm.delta * 10.0 ** rng.uniform(-3.0, 1.0, 60):
            missing = partial(missing_vibration, rate, angle, (first, last), (low, high))
            largest = max(largest, np.abs(chord_errors(missing, low, high)).max())
        limit = (bound.max_error - direct) / norm.reach
        assert largest <= limit * (1.0 + ROUNDING) + 1e-13 * abs(first), seed
        closest = max(closest, largest / limit)
    assert closest > 0.3


def random_function(rng):
    """Return a random function of the position within a speed step, from 0 to 1.

    The result has both end values, the samples at 0, at `X` and at 1, and a bound of the second
    derivative.
    """
    a, b = rng.uniform(0.0, 1.0), rng.choice([1.0, -0.3]) * rng.uniform(0.0, 1.0)
    size, turns, phase = 10.0 ** rng.uniform(-2.0, 0.5), rng.uniform(0.5, 4.0), rng.uniform(0, TURN)

    def ripple(x):
        return np.sin(turns * x + phase) * size / turns**2

    x = np.concatenate([[0.0], X, [1.0]])
    values = a + (b - a) * x + ripple(x) - ripple(0.0) - x * (ripple(1.0) - ripple(0.0))
    return a, b, values, size


def test_steps_that_are_proven():
    """(33), (34) and (35) accept only speed steps without a missed lift-off.

    The inequalities are those of docs/proofs.md. A step is a range of the cam speed. In an accepted
    step a random function, in place of the smallest contact force, stays positive, or becomes
    negative once and stays so.
    """
    positive, negative_once = 0, 0
    for seed in range(200 * CASES):
        rng = np.random.default_rng(seed)
        a, b, values, curvature = random_function(rng)
        errors = a + (b - a) * X - values[1:-1]
        parabola = float((np.abs(errors) / (4.0 * X * (1.0 - X))).max())
        error = ChordError(float(np.abs(errors).max()), parabola, curvature / 8.0)
        is_proven, _ = _prove_by_harmonics(error, a, b)
        if is_proven and b > 0.0:
            assert values.min() >= -1e-3 * parabola
            positive += 1
        elif is_proven:
            negative = values <= 0.0
            assert (values[np.argmax(negative) :] <= 1e-12).all()
            negative_once += 1
    assert min(positive, negative_once) > 10 * CASES


def test_groups_that_are_proven():
    """(27), (33), (35) and (36) accept only groups without a missed lift-off.

    The inequalities are those of docs/proofs.md, and a group is several pieces of the law. In an
    accepted group the force P + V is never negative, or stays negative from one cam speed on.
    """
    proven, by_forced = 0, 0
    for seed in range(200 * CASES):
        rng = np.random.default_rng(seed)
        a, b, forced, forced_curvature = random_function(rng)
        size, turns = 10.0 ** rng.uniform(-2.0, 0.0), rng.uniform(0.5, 60.0)
        x = np.concatenate([[0.0], X, [1.0]])
        values = forced + size * np.sin(turns * x + rng.uniform(0.0, TURN))
        bounds = np.zeros(1, GROUP_ERROR)
        bounds["curvature"], bounds["vibration"] = forced_curvature + size * turns**2, size
        bounds["forced_curvature"] = forced_curvature
        ends = (np.array([x]) for x in (values[0], values[-1], a, b))
        if values[0] > 0.0 and _prove_by_groups(bounds, *ends, 1.0):
            negative = values < 0.0
            assert not negative.any() or (values[np.argmax(negative) :] <= 1e-12).all()
            proven += 1
            by_forced += bool(min(a, b) > size + forced_curvature / 8.0)
    assert min(proven, by_forced) > CASES


def test_parts_that_keep_a_rigid_mass_in_contact():
    """(37) discards only pieces of the law in which a rigid follower keeps contact.

    The inequality is that of docs/proofs.md. A piece is one polynomial of the law. In a discarded
    piece the force is not negative at any speed up to the known jump speed. Rounding of 1e-12 is
    allowed.
    """
    discarded = 0
    for seed in range(100 * CASES):
        rng = np.random.default_rng(seed)
        size, speed = int(rng.integers(2, 10)), 10.0 ** rng.uniform(0.0, 2.0)
        scale = np.array([1.0, 1.0 / speed, 1.0 / speed**2])[:, None]
        part = rng.standard_normal((3, size)) * scale * rng.uniform(0.0, 1.0, (3, 1))
        part[0] += rng.uniform(0.0, 2.0)
        follower = RigidMass(mass=1.0, damping=1.0, stiffness=1.0, preload=0.5)
        if not _may_pull(follower, part, speed):
            values = part @ bernstein.basis(size - 1, np.linspace(0.0, 1.0, 60)).T
            speeds = np.linspace(0.0, speed, 60)[:, None]
            force = values[2] * speeds**2 + values[1] * speeds + values[0] + follower.preload
            assert force.min() >= -1e-12
            discarded += 1
    assert discarded > CASES

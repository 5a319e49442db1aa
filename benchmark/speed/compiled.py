"""DOP853 with event location, compiled by numba, for problems of linear phases.

Python callbacks cost the other peers 4 to 5 µs per evaluation of the right-hand side. This peer
has none: the whole integration is one compiled function. It has the coefficients, the error
estimate, the step control and the dense output of scipy's DOP853.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from scipy.integrate import DOP853

from benchmark.speed.peers import ABSOLUTE
from benchmark.speed.problem import Arrival, Floats, PeerError, Problem
from cam_rig.units import FloatArray

#: Number of stages of a step, without those of the dense output.
STAGES = 12
#: Factors by which a step may shrink and grow, and the safety factor of its size.
MIN_FACTOR, MAX_FACTOR, SAFETY = 0.2, 10.0, 0.9
#: Number of bisections of the dense output for an event: to the last digit of the time.
BISECTIONS = 60


def integrate(  # noqa: PLR0912, PLR0915 - one compiled loop
    a: FloatArray,
    b: FloatArray,
    c: FloatArray,
    e3: FloatArray,
    e5: FloatArray,
    d: FloatArray,
    matrix: FloatArray,
    ends: FloatArray,
    middles: FloatArray,
    forces: FloatArray,
    guard: FloatArray,
    guard_forces: FloatArray,
    state: FloatArray,
    begin: float,
    end: float,
    times: FloatArray,
    rtol: float,
    atol: FloatArray,
    outputs: FloatArray,
) -> tuple[float, bool, int]:
    """Integrate from ``begin`` to ``end``, or to a falling zero of the guard.

    ``state`` is replaced by the final state, and ``outputs`` receives the states at ``times``. The
    result is the final time, True if the guard ended the integration, and the number of outputs.
    """
    size, half = state.size, state.size // 2
    stages = np.zeros((16, size))
    dense = np.zeros((7, size))
    work = np.empty(size)

    def rate(time, q, out):  # type: ignore[no-untyped-def]
        piece = 0
        while piece < ends.size - 1 and time >= ends[piece]:
            piece += 1
        x = time - middles[piece]
        for i in range(half):
            out[i] = q[half + i]
            total = 0.0
            for k in range(forces.shape[2] - 1, -1, -1):
                total = total * x + forces[piece, i, k]
            for j in range(size):
                total += matrix[half + i, j] * q[j]
            out[half + i] = total

    def guard_at(time, q):  # type: ignore[no-untyped-def]
        piece = 0
        while piece < ends.size - 1 and time >= ends[piece]:
            piece += 1
        x = time - middles[piece]
        total = 0.0
        for k in range(guard_forces.shape[1] - 1, -1, -1):
            total = total * x + guard_forces[piece, k]
        for j in range(size):
            total += guard[j] * q[j]
        return total

    def interpolate(x, old, out):  # type: ignore[no-untyped-def]
        for j in range(size):
            value = 0.0
            for k in range(7):
                value = (value + dense[6 - k, j]) * (x if k % 2 == 0 else 1.0 - x)
            out[j] = value + old[j]

    def compute_stages(first, last, time, old, step):  # type: ignore[no-untyped-def]
        for s in range(first, last):
            for j in range(size):
                total = 0.0
                for k in range(s):
                    total += a[s, k] * stages[k, j]
                work[j] = old[j] + step * total
            rate(time + c[s] * step, work, stages[s])

    time, written, has_guard = begin, 0, guard.size > 0
    rate(time, state, stages[0])
    scale = atol + rtol * np.abs(state)
    d0, d1 = np.sqrt(np.mean((state / scale) ** 2)), np.sqrt(np.mean((stages[0] / scale) ** 2))
    step = 1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
    new = np.empty(size)
    rejected = False
    while time < end:
        step = min(step, end - time)
        if step < 1e-15 * max(abs(time), end):
            break
        compute_stages(1, STAGES, time, state, step)
        for j in range(size):
            total = 0.0
            for k in range(STAGES):
                total += b[k] * stages[k, j]
            new[j] = state[j] + step * total
        rate(time + step, new, stages[STAGES])
        norm5 = norm3 = 0.0
        for j in range(size):
            weight = atol[j] + rtol * max(abs(state[j]), abs(new[j]))
            error5 = error3 = 0.0
            for k in range(STAGES + 1):
                error5 += e5[k] * stages[k, j]
                error3 += e3[k] * stages[k, j]
            norm5 += (error5 / weight) ** 2
            norm3 += (error3 / weight) ** 2
        denominator = norm5 + 0.01 * norm3
        error = 0.0 if denominator == 0.0 else step * norm5 / np.sqrt(denominator * size)
        if error >= 1.0:
            step *= max(MIN_FACTOR, SAFETY * error**-0.125)
            rejected = True
            continue
        factor = MAX_FACTOR if error == 0.0 else min(MAX_FACTOR, SAFETY * error**-0.125)
        factor = min(1.0, factor) if rejected else factor
        rejected = False
        stop, hit = time + step, False
        crosses = has_guard and guard_at(stop, new) < 0.0
        if crosses or (written < times.size and times[written] <= stop):
            compute_stages(STAGES + 1, 16, time, state, step)
            for j in range(size):
                change = new[j] - state[j]
                dense[0, j] = change
                dense[1, j] = step * stages[0, j] - change
                dense[2, j] = 2.0 * change - step * (stages[STAGES, j] + stages[0, j])
                for i in range(4):
                    total = 0.0
                    for k in range(16):
                        total += d[i, k] * stages[k, j]
                    dense[3 + i, j] = step * total
            if crosses:
                low, high = 0.0, 1.0
                for _ in range(BISECTIONS):
                    middle = 0.5 * (low + high)
                    interpolate(middle, state, work)
                    if guard_at(time + middle * step, work) < 0.0:
                        high = middle
                    else:
                        low = middle
                stop, hit = time + high * step, True
            while written < times.size and times[written] <= stop:
                interpolate((times[written] - time) / step, state, outputs[:, written])
                written += 1
            if hit:
                interpolate((stop - time) / step, state, work)
                state[:] = work
                return stop, True, written
        time, state[:] = stop, new
        stages[0] = stages[STAGES]
        step *= factor
    return time, False, written


@cache
def kernel() -> Any:
    """Return `integrate`, compiled by numba."""
    import numba

    return numba.njit(cache=True)(integrate)


@cache
def compile_all() -> None:
    """Compile `integrate`, by a step of the equation q̈ = 0, so that no measured run contains it."""
    one = np.ones(1)
    arrays = np.zeros((2, 2)), one, one, np.zeros((1, 1, 1)), np.zeros(0), np.zeros((1, 1))
    outputs = np.empty((2, 1))
    kernel()(*tableau(), *arrays, np.zeros(2), 0.0, 1.0, 0.5 * one, 1e-3, np.full(2, 1e-3), outputs)


@cache
def tableau() -> tuple[FloatArray, ...]:
    """Return A (16, 16), B, C (16,), E3, E5 and D of DOP853, with the stages of its dense output.

    Row 12 of A is empty: stage 12 is the rate at the end of the step.
    """
    a, c = np.zeros((16, 16)), np.ones(16)
    a[:STAGES, :STAGES], c[:STAGES] = DOP853.A, DOP853.C
    a[STAGES + 1 :], c[STAGES + 1 :] = DOP853.A_EXTRA, DOP853.C_EXTRA
    return a, DOP853.B, c, DOP853.E3, DOP853.E5, DOP853.D


@dataclass(frozen=True)
class CompiledPeer:
    """Compiled DOP853 with a relative tolerance."""

    method: str
    rtol: float

    def __call__(
        self, problem: Problem, state: Floats, begin: float, end: float, times: FloatArray
    ) -> Arrival:
        """Integrate; see `benchmark.speed.problem.Integrator`."""
        system = problem.linear
        if system is None:
            raise PeerError("only linear phases are compiled")
        final, outputs = np.array(state, dtype=float), np.empty((len(state), times.size))
        stop, hit, count = kernel()(
            *tableau(),
            *system,
            final,
            begin,
            end,
            times,
            self.rtol,
            ABSOLUTE * self.rtol * problem.scale,
            outputs,
        )
        return Arrival(float(stop), final.tolist(), outputs[:, :count], bool(hit))

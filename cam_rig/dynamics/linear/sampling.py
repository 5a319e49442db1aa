"""Uniform samples of a linear model, as matrix products.

A run of samples inside one part is cut into chunks. In each the polynomial is its Taylor series
about the chunk's middle, and the exponential starts anew from the chunk's first sample; one
product with a fixed matrix (powers, and the exponential over a chunk) gives all samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics.linear.matrix_exponential import free_grid, free_motion
from cam_rig.dynamics.linear.response import LinearResponse, LinearRun, Part
from cam_rig.dynamics.linear.scipy_linalg import expm
from cam_rig.laws import bernstein
from cam_rig.laws.sampling import CHUNK, MIDDLE, WIDEST_CHUNK, chunk_powers, samples_before


@dataclass(frozen=True, eq=False)
class Outputs:
    """What to sample: C x + D (s, ṡ, s̈) + d; ``(k, n)``, ``(k, 3)``, ``(k,)``."""

    state: FloatArray
    law: FloatArray
    constant: FloatArray


def outputs_at(
    model: LinearResponse, start: FloatArray, angle: float, times: FloatArray, outputs: Outputs
) -> FloatArray:
    """Outputs ``(k, m)`` at ascending times ``(m,)`` in s after ``start`` at ``angle`` (rad).

    State and law are of one part, also where by rounding a time is beside a joint.
    """
    free, local, part_of = model.passes(start, angle, times)
    out = np.asarray(outputs.state @ free)
    for i in np.unique(part_of):
        here = np.flatnonzero(part_of == i)
        ordinates = polynomial_part(model, model.parts[i], outputs)
        out[:, here] += bernstein.evaluate(ordinates.T, local[here] / model.parts[i].length).T
    return out


def end_of(
    model: LinearResponse, start: FloatArray, angle: float, duration: float, outputs: Outputs
) -> tuple[FloatArray, FloatArray]:
    """State ``(n,)`` and outputs ``(k,)`` after ``duration`` s."""
    start, angle, rest = model.last_turn(start, angle, duration)
    free, local, part_of = model.passes(start, angle, np.array([rest]))
    part = model.parts[int(part_of[0])]
    ordinates = polynomial_part(model, part, outputs)
    u = bernstein.basis(ordinates.shape[1] - 1, local / part.length)[0]
    state = free[:, 0] + part.forced(local)[:, 0]
    return state, np.asarray(outputs.state @ free[:, 0] + ordinates @ u)


def sample(
    model: LinearResponse,
    start: FloatArray,
    angle: float,
    first: float,
    step: float,
    count: int,
    outputs: Outputs,
) -> FloatArray:
    """Outputs ``(k, count)`` at ``first + j step`` s after ``start`` at cam angle ``angle``."""
    out = np.empty((outputs.state.shape[0], count))
    done = 0
    for run in model.walk(start, angle, first + count * step):
        end = min(count, max(done, samples_before((run.end - first) / step)))
        if end > done:
            offset = first + done * step - run.begin
            _fill(model, run, offset, step, outputs, out[:, done:end])
            done = end
    return out


@lru_cache(maxsize=64)
def polynomial_parts(model: LinearResponse, outputs: Outputs) -> tuple[FloatArray, ...]:
    """Ordinates ``(k, p + 1)`` of the outputs' polynomial in every part; those alike together."""
    weights = outputs.law * model.speed ** np.arange(3)
    motion = np.tensordot(weights, model.law.motion, axes=1)
    groups: dict[tuple[int, int, int], list[Part]] = {}
    for part in model.parts:
        groups.setdefault((*part.of_piece, part.particular.shape[1]), []).append(part)
    found: dict[int, FloatArray] = {}
    for (i, count, width), parts in groups.items():
        of_law = motion[:, :, [part.law_piece for part in parts]].transpose(1, 0, 2)
        flat = bernstein.restrict(of_law.reshape(len(of_law), -1), i / count, (i + 1) / count)
        of_law = bernstein.elevate(flat, width - 1).reshape(width, -1, len(parts))
        of_state = outputs.state @ np.stack([part.particular for part in parts])
        ordinates = of_law.transpose(2, 1, 0) + of_state + outputs.constant[:, None]
        found.update((part.number, rows) for part, rows in zip(parts, ordinates, strict=True))
    return tuple(found[part.number] for part in model.parts)


def polynomial_part(model: LinearResponse, part: Part, outputs: Outputs) -> FloatArray:
    """Ordinates ``(k, p + 1)`` of the outputs' polynomial in a part."""
    return polynomial_parts(model, outputs)[part.number]


@lru_cache(maxsize=4096)
def _taylor_part(model: LinearResponse, part: Part, outputs: Outputs) -> FloatArray:
    """What takes basis values in a part to the Taylor series there, ``(k, p + 1, p + 1)``."""
    return bernstein.taylor(polynomial_part(model, part, outputs).T)


@lru_cache(maxsize=256)
def _chunk(
    model: LinearResponse, outputs: Outputs, degree: int, step: float
) -> tuple[FloatArray, FloatArray]:
    """``(k, p + 1 + n, CHUNK)``: powers and outputs of e^{At} over a chunk; and e^{At} after it."""
    n = outputs.state.shape[1]
    flows = np.stack(
        [
            free_motion(model.matrix, unit, step * np.arange(CHUNK, dtype=np.float64))
            for unit in np.eye(n)
        ]
    )
    over = [
        np.vstack([chunk_powers(degree), np.tensordot(flows, row, axes=([1], [0]))])
        for row in outputs.state
    ]
    return np.stack(over), expm(model.matrix * (step * CHUNK))


def _fill(
    model: LinearResponse,
    run: LinearRun,
    offset: float,
    step: float,
    outputs: Outputs,
    out: FloatArray,
) -> None:
    part, count = run.part, out.shape[1]
    ordinates = polynomial_part(model, part, outputs)
    free = free_motion(model.matrix, run.free, np.array([offset]))[:, 0]
    first, width = (run.local + offset) / part.length, step / part.length
    if count < 2 * CHUNK or width * CHUNK > WIDEST_CHUNK:
        at = bernstein.basis(
            ordinates.shape[1] - 1, first + width * np.arange(count, dtype=np.float64)
        )
        out[:] = ordinates @ at.T
        out += outputs.state @ free_motion(
            model.matrix, free, step * np.arange(count, dtype=np.float64)
        )
        return
    degree, chunks, full = ordinates.shape[1] - 1, -(-count // CHUNK), count // CHUNK
    middles = first + width * CHUNK * (np.arange(chunks, dtype=np.float64) + MIDDLE)
    scale = (0.5 * width * (CHUNK - 1)) ** np.arange(degree + 1)
    series = np.matmul(bernstein.basis(degree, middles), _taylor_part(model, part, outputs) * scale)
    samples, flow = _chunk(model, outputs, degree, step)
    starts = free_grid(flow, free, chunks).T
    for row, terms, over in zip(out, series, samples, strict=True):
        both = np.hstack([terms, starts])
        np.matmul(both[:full], over, out=row[: full * CHUNK].reshape(full, CHUNK))
        if chunks > full:
            row[full * CHUNK :] = (both[full] @ over)[: count - full * CHUNK]

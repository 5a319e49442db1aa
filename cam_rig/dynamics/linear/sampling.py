"""Uniform samples of a linear model, as matrix products.

A run of samples inside one part is cut into chunks. In each the polynomial is its Taylor series
about the chunk's middle, and the exponential starts anew from the chunk's first sample; one
product with a fixed matrix (powers, and the exponential over a chunk) gives all samples, straight
where they belong. What is needed for each chunk is made for all turns of a part together.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from cam_rig.dynamics.linear.exponential import free_motion
from cam_rig.dynamics.linear.propagator import exponentials
from cam_rig.dynamics.linear.response import LinearResponse, Part
from cam_rig.dynamics.parameters import require_angle
from cam_rig.laws import bernstein
from cam_rig.laws.sampling import (
    ChunkSeries,
    SampleRun,
    chunk_powers,
    fill_in_chunks,
    repeated,
    samples_before,
)
from cam_rig.units import FloatArray


@dataclass(frozen=True, eq=False)
class Outputs:
    """What to sample: C x + D (s, ṡ, s̈) + d."""

    state: FloatArray  #: C, ``(k, n)``
    law: FloatArray  #: D, ``(k, 3)``
    constant: FloatArray  #: d, ``(k,)``


def end_of(
    model: LinearResponse, start: FloatArray, angle: float, duration: float, outputs: Outputs
) -> tuple[FloatArray, FloatArray]:
    """State ``(n,)`` and outputs ``(k,)`` after ``duration`` s."""
    start, angle, rest = model.last_turn(start, angle, duration)
    require_angle(angle + model.speed * rest, "angle at the end")
    *_, run = model.walk(start, angle, np.nextafter(rest, np.inf))
    since = np.array([rest - run.begin])
    free = free_motion(model.matrix, run.free, since)[:, 0]
    local = run.local + since
    ordinates = polynomial_part(model, run.part, outputs)
    u = bernstein.basis(ordinates.shape[1] - 1, local / run.part.length)[0]
    return free + run.part.forced(local)[:, 0], np.asarray(outputs.state @ free + ordinates @ u)


def sample(
    model: LinearResponse,
    start: FloatArray,
    angle: float,
    first: float,
    step: float,
    count: int,
    outputs: Outputs,
    out: FloatArray | None = None,
) -> FloatArray:
    """Outputs ``(k, count)``, into ``out`` if given, at ``first + j step`` s after ``start``."""
    out = np.empty((outputs.state.shape[0], count)) if out is None else out
    done = 0
    long: dict[tuple[int, int, int], list[_Passage]] = {}
    for run in model.walk(start, angle, first + count * step):
        end = min(count, max(done, samples_before((run.end - first) / step)))
        if end > done:
            offset = first + done * step - run.begin
            part = run.part
            place, width = (run.local + offset) / part.length, step / part.length
            samples = SampleRun.of(done, end, place, width)
            passage = _Passage(samples, offset, run.free)
            if samples.chunk:
                alike = (part.number, samples.chunk, samples.chunks)
                long.setdefault(alike, []).append(passage)
            else:
                _fill_directly(model, part, passage, step, outputs, out[:, done:end])
            done = end
    for (number, _, _), passages in long.items():
        _fill_in_chunks(model, model.parts[number], passages, step, outputs, out)
    return out


class _Passage(NamedTuple):
    """Samples of one part as it is passed."""

    samples: SampleRun
    offset: float  #: of the first from the state, s
    free: FloatArray  #: the state less X


def _fill_directly(
    model: LinearResponse,
    part: Part,
    passage: _Passage,
    step: float,
    outputs: Outputs,
    out: FloatArray,
) -> None:
    ordinates = polynomial_part(model, part, outputs)
    at = bernstein.basis(ordinates.shape[1] - 1, passage.samples.at())
    times = passage.offset + step * np.arange(out.shape[1], dtype=np.float64)
    np.matmul(ordinates, at.T, out=out)
    out += outputs.state @ free_motion(model.matrix, passage.free, times)


def _fill_in_chunks(
    model: LinearResponse,
    part: Part,
    passages: list[_Passage],
    step: float,
    outputs: Outputs,
    out: FloatArray,
) -> None:
    chunk = passages[0].samples.chunk
    series = _part_series(model, part, outputs, step, chunk)
    over = _chunk(model, outputs, series.powers.shape[0], step, chunk)
    states = np.stack([passage.free for passage in passages], axis=1)
    states = free_motion(model.matrix, states, np.array([passage.offset for passage in passages]))
    trains = repeated([passage.samples for passage in passages])
    polynomial = series.at([train[0] for train in trains])
    rows, _, powers = polynomial.shape
    chunks = passages[0].samples.chunks  # of each: the chunks of all passages are made at once
    polynomial = polynomial.reshape(rows, len(trains), chunks, powers)
    if len(trains) > 1:
        polynomial = np.repeat(polynomial, [len(train) for train in trains], axis=1)
    terms = np.empty((rows, len(passages), chunks, over.shape[1]))
    terms[..., :powers] = polynomial
    terms[..., powers:] = (_chunk_flows(model, step * chunk, chunks) @ states).transpose(2, 0, 1)
    done = 0
    for train in trains:
        fill_in_chunks(train, terms[:, done : done + len(train)], over, out)
        done += len(train)


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
def _part_series(
    model: LinearResponse, part: Part, outputs: Outputs, step: float, chunk: int
) -> ChunkSeries:
    """The series of the outputs' polynomial about the middle of a chunk in a part."""
    taylor = bernstein.taylor(polynomial_part(model, part, outputs).T)
    return ChunkSeries.of(taylor, step / part.length, chunk)


@lru_cache(maxsize=256)
def _chunk(
    model: LinearResponse, outputs: Outputs, powers: int, step: float, chunk: int
) -> FloatArray:
    """``(k, powers + n, chunk)``: powers of the abscissa and outputs of e^{At} over a chunk."""
    flows = exponentials(model.matrix, step * np.arange(chunk, dtype=np.float64))
    of_state = np.einsum("kn,cnj->kjc", outputs.state, flows)
    abscissa = np.broadcast_to(chunk_powers(powers - 1, chunk), (len(of_state), powers, chunk))
    return np.concatenate([abscissa, of_state], axis=1)


@lru_cache(maxsize=256)
def _chunk_flows(model: LinearResponse, apart: float, count: int) -> FloatArray:
    """E^{At} at times ``apart`` s from 0 on, ``(count, n, n)``."""
    return exponentials(model.matrix, apart * np.arange(count, dtype=np.float64))

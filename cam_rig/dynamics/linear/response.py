"""A linear model on a turning cam: its exact response at any time, turn after turn.

ẋ = A x + G (s, ṡ, s̈) + g, at constant cam speed. The particular solutions of one turn are found
once (`propagator`); after that a state is a polynomial and an exponential.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics.linear.exponential import free_motion
from cam_rig.dynamics.linear.propagator import exponential, exponentials, pieces
from cam_rig.dynamics.parameters import (
    require_angle,
    require_number,
    require_turning,
    state_of,
    times_of,
)
from cam_rig.dynamics.velocity_jumps import JOINT_SLACK
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law, bernstein
from cam_rig.laws.sampling import (
    ChunkSeries,
    SampleRun,
    chunk_powers,
    fill_in_chunks,
    repeated,
    samples_before,
)
from cam_rig.units import TURN, FloatArray, to_rpm

#: A mode that a turn changes by less than this (in phase and size) is in resonance.
RESONANT = 1e-11


@dataclass(frozen=True, eq=False)
class TurnMap:
    """What one turn from θ = 0 makes of a state: Φ x + r."""

    flow: FloatArray  #: Φ, ``(n, n)``
    rest: FloatArray  #: r, ``(n,)``

    def after(self, state: FloatArray, turns: int) -> FloatArray:
        """The state ``(n,)`` after whole turns: as many products as their number has bits."""
        flow, rest = self.flow, self.rest
        while turns:
            if turns % 2:
                state = flow @ state + rest
            rest, flow, turns = flow @ rest + rest, flow @ flow, turns // 2
        return state

    def fixed_point(self) -> FloatArray | None:
        """The state that a turn brings back, by one linear solve; None at resonance."""
        gap = np.eye(self.rest.size) - self.flow
        if np.abs(np.linalg.eigvals(gap)).min() < RESONANT:
            return None
        return np.asarray(np.linalg.solve(gap, self.rest))


@dataclass(frozen=True, eq=False)
class Part:
    """A stretch of the turn with one polynomial X: x(t) = X + e^{At} z."""

    number: int  #: in the turn
    low: float  #: cam angle where it begins, rad
    span: float  #: rad
    length: float  #: s
    law_piece: int
    of_piece: tuple[int, int]  #: which part of how many of the law's piece
    particular: FloatArray  #: X, ``(n, p + 1)``
    flow: FloatArray  #: e^{Ah} over the part
    state_jump: FloatArray | None = None  #: by how much the state jumps where it begins

    def forced(self, time: FloatArray) -> FloatArray:
        """X at times in s since the part's start, ``(n, len(time))``."""
        return bernstein.evaluate(self.particular.T, time / self.length).T


class LinearRun(NamedTuple):
    """A part as it is passed."""

    part: Part
    begin: float  #: s since the walk's start
    end: float  #: s
    local: float  #: where in the part it begins, s
    free: FloatArray  #: the state there, less X


@dataclass(frozen=True, eq=False)
class LinearResponse:
    """The response of one linear model to one law at one speed."""

    law: Law
    speed: float  #: rad/s, above 0
    matrix: FloatArray  #: A, ``(n, n)``
    drive: FloatArray  #: G, ``(n, 3)``, what s, ṡ and s̈ contribute
    constant: FloatArray  #: g, ``(n,)``
    #: whether a jump of ṡ, an impulse of s̈, acts on the state; else the caller does it
    jumps_act: bool = False

    def __post_init__(self) -> None:
        require_turning(self.speed)
        object.__setattr__(self, "speed", float(self.speed))

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """The parts of one turn in order."""
        weights = self.drive * self.speed ** np.arange(3)
        forcing = np.tensordot(weights, self.law.motion, axes=1) + self.constant[:, None, None]
        steps = self.law.velocity_jumps if self.jumps_act else {}
        found: list[Part] = []
        spans = self.law.spans.tolist()
        for i, solved in enumerate(pieces(self.matrix, forcing, self.law.spans / self.speed)):
            count = solved.particular.shape[0]
            for k in range(count):
                low, span = self.law.joints[i] + spans[i] * (k / count), spans[i] / count
                x, flow, state_jump = solved.particular[k], solved.part_flow, None
                if k == 0 and i in steps:  # what an impulse of s̈ adds to the state
                    state_jump = self.drive[:, 2] * (self.speed * steps[i])
                found.append(
                    Part(len(found), low, span, solved.part, i, (k, count), x, flow, state_jump)
                )
        return tuple(found)

    def walk(self, start: FloatArray, angle: float, duration: float) -> Iterator[LinearRun]:
        """Run after run for ``duration`` s, with a state jump at the start, none at the end."""
        start = state_of(start, self.constant.size)
        require_angle(angle)
        slack = JOINT_SLACK / self.speed if self.law.repeats else 0.0
        inside = angle - math.floor(angle / TURN) * TURN
        i = bisect_right(self.parts, inside, key=lambda part: part.low) - 1
        now, state, local = 0.0, start, (inside - self.parts[i].low) / self.speed
        while now < duration:
            part = self.parts[i % len(self.parts)]
            low = part.low + (i // len(self.parts)) * TURN
            end = max(now, (low + part.span - inside) / self.speed)
            if part.state_jump is not None and (now > 0.0 or slack - duration < local <= slack):
                state = state + part.state_jump
            if (
                duration - end <= slack
                and self.parts[(i + 1) % len(self.parts)].state_jump is not None
            ):
                end = max(end, duration)
            at = part.forced(np.array([local]))[:, 0] if local > 0.0 else part.particular[:, 0]
            free = state - at
            yield LinearRun(part, now, min(end, duration), local, free)
            if end >= duration:
                return
            # A part's own length, not end - now: the rounding of a late time would turn the phase.
            flow = part.flow if local == 0.0 else exponential(self.matrix, part.length - local)
            state = part.particular[:, -1] + flow @ free
            now, i, local = end, i + 1, 0.0

    def states(self, start: FloatArray, angle: float, times: FloatArray) -> FloatArray:
        """States ``(n, len(times))`` at ascending times in s since ``angle``."""
        out, local, part_of = self.passes(start, angle, times)
        for i in np.unique(part_of):
            here = np.flatnonzero(part_of == i)
            out[:, here] += self.parts[i].forced(local[here])
        return out

    def passes(
        self, start: FloatArray, angle: float, times: FloatArray
    ) -> tuple[FloatArray, FloatArray, NDArray[np.intp]]:
        """States less X ``(n, m)``, times in their parts (s) and these parts' numbers, ``(m,)``."""
        times = times_of(times)
        last = float(times[-1]) if times.size else 0.0
        require_angle(angle)
        require_angle(angle + self.speed * last, "angle at the last time")
        runs = list(self.walk(start, angle, np.nextafter(last, np.inf)))
        begins = np.array([run.begin for run in runs])
        run_of = np.searchsorted(begins, times, side="right") - 1
        since = times - begins[run_of]
        free = np.stack([run.free for run in runs], axis=1)[:, run_of]
        local = np.array([run.local for run in runs])[run_of] + since
        part_of = (run_of + runs[0].part.number) % len(self.parts)
        return free_motion(self.matrix, free, since), local, part_of

    def end(self, start: FloatArray, angle: float, duration: float) -> FloatArray:
        """State ``(n,)`` after ``duration`` s; many turns cost no more than one."""
        start, angle, rest = self.last_turn(start, angle, duration)
        return self.states(start, angle, np.array([rest]))[:, 0]

    def last_turn(
        self, start: FloatArray, angle: float, duration: float
    ) -> tuple[FloatArray, float, float]:
        """State, angle (rad) and what is left of ``duration`` (s) after all whole turns but one."""
        require_angle(angle)
        require_number("duration", duration, "≥ 0")
        first = math.ceil(angle / TURN)
        # Not up to a state jump at the very end, which is the next interval's.
        spare = 0.0 if self.parts[0].state_jump is None else 2.0 * JOINT_SLACK
        whole = math.floor((angle + self.speed * duration - spare) / TURN) - first
        if whole <= 1:
            return start, angle, duration
        before = max(0.0, (first * TURN - angle) / self.speed)
        start = self.end(start, angle, before) if before > 0.0 else start
        start = self.turn.after(start, whole)
        return start, 0.0, max(0.0, duration - before - whole * (TURN / self.speed))

    @cached_property
    def turn(self) -> TurnMap:
        """What one turn from θ = 0 does to the state."""
        return self._maps[-1]

    @cached_property
    def _maps(self) -> list[TurnMap]:
        """What the turn has done to the state where each part begins, and at its end."""
        flow, rest = np.eye(self.constant.size), np.zeros(self.constant.size)
        found = []
        for part in self.parts:
            rest = rest if part.state_jump is None else rest + part.state_jump
            found.append(TurnMap(flow, rest))
            rest = part.particular[:, -1] + part.flow @ (rest - part.particular[:, 0])
            flow = part.flow @ flow
        return [*found, TurnMap(flow, rest)]

    def free_starts(self, start: FloatArray, turns: int) -> FloatArray:
        """States less X where each part of each turn begins, ``(turns, parts, n)``, from θ = 0."""
        states = [start]
        for _ in range(1, turns):
            states.append(self.turn.after(states[-1], 1))
        flows = np.stack([found.flow for found in self._maps[:-1]])
        rests = np.stack([found.rest for found in self._maps[:-1]])
        forced = np.stack([part.particular[:, 0] for part in self.parts])
        return np.asarray(np.einsum("pij,tj->tpi", flows, np.stack(states)) + (rests - forced))

    def periodic(self) -> FloatArray:
        """The state at θ = 0, before a jump there, that a turn brings back: one linear solve."""
        state = self.turn.fixed_point()
        if state is None:
            raise no_steady_state(self.speed)
        return state


def no_steady_state(speed: float) -> DynamicsError:
    """What is raised at a speed (rad/s) where a mode without damping is in resonance."""
    return DynamicsError(
        f"no steady state at {to_rpm(speed):.6g} rpm: a mode without damping is at a harmonic of "
        "the speed; allowed: damping, or another speed"
    )


# Uniform samples, as matrix products.
#
# A run of samples inside one part is cut into chunks. In each the polynomial is its Taylor series
# about the chunk's middle, and the exponential starts anew from the chunk's first sample; one
# product with a fixed matrix (powers, and the exponential over a chunk) gives all samples, straight
# where they belong. What is needed for each chunk is made for all turns of a part together.


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

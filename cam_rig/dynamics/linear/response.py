"""Exact response of a linear model on a cam at constant speed, at any time.

The model is ẋ = A x + G (s, ṡ, s̈) + g with the cam motion s(t). A turn of the cam is divided into
parts. In each part the state is x(t) = X(t) + e^{At} z, with a polynomial X, the forced response,
and a free vibration. The polynomials of one turn are computed once (`propagator`).
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
    check_state,
    check_times,
    require_angle,
    require_number,
    require_turning,
)
from cam_rig.dynamics.velocity_jumps import JOINT_ATOL_RAD
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law, bernstein
from cam_rig.laws.sampling import (
    ChunkSeries,
    SampleRun,
    chunk_powers,
    fill_in_chunks,
    group_repeated_runs,
    samples_before,
)
from cam_rig.units import TURN, FloatArray, to_rpm

#: Smallest |eigenvalue| of I − Φ at which a steady state exists. Φ is the matrix from the state
#: before a turn to that after it. With a smaller eigenvalue a turn hardly changes a mode in phase
#: or size, because the mode is in resonance.
MIN_EIGENVALUE = 1e-11


@dataclass(frozen=True, eq=False)
class TurnMap:
    """Affine map Φ x + r from a state x at cam angle 0 to the state after one turn."""

    flow: FloatArray  #: matrix Φ, ``(n, n)``
    offset: FloatArray  #: vector r, ``(n,)``

    def after(self, state: FloatArray, turns: int) -> FloatArray:
        """Return the state after ``turns`` whole turns, ``(n,)``.

        The number of matrix products is the number of bits of ``turns``.
        """
        flow, offset = self.flow, self.offset
        while turns:
            if turns % 2:
                state = flow @ state + offset
            offset, flow, turns = flow @ offset + offset, flow @ flow, turns // 2
        return state

    def fixed_point(self) -> FloatArray | None:
        """Return the state that repeats after one turn, ``(n,)``, or None at resonance."""
        matrix = np.eye(self.offset.size) - self.flow
        if np.abs(np.linalg.eigvals(matrix)).min() < MIN_EIGENVALUE:
            return None
        return np.asarray(np.linalg.solve(matrix, self.offset))


@dataclass(frozen=True, eq=False)
class Part:
    """Part of a turn of the cam, with the polynomial forced response X(t) in it.

    The part lies in one polynomial piece of the law. The state in it is x(t) = X(t) + e^{At} z.
    """

    number: int  #: index of the part in the turn
    low: float  #: cam angle at the start of the part, rad
    span: float  #: cam angle that the part covers, rad
    length: float  #: duration h of the part, s
    law_piece: int  #: index of the piece of the law that contains the part
    of_piece: tuple[int, int]  #: index of the part in its piece, and number of parts of the piece
    particular: FloatArray  #: Bernstein ordinates of X, ``(n, p + 1)``
    flow: FloatArray  #: matrix e^{Ah} of the free vibration over the part, ``(n, n)``
    #: Jump of the state at the start of the part by a velocity jump of the law, ``(n,)``, or None.
    state_jump: FloatArray | None = None

    def forced(self, time: FloatArray) -> FloatArray:
        """Return the forced response X at times (s) since the start of the part.

        The shape is ``(n, len(time))``.
        """
        return bernstein.evaluate(self.particular.T, time / self.length).T


class LinearRun(NamedTuple):
    """Passage of the cam through one part of its turn, with the response of the model.

    `LinearResponse.walk` yields the passages in the order of time.
    """

    part: Part  #: part of the turn
    begin: float  #: time at which the passage starts, since the start of the walk, s
    end: float  #: time at which the passage ends, since the start of the walk, s
    local: float  #: time from the start of the part to the start of the passage, s
    free: FloatArray  #: free vibration x − X at the start of the passage, ``(n,)``


@dataclass(frozen=True, eq=False)
class LinearResponse:
    """Response of a linear model with n states to one law of a cam at one speed.

    The model is ẋ = A x + G (s, ṡ, s̈) + g.
    """

    law: Law  #: motion law of the cam
    speed: float  #: cam speed, rad/s, > 0
    matrix: FloatArray  #: A, weights of the states x in ẋ, ``(n, n)``
    drive: FloatArray  #: G, weights of s, ṡ and s̈ in ẋ, ``(n, 3)``
    constant: FloatArray  #: g, constant terms in ẋ, ``(n,)``
    #: True if a velocity jump of the law, an impulse of s̈, acts on the states of the model. If
    #: False, the caller handles the velocity jumps.
    jumps_act: bool = False

    def __post_init__(self) -> None:
        require_turning(self.speed)
        object.__setattr__(self, "speed", float(self.speed))

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Parts of one turn of the cam, in the order of the angle."""
        weights = self.drive * self.speed ** np.arange(3)
        forcing = np.tensordot(weights, self.law.motion, axes=1) + self.constant[:, None, None]
        steps = self.law.velocity_jumps if self.jumps_act else {}
        parts: list[Part] = []
        spans = self.law.spans.tolist()
        for i, solved in enumerate(pieces(self.matrix, forcing, self.law.spans / self.speed)):
            count = solved.particular.shape[0]
            for k in range(count):
                low, span = self.law.joints[i] + spans[i] * (k / count), spans[i] / count
                x, flow, state_jump = solved.particular[k], solved.part_flow, None
                if k == 0 and i in steps:  # the velocity jump is an impulse of s̈
                    state_jump = self.drive[:, 2] * (self.speed * steps[i])
                parts.append(
                    Part(len(parts), low, span, solved.part, i, (k, count), x, flow, state_jump)
                )
        return tuple(parts)

    def walk(self, start: FloatArray, angle: float, duration: float) -> Iterator[LinearRun]:
        """Yield the passages of the cam through parts of the turn, in the order of time.

        They start in the state ``start`` at ``angle`` (rad) and take ``duration`` s. A jump of the
        state at the start is applied, and a jump at the end is not.
        """
        start = check_state(start, self.constant.size)
        require_angle(angle)
        slack = self._slack
        inside = angle - math.floor(angle / TURN) * TURN
        i = bisect_right(self.parts, inside, key=lambda part: part.low) - 1
        time, state, local = 0.0, start, (inside - self.parts[i].low) / self.speed
        while time < duration:
            part = self.parts[i % len(self.parts)]
            low = part.low + (i // len(self.parts)) * TURN
            end = max(time, (low + part.span - inside) / self.speed)
            if part.state_jump is not None and (time > 0.0 or slack - duration < local <= slack):
                state = state + part.state_jump
            if (
                duration - end <= slack
                and self.parts[(i + 1) % len(self.parts)].state_jump is not None
            ):
                end = max(end, duration)
            x = part.forced(np.array([local]))[:, 0] if local > 0.0 else part.particular[:, 0]
            free = state - x
            yield LinearRun(part, time, min(end, duration), local, free)
            if end >= duration:
                return
            # Use the stored duration of the part, because the rounding of end - time at a late time
            # would change the phase of the vibration.
            flow = part.flow if local == 0.0 else exponential(self.matrix, part.length - local)
            state = part.particular[:, -1] + flow @ free
            time, i, local = end, i + 1, 0.0

    def states(self, start: FloatArray, angle: float, times: FloatArray) -> FloatArray:
        """Return the states of the model at ascending times (s), ``(n, len(times))``.

        Times are measured from the state ``start`` at the cam angle ``angle`` (rad).
        """
        out, local, part_of = self.passes(start, angle, times)
        for i in np.unique(part_of):
            in_part = np.flatnonzero(part_of == i)
            out[:, in_part] += self.parts[i].forced(local[in_part])
        return out

    def passes(
        self, start: FloatArray, angle: float, times: FloatArray
    ) -> tuple[FloatArray, FloatArray, NDArray[np.intp]]:
        """Return the free vibration and the part of the turn at m ascending times (s).

        Times are measured from the state ``start`` at the cam angle ``angle`` (rad). The results
        are the free vibrations x − X, ``(n, m)``, the times since the start of the part (s),
        ``(m,)``, and the indices of the parts, ``(m,)``.
        """
        times = check_times(times)
        last = float(times[-1]) if times.size else 0.0
        require_angle(angle)
        require_angle(angle + self.speed * last, "angle at the last time")
        begins, first_local, free, parts = self._passages(start, angle, np.nextafter(last, np.inf))
        run = np.searchsorted(begins, times, side="right") - 1
        since = times - begins[run]
        local = since + np.where(run == 0, first_local, 0.0)
        return free_motion(self.matrix, free[:, run], since), local, parts[run]

    def _passages(
        self, start: FloatArray, angle: float, duration: float
    ) -> tuple[FloatArray, float, FloatArray, NDArray[np.intp]]:
        """Return the passages of `walk` as arrays.

        The results are their starts (s), ``(m,)``, the time (s) from the start of the first part to
        the first passage, the free vibrations at the starts, ``(n, m)``, and the indices of the
        parts, ``(m,)``. The passages after the first turn are computed together.
        """
        inside = angle - math.floor(angle / TURN) * TURN
        first_turn = (self.parts[-1].low + self.parts[-1].span - inside) / self.speed
        runs = list(self.walk(start, angle, min(duration, first_turn)))
        begins = np.array([run.begin for run in runs])
        free = np.stack([run.free for run in runs], axis=1)
        numbers = np.array([run.part.number for run in runs])
        if duration > first_turn:
            part = runs[-1].part
            flow = exponential(self.matrix, part.length - runs[-1].local)
            turns = math.ceil((duration - first_turn) * self.speed / TURN)
            later = self.free_starts(part.particular[:, -1] + flow @ runs[-1].free, turns)
            lows = np.array([part.low for part in self.parts]) - inside
            times = (TURN * np.arange(1.0, turns + 1.0)[:, None] + lows).ravel() / self.speed
            count = int(np.searchsorted(times, duration))
            is_jump = self.parts[(count - 1) % len(self.parts)].state_jump is not None
            if count and is_jump and duration - times[count - 1] <= self._slack:
                count -= 1  # a jump at the end belongs to the next interval
            begins = np.append(begins, times[:count])
            free = np.concatenate([free, later.reshape(-1, len(free))[:count].T], axis=1)
            numbers = np.append(numbers, np.arange(count) % len(self.parts))
        return begins, runs[0].local, free, numbers

    @property
    def _slack(self) -> float:
        """Largest rounding error (s) of the time of a velocity jump."""
        return JOINT_ATOL_RAD / self.speed if self.law.repeats else 0.0

    def end(self, start: FloatArray, angle: float, duration: float) -> FloatArray:
        """Return the state after ``duration`` s from a state at a cam angle, ``(n,)``.

        The angle is in rad. The computing time does not increase with the number of turns.
        """
        start, angle, remainder = self.last_turn(start, angle, duration)
        return self.states(start, angle, np.array([remainder]))[:, 0]

    def last_turn(
        self, start: FloatArray, angle: float, duration: float
    ) -> tuple[FloatArray, float, float]:
        """Advance the state over all whole turns but the last, at once.

        ``start`` is the state at the cam angle ``angle`` (rad). Returns the state and the cam angle
        (rad) after these turns, and the remaining part of ``duration`` (s). If there is at most one
        whole turn, the arguments are returned.
        """
        require_angle(angle)
        require_number("duration", duration, "≥ 0")
        first = math.ceil(angle / TURN)
        # Do not skip a turn up to a jump of the state at its end, which belongs to the next
        # interval.
        spare = 0.0 if self.parts[0].state_jump is None else 2.0 * JOINT_ATOL_RAD
        whole = math.floor((angle + self.speed * duration - spare) / TURN) - first
        if whole <= 1:
            return start, angle, duration
        before = max(0.0, (first * TURN - angle) / self.speed)
        start = self.end(start, angle, before) if before > 0.0 else start
        start = self.turn.after(start, whole)
        return start, 0.0, max(0.0, duration - before - whole * (TURN / self.speed))

    @cached_property
    def turn(self) -> TurnMap:
        """Map of the state at cam angle 0 to the state after one turn."""
        return self._maps[-1]

    @cached_property
    def _maps(self) -> list[TurnMap]:
        """Maps of the state at cam angle 0 to the state at the start of each part.

        A part is a part of the turn (see `Part`). The last map leads to the end of the turn.
        """
        flow, offset = np.eye(self.constant.size), np.zeros(self.constant.size)
        maps = []
        for part in self.parts:
            offset = offset if part.state_jump is None else offset + part.state_jump
            maps.append(TurnMap(flow, offset))
            offset = part.particular[:, -1] + part.flow @ (offset - part.particular[:, 0])
            flow = part.flow @ flow
        return [*maps, TurnMap(flow, offset)]

    def free_starts(self, start: FloatArray, turns: int) -> FloatArray:
        """Return the free vibrations at the start of all parts of several turns.

        They are the states less the forced response X, ``(turns, parts, n)``. ``start`` is the
        state at cam angle 0 before the first turn.
        """
        states, turn = [start], self.turn
        for _ in range(1, turns):
            states.append(turn.flow @ states[-1] + turn.offset)
        flows = np.stack([part_map.flow for part_map in self._maps[:-1]])
        offsets = np.stack([part_map.offset for part_map in self._maps[:-1]])
        forced = np.stack([part.particular[:, 0] for part in self.parts])
        return np.asarray(np.einsum("pij,tj->tpi", flows, np.stack(states)) + (offsets - forced))

    def periodic(self) -> FloatArray:
        """Return the state at cam angle 0 in steady state, ``(n,)``.

        It repeats after one turn. If the state jumps at angle 0, it is the state before the jump.

        Raises
        ------
        DynamicsError
            If a mode without damping is in resonance.
        """
        state = self.turn.fixed_point()
        if state is None:
            raise no_steady_state(self.speed)
        return state


def no_steady_state(speed: float) -> DynamicsError:
    """Return the error for a cam speed (rad/s) at which an undamped mode is in resonance."""
    return DynamicsError(
        f"no steady state at {to_rpm(speed):.6g} rpm: a mode without damping is at a harmonic of "
        "the speed; allowed: damping, or another speed"
    )


# The rest of this module computes samples with a uniform time step by matrix products.
#
# The samples in one part of the turn are divided into chunks of equal size. In each chunk the
# polynomial is its Taylor series about the middle of the chunk, and the exponential starts from the
# first sample of the chunk. One product with a fixed matrix (powers, and the exponential over a
# chunk) writes all samples to their columns of the output. The coefficients of a part are computed
# at once for all turns.


@dataclass(frozen=True, eq=False)
class Outputs:
    """Definition of k outputs C x + D (s, ṡ, s̈) + d of a linear model with n states."""

    state: FloatArray  #: C, weights of the states, ``(k, n)``
    law: FloatArray  #: D, weights of s, ṡ and s̈, ``(k, 3)``
    constant: FloatArray  #: d, constant terms, ``(k,)``


def compute_end(
    model: LinearResponse, start: FloatArray, angle: float, duration: float, outputs: Outputs
) -> tuple[FloatArray, FloatArray]:
    """Return the state ``(n,)`` and the outputs ``(k,)`` at the end of a run.

    The run starts in the state ``start`` at the cam angle ``angle`` (rad) and takes ``duration`` s.
    """
    start, angle, remainder = model.last_turn(start, angle, duration)
    require_angle(angle + model.speed * remainder, "angle at the end")
    *_, run = model.walk(start, angle, np.nextafter(remainder, np.inf))
    since = np.array([remainder - run.begin])
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
    """Return uniform samples of the outputs, ``(k, count)``.

    Parameters
    ----------
    model : LinearResponse
        The response of the linear model on the cam.
    start : array, ``(n,)``
        State of the model at time 0.
    angle : float
        Cam angle at time 0, rad.
    first : float
        Time of the first sample, s.
    step : float
        Time between two samples, s.
    count : int
        Number of samples.
    outputs : Outputs
        Outputs to sample.
    out : array, ``(k, count)``, optional
        Array for the samples (default: a new array).
    """
    out = np.empty((outputs.state.shape[0], count)) if out is None else out
    done = 0
    chunked: dict[tuple[int, int, int], list[_Passage]] = {}
    for run in model.walk(start, angle, first + count * step):
        end = min(count, max(done, samples_before((run.end - first) / step)))
        if end > done:
            offset = first + done * step - run.begin
            part = run.part
            u, width = (run.local + offset) / part.length, step / part.length
            samples = SampleRun.of(done, end, u, width)
            if samples.chunk:
                key = (part.number, samples.chunk, samples.chunks)
                chunked.setdefault(key, []).append(_Passage(samples, offset, run.free))
            else:  # too few samples for chunks: evaluate them one by one
                ordinates, times = (
                    polynomial_part(model, part, outputs),
                    np.arange(float(end - done)),
                )
                basis = bernstein.basis(ordinates.shape[1] - 1, samples.at())
                np.matmul(ordinates, basis.T, out=out[:, done:end])
                free = free_motion(model.matrix, run.free, offset + step * times)
                out[:, done:end] += outputs.state @ free
            done = end
    for (number, _, _), passages in chunked.items():
        _fill_in_chunks(model, model.parts[number], passages, step, outputs, out)
    return out


class _Passage(NamedTuple):
    """Samples of a uniform time grid in one passage of the cam through a part of its turn."""

    samples: SampleRun  #: indices and positions of the samples
    offset: float  #: time from the start of the passage to its first sample, s
    free: FloatArray  #: free vibration at the start of the passage, ``(n,)``


def _fill_in_chunks(
    model: LinearResponse,
    part: Part,
    passages: list[_Passage],
    step: float,
    outputs: Outputs,
    out: FloatArray,
) -> None:
    """Write the samples of all passages through one part of the turn to ``out``.

    They are computed in chunks of equal size. ``step`` is the time between samples, s. ``out`` has
    one row per output and one column per sample.
    """
    chunk = passages[0].samples.chunk
    series = _part_series(model, part, outputs, step, chunk)
    over = _chunk_matrix(model, outputs, series.powers.shape[0], step, chunk)
    states = np.stack([passage.free for passage in passages], axis=1)
    states = free_motion(model.matrix, states, np.array([passage.offset for passage in passages]))
    trains = group_repeated_runs([passage.samples for passage in passages])
    polynomial = series.at([train[0] for train in trains])
    rows, _, powers = polynomial.shape
    chunks = passages[0].samples.chunks  # chunks per passage
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
    """Return the forced response of the outputs in each part of the turn.

    It is a polynomial of time per output. The result has one array of Bernstein ordinates per part,
    ``(k, p + 1)``. Parts at the same position in their pieces of the law are computed together.
    """
    weights = outputs.law * model.speed ** np.arange(3)
    motion = np.tensordot(weights, model.law.motion, axes=1)
    groups: dict[tuple[int, int, int], list[Part]] = {}
    for part in model.parts:
        groups.setdefault((*part.of_piece, part.particular.shape[1]), []).append(part)
    by_number: dict[int, FloatArray] = {}
    for (i, count, width), parts in groups.items():
        of_law = motion[:, :, [part.law_piece for part in parts]].transpose(1, 0, 2)
        flat = bernstein.restrict(of_law.reshape(len(of_law), -1), i / count, (i + 1) / count)
        of_law = bernstein.elevate(flat, width - 1).reshape(width, -1, len(parts))
        of_state = outputs.state @ np.stack([part.particular for part in parts])
        ordinates = of_law.transpose(2, 1, 0) + of_state + outputs.constant[:, None]
        by_number.update((part.number, rows) for part, rows in zip(parts, ordinates, strict=True))
    return tuple(by_number[part.number] for part in model.parts)


def polynomial_part(model: LinearResponse, part: Part, outputs: Outputs) -> FloatArray:
    """Return the forced response of the outputs in one part of the turn, ``(k, p + 1)``.

    Each row contains the Bernstein ordinates of a polynomial of time.
    """
    return polynomial_parts(model, outputs)[part.number]


@lru_cache(maxsize=4096)
def _part_series(
    model: LinearResponse, part: Part, outputs: Outputs, step: float, chunk: int
) -> ChunkSeries:
    """Return the Taylor series of the outputs' forced response in a part of the turn.

    Samples are computed in chunks of ``chunk`` samples, ``step`` s apart. Each series is about the
    middle of a chunk.
    """
    taylor = bernstein.taylor(polynomial_part(model, part, outputs).T)
    return ChunkSeries.of(taylor, step / part.length, chunk)


@lru_cache(maxsize=256)
def _chunk_matrix(
    model: LinearResponse, outputs: Outputs, powers: int, step: float, chunk: int
) -> FloatArray:
    """Return the matrix that computes a chunk of samples of each of k outputs.

    It is multiplied by the Taylor coefficients of the forced response and by the free vibration at
    the first sample. Its first rows are powers of the position in the chunk, and the others are the
    outputs of e^{At}. The shape is ``(k, powers + n, chunk)``. ``step`` is the time between
    samples, s.
    """
    flows = exponentials(model.matrix, step * np.arange(chunk, dtype=np.float64))
    of_state = np.einsum("kn,cnj->kjc", outputs.state, flows)
    abscissa = np.broadcast_to(chunk_powers(powers - 1, chunk), (len(of_state), powers, chunk))
    return np.concatenate([abscissa, of_state], axis=1)


@lru_cache(maxsize=256)
def _chunk_flows(model: LinearResponse, period: float, count: int) -> FloatArray:
    """Return the matrices e^{At} at ``count`` times, ``(count, n, n)``.

    The times start at 0 and are ``period`` s apart.
    """
    return exponentials(model.matrix, period * np.arange(count, dtype=np.float64))

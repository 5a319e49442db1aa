"""Motion of an oscillator on a cam at one constant speed.

Between two joints of the law the forced response is a polynomial, Σ hₖ Ωᵏ s⁽ᵏ⁾(θ), where hₖ are the
Taylor coefficients of the transfer function. If a derivative of s jumps at a joint, that polynomial
jumps too, and a free vibration cancels the jump. Only these jumps excite the mode.

Numbers in brackets are those of docs/proofs.md, part 2. The names follow the symbols there.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics.events.contact import StemVibration
from cam_rig.dynamics.events.free_flight import compute_impulse_response
from cam_rig.dynamics.events.run_table import CamWeights
from cam_rig.laws.vectors import Matrices, Matrix, Records, Vector, min_of
from cam_rig.units import TURN

#: Size of a term below which the term is rounding, relative to the largest term. The series stops
#: after two such terms in a row.
SERIES_RTOL = 1e-14
#: Largest accepted rounding error of the terms of P, as a fraction of the terms with s, s' and s''.
MAX_ROUNDING = 1e-5
#: Float epsilon: distance between 1 and the next float.
EPS = 2.0**-52
#: Logarithm of the fraction of a vibration that counts as zero: e⁻³⁹ = 1e-17 is below rounding.
LOG_FADED = -39.0
#: Lower limit of ρ as a fraction of δ: near critical damping the two rates become equal (16).
MIN_RHO = 0.5

#: Fields of a `Flow` in a record.
FLOW_FIELDS = [(name, "f8") for name in ("eta_eta", "eta_rate", "rate_eta", "rate_rate")]
#: Flow over one span of the law, and e^{−λt}, the fraction of the norm N after it (16).
SPAN_FLOW = np.dtype([*FLOW_FIELDS, ("remainder", "f8")], align=True)
#: Free vibration at the start of a piece. `min_output.free_at` combines it with that of a turn.
PIECE_START = np.dtype(
    [
        *FLOW_FIELDS,  # from the start of the turn to the start of the piece
        ("displacement", "f8"),  # η excited by the joints of the turn up to the piece, m
        ("velocity", "f8"),  # η̇ excited by them, m/s
        ("remainder", "f8"),  # e^{−λt} from the start of the turn to the start of the piece (16)
        ("floor", "f8"),  # lower bound of the output in the piece in all turns (19)
    ],
    align=True,
)
#: Free vibration (η, η̇) at the start of a turn, m and m/s.
TURN_START = np.dtype([("displacement", "f8"), ("velocity", "f8")], align=True)


class GroupRow(IntEnum):
    """Index of a matrix ``(p + 2, g)`` in `LawSeries.groups`."""

    MAX = 0  #: upper bound of |s⁽ᵏ⁾| in the group
    START_JUMP = 1  #: |jump| at the start of the group
    INNER_JUMPS = 2  #: sum of |jump| at the other joints of the group


class LawSeries(NamedTuple):
    """Derivatives and harmonics of a law of n pieces of degree p.

    Adjacent pieces form g groups.
    """

    derivatives: Matrices  #: Bernstein ordinate j of s⁽ᵏ⁾(θ) in piece i, ``(p + 1, p + 2, n)``
    jumps: Matrix  #: jumps of s⁽ᵏ⁾ at the start of each piece, ``(p + 2, n)``
    breaks: Vector  #: cam angles of the joints, ``(n + 1,)``, rad
    spans: Vector  #: distinct spans of pieces, ``(m,)``, rad
    span_index: NDArray[np.intp]  #: index of each piece's span in ``spans``, ``(n,)``
    first_pieces: NDArray[np.intp]  #: index of the first piece of each group, and n, ``(g + 1,)``
    max_derivatives: Vector  #: upper bounds of |s⁽ᵏ⁾|, ``(p + 2,)``
    groups: Matrices  #: matrices of `GroupRow`, ``(3, p + 2, g)``
    piece_maxima: Matrix  #: upper bounds of |s| to |s⁗| in each piece, ``(n, 5)``
    harmonics: Vector  #: Cₖ ≥ |cₖ| of s = Σ cₖ e^{ikθ} (28), for k = 1 … h
    tails: Vector  #: Σ Cⱼ/j for j ≥ k, ``(h,)``
    block_maxima: Vector  #: Cₖ from k = h + 1 on, for each block of harmonics (30)


class Oscillator(NamedTuple):
    """Mode η̈ = −κ η − d η̇ + drive · (s, ṡ, s̈), its output and its duration."""

    stiffness: float  #: κ, 1/s²
    damping: float  #: d, 1/s
    drive: CamWeights  #: d₀, d₁, d₂. The constant is not used.
    per_displacement: float  #: p, weight of η in the output
    per_velocity: float  #: q, weight of η̇ in the output
    cam: CamWeights  #: m₀, m₁, m₂, weights of s, ṡ and s̈ in the output, and its constant
    duration: float  #: duration of a run from rest at θ = 0, s, or infinite for steady state


class Series(NamedTuple):
    """Taylor coefficients of the transfer functions, ``(p + 1,)`` each (15)."""

    eta: Vector  #: hₖ of η
    output: Vector  #: gₖ of the output


class ModeOnLaw(NamedTuple):
    """Vibration mode that is excited by a law."""

    law: LawSeries
    mode: Oscillator
    series: Series


class Flow(NamedTuple):
    """Matrix e^{At} that takes the vibration (η, η̇) to the vibration a time t later."""

    eta_eta: float  #: from η at the start to η at the end
    eta_rate: float  #: from η̇ to η, s
    rate_eta: float  #: from η to η̇, 1/s
    rate_rate: float  #: from η̇ to η̇


class VibrationNorm(NamedTuple):
    """Norm N = √((ρη)² + (η̇ + δη)²) of a free vibration (16).

    It fades at least as fast as e^{−λt}.
    """

    delta: float  #: δ, half of the mode's damping, 1/s
    rho: float  #: ρ, 1/s
    decay: float  #: λ, 1/s
    sigma: float  #: σ, largest factor by which d/dt multiplies the norm, 1/s (18)
    reach: float  #: R, largest output per unit of the norm (17)


class OscillatorMotion(NamedTuple):
    """Motion of a vibration mode on a law at one cam speed."""

    speed: float  #: Ω, rad/s
    norm: VibrationNorm
    eta_terms: Vector  #: significant terms hₖ Ωᵏ
    forced: Matrix  #: ordinates of the output's polynomial part P, ``(p + 1, n)``
    min_forced: Vector  #: smallest ordinate of P in each piece, ``(n,)``
    group_min_forced: Vector  #: smallest ordinate of P in each group, ``(g,)``
    max_forced: Vector  #: largest absolute ordinate of P in each piece, ``(n,)``
    span_flows: Records  #: records of `SPAN_FLOW` for ``LawSeries.spans``, ``(m,)``
    piece_starts: Records  #: records of `PIECE_START`, ``(n,)``
    turn_starts: Records  #: records of `TURN_START` until the motion repeats or ends, ``(t,)``
    #: (η, η̇) at the start of a turn in steady state. Infinite if there is no steady state.
    steady_start: StemVibration


def norm_of(mode: Oscillator) -> VibrationNorm:
    """Return the norm (16) of the free vibration of a mode.

    Its decay λ is the slower of the two rates of the mode. It is smaller near critical damping.
    """
    delta = 0.5 * mode.damping
    square = mode.stiffness - delta * delta
    root = math.sqrt(abs(square))
    rho = max(root, MIN_RHO * delta)
    if square < 0.0 and rho == root:
        decay = mode.stiffness / (delta + root)
    else:
        decay = delta - 0.5 * abs(rho * rho - square) / rho
    per_displacement, velocity = (
        mode.per_displacement - delta * mode.per_velocity,
        mode.per_velocity,
    )
    reach = math.sqrt((per_displacement / rho) * (per_displacement / rho) + velocity * velocity)
    return VibrationNorm(
        delta=delta,
        rho=rho,
        decay=decay,
        sigma=_spectral_norm(-delta, rho, -square / rho, -delta),
        reach=reach,
    )


def amplitude(norm: VibrationNorm, free: StemVibration) -> float:
    """Return the norm N of a free vibration, in m/s."""
    a, b = norm.rho * free.displacement, free.velocity + norm.delta * free.displacement
    return math.sqrt(a * a + b * b)


def _spectral_norm(a: float, b: float, c: float, d: float) -> float:
    """Return the spectral norm of the 2 × 2 matrix [[a, b], [c, d]]."""
    squares, determinant = a * a + b * b + c * c + d * d, a * d - b * c
    discriminant = max(0.0, squares * squares - 4.0 * determinant * determinant)
    return math.sqrt(0.5 * (squares + math.sqrt(discriminant)))


def mode_on_law(law: LawSeries, mode: Oscillator) -> ModeOnLaw:
    """Return a mode on a law, with the p + 1 Taylor coefficients of (15).

    Long division of the transfer function gives the coefficients.
    """
    count = len(law.jumps) - 1
    eta, output = np.zeros(count), np.zeros(count)
    drive = mode.drive.lift, mode.drive.velocity, mode.drive.acceleration
    cam = mode.cam.lift, mode.cam.velocity, mode.cam.acceleration
    for k in range(count):
        remainder = drive[k] if k < 3 else 0.0
        if k > 0:
            remainder -= mode.damping * eta[k - 1]
        if k > 1:
            remainder -= eta[k - 2]
        eta[k] = remainder / mode.stiffness
        output[k] = mode.per_displacement * eta[k] + (cam[k] if k < 3 else 0.0)
        if k > 0:
            output[k] += mode.per_velocity * eta[k - 1]
    return ModeOnLaw(law, mode, Series(eta, output))


def is_resolved(run: ModeOnLaw, speed: float) -> bool:
    """Return True if the rounding error of the output is within `MAX_ROUNDING`.

    ``speed`` is in rad/s. If the mode has few periods in a short piece of high degree, the terms of
    P grow and cancel against the free vibration.
    """
    output, power, max_term, reference = run.series.output, 1.0, 0.0, 0.0
    for k in range(len(output)):
        max_term = max(max_term, abs(output[k]) * power * run.law.max_derivatives[k])
        if k < 3:
            reference = max_term
        power *= speed
    return EPS * max_term <= MAX_ROUNDING * reference


def count_terms(law: LawSeries, series: Series, speed: float) -> int:
    """Return the number of significant terms of the series at a cam speed (rad/s).

    The terms end before two successive terms that are rounding.
    """
    power, max_term, was_small = 1.0, 0.0, False
    for k in range(len(series.output)):
        size = abs(series.output[k]) * power * law.max_derivatives[k]
        max_term = max(max_term, size)
        is_small = size <= SERIES_RTOL * max_term
        if k > 2 and is_small and was_small:
            return k
        was_small = is_small
        power *= speed
    return len(series.output)


def forced_vibration(law: LawSeries, eta_terms: Vector, speed: float, piece: int) -> StemVibration:
    """Return the forced vibration (η, η̇) at the start of a piece (15).

    It is the polynomial X of the terms ``eta_terms``. ``speed`` is in rad/s.
    """
    displacement, velocity = 0.0, 0.0
    for k in range(len(eta_terms)):
        displacement += eta_terms[k] * law.derivatives[0][k][piece]
        velocity += eta_terms[k] * law.derivatives[0][k + 1][piece]
    return StemVibration(displacement, velocity * speed)


def add_weighted(out: Vector, weights: Vector, rows: Matrix, first: int) -> None:
    """Add the weighted sum Σ weights[k] rows[first + k] to ``out``.

    Two rows at a time halve the number of accesses to ``out``. Compiled code uses SIMD.
    """
    for k in range(0, len(weights) - 1, 2):
        a, b, row, next_row = weights[k], weights[k + 1], rows[first + k], rows[first + k + 1]
        for i in range(len(out)):
            out[i] += a * row[i] + b * next_row[i]
    if len(weights) % 2 == 1:
        a, row = weights[-1], rows[first + len(weights) - 1]
        for i in range(len(out)):
            out[i] += a * row[i]


def scale_terms(terms: Vector, count: int, speed: float) -> Vector:
    """Return the first ``count`` terms of a series, with term k multiplied by Ωᵏ.

    ``speed`` is Ω, rad/s.
    """
    out, power = np.zeros(count), 1.0
    for k in range(count):
        out[k] = terms[k] * power
        power *= speed
    return out


def flow_over(mode: Oscillator, time: float) -> Flow:
    """Return the matrix e^{At} of a mode's free vibration over a time (s)."""
    response = compute_impulse_response(mode.damping, mode.stiffness, time)
    return Flow(
        eta_eta=response.rate + mode.damping * response.value,
        eta_rate=response.value,
        rate_eta=-mode.stiffness * response.value,
        rate_rate=response.rate,
    )


def write_flow(record: np.void, flow: Flow) -> None:
    """Write the matrix of a flow to the fields of a record."""
    record["eta_eta"], record["eta_rate"] = flow.eta_eta, flow.eta_rate
    record["rate_eta"], record["rate_rate"] = flow.rate_eta, flow.rate_rate


def read_flow(record: np.void) -> Flow:
    """Return the matrix of a flow from the fields of a record."""
    return Flow(record["eta_eta"], record["eta_rate"], record["rate_eta"], record["rate_rate"])


def apply_flow(flow: Flow, free: StemVibration) -> StemVibration:
    """Return the free vibration after a flow, from that before it."""
    return StemVibration(
        flow.eta_eta * free.displacement + flow.eta_rate * free.velocity,
        flow.rate_eta * free.displacement + flow.rate_rate * free.velocity,
    )


def motion_at(run: ModeOnLaw, speed: float) -> OscillatorMotion:
    """Return the motion of the mode at a cam speed (rad/s)."""
    law, mode, series = run
    count, norm = len(law.span_index), norm_of(mode)
    terms = count_terms(law, series, speed)
    span_flows = np.zeros(len(law.spans), SPAN_FLOW)
    for m in range(len(span_flows)):
        write_flow(span_flows[m], flow_over(mode, law.spans[m] / speed))
        span_flows[m]["remainder"] = math.exp(-norm.decay * law.spans[m] / speed)
    weights = scale_terms(series.output, terms, speed)
    eta_terms = scale_terms(series.eta, terms, speed)
    min_forced, max_forced = np.zeros(count), np.zeros(count)
    forced = _forced_ordinates(law, weights, mode.cam.constant, min_forced, max_forced)
    group_min_forced = np.zeros(len(law.first_pieces) - 1)
    for g in range(len(group_min_forced)):
        first, end = law.first_pieces[g], law.first_pieces[g + 1]
        group_min_forced[g] = min_of(min_forced[first:end])
    jumps = np.zeros((2, count))
    for k in range(2):  # jumps of η, then of η̇
        add_weighted(jumps[k], eta_terms, law.jumps, k)
    for i in range(count):
        jumps[1][i] *= speed
    piece_starts = np.zeros(count, PIECE_START)
    turn_flow, excited = _pass_turn(law, span_flows, jumps, piece_starts)
    x = forced_vibration(law, eta_terms, speed, 0)
    steady = _steady_vibration(turn_flow, excited)
    turn_starts = _turn_starts(mode, norm, speed, x, turn_flow, excited, steady)
    max_reach = 0.0
    for i in range(len(turn_starts)):
        start = StemVibration(turn_starts[i]["displacement"], turn_starts[i]["velocity"])
        max_reach = max(max_reach, norm.reach * amplitude(norm, start))
    for i in range(count):  # (19)
        start = StemVibration(piece_starts[i]["displacement"], piece_starts[i]["velocity"])
        floor = min_forced[i] - norm.reach * amplitude(norm, start)
        piece_starts[i]["floor"] = floor - max_reach * piece_starts[i]["remainder"]
    return OscillatorMotion(
        speed=speed,
        norm=norm,
        eta_terms=eta_terms,
        forced=forced,
        min_forced=min_forced,
        group_min_forced=group_min_forced,
        max_forced=max_forced,
        span_flows=span_flows,
        piece_starts=piece_starts,
        turn_starts=turn_starts,
        steady_start=StemVibration(
            x.displacement + steady.displacement, x.velocity + steady.velocity
        ),
    )


def _pass_turn(
    law: LawSeries, span_flows: Records, jumps: Matrix, piece_starts: Records
) -> tuple[Flow, StemVibration]:
    """Write ``piece_starts``, and return a turn's flow and the vibration it excites.

    ``jumps`` are those of X and Ẋ, ``(2, n)``. The jump at angle 0 counts at the end of the turn.
    """
    first = StemVibration(jumps[0][0], jumps[1][0])
    displacement, velocity = first.displacement, first.velocity
    a, b, c, d, remainder = 1.0, 0.0, 0.0, 1.0, 1.0
    for i in range(len(piece_starts)):
        displacement, velocity = displacement - jumps[0][i], velocity - jumps[1][i]
        start = piece_starts[i]
        start["displacement"], start["velocity"] = displacement, velocity
        start["remainder"] = remainder
        write_flow(start, Flow(a, b, c, d))
        span_flow = span_flows[law.span_index[i]]
        p, q, r, s = read_flow(span_flow)
        displacement, velocity = p * displacement + q * velocity, r * displacement + s * velocity
        a, b, c, d = p * a + q * c, p * b + q * d, r * a + s * c, r * b + s * d
        remainder *= span_flow["remainder"]
    excited = StemVibration(displacement - first.displacement, velocity - first.velocity)
    return Flow(a, b, c, d), excited


def _forced_ordinates(
    law: LawSeries, weights: Vector, constant: float, minima: Vector, maxima: Vector
) -> Matrix:
    """Return the ordinates of the output's polynomial part P, ``(p + 1, n)``.

    The least ordinate of each piece is written to ``minima``, the largest absolute one to
    ``maxima``, ``(n,)`` each.
    """
    out = np.zeros((len(law.derivatives), len(minima)))
    for j in range(len(out)):
        row = out[j]
        for i in range(len(row)):
            row[i] = constant
        add_weighted(row, weights, law.derivatives[j], 0)
        if j == 0:
            for i in range(len(row)):
                minima[i], maxima[i] = row[i], abs(row[i])
        else:
            for i in range(len(row)):
                minima[i], maxima[i] = min(minima[i], row[i]), max(maxima[i], abs(row[i]))
    return out


def _steady_vibration(flow: Flow, excited: StemVibration) -> StemVibration:
    """Return the free vibration that repeats after a turn, infinite if not unique.

    ``flow`` is that of the turn, and ``excited`` the vibration that the turn excites.
    """
    a, d = 1.0 - flow.eta_eta, 1.0 - flow.rate_rate
    determinant = a * d - flow.eta_rate * flow.rate_eta
    if determinant == 0.0:
        return StemVibration(math.inf, math.inf)
    displacement = d * excited.displacement + flow.eta_rate * excited.velocity
    velocity = flow.rate_eta * excited.displacement + a * excited.velocity
    return StemVibration(displacement / determinant, velocity / determinant)


def _turn_starts(
    mode: Oscillator,
    norm: VibrationNorm,
    speed: float,
    forced: StemVibration,
    flow: Flow,
    excited: StemVibration,
    steady: StemVibration,
) -> Records:
    """Return the free vibration at the start of each turn, as records of `TURN_START`.

    ``forced`` is (X, Ẋ) at the start of the run. ``flow`` and ``excited`` are those of a turn, and
    ``steady`` is the vibration in steady state.
    """
    if math.isinf(mode.duration):
        starts = np.zeros(1, TURN_START)
        starts[0]["displacement"], starts[0]["velocity"] = steady.displacement, steady.velocity
        return starts
    turns = max(1, math.ceil(speed * mode.duration / TURN))
    decay_per_turn = norm.decay * TURN / speed
    if decay_per_turn * turns > -LOG_FADED:
        turns = 1 + math.ceil(-LOG_FADED / decay_per_turn)
    starts = np.zeros(turns, TURN_START)
    free = StemVibration(-forced.displacement, -forced.velocity)
    for i in range(turns):
        starts[i]["displacement"], starts[i]["velocity"] = free.displacement, free.velocity
        free = apply_flow(flow, free)
        free = StemVibration(
            free.displacement + excited.displacement, free.velocity + excited.velocity
        )
    return starts


def end_angle(motion: OscillatorMotion, duration: float) -> float:
    """Return the angle (rad) at which a run ends, or after which it repeats."""
    return min(len(motion.turn_starts) * TURN, motion.speed * duration)

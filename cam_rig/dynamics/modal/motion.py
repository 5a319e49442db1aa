"""Motion of a vibration mode that a cam excites, at one constant cam speed Ω.

The law s(θ) consists of polynomial pieces that meet at joints. Between two joints the forced
response of the mode is a polynomial, Σ hₖ Ωᵏ s⁽ᵏ⁾(θ), where hₖ are the Taylor coefficients of the
transfer function. If a derivative of s jumps at a joint, that polynomial jumps too, and a free
vibration cancels the jump, because the motion is continuous. Only these jumps excite free
vibration. The output of the mode, for example the contact force, is the sum of a polynomial P and
the weighted free vibration.

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

#: Size below which a term of the forced response Σ hₖ Ωᵏ s⁽ᵏ⁾ counts as rounding, relative to the
#: largest term. The series ends before two such terms in a row.
SERIES_RTOL = 1e-14
#: Smallest step of s' at a joint that excites a vibration, as a fraction of the largest |s|, in
#: 1/rad. Smaller steps are rounding errors.
VELOCITY_STEP_RTOL = 1e-9
#: Largest accepted rounding error of the polynomial part of a mode's output (for example a contact
#: force), as a fraction of its largest term with s, s' or s''.
MAX_ROUNDING = 1e-5
#: Float epsilon: distance between 1 and the next float.
EPS = 2.0**-52
#: Logarithm of the fraction of a vibration that counts as zero: e⁻³⁹ = 1e-17 is below rounding.
LOG_FADED = -39.0
#: Lower limit of the frequency ρ in the vibration norm, as a fraction of the damping rate δ. It
#: keeps the norm (16) of docs/proofs.md regular near critical damping, where √|κ − δ²| is zero.
MIN_RHO = 0.5

#: Fields of a record that contain the four elements of the matrix e^{At} of a free vibration.
FLOW_FIELDS = [(name, "f8") for name in ("eta_eta", "eta_rate", "rate_eta", "rate_rate")]
#: Record of the `Flow` over one polynomial piece of the law. The field ``remainder`` is e^{−λt},
#: the fraction of the norm N of a free vibration that is left after the piece.
SPAN_FLOW = np.dtype([*FLOW_FIELDS, ("remainder", "f8")], align=True)
#: Record of the free vibration at the start of a polynomial piece of the law, for any turn.
#: `min_output.free_at` combines it with the free vibration at the start of a turn.
PIECE_START = np.dtype(
    [
        *FLOW_FIELDS,  # from the start of the turn to the start of the piece
        ("displacement", "f8"),  # η excited by the joints of the turn up to the piece, m
        ("velocity", "f8"),  # η̇ excited by the joints of the turn up to the piece, m/s
        ("remainder", "f8"),  # e^{−λt} from the start of the turn to the start of the piece (16)
        ("floor", "f8"),  # lower bound of the output in the piece in all turns (19)
    ],
    align=True,
)
#: Record of the free vibration (η, η̇) of a mode at the start of a turn, in m and m/s.
TURN_START = np.dtype([("displacement", "f8"), ("velocity", "f8")], align=True)


class GroupRow(IntEnum):
    """Index of a matrix ``(p + 2, g)`` in `LawSeries.groups`.

    Each matrix has one row per derivative s⁽ᵏ⁾ and one column per group of adjacent pieces.
    """

    MAX = 0  #: upper bound of |s⁽ᵏ⁾| in the group
    START_JUMP = 1  #: |jump of s⁽ᵏ⁾| at the start of the group
    INNER_JUMPS = 2  #: sum of |jump of s⁽ᵏ⁾| at the joints inside the group


class LawSeries(NamedTuple):
    """Derivatives s⁽ᵏ⁾(θ), k = 0 … p + 1, and harmonics of a law of n pieces of degree p.

    The pieces are polynomials in the cam angle. Adjacent pieces form g groups.
    """

    derivatives: Matrices  #: Bernstein ordinate j of s⁽ᵏ⁾(θ) in piece i, ``(p + 1, p + 2, n)``
    jumps: Matrix  #: jumps of s⁽ᵏ⁾ at the start of each piece, ``(p + 2, n)``
    breaks: Vector  #: cam angles of the joints, ``(n + 1,)``, rad
    spans: Vector  #: distinct cam angles that a piece spans, ``(m,)``, rad
    span_index: NDArray[np.intp]  #: index of each piece's span in ``spans``, ``(n,)``
    first_pieces: NDArray[np.intp]  #: index of the first piece of each group, and n, ``(g + 1,)``
    max_derivatives: Vector  #: upper bounds of |s⁽ᵏ⁾| over the turn, ``(p + 2,)``
    groups: Matrices  #: bounds in each group: one matrix per `GroupRow`, ``(3, p + 2, g)``
    piece_maxima: Matrix  #: upper bounds of |s|, |s'|, … |s⁗| in each piece, ``(n, 5)``
    harmonics: Vector  #: upper bounds Cₖ of |cₖ| of s = Σ cₖ e^{ikθ}, k = 1 … h, ``(h,)`` (28)
    tails: Vector  #: Σ Cⱼ/j over all harmonics j ≥ k, for k = 1 … h, ``(h,)``
    block_maxima: Vector  #: upper bound of |cₖ| in each block of harmonics from h + 1 on (30)


class Oscillator(NamedTuple):
    """Vibration mode η̈ = −κ η − d η̇ + d₀ s + d₁ ṡ + d₂ s̈ that the cam motion s(t) drives.

    Its output is p η + q η̇ + m₀ s + m₁ ṡ + m₂ s̈ + constant, for example a contact force.
    """

    stiffness: float  #: κ in η̈ = −κ η − d η̇ + …, 1/s²
    damping: float  #: d in η̈ = −κ η − d η̇ + …, 1/s
    drive: CamWeights  #: weights d₀, d₁, d₂ of s, ṡ and s̈ in η̈. Its constant is not used.
    per_displacement: float  #: p, weight of η in the output
    per_velocity: float  #: q, weight of η̇ in the output
    cam: CamWeights  #: weights m₀, m₁, m₂ of s, ṡ and s̈ in the output, and its constant
    duration: float  #: duration of a run from rest at θ = 0, s, or infinite for steady state


class Series(NamedTuple):
    """Taylor coefficients of a mode's transfer functions, shape ``(p + 1,)`` each.

    The forced response to a law s of degree p is the sum of coefficient k times dᵏs/dtᵏ, by (15) of
    docs/proofs.md.
    """

    eta: Vector  #: hₖ of the vibration η
    output: Vector  #: gₖ of the output, for example the contact force


class ModeOnLaw(NamedTuple):
    """Vibration mode and the cam law that excites it."""

    law: LawSeries  #: law of the cam
    mode: Oscillator  #: vibration mode and its output
    series: Series  #: Taylor coefficients of the forced response to the law


class Flow(NamedTuple):
    """Matrix e^{At} that advances a free vibration (η, η̇) by a time t."""

    eta_eta: float  #: factor from η at the start to η at the end
    eta_rate: float  #: factor from η̇ at the start to η at the end, s
    rate_eta: float  #: factor from η at the start to η̇ at the end, 1/s
    rate_rate: float  #: factor from η̇ at the start to η̇ at the end


class VibrationNorm(NamedTuple):
    """Norm N = √((ρη)² + (η̇ + δη)²) of a free vibration (η, η̇), in m/s.

    It fades at least as fast as e^{−λt}, by (16) of docs/proofs.md. `norm_of` chooses the numbers.
    """

    delta: float  #: δ, half of the mode's damping, 1/s
    rho: float  #: ρ, frequency of the free vibration or a lower limit near critical damping, 1/s
    decay: float  #: λ, guaranteed rate of decay of the norm, 1/s
    sigma: float  #: σ, largest ratio of the norm of d/dt(η, η̇) to the norm of (η, η̇), 1/s (18)
    reach: float  #: R, largest output of a free vibration per unit of its norm (17)


class OscillatorMotion(NamedTuple):
    """Motion of a vibration mode on a law of n pieces at one cam speed.

    The output of the mode is the sum of a polynomial P and the weighted free vibration.
    """

    speed: float  #: cam speed Ω, rad/s
    norm: VibrationNorm  #: norm of the mode's free vibration
    eta_terms: Vector  #: significant terms hₖ Ωᵏ of the forced response Σ hₖ Ωᵏ s⁽ᵏ⁾ of η
    forced: Matrix  #: Bernstein ordinates of P in each piece, ``(p + 1, n)``
    min_forced: Vector  #: smallest ordinate of P in each piece, ``(n,)``
    group_min_forced: Vector  #: smallest ordinate of P in each group of pieces, ``(g,)``
    max_forced: Vector  #: largest absolute ordinate of P in each piece, ``(n,)``
    span_flows: Records  #: one record of `SPAN_FLOW` per number in ``LawSeries.spans``, ``(m,)``
    piece_starts: Records  #: one record of `PIECE_START` per piece, ``(n,)``
    #: One record of `TURN_START` per turn until the motion repeats or ends, ``(t,)``.
    turn_starts: Records
    #: Vibration (η, η̇) of the end mass at the start of a turn in steady state. It is infinite if
    #: there is no steady state.
    steady_start: StemVibration


def norm_of(mode: Oscillator) -> VibrationNorm:
    """Return the norm (16) of docs/proofs.md for the free vibration of a mode.

    Its decay rate λ is that of the slower of the mode's two exponentials. Near critical damping it
    is smaller, because there ρ has the lower limit `MIN_RHO` δ.
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
    """Return the norm N = √((ρη)² + (η̇ + δη)²) of a free vibration (η, η̇), in m/s.

    ``norm`` contains ρ and δ of the mode. The norm measures the size of the vibration and never
    grows.
    """
    a, b = norm.rho * free.displacement, free.velocity + norm.delta * free.displacement
    return math.sqrt(a * a + b * b)


def _spectral_norm(a: float, b: float, c: float, d: float) -> float:
    """Return the spectral norm (largest singular value) of the matrix [[a, b], [c, d]]."""
    squares, determinant = a * a + b * b + c * c + d * d, a * d - b * c
    discriminant = max(0.0, squares * squares - 4.0 * determinant * determinant)
    return math.sqrt(0.5 * (squares + math.sqrt(discriminant)))


def mode_on_law(law: LawSeries, mode: Oscillator) -> ModeOnLaw:
    """Return a vibration mode with the series of its response to a law of degree p.

    The response is a sum over the derivatives of the lift. Its p + 1 coefficients, (15) in
    docs/proofs.md, are the Taylor coefficients of the transfer function from lift to mode. They
    result from long division of its numerator by its denominator.
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

    ``speed`` is the cam speed in rad/s. The terms of the polynomial part of the output grow with
    the speed. If few periods of the mode fit in a short piece of high degree, they are large and
    cancel against the free vibration, which loses digits.
    """
    output, power, max_term, reference = run.series.output, 1.0, 0.0, 0.0
    for k in range(len(output)):
        max_term = max(max_term, abs(output[k]) * power * run.law.max_derivatives[k])
        if k < 3:
            reference = max_term
        power *= speed
    return EPS * max_term <= MAX_ROUNDING * reference


def count_terms(law: LawSeries, series: Series, speed: float) -> int:
    """Return the number of significant terms of the forced response at a cam speed.

    The series Σ gₖ Ωᵏ s⁽ᵏ⁾ of the output ends before two successive terms that are at most
    `SERIES_RTOL` of the largest term. ``speed`` is Ω, rad/s.
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
    """Return the forced vibration (η, η̇) at the start of a piece of the law.

    It is the value of Σ hₖ Ωᵏ s⁽ᵏ⁾(θ) there and its time derivative, by (15) of docs/proofs.md.
    ``eta_terms`` are the numbers hₖ Ωᵏ. ``speed`` is Ω, rad/s. ``piece`` is an index from 0.
    """
    displacement, velocity = 0.0, 0.0
    for k in range(len(eta_terms)):
        displacement += eta_terms[k] * law.derivatives[0][k][piece]
        velocity += eta_terms[k] * law.derivatives[0][k + 1][piece]
    return StemVibration(displacement, velocity * speed)


def add_weighted(out: Vector, weights: Vector, rows: Matrix, first: int) -> None:
    """Add the weighted sum Σ weights[k] rows[first + k] of matrix rows to ``out``.

    The loop adds two rows at a time, which halves the number of accesses to ``out``. numba compiles
    it to SIMD instructions.
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
    """Return the first ``count`` numbers of ``terms``, with number k multiplied by Ωᵏ.

    ``speed`` is the cam speed Ω, rad/s.
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
    """Write a flow, the matrix e^{At} of a free vibration, to the fields of a record.

    The record has the fields `FLOW_FIELDS`.
    """
    record["eta_eta"], record["eta_rate"] = flow.eta_eta, flow.eta_rate
    record["rate_eta"], record["rate_rate"] = flow.rate_eta, flow.rate_rate


def read_flow(record: np.void) -> Flow:
    """Return a flow, the matrix e^{At} of a free vibration, from the fields of a record.

    The record has the fields `FLOW_FIELDS`.
    """
    return Flow(record["eta_eta"], record["eta_rate"], record["rate_eta"], record["rate_rate"])


def apply_flow(flow: Flow, free: StemVibration) -> StemVibration:
    """Return the free vibration (η, η̇) at the end of a flow, from ``free`` at its start.

    It is the product of the matrix e^{At} and (η, η̇).
    """
    return StemVibration(
        flow.eta_eta * free.displacement + flow.eta_rate * free.velocity,
        flow.rate_eta * free.displacement + flow.rate_rate * free.velocity,
    )


def motion_at(run: ModeOnLaw, speed: float) -> OscillatorMotion:
    """Return the motion of a vibration mode on a law at a cam speed (rad/s).

    It consists of the forced response in each polynomial piece, and the free vibration at the start
    of each piece and each turn.
    """
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
    min_step = VELOCITY_STEP_RTOL * law.max_derivatives[0]
    for i in range(count):
        jumps[1][i] *= speed
        if abs(law.jumps[1][i]) > min_step:  # the state jumps as well, by the impulse of s''
            jumps[1][i] -= mode.drive.acceleration * speed * law.jumps[1][i]
    piece_starts = np.zeros(count, PIECE_START)
    turn_flow, excited = _pass_turn(law, span_flows, jumps, piece_starts)
    x = forced_vibration(law, eta_terms, speed, 0)
    steady = _steady_vibration(turn_flow, excited)
    turn_starts = _turn_starts(mode, norm, speed, x, turn_flow, excited, steady)
    max_reach = 0.0
    for i in range(len(turn_starts)):
        start = StemVibration(turn_starts[i]["displacement"], turn_starts[i]["velocity"])
        max_reach = max(max_reach, norm.reach * amplitude(norm, start))
    for i in range(count):  # lower bound (19) of the output in each piece
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
    """Return the flow over a turn, and the free vibration that the turn's joints excite.

    The free vibration at the start of each piece of the law is written to ``piece_starts``, records
    of `PIECE_START`. ``jumps`` are the jumps of the forced vibration and its rate at the start of
    each piece, ``(2, n)``. In the returned vibration the jump at angle 0 counts at the end of the
    turn.
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
    """Return the Bernstein ordinates of the output's polynomial part P, ``(p + 1, n)``.

    The law has n pieces of degree p. ``weights`` are the factors of s⁽ᵏ⁾ in P, and ``constant`` is
    added. The smallest ordinate of each piece is written to ``minima``, the largest absolute one to
    ``maxima``, shape ``(n,)`` each.
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
    """Return the free vibration that repeats after each turn, in steady state.

    ``flow`` is the flow over one turn, and ``excited`` the vibration that the joints of one turn
    excite. The result is infinite if the repeating vibration is not unique.
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

    The turns end when the run ends or the vibration of the start has faded to rounding. In steady
    state there is a single record, ``steady``. ``forced`` is the forced vibration at the start of
    the run, which the free vibration cancels there. ``flow`` is the flow over a turn, and
    ``excited`` is the vibration that the joints of a turn excite. ``mode`` is the vibration mode
    and ``norm`` the norm of its free vibration.
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
    """Return the cam angle (rad) at which a run ends, or after which its motion repeats.

    ``duration`` is the duration of the run in s, infinite in steady state.
    """
    return min(len(motion.turn_starts) * TURN, motion.speed * duration)

"""Free motion of the follower in flight.

In flight the masses obey ẋ = A x + b. The n states x are displacements and velocities alternately.
If the matrix V of the vibration modes is well conditioned, x = V ξ separates the states into pairs
ξ = (q, q̇) with q̈ = −κ q − 2δ q̇ + const, and each pair is solved in closed form. Otherwise the
matrix exponential is used. The states are exact to rounding. The acceleration is also available as
a polynomial over a short time, a window.

All results are changes since the lift-off, not displacements from the position of rest, because a
weak spring puts that position far away. `cam_rig.dynamics.linear.exponential` has the same
physics for whole arrays of samples.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cam_rig.laws.polynomials import restrict
from cam_rig.laws.vectors import Matrix, Records, Vector, dot

#: Largest product of time and fastest rate at which the power series of the impulse response is
#: used.
MAX_SERIES_TIME = 0.5
#: Number of terms of the power series of the impulse response. The first omitted term, 0.5^18/18!,
#: is far below rounding.
SERIES_TERMS = 18
#: Size below which a term of the power series of the impulse response is negligible, 1/1024 of the
#: float epsilon. The series stops after two such terms in a row. The first term is 1.
MIN_SERIES_TERM = 2.0**-62
#: Product of ‖A‖ and the duration of a window, a short time in which the acceleration of a flying
#: mass is a polynomial. A is the matrix of the motion. It has no unit and is equal to
#: `linear.exponential.REACH`.
WINDOW_REACH = 2.0
#: Largest product ‖A‖ t at which the power series of e^{At} is used without squaring.
MAX_EXPONENTIAL_REACH = 0.5
#: Number of terms of the power series of e^{At}. The first omitted term, 0.5^18/18!, is far below
#: rounding.
EXPONENTIAL_TERMS = 18
#: Largest number of states of a system in flight: displacement and velocity of two masses.
MAX_STATES = 4
#: Number of Bernstein ordinates of the acceleration in a window (short time of a flight),
#: `linear.exponential.SERIES_DEGREE` + 1.
SERIES_SIZE = 25
#: Smallest ratio of the slow to the fast decay rate of an overdamped motion at which the integral
#: of its impulse response is computed from the response. At a smaller ratio this would lose digits.
MIN_RATE_RATIO = 0.1


#: Record of the masses in flight, ẋ = A x + b with n states (see `FreeSystem`). The rows and
#: columns from n on are unused. The fields from ``modes`` on are used only if ``has_pairs`` is
#: True.
FREE_SYSTEM = np.dtype(
    [
        ("size", "i8"),  # number n of states
        ("window", "f8"),  # duration for which ``series`` is exact to rounding, s
        ("matrix", "f8", (MAX_STATES, MAX_STATES)),  # A of ẋ = A x + b
        ("load", "f8", (MAX_STATES,)),  # b of ẋ = A x + b
        ("contact_row", "f8", (MAX_STATES,)),  # weights of x in the contact mass's displacement
        ("energy", "f8", (MAX_STATES, MAX_STATES)),  # E of inequality (5) in docs/proofs.md
        # Matrix from ẋ to the Bernstein ordinates of the contact mass's acceleration in a window.
        ("series", "f8", (SERIES_SIZE, MAX_STATES)),
        ("modes", "f8", (MAX_STATES, MAX_STATES)),  # V of the transformation x = V ξ to pairs
        ("inverse", "f8", (MAX_STATES, MAX_STATES)),  # inverse V⁻¹ of ``modes``
        ("modal_load", "f8", (MAX_STATES,)),  # load V⁻¹ b of the pairs
        ("pair_damping", "f8", (MAX_STATES // 2,)),  # 2δ of each pair, 1/s
        ("pair_stiffness", "f8", (MAX_STATES // 2,)),  # κ of each pair, 1/s²
        ("modal_contact_row", "f8", (MAX_STATES,)),  # product of ``contact_row`` and V
        ("modal_energy", "f8", (MAX_STATES, MAX_STATES)),  # product E V, zero below row n
        ("has_pairs", "?"),  # True if V is well conditioned, so that the pairs are used
    ],
    align=True,
)
#: Record of the constants of one decoupled pair of states (q, q̇) during one flight.
PAIR_START = np.dtype(
    [
        ("rate", "f8"),  # rate of q at the start of the flight, including the load
        ("pull", "f8"),  # κ q + 2δ q̇ − const at the start, from which q(t) follows
        ("force", "f8"),  # rate q̈ of q̇ at the start of the flight
    ],
    align=True,
)


class ImpulseResponse(NamedTuple):
    """Response S(t) of ẍ + 2δ ẋ + κ x = 0 to a unit impulse, at one time."""

    value: float  #: impulse response S, s
    rate: float  #: time derivative Ṡ, without unit
    integral: float  #: integral of S from time 0, s²


class LiftOffState(NamedTuple):
    """State of the masses at the start of a flight, and their coefficients."""

    free: Records  #: coefficients of the free motion, one record of `FREE_SYSTEM`
    start: Vector  #: states x at the start of the flight, ``(n,)``
    rates: Vector  #: rates ẋ at the start of the flight, ``(n,)``
    pairs: Records  #: constants of the decoupled pairs, records of `PAIR_START`, ``(n / 2,)``


class Advance(NamedTuple):
    """Change of the n states of the masses since the start of the flight, at one time."""

    change: Vector  #: change x(t) − x(0) of the states, ``(n,)``
    rates: Vector  #: rates ẋ(t) of the states, ``(n,)``


class PairAdvance(NamedTuple):
    """Change of one decoupled pair of states (q, q̇) since the start of the flight."""

    displacement: float  #: change q(t) − q(0) of the displacement
    velocity: float  #: change q̇(t) − q̇(0) of the velocity
    displacement_rate: float  #: time derivative of ``displacement``
    velocity_rate: float  #: time derivative of ``velocity``


class ContactMassMotion(NamedTuple):
    """Motion of the contact mass (the mass that meets the cam) in flight, at one time."""

    change: float  #: change of the displacement since the start of the flight, m
    velocity: float  #: velocity at this time, m/s
    max_acceleration: float  #: upper bound of |acceleration| at this and all later times, m/s²


def compute_impulse_response(damping: float, stiffness: float, time: float) -> ImpulseResponse:
    """Return the impulse response S, Ṡ and ∫S of ẍ + 2δ ẋ + κ x = 0 at a time (s).

    ``damping`` is 2δ in 1/s and ``stiffness`` is κ in 1/s².
    """
    reach = stiffness * time * time
    if damping * time <= MAX_SERIES_TIME and reach <= MAX_SERIES_TIME * MAX_SERIES_TIME:
        return _expand_impulse_response(damping * time, reach, time)
    decay = 0.5 * damping
    square = stiffness - decay * decay
    if square > 0.0:
        frequency, envelope = math.sqrt(square), math.exp(-decay * time)
        value = envelope * math.sin(frequency * time) / frequency
        rate = envelope * math.cos(frequency * time) - decay * value
        return ImpulseResponse(value, rate, (1.0 - rate - 2.0 * decay * value) / stiffness)
    return _overdamped_impulse_response(decay, math.sqrt(-square), stiffness, time)


def _expand_impulse_response(damping: float, stiffness: float, time: float) -> ImpulseResponse:
    """Return the impulse response of ẍ + 2δ ẋ + κ x = 0 by its Taylor series.

    The series is for a short time t, ``time`` in s. ``damping`` is 2δ t and ``stiffness`` is κ t²,
    both without unit. The terms follow from the equation of motion.
    """
    term, previous, value, integral = 1.0, 0.0, 0.0, 0.0
    for i in range(2, SERIES_TERMS + 1):
        inverse = 1.0 / i
        integral_term = term * inverse
        value += term
        integral += integral_term
        previous, term = integral_term, -(damping * integral_term + stiffness * previous * inverse)
        if abs(previous) + abs(term) < MIN_SERIES_TERM:
            break
    rate = 1.0 - damping * value - stiffness * integral
    return ImpulseResponse(value * time, rate, integral * time * time)


def _overdamped_impulse_response(
    decay: float, root: float, stiffness: float, time: float
) -> ImpulseResponse:
    """Return the impulse response of ẍ + 2δ ẋ + κ x = 0 for δ² ≥ κ.

    ``decay`` is δ and ``root`` is √(δ² − κ), in 1/s. ``stiffness`` is κ in 1/s², and ``time`` is in
    s. The formulas contain no growing exponential.
    """
    fast, difference = decay + root, 2.0 * root
    slow = stiffness / fast
    growth = -math.expm1(-difference * time) / difference if difference > 0.0 else time
    value = math.exp(-slow * time) * growth
    rate = math.exp(-fast * time) - slow * value
    if slow > MIN_RATE_RATIO * fast:
        return ImpulseResponse(value, rate, (1.0 - rate - 2.0 * decay * value) / stiffness)
    slow_integral = -math.expm1(-slow * time) / slow if slow > 0.0 else time
    integral = (slow_integral + math.expm1(-fast * time) / fast) / difference
    return ImpulseResponse(value, rate, integral)


def start_free_motion(system: Records, start: Vector) -> LiftOffState:
    """Return the constants of a flight that starts in a state of the masses, ``(n,)``.

    ``system`` contains the coefficients of the masses in flight, one record of `FREE_SYSTEM`.
    """
    free, size = system[0], len(start)
    load = free["load"]
    rates = multiply(free["matrix"], start)
    for i in range(size):
        rates[i] += load[i]
    pairs = np.zeros(size // 2, PAIR_START)
    if free["has_pairs"]:
        modal, modal_load = multiply(free["inverse"], start), free["modal_load"]
        for i in range(size // 2):
            displacement, velocity = modal[2 * i], modal[2 * i + 1]
            damping, stiffness = free["pair_damping"][i], free["pair_stiffness"][i]
            gain, push = modal_load[2 * i], modal_load[2 * i + 1]
            pair = pairs[i]
            pair["rate"] = velocity + gain
            pair["pull"] = stiffness * displacement - push - damping * gain
            pair["force"] = -stiffness * displacement - damping * velocity + push
    return LiftOffState(free=system, start=start, rates=rates, pairs=pairs)


def multiply(matrix: Matrix, column: Vector) -> Vector:
    """Return the product of a matrix and a column vector ``(n,)``, shape ``(n,)``.

    Of a matrix that is larger than n × n, only the first n rows and columns are used.
    """
    out = np.zeros(len(column))
    for i in range(len(column)):
        out[i] = dot(column, matrix[i])
    return out


def contact_component(lift_off: LiftOffState, state: Vector) -> float:
    """Return the component of a state vector that belongs to the contact mass.

    The contact mass is the mass that meets the cam. The component is its displacement (m) if
    ``state`` is x, and its velocity (m/s) if ``state`` is the rate ẋ.
    """
    return dot(state, lift_off.free[0]["contact_row"])


def advance(lift_off: LiftOffState, time: float) -> Advance:
    """Return the change and the rates of all states a time (s) after the lift-off."""
    free, size = lift_off.free[0], len(lift_off.start)
    if not free["has_pairs"]:
        flow, integral = _exponential(free, time, size)
        return Advance(multiply(integral, lift_off.rates), multiply(flow, lift_off.rates))
    modes = free["modes"]
    change, rates = np.zeros(size), np.zeros(size)
    for i in range(size // 2):
        pair = _advance_pair(lift_off, i, time)
        change[2 * i], change[2 * i + 1] = pair.displacement, pair.velocity
        rates[2 * i], rates[2 * i + 1] = pair.displacement_rate, pair.velocity_rate
    return Advance(multiply(modes, change), multiply(modes, rates))


def _advance_pair(lift_off: LiftOffState, i: int, time: float) -> PairAdvance:
    """Return the change of a decoupled pair of states (q, q̇) since the lift-off.

    ``i`` is the index of the pair, and ``time`` is the time since the lift-off, s.
    """
    free, pair = lift_off.free[0], lift_off.pairs[i]
    stiffness = free["pair_stiffness"][i]
    response = compute_impulse_response(free["pair_damping"][i], stiffness, time)
    rate, pull, force = pair["rate"], pair["pull"], pair["force"]
    return PairAdvance(
        displacement=rate * response.value - pull * response.integral,
        velocity=force * response.value - stiffness * rate * response.integral,
        displacement_rate=rate * response.rate - pull * response.value,
        velocity_rate=force * response.rate - stiffness * rate * response.value,
    )


def advance_contact_mass(lift_off: LiftOffState, time: float) -> ContactMassMotion:
    """Return the motion of the contact mass a time (s) after the lift-off.

    The result contains a bound of its acceleration at all later times, by inequality (5) of
    docs/proofs.md.
    """
    free = lift_off.free[0]
    if not free["has_pairs"]:
        state = advance(lift_off, time)
        return ContactMassMotion(
            change=contact_component(lift_off, state.change),
            velocity=contact_component(lift_off, state.rates),
            max_acceleration=bound_acceleration(lift_off, state.rates),
        )
    change, velocity, row, energy = 0.0, 0.0, free["modal_contact_row"], free["modal_energy"]
    e0, e1, e2, e3 = 0.0, 0.0, 0.0, 0.0  # components of E ẋ, without an array to save time
    for i in range(len(lift_off.start) // 2):
        pair, j = _advance_pair(lift_off, i, time), 2 * i
        change += row[j] * pair.displacement + row[j + 1] * pair.velocity
        velocity += row[j] * pair.displacement_rate + row[j + 1] * pair.velocity_rate
        e0 += energy[0][j] * pair.displacement_rate + energy[0][j + 1] * pair.velocity_rate
        e1 += energy[1][j] * pair.displacement_rate + energy[1][j + 1] * pair.velocity_rate
        e2 += energy[2][j] * pair.displacement_rate + energy[2][j + 1] * pair.velocity_rate
        e3 += energy[3][j] * pair.displacement_rate + energy[3][j + 1] * pair.velocity_rate
    return ContactMassMotion(change, velocity, math.sqrt(e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3))


def bound_acceleration(lift_off: LiftOffState, rates: Vector) -> float:
    """Return an upper bound (m/s²) of |acceleration| of the contact mass in flight.

    It applies to the present and all later times. ``rates`` are the rates ẋ of all states at the
    present time. The bound is ‖E ẋ‖, inequality (5) of docs/proofs.md.
    """
    total, energy = 0.0, lift_off.free[0]["energy"]
    for i in range(len(rates)):
        component = dot(rates, energy[i])
        total += component * component
    return math.sqrt(total)


def acceleration_ordinates(lift_off: LiftOffState, rates: Vector, duration: float) -> Vector:
    """Return the acceleration of the contact mass as a polynomial of time.

    The contact mass is the mass that meets the cam. Returns the Bernstein ordinates (m/s²) of the
    polynomial, shape ``(SERIES_SIZE,)``. They cover ``duration`` s, at most the field ``window`` of
    `FREE_SYSTEM`. They start at the time at which the rates of the states are ``rates``. Lemma (10)
    of docs/proofs.md bounds the truncation error.
    """
    series, ordinates = lift_off.free[0]["series"], np.zeros(SERIES_SIZE)
    for j in range(SERIES_SIZE):
        ordinates[j] = dot(rates, series[j])
    fraction = duration / lift_off.free[0]["window"]
    return ordinates if fraction >= 1.0 else restrict(ordinates, SERIES_SIZE, 0.0, fraction)


def compute_flow(free: np.void, time: float) -> Matrix:
    """Return the matrix e^{At} of the masses in flight for a time (s), ``(n, n)``.

    ``free`` is a record of `FREE_SYSTEM`.
    """
    size, inverse = free["size"], free["inverse"]
    if not free["has_pairs"]:
        return _exponential(free, time, size)[0]
    modal = np.zeros((size, size))
    for i in range(size // 2):
        damping, stiffness = free["pair_damping"][i], free["pair_stiffness"][i]
        response = compute_impulse_response(damping, stiffness, time)
        value, rate = response.value, response.rate
        upper, lower = inverse[2 * i], inverse[2 * i + 1]
        for j in range(size):
            modal[2 * i][j] = (rate + damping * value) * upper[j] + value * lower[j]
            modal[2 * i + 1][j] = rate * lower[j] - stiffness * value * upper[j]
    return _matrix_product(free["modes"], modal, 1.0)


def _exponential(free: np.void, time: float, size: int) -> tuple[Matrix, Matrix]:
    """Return the matrix F = e^{At} for a time (s), and its integral P from time 0.

    Both are ``(n, n)``, with A and n = ``size`` of ``free``, a record of `FREE_SYSTEM`. They are
    computed by scaling and squaring: if the time is doubled, F becomes F² and P becomes P + F P.
    """
    reach, doublings = abs(time) * WINDOW_REACH / free["window"], 0
    while reach > MAX_EXPONENTIAL_REACH:
        reach, doublings = 0.5 * reach, doublings + 1
    step = time
    for _ in range(doublings):
        step *= 0.5
    flow, integral, term = np.zeros((size, size)), np.zeros((size, size)), np.zeros((size, size))
    for i in range(size):
        flow[i][i], integral[i][i], term[i][i] = 1.0, step, 1.0
    for order in range(1, EXPONENTIAL_TERMS):
        term = _matrix_product(free["matrix"], term, step / order)
        _add_scaled(flow, term, 1.0)
        _add_scaled(integral, term, step / (order + 1))
    for _ in range(doublings):
        _add_scaled(integral, _matrix_product(flow, integral, 1.0), 1.0)
        flow = _matrix_product(flow, flow, 1.0)
    return flow, integral


def _matrix_product(left: Matrix, right: Matrix, scale: float) -> Matrix:
    """Return the product of two square matrices, multiplied by ``scale``.

    The sums have a fixed order, so that plain Python and compiled code give identical bits.
    """
    size = len(right)
    out = np.zeros((size, size))
    for i in range(size):
        for j in range(size):
            total = 0.0
            for k in range(size):
                total += left[i][k] * right[k][j]
            out[i][j] = scale * total
    return out


def _add_scaled(target: Matrix, term: Matrix, scale: float) -> None:
    """Add ``scale`` times a square matrix to ``target`` in place."""
    for i in range(len(target)):
        for j in range(len(target)):
            target[i][j] += scale * term[i][j]

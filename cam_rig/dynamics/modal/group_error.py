"""Chord error of the output over a step of the cam speed, for each group of pieces.

A group contains adjacent polynomial pieces of the law. At a fixed cam angle of a run the output F
of a vibration mode, for example the contact force, is a smooth function of the cam speed Ω. Its
chord error is the straight line between its values at two speeds less F. The forced response, a
polynomial, has bounded derivatives with respect to Ω (26). A free vibration that was excited with
norm N a time t ago is at most N e^{−λt}, and t is proportional to 1/Ω. Its second derivative with
respect to Ω contains t and t², and it fades (24). The sums of N t^q e^{−λt} for q = 0, 1, 2 are
updated from group to group.

Numbers in brackets are those of docs/proofs.md, part 2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cam_rig.dynamics.modal.motion import (
    GroupRow,
    LawSeries,
    ModeOnLaw,
    Series,
    VibrationNorm,
    add_weighted,
)
from cam_rig.laws.vectors import Matrix, Records, Vector
from cam_rig.units import TURN

#: Lower limit of divisors that may be zero, so that quotients stay finite. It is far below all
#: physical values.
MIN_DIVISOR = 1e-100

#: Record of the bounds of the output F in one group of adjacent pieces of the law, between two cam
#: speeds, by (27) of docs/proofs.md.
GROUP_ERROR = np.dtype(
    [
        ("curvature", "f8"),  # upper bound of |d²F/dΩ²|, F is the output and Ω the cam speed
        ("vibration", "f8"),  # upper bound of |V|, the part of F from the free vibration
        ("forced_curvature", "f8"),  # upper bound of |d²P/dΩ²|, P is the polynomial part of F
    ],
    align=True,
)


class Excitation(NamedTuple):
    """Upper bounds of the vibration norm N that jumps of the law's derivatives excite.

    N is that of `VibrationNorm`, in m/s. The bounds of its derivatives with respect to the cam
    speed Ω are included. They are (23) of docs/proofs.md.
    """

    n: float  #: upper bound of the norm N, m/s
    slope: float  #: upper bound of N' = dN/dΩ
    curvature: float  #: upper bound of N'' = d²N/dΩ²


class FadingSums(NamedTuple):
    """Sums over all previous excitations of the vibration, which fade with time.

    An excitation is a jump of a derivative of the law. Each term has the factor e^{−λt} for the
    time t in s since the excitation. N, N' and N'' are those of `Excitation`. The sums bound the
    second derivative of the vibration with respect to the cam speed, by (24) of docs/proofs.md.
    """

    n: float  #: Σ N e^{−λt}
    n_t: float  #: Σ N t e^{−λt}
    n_tt: float  #: Σ N t² e^{−λt}
    slope: float  #: Σ N' e^{−λt}
    slope_t: float  #: Σ N' t e^{−λt}
    curvature: float  #: Σ N'' e^{−λt}


class SpeedStep(NamedTuple):
    """Step of the cam speed, and the duration of the runs at both speeds."""

    low: float  #: lower speed, rad/s
    high: float  #: higher speed, rad/s
    duration: float  #: duration of the run, s, infinite in steady state


def bound_groups(
    run: ModeOnLaw, norm: VibrationNorm, low: float, high: float, out: Records
) -> None:
    """Write bounds of the chord error in all groups of the law's pieces to ``out``.

    The chord error is the deviation of the output from the straight line between its values at the
    cam speeds ``low`` and ``high``, rad/s. ``out`` are records of `GROUP_ERROR`, one per group of
    adjacent pieces of the law. ``norm`` is the norm of the mode's free vibration.
    """
    law, mode, series = run
    count, step = len(law.first_pieces) - 1, SpeedStep(low, high, mode.duration)
    remainders, forced = np.zeros(count), np.zeros(count)
    weights = _excitation_weights(norm, series, high)
    add_weighted(forced, _curvature_weights(series, high), law.groups[GroupRow.MAX], 0)
    for i in range(count):
        out[i]["curvature"], out[i]["vibration"] = forced[i], 0.0
        out[i]["forced_curvature"] = forced[i]
        remainders[i] = math.exp(-norm.decay * _span(law, i) / high)
    at_start = _excite(law.groups[GroupRow.START_JUMP], weights)
    inside = _excite(law.groups[GroupRow.INNER_JUMPS], weights)
    start = np.zeros(3)
    if mode.duration < math.inf:
        for k in range(len(weights[0])):
            size = abs(law.derivatives[0][k][0])
            for i in range(3):
                start[i] += weights[i][k] * size
    from_rest = Excitation(start[0], start[1], start[2])
    _add_vibrations(law, norm, step, remainders, at_start, inside, from_rest, out)


def _span(law: LawSeries, group: int) -> float:
    """Return the cam angle (rad) that a group of adjacent pieces covers."""
    first, end = law.first_pieces[group], law.first_pieces[group + 1]
    span: float = law.breaks[end] - law.breaks[first]
    return span


def _excitation_weights(norm: VibrationNorm, series: Series, speed: float) -> Matrix:
    """Return the factors of |jump of s⁽ᵏ⁾| in the excitation, shape ``(3, p + 2)``.

    The three rows are for the norm N of the excited vibration and its derivatives N' and N'' with
    respect to the cam speed, by (23) of docs/proofs.md. The columns are k = 0 … p + 1. ``speed`` is
    in rad/s.
    """
    factor, power, count = norm.rho + norm.delta, 1.0, len(series.eta)
    out = np.zeros((3, count + 1))
    for k in range(count + 1):
        weight = factor * abs(series.eta[k]) if k < count else 0.0
        if k > 0:
            weight += abs(series.eta[k - 1])
        weight *= power
        out[0][k], out[1][k] = weight, k * weight / speed
        out[2][k] = k * (k - 1) * weight / (speed * speed)
        power *= speed
    return out


def _curvature_weights(series: Series, speed: float) -> Vector:
    """Return the factors of max |s⁽ᵏ⁾| in the bound of |d²P/dΩ²|, one for each k.

    P = Σ gₖ Ωᵏ s⁽ᵏ⁾ is the polynomial part of the output at the cam speed Ω (``speed``, rad/s). The
    factors are k(k − 1) |gₖ| Ωᵏ⁻², by (26) of docs/proofs.md.
    """
    weights, power = np.zeros(len(series.output)), 1.0
    for k in range(2, len(weights)):
        weights[k] = k * (k - 1) * abs(series.output[k]) * power
        power *= speed
    return weights


def _excite(jumps: Matrix, weights: Matrix) -> Matrix:
    """Return the excitation N, N' and N'' by the jumps in each group, shape ``(3, g)``.

    ``jumps`` are sums of |jump of s⁽ᵏ⁾| in each of g groups of pieces, shape ``(p + 2, g)``.
    ``weights`` are those of `_excitation_weights`. The formula is (23) of docs/proofs.md.
    """
    out = np.zeros((3, len(jumps[0])))
    for i in range(3):
        add_weighted(out[i], weights[i], jumps, 0)
    return out


def _add_vibrations(
    law: LawSeries,
    norm: VibrationNorm,
    step: SpeedStep,
    remainders: Vector,
    at_start: Matrix,
    inside: Matrix,
    from_rest: Excitation,
    out: Records,
) -> None:
    """Add the bounds of the free vibrations' chord errors to ``out``, group by group.

    Vibrations are excited by the jumps at the start of each group of pieces (``at_start``), by the
    jumps inside it (``inside``), and by the start of the run (``from_rest``). ``remainders`` are
    the fractions of a vibration that are left after each group. A vibration that is excited inside
    a group gets the largest possible size and age: it does not fade before the end of the group and
    has the age of an excitation at its start.
    """
    sums, end = FadingSums(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), step.high * step.duration
    count = len(remainders)
    if end > TURN:
        for i in range(count):
            time = _span(law, i) / step.low
            if i > 0:
                sums = _add(sums, _column(at_start, i), 0.0)
            sums = _add(_fade(sums, remainders[i], time), _column(inside, i), time)
        sums = _repeat_turn(_add(sums, _column(at_start, 0), 0.0), norm, step)
    max_age = min(step.duration, 1.0 / max(norm.decay, MIN_DIVISOR))
    sums = _add(sums, from_rest, max_age)
    for i in range(count):
        if law.breaks[law.first_pieces[i]] >= end:
            break
        time = _span(law, i) / step.low
        if i > 0:
            sums = _add(sums, _column(at_start, i), 0.0)
        inner = FadingSums(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        inner = _add(inner, _column(inside, i), time)
        curvature = _bound_curvature(sums, norm, min(time, max_age), step.low)
        curvature += _bound_curvature(inner, norm, 0.0, step.low)
        out[i]["curvature"] += norm.reach * curvature
        out[i]["vibration"] += norm.reach * (sums.n + inner.n)
        sums = _add(_fade(sums, remainders[i], time), _column(inside, i), time)


def _column(rows: Matrix, group: int) -> Excitation:
    """Return the excitation of vibrations in one group of the law's pieces.

    ``rows`` is the array of all groups, with the rows N, N' and N'' of `Excitation` and one column
    per group. ``group`` is the index of the group.
    """
    return Excitation(rows[0][group], rows[1][group], rows[2][group])


def _add(sums: FadingSums, added: Excitation, age: float) -> FadingSums:
    """Return sums over past excitations of the vibration, with one more excitation.

    ``age`` is the time since the excitation ``added``, s. Its terms have no fading factor yet.
    """
    return FadingSums(
        n=sums.n + added.n,
        n_t=sums.n_t + added.n * age,
        n_tt=sums.n_tt + added.n * age * age,
        slope=sums.slope + added.slope,
        slope_t=sums.slope_t + added.slope * age,
        curvature=sums.curvature + added.curvature,
    )


def _fade(sums: FadingSums, remainder: float, time: float) -> FadingSums:
    """Return sums over past excitations of the vibration after a further ``time`` (s).

    ``remainder`` is the fraction to which a vibration fades in this time.
    """
    return FadingSums(
        n=remainder * sums.n,
        n_t=remainder * (sums.n_t + time * sums.n),
        n_tt=remainder * (sums.n_tt + time * (2.0 * sums.n_t + time * sums.n)),
        slope=remainder * sums.slope,
        slope_t=remainder * (sums.slope_t + time * sums.slope),
        curvature=remainder * sums.curvature,
    )


def _repeat_turn(sums: FadingSums, norm: VibrationNorm, step: SpeedStep) -> FadingSums:
    """Return the sums over the excitations of all previous turns of the run.

    ``sums`` are those over a single turn. The bound is (25) of docs/proofs.md. ``norm`` is the norm
    of the free vibration, which fades, and ``step`` the step of the cam speed.
    """
    period, turns = TURN / step.low, step.high * step.duration / TURN
    remainder = math.exp(-norm.decay * TURN / step.high)
    endless = 1.0 / max(-math.expm1(-norm.decay * TURN / step.high), MIN_DIVISOR)
    number = min(turns, endless)
    linear = period * min(0.5 * turns * turns, remainder * endless * endless)
    square = remainder * (1.0 + remainder) * endless * endless * endless
    square = period * period * min(turns * turns * turns / 3.0, square)
    return FadingSums(
        n=sums.n * number,
        n_t=sums.n_t * number + sums.n * linear,
        n_tt=sums.n_tt * number + 2.0 * sums.n_t * linear + sums.n * square,
        slope=sums.slope * number,
        slope_t=sums.slope_t * number + sums.slope * linear,
        curvature=sums.curvature * number,
    )


def _bound_curvature(sums: FadingSums, norm: VibrationNorm, time: float, low: float) -> float:
    """Return an upper bound of the norm of d²V/dΩ² of the free vibration V.

    V is the sum of all vibrations in ``sums``, and Ω is the cam speed. The bound applies up to
    ``time`` s after the time of ``sums``. ``low`` is the lower speed of the step, rad/s. The
    formula is (24) of docs/proofs.md.
    """
    rate, n_t = norm.sigma / low, sums.n_t + time * sums.n
    n_tt = sums.n_tt + time * (2.0 * sums.n_t + time * sums.n)
    slope_t = sums.slope_t + time * sums.slope
    return sums.curvature + rate * (2.0 * slope_t + rate * n_tt + 2.0 / low * n_t)

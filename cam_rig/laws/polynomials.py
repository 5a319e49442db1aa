"""Functions for single polynomials in Bernstein form on u ∈ [0, 1].

Compiled code uses them too. A vector of n + 1 ordinates bᵢ is the polynomial Σ bᵢ C(n, i) uⁱ(1 −
u)ⁿ⁻ⁱ. Weighted ordinates are bᵢ C(n, i). Numbers in brackets are the inequalities of
docs/proofs.md, part 1.
"""

from __future__ import annotations

import numpy as np

from cam_rig.laws.vectors import Matrix, Vector, binomials

#: Smallest width of a part of [0, 1] that is halved. Below it double precision does not separate
#: two roots.
MIN_PART_WIDTH = 2.0**-46
#: Largest number of halvings of [0, 1], a few more than reach `MIN_PART_WIDTH`.
MAX_DEPTH = 48
#: Relative width of a bracket at which a root is found: four float epsilons.
BRACKET_RTOL = 4.0 * 2.0**-52
#: Largest relative size of a Newton step that cannot change a root.
NEGLIGIBLE_STEP = 2.0**-55
#: Largest relative size of steps that count as rounding if they stop shrinking.
ROUNDING_STEP = 2.0**-40
#: Largest number of Newton steps. A root next to 0 may need as many halvings as floats allow, other
#: roots need about six.
MAX_STEPS = 2000
#: Return value of a search that finds no root.
NO_ROOT = -1.0


def restrict(ordinates: Vector, size: int, first: float, last: float) -> Vector:
    """Return the ordinates of a polynomial on [first, last] ⊂ [0, 1], first < 1.

    The polynomial is that of the first ``size`` ordinates. The algorithm is de Casteljau's.
    """
    inner = last
    out = np.zeros(size)
    for i in range(size):
        out[i] = ordinates[i]
    if first > 0.0:
        remainder, inner = 1.0 - first, (last - first) / (1.0 - first)
        for count in range(size - 1, 0, -1):
            current = out[0]
            for i in range(count):
                following = out[i + 1]
                out[i], current = remainder * current + first * following, following
    if inner < 1.0:
        remainder = 1.0 - inner
        for order in range(1, size):
            previous = out[order - 1]
            for i in range(order, size):
                current = out[i]
                out[i], previous = remainder * previous + inner * current, current
    return out


def elevate(ordinates: Vector, size: int) -> Vector:
    """Return the ordinates of the same polynomial with a higher degree, ``(size,)``.

    They are convex combinations of the given ones, so the conversion is stable.
    """
    if len(ordinates) == size:
        return ordinates
    out, weights = np.zeros(size), binomials(len(ordinates) - 1)
    factors = binomials(size - len(ordinates))
    for i in range(len(ordinates)):
        weighted = weights[i] * ordinates[i]
        for j in range(len(factors)):
            out[i + j] += weighted * factors[j]
    weights = binomials(size - 1)
    for i in range(size):
        out[i] /= weights[i]
    return out


def integrate(ordinates: Vector, length: float, start: float) -> Vector:
    """Return the ordinates of the integral of a polynomial, one degree higher.

    The interval has the length ``length``. The value of the integral at u = 0 is ``start``.
    """
    size = len(ordinates)
    out, step, total = np.zeros(size + 1), length / size, 0.0
    out[0] = start
    for i in range(size):
        total += ordinates[i]
        out[i + 1] = step * total + start
    return out


def horner(weighted: Vector, slopes: Vector, degree: int, u: float) -> tuple[float, float, float]:
    """Return v, w and r, so that the value at u is v rⁿ and the derivative w rⁿ⁻¹.

    n is ``degree``. ``weighted`` and ``slopes`` are the weighted ordinates of both. Horner's rule
    is applied in u/(1 − u), or in its inverse beyond the middle, so that no power grows.
    """
    slope, remainder = 0.0, 1.0 - u
    if u < 0.5:
        ratio, total = u / remainder, weighted[degree]
        for i in range(degree - 1, -1, -1):
            total = total * ratio + weighted[i]
            slope = slope * ratio + slopes[i]
        return total, slope, remainder
    ratio, total = remainder / u, 0.0
    for i in range(degree):
        total = total * ratio + weighted[i]
        slope = slope * ratio + slopes[i]
    return total * ratio + weighted[degree], slope, u


def weighted_value(weighted: Vector, size: int, u: float) -> float:
    """Return the value at u of the polynomial with ``size`` weighted ordinates."""
    total, remainder, power = 0.0, 1.0 - u, 1.0
    if u < 0.5:
        ratio = u / remainder
        for i in range(size - 1, -1, -1):
            total = total * ratio + weighted[i]
            power *= remainder
        return total * (power / remainder)
    ratio = remainder / u
    for i in range(size):
        total = total * ratio + weighted[i]
        power *= u
    return total * (power / u)


def weight_ordinates(ordinates: Vector, size: int) -> Vector:
    """Return the first ``size`` ordinates multiplied by their binomial coefficients."""
    out, weights = np.zeros(size), binomials(size - 1)
    for i in range(size):
        out[i] = weights[i] * ordinates[i]
    return out


def value_at(ordinates: Vector, size: int, u: float) -> float:
    """Return the value at u of the polynomial with the first ``size`` ordinates."""
    return weighted_value(weight_ordinates(ordinates, size), size, u)


def find_single_root(ordinates: Vector) -> float:
    """Return the root u ∈ (0, 1) of a polynomial that changes sign once.

    Invariant: the root is in [low, high]. A Newton step that leaves the bracket, or that is longer
    than half the last step, is replaced by a halving.
    """
    degree = len(ordinates) - 1
    weighted, slopes = weight_ordinates(ordinates, degree + 1), np.zeros(degree)
    weights = binomials(degree - 1)
    for i in range(degree):
        slopes[i] = degree * weights[i] * (ordinates[i + 1] - ordinates[i])
    low, high, step, converges = 0.0, 1.0, 1.0, False
    u: float = ordinates[0] / (ordinates[0] - ordinates[degree])
    for _ in range(MAX_STEPS):
        value, slope, scale = horner(weighted, slopes, degree, u)
        if value == 0.0:
            return u
        if (value < 0.0) == (ordinates[0] < 0.0):
            low = u
        else:
            high = u
        following = u - value * scale / slope if slope != 0.0 else low
        newton_step = abs(following - u)
        is_inside, shrinks = low < following < high, newton_step <= 0.5 * step
        # Each Newton step is a constant times the square of the previous one.
        if (
            converges
            and is_inside
            and newton_step * (newton_step / step) * (newton_step / step) <= NEGLIGIBLE_STEP * u
        ):
            return following
        if converges and not shrinks and step <= ROUNDING_STEP * u:  # the value is rounding
            return u
        converges = is_inside and shrinks
        if not converges:
            following = 0.5 * (low + high)
        step = abs(following - u)
        u = following
        if high - low <= BRACKET_RTOL * u:
            return u
    return u


def count_sign_changes(ordinates: Vector) -> int:
    """Return the number of sign changes of the ordinates.

    By (7) it is at least the number of roots in (0, 1).
    """
    changes, previous = 0, 0.0
    for value in ordinates:
        if value != 0.0:
            if previous != 0.0 and (value < 0.0) != (previous < 0.0):
                changes += 1
            previous = value
    return changes


def have_opposite_signs(a: float, b: float) -> bool:
    """Return True if one number is negative and the other positive.

    The product of both could underflow.
    """
    return bool((a < 0.0 < b) or (b < 0.0 < a))


def find_crossing(ordinates: Vector, limit: float, last: bool) -> float:
    """Return the first or the last u in (0, 1) at which a polynomial changes sign.

    Sign changes beyond ``limit`` do not count. The result is `NO_ROOT` without a sign change.
    Invariant: each part of [0, 1] that is not on the stack does not contain a sign change that
    counts, because its ordinates do not change sign (7), or its sign change is in ``result``. A
    zero that is touched without crossing does not count.
    """
    parts = np.zeros((MAX_DEPTH, len(ordinates)))
    starts, widths = np.zeros(MAX_DEPTH), np.zeros(MAX_DEPTH)
    for i in range(len(ordinates)):
        parts[0][i] = ordinates[i]
    widths[0], top, result = 1.0, 0, NO_ROOT
    while top >= 0:
        part, start, width = parts[top], starts[top], widths[top]
        changes = count_sign_changes(part) if start <= limit else 0
        crosses = have_opposite_signs(part[0], part[-1])
        root = NO_ROOT
        if (changes == 1 and crosses) or (changes > 0 and width <= MIN_PART_WIDTH):
            if crosses:
                root = start + width * (find_single_root(part) if changes == 1 else 0.5)
            top -= 1
        elif changes == 0:
            top -= 1
        else:  # the left half first, then the right one
            if halve_at_root(parts, top):
                root = start + 0.5 * width
            widths[top], widths[top + 1] = 0.5 * width, 0.5 * width
            starts[top], starts[top + 1] = start + 0.5 * width, start
            top += 1
        if 0.0 <= root <= limit:
            result = max(result, root) if last else root
            limit = limit if last else root
    return result


def halve(right: Vector, left: Vector) -> None:
    """Replace a polynomial by its right half, and write its left half to ``left``.

    The algorithm is de Casteljau's.
    """
    size = len(right)
    for order in range(size):
        left[order] = current = right[0]
        for i in range(size - 1 - order):
            following = right[i + 1]
            right[i], current = 0.5 * (current + following), following


def halve_at_root(parts: Matrix, top: int) -> bool:
    """Halve the part ``top``: its right half replaces it, its left half the next part.

    Returns True if the polynomial changes sign exactly in the middle.
    """
    right, left = parts[top], parts[top + 1]
    size = len(right)
    halve(right, left)
    if right[0] != 0.0:
        return False
    before, after = size - 1, 0
    while before > 0 and left[before] == 0.0:
        before -= 1
    while after < size - 1 and right[after] == 0.0:
        after += 1
    return have_opposite_signs(left[before], right[after])


def find_fall(ordinates: Vector, rounding: float) -> float:
    """Return the zero u ∈ [0, 1] after which a polynomial is below −``rounding``.

    The result is `NO_ROOT` without such a zero. It is 0 if the polynomial starts below
    −``rounding``, or if it starts below zero by less and continues to fall.
    """
    lowest = ordinates[0]
    for value in ordinates:
        lowest = min(lowest, value)
    if lowest >= -rounding:
        return NO_ROOT
    if ordinates[0] < -rounding:
        return 0.0
    if ordinates[0] > 0.0 and ordinates[-1] < -rounding and count_sign_changes(ordinates) == 1:
        return find_single_root(ordinates)
    raised = np.zeros(len(ordinates))
    for i in range(len(ordinates)):
        raised[i] = ordinates[i] + rounding
    below = find_crossing(raised, 1.0, False)
    if below < 0.0:
        return NO_ROOT
    return max(0.0, find_crossing(ordinates, below, True))

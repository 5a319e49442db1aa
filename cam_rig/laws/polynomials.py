"""Polynomials in Bernstein form, one at a time, and where they fall below zero."""

from __future__ import annotations

from cam_rig.laws.rows import Row, Rows, binomials, zeros

#: Subdivision stops here: roots nearer than this cannot be told apart in double precision.
RESOLUTION, MAX_DEPTH = 2.0**-46, 48
#: Relative width at which two neighbouring floats are told apart no further.
WIDTH = 4.0 * 2.0**-52
#: Steps beside the root: one that need not be taken, and one as small as the value's rounding.
NOTHING, ROUNDED = 2.0**-55, 2.0**-40
#: A root beside 0 may take as many halvings as a float has; an ordinary one takes some six steps.
MAX_STEPS = 2000
#: Where there is no root.
NONE = -1.0


def restricted(row: Row, size: int, first: float, last: float) -> Row:
    """The first ``size`` ordinates on [first, last] ⊂ [0, 1], first < 1 (de Casteljau)."""
    inner = last
    out = zeros(size)
    for i in range(size):
        out[i] = row[i]
    if first > 0.0:
        rest, inner = 1.0 - first, (last - first) / (1.0 - first)
        for count in range(size - 1, 0, -1):
            now = out[0]
            for i in range(count):
                after = out[i + 1]
                out[i], now = rest * now + first * after, after
    if inner < 1.0:
        rest = 1.0 - inner
        for order in range(1, size):
            before = out[order - 1]
            for i in range(order, size):
                now = out[i]
                out[i], before = rest * before + inner * now, now
    return out


def elevated(row: Row, size: int) -> Row:
    """The same polynomial with ``size`` ordinates: convex combinations, so stable."""
    if len(row) == size:
        return row
    out, own, more = zeros(size), binomials(len(row) - 1), binomials(size - len(row))
    for i in range(len(row)):
        weighted = own[i] * row[i]
        for j in range(len(more)):
            out[i + j] += weighted * more[j]
    own = binomials(size - 1)
    for i in range(size):
        out[i] /= own[i]
    return out


def integrated(row: Row, length: float, start: float) -> Row:
    """The integral over ``length`` that begins at ``start``, one degree higher."""
    size = len(row)
    out, step, total = zeros(size + 1), length / size, 0.0
    out[0] = start
    for i in range(size):
        total += row[i]
        out[i + 1] = step * total + start
    return out


def horner(weighted: Row, slopes: Row, degree: int, u: float) -> tuple[float, float, float]:
    """A value and its slope at u, of ordinates times binomials, but for powers of the third.

    Horner's rule in u/(1 − u), or in its inverse beyond the middle, so that no power grows. The
    value is still to be multiplied by the scale to the degree's power, the slope to one less.
    """
    slope, rest = 0.0, 1.0 - u
    if u < 0.5:
        ratio, total = u / rest, weighted[degree]
        for i in range(degree - 1, -1, -1):
            total = total * ratio + weighted[i]
            slope = slope * ratio + slopes[i]
        return total, slope, rest
    ratio, total = rest / u, 0.0
    for i in range(degree):
        total = total * ratio + weighted[i]
        slope = slope * ratio + slopes[i]
    return total * ratio + weighted[degree], slope, u


def weighted_value(weighted: Row, size: int, u: float) -> float:
    """The value at u of ``size`` ordinates times binomials."""
    total, rest, power = 0.0, 1.0 - u, 1.0
    if u < 0.5:
        ratio = u / rest
        for i in range(size - 1, -1, -1):
            total = total * ratio + weighted[i]
            power *= rest
        return total * (power / rest)
    ratio = rest / u
    for i in range(size):
        total = total * ratio + weighted[i]
        power *= u
    return total * (power / u)


def weighted_by_binomials(row: Row, size: int) -> Row:
    """The first ``size`` ordinates times binomials, for `horner`."""
    out, weights = zeros(size), binomials(size - 1)
    for i in range(size):
        out[i] = weights[i] * row[i]
    return out


def value_at(row: Row, size: int, u: float) -> float:
    """The value at u of the first ``size`` ordinates."""
    return weighted_value(weighted_by_binomials(row, size), size, u)


def only_root(row: Row) -> float:
    """U ∈ (0, 1) where a polynomial changes sign once: Newton's steps, and halvings beside them."""
    degree = len(row) - 1
    weighted, slopes = weighted_by_binomials(row, degree + 1), zeros(degree)
    weights = binomials(degree - 1)
    for i in range(degree):
        slopes[i] = degree * weights[i] * (row[i + 1] - row[i])
    low, high, step, closing = 0.0, 1.0, 1.0, False
    u = row[0] / (row[0] - row[degree])
    for _ in range(MAX_STEPS):
        value, slope, scale = horner(weighted, slopes, degree, u)
        if value == 0.0:
            return u
        if (value < 0.0) == (row[0] < 0.0):
            low = u
        else:
            high = u
        following = u - value * scale / slope if slope != 0.0 else low
        ahead = abs(following - u)
        # Each step of Newton's is a constant times the square of the one before.
        inside, quick = low < following < high, ahead <= 0.5 * step
        if closing and inside and ahead * (ahead / step) * (ahead / step) <= NOTHING * u:
            return following
        if closing and not quick and step <= ROUNDED * u:  # the value is rounding
            return u
        closing = inside and quick
        if not closing:
            following = 0.5 * (low + high)
        step = abs(following - u)
        u = following
        if high - low <= WIDTH * u:
            return u
    return u


def sign_changes(row: Row) -> int:
    """Changes of sign along the ordinates: no fewer than roots in (0, 1) (Descartes' rule)."""
    changes, before = 0, 0.0
    for value in row:
        if value != 0.0:
            if before != 0.0 and (value < 0.0) != (before < 0.0):
                changes += 1
            before = value
    return changes


def opposite(one: float, other: float) -> bool:
    """Whether the signs are opposite; a product of the two would underflow for tiny values."""
    return (one < 0.0 < other) or (other < 0.0 < one)


def crossing(row: Row, limit: float, last: bool) -> float:
    """The first change of sign in (0, 1) up to ``limit``, or the last one; `NONE` without one.

    None is missed: a part is dropped only when its ordinates do not change sign, which proves
    that the polynomial does not. Touching zero without crossing it is not counted.
    """
    parts, lows, widths = zeros((MAX_DEPTH, len(row))), zeros(MAX_DEPTH), zeros(MAX_DEPTH)
    for i in range(len(row)):
        parts[0][i] = row[i]
    widths[0], top, found = 1.0, 0, NONE
    while top >= 0:
        part, low, width = parts[top], lows[top], widths[top]
        changes = sign_changes(part) if low <= limit else 0
        ends = opposite(part[0], part[-1])
        root = NONE
        if (changes == 1 and ends) or (changes > 0 and width <= RESOLUTION):
            if ends:
                root = low + width * (only_root(part) if changes == 1 else 0.5)
            top -= 1
        elif changes == 0:
            top -= 1
        else:  # the left half comes first, then the right one
            if halve_at_root(parts, top):
                root = low + 0.5 * width
            widths[top], widths[top + 1] = 0.5 * width, 0.5 * width
            lows[top], lows[top + 1] = low + 0.5 * width, low
            top += 1
        if 0.0 <= root <= limit:
            found = max(found, root) if last else root
            limit = limit if last else root
    return found


def halve(right: Row, left: Row) -> None:
    """The right half of a polynomial in its place, the left one in another (de Casteljau)."""
    size = len(right)
    for order in range(size):
        left[order] = now = right[0]
        for i in range(size - 1 - order):
            after = right[i + 1]
            right[i], now = 0.5 * (now + after), after


def halve_at_root(parts: Rows, top: int) -> bool:
    """The right half in place of a part, the left one behind it; whether the middle is a root."""
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
    return opposite(left[before], right[after])


def fall(row: Row, noise: float) -> float:
    """U ∈ [0, 1] of the zero after which a polynomial is below −``noise``; `NONE` without one.

    One that is below at its start already falls there; so does one that begins below zero, if by
    less, and goes on falling.
    """
    lowest = row[0]
    for value in row:
        lowest = min(lowest, value)
    if lowest >= -noise:
        return NONE
    if row[0] < -noise:
        return 0.0
    if row[0] > 0.0 and row[-1] < -noise and sign_changes(row) == 1:
        return only_root(row)
    lifted = zeros(len(row))
    for i in range(len(row)):
        lifted[i] = row[i] + noise
    below = crossing(lifted, 1.0, False)
    if below < 0.0:
        return NONE
    return max(0.0, crossing(row, below, True))

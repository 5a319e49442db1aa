"""Rises that are tuned to a follower on its stem at one speed: polydyne and input shaping.

The mass on its stem has the equation m ẍ + c ẋ + (k + k_s) x = k_s s (eq. 5 of the paper).
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from cam_rig.errors import LawError
from cam_rig.laws import bernstein
from cam_rig.laws.bernstein import Pieces, join_pieces
from cam_rig.laws.catalogue import rise_figures
from cam_rig.laws.sampling import Section, fit_sections
from cam_rig.laws.segments import NAMED_RISES, RISES, unit_rise
from cam_rig.schema.law_names import law_name, suggest_law
from cam_rig.schema.motions import Polydyne
from cam_rig.schema.tuned import Shaping, Tuning
from cam_rig.units import FloatArray

#: Lowest class of the follower's motion of a polydyne cam. With a lower class the cam has steps.
MIN_CLASS = 2
#: Distance of two breakpoints, as a fraction of the span, below which they are one. On a shorter
#: piece the rounding of s'' would be larger than the step of s'' that the merged pieces leave.
BREAK_ATOL = 5e-6
#: Largest difference of the two outer ordinates of a unit rise that counts as velocity 0. Rounding
#: reaches 1e-12.
END_VELOCITY_ATOL = 1e-9
#: Smallest share of the span that the rise itself keeps when it is shaped.
MIN_RISE_SHARE = 0.1
#: Largest degree of the third derivative of a shaped rise. On short pieces of a higher degree the
#: vibration loses digits.
MAX_DEGREE = 9


def has_rests(name: str) -> bool:
    """Return True if a named rise is not designed for a velocity at its ends.

    The law ``constant_velocity`` is not designed for one either.
    """
    return name not in NAMED_RISES or NAMED_RISES[name].slopes == (0.0, 0.0)


def has_end_velocity(pieces: Pieces) -> bool:
    """Return True if a unit rise does not start and end with velocity 0.

    The velocity at an end is proportional to the difference of the two outer ordinates.
    """
    _, columns = pieces
    ends = columns[0][:2], columns[-1][-2:]
    return any(abs(end[-1] - end[0]) > END_VELOCITY_ATOL for end in ends)


def polydyne(segment: Polydyne) -> Pieces:
    """Return the pieces of a polydyne rise from 0 to 1 over u from 0 to 1.

    The follower's motion x̂ from 0 to 1 needs the lift x̂ + (c ω x̂' + m ω² x̂'')/(k + k_s). So the
    static deflection of the stem is that of any cam, and the levels are those of the file.

    Raises
    ------
    LawError
        If the follower's motion is not a rise between rests of class C2 or smoother.

    References
    ----------
    Equation 5 of the paper.
    """
    name = law_name(segment.follower)
    order = rise_figures(name).continuity if name in RISES and has_rests(name) else -1
    if order < MIN_CLASS:
        kind = (
            suggest_law(segment.follower, list(filter(has_rests, RISES)))
            if order < 0
            else f" of class C{order}"
        )
        raise LawError(
            f"follower is {segment.follower[:40]!r}{kind}; allowed: a rise between dwells of class "
            f"C{MIN_CLASS} or smoother, such as poly4567, so that the lift of the cam has no step"
        )
    rig, speed, span = segment.rig, segment.speed.si, segment.span.si
    stiffness = rig.spring_stiffness.si + rig.stem_stiffness.si
    factors = (1.0, rig.damping.si * speed / stiffness, rig.mass.si * speed**2 / stiffness)
    breaks, columns = unit_rise(name)
    result = []
    for start, stop, column in zip(breaks[:-1], breaks[1:], columns, strict=True):
        total, derivative = np.zeros_like(column), column
        for factor in factors:
            total = total + factor * bernstein.elevate(derivative, column.size - 1)
            derivative = bernstein.derivative(derivative) / (span * (stop - start))
        result.append(total)
    return breaks, result


def half_period(tuning: Tuning) -> tuple[float, float]:
    """Return the cam angle (rad) of half a period of the stem, and its decay.

    The decay is the ratio of the amplitudes after and before the half period.

    Raises
    ------
    LawError
        If the stem does not oscillate.
    """
    rig = tuning.rig
    rate = math.sqrt((rig.spring_stiffness.si + rig.stem_stiffness.si) / rig.mass.si)
    ratio = 0.5 * rig.damping.si / (rig.mass.si * rate)
    if ratio >= 1.0:
        raise LawError(
            f"shaping: the damping ratio of the stem of {rig.name} is {ratio:.4g}; allowed: below "
            "1, because the stem does not oscillate"
        )
    damped = math.sqrt(1.0 - ratio**2)
    return tuning.speed.si * math.pi / (rate * damped), math.exp(-math.pi * ratio / damped)


def shape(pieces: Pieces, span: float, shaping: Shaping) -> Pieces:
    """Return the sum of a unit rise and its delayed copies, over u from 0 to 1.

    The rise and its copies are shorter than the span (rad) by the delays, so that the sum ends with
    the span. The amplitudes are the powers of 1 + decay, with the sum 1.

    Raises
    ------
    LawError
        If the span is too short for the delays.
    """
    delay, decay = half_period(shaping)
    amplitudes = np.array([1.0, decay] if shaping.kind == "ZV" else [1.0, 2.0 * decay, decay**2])
    amplitudes /= amplitudes.sum()
    copies = amplitudes.size - 1
    shortest = copies * delay / (1.0 - MIN_RISE_SHARE)
    if span < shortest:
        raise LawError(
            f"span is {math.degrees(span):.6g}°, {shaping.kind} delays by "
            f"{math.degrees(copies * delay):.6g}°; allowed: at least {math.degrees(shortest):.6g}° "
            "(lengthen the span, or shape for a lower speed)"
        )
    starts: FloatArray = delay / span * np.arange(copies + 1.0)
    return _sum_of_copies(pieces, starts, amplitudes)


def _sum_of_copies(pieces: Pieces, starts: FloatArray, amplitudes: FloatArray) -> Pieces:
    """Return the sum of copies of a unit rise, which end at 1 with the last one.

    ``starts`` are those of the copies, the first at 0. The degree is low, because pieces may be
    short compared with a period of the stem.
    """
    width, breaks = 1.0 - float(starts[-1]), np.array(pieces[0])
    derivatives = [join_pieces(pieces[1])]
    for _ in range(3):
        derivatives.append(bernstein.derivative(derivatives[-1]) / (width * np.diff(breaks)))
    edges = np.sort((starts[:, None] + width * breaks).ravel())
    edges = edges[np.diff(edges, prepend=-1.0) > BREAK_ATOL]
    edges[-1] = 1.0

    def interval(low: float, high: float) -> Section:
        middles = (0.5 * (low + high) - starts) / width
        indices = np.searchsorted(breaks, middles) - 1

        def curve(x: FloatArray, order: int) -> FloatArray:
            total = np.full_like(x, amplitudes[middles >= 1.0].sum() if order == 0 else 0.0)
            for i, start, size in zip(indices, starts, amplitudes, strict=True):
                if 0 <= i < breaks.size - 1:
                    u = ((x - start) / width - breaks[i]) / (breaks[i + 1] - breaks[i])
                    total += size * bernstein.evaluate(derivatives[order][:, i], u)
            return total

        return low, high, curve

    degree = min(max(1, derivatives[0].shape[0] - 2), MAX_DEGREE)
    return fit_sections([interval(*ends) for ends in pairwise(edges.tolist())], degree)

"""Recognition of named laws in gauge readings: which rise explains each event, and how well.

An event is the motion between two dwells, or between a dwell and the extreme lift between two
dwells of one level. Each law of `candidates` is fitted to the readings of the event by least
squares, with four free parameters: start, span, level and rise. Laws are ranked by their
likelihood for normal errors of equal variance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from cam_rig.laws import bernstein
from cam_rig.laws.bernstein import Pieces, join_pieces
from cam_rig.laws.families import FAMILIES, family_rise, mirror
from cam_rig.laws.segments import NAMED_RISES, unit_rise
from cam_rig.laws.tuned import has_rests
from cam_rig.studies.fit_cam.dwells import FoundDwell
from cam_rig.studies.fit_cam.gauge import Readings
from cam_rig.units import TURN, FloatArray

#: Shares of constant velocity of the members of ``modified_constant_velocity`` in the trade.
TRADE_SHARES = (0.2, 0.33, 0.5, 0.66)
#: Smallest logarithm of the likelihood ratio to the best law at which another law is significantly
#: worse. The true law is worse than a wrong one by so much with a probability of at most 0.1 %.
SIGNIFICANT = -math.log(1e-3)
#: Largest ratio of the residual variance of the best law to that of the scatter, in standard errors
#: of the ratio above 1, at which the law explains the readings. It is far beyond chance.
MAX_RATIO_ERRORS = 6.0
#: Smallest number of readings of an event: twice the number of free parameters.
MIN_EVENT_READINGS = 8


@dataclass(frozen=True)
class RecognisedLaw:
    """Law that was fitted to the readings of an event, with standard errors.

    Parameters
    ----------
    event : int
        Index of the event from 1, in the order of the cam angle.
    law : str
        Name of the law, with its parameter, or "mirrored".
    start, start_error, span, span_error : float
        Cam angle of the start, and span, rad.
    rise, rise_error : float
        Rise, negative for a fall, m.
    rms : float
        Residual, r.m.s., m.
    worse : float
        Logarithm of the likelihood ratio of the best law to this law.
    explains : bool
        True if the residual is that of the scatter.
    """

    event: int
    law: str
    start: float
    start_error: float
    span: float
    span_error: float
    rise: float
    rise_error: float
    rms: float
    worse: float
    explains: bool


@lru_cache(maxsize=1)
def candidates() -> dict[str, Pieces]:
    """Return the unit rises that are recognised, each curve once, by name."""
    names = [name for name in NAMED_RISES if has_rests(name) and name != "constant_velocity"]
    rises = {name: unit_rise(name) for name in (*names, *FAMILIES)}
    for share in TRADE_SHARES:
        name = f"modified_constant_velocity {share:g}"
        rises[name] = family_rise("modified_constant_velocity", {"constant_velocity": share})
    rises |= {f"{name}, mirrored": mirror(rises[name]) for name in ("double_harmonic", "poly8")}
    u, unique = np.linspace(0.0, 1.0, 41), dict[bytes, str]()
    for name, pieces in rises.items():
        unique.setdefault(np.round(_values(pieces, u, 0), 9).tobytes(), name)
    return {name: rises[name] for name in unique.values()}


def _values(pieces: Pieces, u: FloatArray, order: int) -> FloatArray:
    """Return a unit rise with dwells before and after it, or its derivative, at any u."""
    breaks, inside = np.array(pieces[0]), np.clip(u, 0.0, 1.0)
    ordinates = join_pieces(pieces[1])
    for _ in range(order):
        ordinates = bernstein.derivative(ordinates) / np.diff(breaks)
    i = np.clip(np.searchsorted(breaks, inside, side="right") - 1, 0, breaks.size - 2)
    values = bernstein.evaluate(ordinates, (inside - breaks[i]) / np.diff(breaks)[i])
    return np.where((u == inside) | (order == 0), values[np.arange(u.size), i], 0.0)


def recognise(
    readings: Readings, dwells: Sequence[FoundDwell], scatter: float
) -> tuple[RecognisedLaw, ...]:
    """Return the laws of each event by likelihood: the best two, and all that are not worse.

    ``scatter`` is the standard deviation of the readings, m.
    """
    result: list[RecognisedLaw] = []
    events = sorted(_windows(readings, dwells), key=lambda event: event[1] % TURN)
    for event, (window, start, span) in enumerate(events, start=1):
        angles = (readings.angles - window[0]) % TURN
        inside = angles <= window[1]
        if inside.sum() < MIN_EVENT_READINGS:
            continue
        fits = [
            (name, *_fit(pieces, angles[inside], readings.lifts[inside], start - window[0], span))
            for name, pieces in candidates().items()
        ]
        fits.sort(key=lambda fit: fit[1])
        count, best = int(inside.sum()), fits[0][1]
        variance = max(best / (count - 4), scatter**2)
        explains = variance <= scatter**2 * (1.0 + MAX_RATIO_ERRORS * math.sqrt(2.0 / count))
        for rank, (name, square_sum, x, errors) in enumerate(fits):
            worse = (square_sum - best) / (2.0 * variance)
            if rank < 2 or worse < SIGNIFICANT:
                starts, spans, rises = zip(x[:3], math.sqrt(variance) * errors[:3], strict=True)
                angle = ((starts[0] + window[0]) % TURN, starts[1])
                rms = math.sqrt(square_sum / count)
                result.append(
                    RecognisedLaw(event, name, *angle, *spans, *rises, rms, worse, explains)
                )
    return tuple(result)


def describe(laws: Sequence[RecognisedLaw]) -> Iterator[str]:
    """Yield a sentence on each event, with all laws that are not significantly worse."""
    for event in sorted({law.event for law in laws}):
        best, *others = [law for law in laws if law.event == event and law.worse < SIGNIFICANT]
        names = " or ".join(law.law for law in (best, *others))
        where = f"Event {event}, from {math.degrees(best.start):.4g}°"
        if not best.explains:
            yield f"{where}: no listed law explains the readings, {best.law} is the nearest."
        elif others:
            yield f"{where}: {names}. The readings do not distinguish them."
        else:
            yield f"{where}: {names}. Every other listed law is significantly worse."


def _windows(
    readings: Readings, dwells: Sequence[FoundDwell]
) -> Iterator[tuple[tuple[float, float], float, float]]:
    """Yield the window of each event, and an estimate of start and span, rad.

    A window is a start and a length, from the middle of the dwell before to that of the dwell
    after. Between two dwells of one level it is divided at the extreme lift.
    """
    rests = [dwell.rest for dwell in dwells]
    for before, after in pairwise([*rests, *rests[:1]]):
        low, start = before.start + 0.5 * before.span, before.start + before.span
        span = (after.start - start) % TURN
        length = 0.5 * before.span + span + 0.5 * after.span
        if abs(after.level - before.level) > 0.01 * np.ptp(readings.lifts):
            yield (low, length), start, span
            continue
        inside = (readings.angles - start) % TURN <= span
        top = int(np.argmax(np.where(inside, np.abs(readings.lifts - before.level), -1.0)))
        middle = (float(readings.angles[top]) - start) % TURN
        yield (low, middle + start - low), start, middle
        yield (start + middle, low + length - start - middle), start + middle, span - middle


def _fit(
    pieces: Pieces, angles: FloatArray, lifts: FloatArray, start: float, span: float
) -> tuple[float, FloatArray, FloatArray]:
    """Return the sum of squares (m²), start, span, rise and level, and their relative errors.

    The errors are for a unit scatter of the readings. Angles are in rad.
    """
    from scipy.optimize import least_squares

    scale = float(np.ptp(lifts))
    target = (lifts - lifts.mean()) / scale

    def jacobian(x: FloatArray) -> FloatArray:
        u = (angles - x[0]) / x[1]
        slope = -x[2] / x[1] * _values(pieces, u, 1)
        return np.stack([slope, slope * u, _values(pieces, u, 0), np.ones_like(u)], axis=1)

    def residuals(x: FloatArray) -> FloatArray:
        return np.asarray(x[2] * _values(pieces, (angles - x[0]) / x[1], 0) + x[3] - target)

    rise = float(np.sign(target[angles.argmax()] - target[angles.argmin()]))
    first = [start, span, rise, -0.5 * rise]
    bounds = [-TURN, 0.1 * span, -2.0, -2.0], [TURN, 2.0 * span, 2.0, 2.0]
    found = least_squares(residuals, first, jacobian, bounds, xtol=1e-12, ftol=1e-12)
    slopes = np.asarray(found.jac, dtype=np.float64)
    covariance = np.linalg.pinv(slopes.T @ slopes)
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0)) / scale
    size = np.array([1.0, 1.0, scale, scale])
    return 2.0 * float(found.cost) * scale**2, found.x * size, errors * size

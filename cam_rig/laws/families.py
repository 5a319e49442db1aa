"""Rises of the handbooks: families with parameters, and single laws that are not in the sources.

Every rise is from 0 to 1 over u from 0 to 1. Peaks are per unit rise and unit span.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache, partial

import numpy as np

from cam_rig.laws import bernstein
from cam_rig.laws.bernstein import Pieces
from cam_rig.laws.sampling import Curve, Section, fit_curve, fit_sections, wave
from cam_rig.laws.tasks import motion_between
from cam_rig.schema.motions import CONSTANT_VELOCITY, MOTIONS, SCCA_SHARES
from cam_rig.units import FloatArray

#: Shape of a rise: ordinates of one Bézier curve, analytic sections, or pieces.
Shape = FloatArray | list[Section] | Pieces
PI = math.pi
#: Degree of the third derivative of a quarter of a sine, sufficient for rounding.
QUARTER_DEGREE = 14


@lru_cache(maxsize=1)
def _quarter_sine() -> FloatArray:
    """Return the ordinates of sin(πx/2) over x from 0 to 1."""
    return fit_curve(wave(0.0, 0.0, -1.0, 0.5 * PI, 0.0), 0.0, 1.0, QUARTER_DEGREE)[1][0]


def scca(
    b: float, c: float, d: float, constant_velocity: float, acceleration_share: float
) -> Pieces:
    """Return the rise with sine, constant and cosine acceleration.

    The acceleration rises as a quarter of a sine, is constant, falls as a cosine to the opposite
    value, is constant, and returns as a quarter of a sine. A part with constant velocity may be in
    the middle.

    Parameters
    ----------
    b, c, d : float
        Shares of sine, constant and cosine of the time with acceleration. Their sum is 1.
    constant_velocity : float
        Share of the span with constant velocity.
    acceleration_share : float
        Share of acceleration in the time with acceleration or deceleration, 0.5 if symmetric.

    Returns
    -------
    Pieces
        Pieces of the unit rise, twice integrated from the accelerations.
    """
    up, flat = _quarter_sine(), np.ones(1)
    first = (1.0 - constant_velocity) * acceleration_share
    second = 1.0 - constant_velocity - first
    halves = ((b, up), (c, flat), (d, up[::-1])), ((d, up), (c, flat), (b, up[::-1]))
    parts = [(share * first, second * acceleration) for share, acceleration in halves[0]]
    parts += [(constant_velocity, 0.0 * flat)]  # both halves have the same change of the velocity
    parts += [(share * second, -first * acceleration) for share, acceleration in halves[1]]
    breaks, columns, level, slope = [0.0], list[FloatArray](), 0.0, 0.0
    for width, acceleration in parts:
        if width > 0.0:
            velocity = slope + width * bernstein.antiderivative(acceleration)
            columns.append(level + width * bernstein.antiderivative(velocity))
            breaks.append(breaks[-1] + width)
            level, slope = float(columns[-1][-1]), float(velocity[-1])
    return [*breaks[:-1], 1.0], [column / level for column in columns]


def sum_of_waves(*waves: Curve) -> list[Section]:
    """Return the sum of functions as one section."""

    def curve(u: FloatArray, order: int) -> FloatArray:
        return np.asarray(sum(wave(u, order) for wave in waves))

    return [(0.0, 1.0, curve)]


def sine_series(sizes: Mapping[int, float]) -> list[Section]:
    """Return u minus the sum of sizes[k]·sin 2πku/2π."""
    waves = (wave(0.0, 0.0, size / (2.0 * PI), 2.0 * PI * k, 0.0) for k, size in sizes.items())
    return sum_of_waves(wave(0.0, 1.0, 0.0, 0.0, 0.0), *waves)


@dataclass(frozen=True)
class HandbookLaw:
    """Rise of the handbooks: its source, its shape, and the defaults of its parameters."""

    source: str
    shape: Callable[..., Shape]
    parameters: Mapping[str, float] | None = None


def _scca_family(name: str, source: str, constant_velocity: float = 0.0) -> HandbookLaw:
    """Return the family of a law with sine, constant and cosine acceleration."""
    shares = dict(zip("bcd", SCCA_SHARES[name], strict=True))
    others = {"constant_velocity": constant_velocity, "acceleration_share": 0.5}
    return HandbookLaw(source, scca, shares | others)


#: Source of two of the laws.
HANDBOOK = "Cam Design Handbook"

#: Coefficients of the law ``poly8``, of u^0 to u^8.
POLY8 = "0 0 0 6.09755 0 -20.78040 26.73155 -13.60965 2.56095"

#: Rises of the handbooks by their names in cam files. The peak factors are tested.
FAMILIES: dict[str, HandbookLaw] = {
    **{
        law: HandbookLaw(
            "any ends, here rests", partial(motion_between, law, zeros, [1.0, *zeros[1:]])
        )
        for law, zeros in {name: [0.0] * (4 if name == "poly7" else 3) for name in MOTIONS}.items()
    },
    "scca": _scca_family("scca", "sine, constant, cosine"),
    "modified_constant_velocity": _scca_family(
        "modified_constant_velocity", "modified sine, constant velocity", CONSTANT_VELOCITY
    ),
    "parabolic": _scca_family("parabolic", "constant acceleration"),
    "double_harmonic": HandbookLaw(
        "rest to reversal",
        lambda: sum_of_waves(
            wave(0.5, 0.0, 0.5, PI, 0.5 * PI), wave(-0.125, 0.0, -0.125, 2.0 * PI, 0.5 * PI)
        ),
    ),
    "gutman13": HandbookLaw("Gutman 1961", partial(sine_series, {1: 15 / 16, 3: 1 / 48})),
    "freudenstein13": HandbookLaw(
        f"{HANDBOOK}, eq. 4.12", partial(sine_series, {1: 27 / 28, 3: 1 / 84})
    ),
    "freudenstein135": HandbookLaw(
        f"{HANDBOOK}, eq. 4.13",
        partial(sine_series, {k: 1125 / 1192 / size for k, size in ((1, 1), (3, 54), (5, 1250))}),
    ),
    # The decimals end at 1 with zero slope and third derivative, exactly.
    "poly8": HandbookLaw(
        f"rest to reversal; {HANDBOOK}, p. 100",
        partial(bernstein.from_powers, [Fraction(text) for text in POLY8.split()]),
    ),
    # Rests at both ends, and neither acceleration nor jerk in the middle.
    "low_impact_crossover": HandbookLaw(
        "low-impact crossover",
        lambda: np.array([0.0, 0.0, 0.0, 2.0 / 3.0, 1.0 / 3.0, 1.0, 1.0, 1.0]),
    ),
}


def family_rise(name: str, parameters: Mapping[str, float | None] | None = None) -> Pieces:
    """Return the Bernstein pieces of a rise of the handbooks, over u from 0 to 1.

    Parameters that are missing or None have their defaults.
    """
    changed = {key: value for key, value in (parameters or {}).items() if value is not None}
    return _pieces(name, tuple(sorted({**(FAMILIES[name].parameters or {}), **changed}.items())))


def mirror(pieces: Pieces) -> Pieces:
    """Return a rise mirrored in time, 1 − s(1 − u)."""
    breaks, columns = pieces
    return [1.0 - u for u in reversed(breaks)], [1.0 - x[::-1] for x in reversed(columns)]


@lru_cache(maxsize=64)
def _pieces(name: str, parameters: tuple[tuple[str, float], ...]) -> Pieces:
    shape = FAMILIES[name].shape(**dict(parameters))
    if isinstance(shape, tuple):
        return shape
    return fit_sections(shape) if isinstance(shape, list) else ([0.0, 1.0], [shape])

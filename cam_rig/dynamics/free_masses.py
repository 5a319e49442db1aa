"""The two masses in the air, as the stretch of the stem and the centre of mass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from cam_rig.dynamics.linear.exponential import FreeSystem, Pairs
from cam_rig.dynamics.linear.response import LinearResponse, Outputs
from cam_rig.dynamics.parameters import MAX_DAMPING_RATIO, floats_of, si_or_none
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.units import FloatArray

#: What two masses need of a rig beside what one needs, and what is said where it is missing.
NEEDED = ("roller_share", "stem_stiffness", "stem_damping")

BY, ONE_MASS = "two masses (the model two_mass)", "take one mass (the model one_mass)"


@dataclass(frozen=True)
class TwoMassParameters:
    """The two-mass follower of eq. 14-19: a roller mass and an end mass, joined by the stem."""

    roller_mass: float  #: m₁, kg
    end_mass: float  #: m₂, kg
    stem_stiffness: float  #: k₁, N/m
    spring_stiffness: float  #: k₂, N/m
    stem_damping: float  #: c₁, in the stem, N·s/m
    damping: float  #: c₂, end mass to ground, N·s/m
    preload: float  #: N, of the closing spring at zero lift
    #: Newton's coefficient of a landing of the roller mass; None if not told
    restitution: float | None = 0.0

    def __post_init__(self) -> None:
        vars(self).update(floats_of(vars(self), "restitution"))

    @classmethod
    def from_rig(cls, rig: RigConfig) -> TwoMassParameters:
        """Take the numbers of a rig file that has a stem and says how the mass is split.

        Raises
        ------
        ConfigError : no stem, or no split of the mass
        DynamicsError : a damping ratio above `MAX_DAMPING_RATIO`
        """
        follower = rig.follower
        share, stem, stem_damping = (rig.need(key, BY, ONE_MASS).si for key in NEEDED)
        roller = follower.mass.si * share
        found = cls(
            roller_mass=roller,
            end_mass=follower.mass.si - roller,
            stem_stiffness=stem,
            spring_stiffness=follower.spring_stiffness.si,
            stem_damping=stem_damping,
            damping=follower.damping.si,
            preload=follower.preload.si,
            restitution=si_or_none(follower.restitution),
        )
        if found.damping_ratio > MAX_DAMPING_RATIO:
            most = (found.stem_damping + found.damping) * MAX_DAMPING_RATIO / found.damping_ratio
            raise DynamicsError(
                f"rig {rig.name}: stem_damping {stem_damping:.4g} N*s/m and damping "
                f"{found.damping:.4g} N*s/m are {found.damping_ratio:.3g} times what is critical "
                f"for the end mass on its stem; allowed: {MAX_DAMPING_RATIO:g} times, together "
                f"{most:.3g} N*s/m; a stem that is damped more is rigid, so {ONE_MASS}"
            )
        return found

    @cached_property
    def damping_ratio(self) -> float:
        """Of the end mass, by both dampers, while the roller is held."""
        both = self.stem_damping + self.damping
        return 0.5 * both / float(np.sqrt(self.stiffness * self.end_mass))

    @cached_property
    def stiffness(self) -> float:
        """k₁ + k₂, N/m."""
        return self.stem_stiffness + self.spring_stiffness

    @cached_property
    def share(self) -> float:
        """α, the static share of the lift that the end mass follows."""
        return self.stem_stiffness / self.stiffness

    def static_place(self, cam: FloatArray) -> FloatArray:
        """(y, ẏ) without vibration where s and ṡ are the first two rows of ``cam``."""
        return np.stack([self.share * cam[0] - self.preload / self.stiffness, self.share * cam[1]])

    @cached_property
    def inner_matrix(self) -> FloatArray:
        """A of flight in (w, ẇ, Y, Ẏ), as in `free_masses`."""
        m1, m2 = self.roller_mass, self.end_mass
        total, both = m1 + m2, 1.0 / m1 + 1.0 / m2
        share, end = m1 / total, 1.0 / m2
        k1, c1 = self.stem_stiffness, self.stem_damping
        k2, c2 = self.spring_stiffness, self.damping
        fast = [-k1 * both - k2 * share * end, -c1 * both - c2 * share * end, -k2 * end, -c2 * end]
        slow = [-k2 * share / total, -c2 * share / total, -k2 / total, -c2 / total]
        return np.array([[0.0, 1.0, 0.0, 0.0], fast, [0.0, 0.0, 0.0, 1.0], slow])


@lru_cache(maxsize=64)
def contact_response(law: Law, parameters: TwoMassParameters, speed: float) -> LinearResponse:
    """The end mass while the roller is in contact, which a jump of s' may end; state (η, η̇)."""
    p, damping = parameters, parameters.stem_damping + parameters.damping
    matrix = np.array([[0.0, 1.0], [-p.stiffness / p.end_mass, -damping / p.end_mass]])
    drive = np.zeros((2, 3))
    drive[1, 1:] = (p.stem_damping - damping * p.share) / p.end_mass, -p.share
    return LinearResponse(law, speed, matrix, drive, np.zeros(2))


@lru_cache(maxsize=64)
def force_output(parameters: TwoMassParameters) -> Outputs:
    """One row: the contact force."""
    p = parameters
    state = np.array([[-p.stem_stiffness, -p.stem_damping]])
    left = p.spring_stiffness / p.stiffness  # 1 − α, without its cancellation
    law = np.array([[p.stem_stiffness * left, p.stem_damping * left, p.roller_mass]])
    return Outputs(state, law, np.array([p.share * p.preload]))


#: Pairs whose shapes are more alike than this are not told apart: their digits would cancel.
WORST_CONDITION = 1e3
#: Newton's steps to a factor of the characteristic polynomial, and when it is found.
MAX_STEPS, FOUND = 12, 1e-15


@lru_cache(maxsize=64)
def free_masses(parameters: TwoMassParameters) -> FreeSystem:
    """Both masses without the cam.

    The state is (w, ẇ, Y, Ẏ): stretch w = y − z of the stem, and centre of mass Y. In these the
    slow and the fast motion stand apart; in z and y the closing spring drowns in the rounding of
    the stem, 1e5 times as stiff.
    """
    p = parameters
    total = p.roller_mass + p.end_mass
    share = p.roller_mass / total
    own = np.sqrt(np.array([p.end_mass, p.stem_stiffness, p.spring_stiffness]) / p.roller_mass)
    energy = [
        [0.0, share - 1.0, 0.0, 1.0],
        [0.0, own[0] * share, 0.0, own[0]],
        [own[1], 0.0, 0.0, 0.0],
        [own[2] * share, 0.0, own[2], 0.0],
    ]
    end = p.preload / p.end_mass
    load = [0.0, -end, 0.0, -p.preload / total]
    row = np.array([share - 1.0, 0.0, 1.0, 0.0])
    return FreeSystem(p.inner_matrix, np.array(load), row, np.array(energy), _pairs(p))


def to_inner(parameters: TwoMassParameters, state: FloatArray) -> FloatArray:
    """(w, ẇ, Y, Ẏ) of (z, ż, y, ẏ)."""
    p, z, y = parameters, state[:2], state[2:]
    stretch = y - z
    centre = z + p.end_mass / (p.roller_mass + p.end_mass) * stretch
    return np.array([stretch[0], stretch[1], centre[0], centre[1]])


def from_inner(parameters: TwoMassParameters, inner: FloatArray) -> FloatArray:
    """(z, ż, y, ẏ) of states ``(4,)`` or ``(4, n)`` as `to_inner` makes them."""
    p = parameters
    stretch, centre = inner[:2], inner[2:]
    before = centre - p.end_mass / (p.roller_mass + p.end_mass) * stretch
    return np.concatenate([before, before + stretch])


def _pairs(p: TwoMassParameters) -> Pairs | None:
    """The best way to pair the four rates: stem and centre least coupled; None if none is good."""
    found = [
        _shaped(p, *sides)
        for factors in _factors(_characteristic(p))
        for sides in (factors, factors[::-1])
    ]
    good = [x for x in found if x is not None and _condition(x.shapes) < WORST_CONDITION]
    return min(good, key=lambda x: np.abs(x.shapes[[0, 2], [2, 0]]).max(), default=None)


def _condition(shapes: FloatArray) -> float:
    rows = np.array(shapes)
    for axis in (0, 1, 0, 1):
        rows = rows / np.linalg.norm(rows, axis=axis, keepdims=True)
    return float(np.linalg.cond(rows))


def _characteristic(p: TwoMassParameters) -> FloatArray:
    """a₃, a₂, a₁, a₀ of λ⁴ + a₃ λ³ + …: sums of what is positive, so no digit is lost."""
    m1, m2, k1, k2 = p.roller_mass, p.end_mass, p.stem_stiffness, p.spring_stiffness
    c1, c2 = p.stem_damping, p.damping
    cubic = m1 * (c1 + c2) + m2 * c1
    square = m1 * (k1 + k2) + m2 * k1 + c1 * c2
    return np.array([cubic, square, c1 * k2 + c2 * k1, k1 * k2]) / (m1 * m2)


Factor = tuple[float, float]


def _factors(polynomial: FloatArray) -> list[tuple[Factor, Factor]]:
    """All ways to write λ⁴ + … as (λ² + P λ + Q)(λ² + p λ + q) with Q ≥ q."""
    rate = float(polynomial[3]) ** 0.25
    scale = max(rate, float(np.sqrt(polynomial[1])))
    scaled = polynomial / scale ** np.arange(1, 5)
    roots = np.roots([1.0, *scaled])
    found = []
    for other in (1, 2, 3):
        one = roots[[0, other]]
        rest = np.delete(roots, [0, other])
        slow = min(one, rest, key=lambda pair: abs(np.prod(pair)))
        if abs(slow.sum().imag) > 1e-6 * np.abs(slow).max():
            continue  # half of two pairs
        factor = _polished(scaled, -float(slow.sum().real), float(np.prod(slow).real))
        if factor is not None:
            (high, highest), (low, lowest) = factor
            fast = (high * scale, highest * scale**2)
            found.append((fast, (low * scale, lowest * scale**2)))
    return found


def _polished(polynomial: FloatArray, p: float, q: float) -> tuple[Factor, Factor] | None:
    """Newton's method for P q + p Q = a₁ and q Q = a₀, from a factor that is nearly one."""
    a3, a2, a1, a0 = polynomial.tolist()
    for _ in range(MAX_STEPS):
        high, highest = a3 - p, a2 - q - p * (a3 - p)
        off = np.array([high * q + p * highest - a1, q * highest - a0])
        slopes = np.array(
            [[-q + highest + p * (p - high), high - p], [q * (p - high), highest - q]]
        )
        try:
            step = np.linalg.solve(slopes, off)
        except np.linalg.LinAlgError:
            return None
        p, q = p - float(step[0]), q - float(step[1])
        if abs(step[0]) <= FOUND * abs(p) and abs(step[1]) <= FOUND * abs(q):
            break
    high, highest = a3 - p, a2 - q - p * (a3 - p)
    fine = q > 0.0 and highest > 0.0 and min(p, high) > -1e-12
    return ((max(high, 0.0), highest), (max(p, 0.0), q)) if fine else None


def _shaped(p: TwoMassParameters, stem: Factor, spring: Factor) -> Pairs | None:
    """The pair that goes by the stem's stretch w, and the one that goes by the centre Y.

    In the first (w, ẇ) = (q, q̇), and the centre follows w as its own equation says; in the second
    the other way round.
    """
    shapes, matrix = np.eye(4), p.inner_matrix
    for first, pair in ((0, stem), (2, spring)):
        other = 2 - first
        follows = _following(matrix[other + 1], first, other, pair)
        if follows is None:
            return None
        damping, stiffness = pair
        rate = -stiffness * follows[1], follows[0] - damping * follows[1]
        shapes[other : other + 2, first : first + 2] = follows, rate
    rates, inverse = np.array([stem, spring]), _inverse(shapes)
    return None if inverse is None else Pairs(shapes, inverse, rates[:, 0], rates[:, 1])


def _inverse(shapes: FloatArray) -> FloatArray | None:
    """The inverse of [[1, G], [H, 1]], block by block: its entries are of very different sizes."""
    right, left = shapes[:2, 2:], shapes[2:, :2]
    (a, b), (c, d) = np.eye(2) - right @ left
    divisor = a * d - b * c
    if divisor == 0.0:
        return None
    both = np.array([[d, -b], [-c, a]]) / divisor
    return np.block([[both, -both @ right], [-left @ both, np.eye(2) + left @ both @ right]])


def _following(row: FloatArray, first: int, other: int, pair: Factor) -> Factor | None:
    """What q and q̇ contribute to the place that follows them: f = (c + d B)(a + b B)⁻¹.

    B is the pair's own matrix, B² = −κ − 2δ B; ``row`` is the equation of what follows. Written
    out, each contribution is known to its own last digit.
    """
    damping, stiffness = pair
    a, b = -stiffness - row[other], -damping - row[other + 1]
    c, d = row[first], row[first + 1]
    divisor = a * (a - damping * b) + stiffness * b**2
    if divisor == 0.0:
        return None
    place = c * (a - damping * b) + stiffness * b * d
    return float(place / divisor), float((d * a - b * c) / divisor)

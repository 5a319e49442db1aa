"""Two-mass follower: parameters, linear model in contact, and motion in flight.

The roller mass is on the cam, and the end mass is at the other end of the elastic stem, on the
closing spring. In flight the state is the stretch of the stem and the position of the centre of
mass, with their rates.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from cam_rig.dynamics.linear.exponential import FreeSystem, Pairs
from cam_rig.dynamics.linear.response import LinearResponse, Outputs
from cam_rig.dynamics.parameters import MAX_DAMPING_RATIO, check_numbers, si_or_none
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.units import FloatArray

#: Keys of the numbers in a rig file that the two-mass model needs and the one-mass model does not
#: need.
TWO_MASS_KEYS = ("roller_share", "stem_stiffness", "stem_damping")
#: Name of the two-mass model in the error message for a number that the rig file lacks.
NEEDED_BY = "two masses (the model two_mass)"
#: Remedy in the error message for a number that the two-mass model needs and the rig file lacks.
ONE_MASS = "take one mass (the model one_mass)"


@dataclass(frozen=True)
class TwoMassParameters:
    """Two-mass follower (eq. 14-19): roller mass and end mass, joined by the stem.

    Whole numbers are converted to floats.

    Parameters
    ----------
    roller_mass : float
        m₁, mass on the cam, kg, > 0.
    end_mass : float
        m₂, mass at the other end of the stem, kg, > 0.
    stem_stiffness : float
        k₁, N/m, > 0.
    spring_stiffness : float
        k₂, stiffness of the closing spring, N/m, > 0.
    stem_damping : float
        c₁, damping in the stem, N·s/m, ≥ 0.
    damping : float
        c₂, damping between end mass and ground, N·s/m, ≥ 0.
    preload : float
        Force of the closing spring at zero lift, N, ≥ 0.
    restitution : float, optional
        Newton's coefficient of a landing of the roller mass, in [0, 1). 0 is a plastic landing
        (default), None if the rig file does not contain it.

    Raises
    ------
    DynamicsError
        If a number is not finite or outside its limits.

    References
    ----------
    Paper, eq. 14-19. There k₁ is the stem and k₂ the closing spring, as here.
    """

    roller_mass: float  #: m₁, mass on the cam, kg
    end_mass: float  #: m₂, mass at the other end of the stem, kg
    stem_stiffness: float  #: k₁, stiffness of the stem, N/m
    spring_stiffness: float  #: k₂, stiffness of the closing spring, N/m
    stem_damping: float  #: c₁, damping in the stem, N·s/m
    damping: float  #: c₂, damping between end mass and ground, N·s/m
    preload: float  #: force of the closing spring at zero lift, N
    restitution: float | None = 0.0  #: Newton's coefficient of a landing, or None

    def __post_init__(self) -> None:
        vars(self).update(check_numbers(vars(self), "restitution"))

    @classmethod
    def from_rig(cls, rig: RigConfig) -> TwoMassParameters:
        """Return the parameters of a rig.

        The roller mass is the fraction ``roller_share`` of the mass of the follower.

        Raises
        ------
        ConfigError
            If the rig does not have a stem, or does not state how the mass is split.
        DynamicsError
            If a damping ratio is above `MAX_DAMPING_RATIO`.
        """
        follower = rig.follower
        share, stem, stem_damping = (n.si for n in rig.need_all(TWO_MASS_KEYS, NEEDED_BY, ONE_MASS))
        roller = follower.mass.si * share
        parameters = cls(
            roller_mass=roller,
            end_mass=follower.mass.si - roller,
            stem_stiffness=stem,
            spring_stiffness=follower.spring_stiffness.si,
            stem_damping=stem_damping,
            damping=follower.damping.si,
            preload=follower.preload.si,
            restitution=si_or_none(follower.restitution),
        )
        damping, ratio = parameters.damping, parameters.damping_ratio
        if ratio > MAX_DAMPING_RATIO:
            limit = (parameters.stem_damping + damping) * MAX_DAMPING_RATIO / ratio
            raise DynamicsError(
                f"rig {rig.name}: stem_damping {stem_damping:.4g} N*s/m and damping "
                f"{damping:.4g} N*s/m are {ratio:.3g} times what is critical "
                f"for the end mass on its stem; allowed: {MAX_DAMPING_RATIO:g} times, together "
                f"{limit:.3g} N*s/m; a stem that is damped more is rigid, so {ONE_MASS}"
            )
        return parameters

    @cached_property
    def damping_ratio(self) -> float:
        """Damping ratio of the end mass with both dampers, while the roller is fixed."""
        both = self.stem_damping + self.damping
        return 0.5 * both / float(np.sqrt(self.stiffness * self.end_mass))

    @cached_property
    def stiffness(self) -> float:
        """Stiffness k₁ + k₂ that acts on the end mass while the roller is fixed, N/m."""
        return self.stem_stiffness + self.spring_stiffness

    @cached_property
    def share(self) -> float:
        """Static fraction α = k₁/(k₁ + k₂) of the lift that the end mass follows."""
        return self.stem_stiffness / self.stiffness

    def static_position(self, cam: FloatArray) -> FloatArray:
        """Return (y, ẏ) of the end mass in contact without vibration, ``(2, n)``.

        The displacement y is in m, and ẏ in m/s. The first two rows of ``cam`` are the cam's s (m)
        and ṡ (m/s).
        """
        return np.stack([self.share * cam[0] - self.preload / self.stiffness, self.share * cam[1]])

    @cached_property
    def inner_matrix(self) -> FloatArray:
        """Matrix A of the equation ẋ = A x + b of the two masses in flight, ``(4, 4)``.

        The state x is (w, ẇ, Y, Ẏ), with the stretch w of the stem and the centre of mass Y.
        """
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
    """Return the linear model of the end mass while the roller mass is on the cam.

    The state is the vibration (η, η̇) of the end mass about its static position, in m and m/s.
    ``speed`` is the cam speed, rad/s. A velocity jump of the law does not act on the state in this
    model, because it may end the contact. The caller handles it.
    """
    p, damping = parameters, parameters.stem_damping + parameters.damping
    matrix = np.array([[0.0, 1.0], [-p.stiffness / p.end_mass, -damping / p.end_mass]])
    drive = np.zeros((2, 3))
    drive[1, 1:] = (p.stem_damping - damping * p.share) / p.end_mass, -p.share
    return LinearResponse(law, speed, matrix, drive, np.zeros(2))


@lru_cache(maxsize=64)
def force_output(parameters: TwoMassParameters) -> Outputs:
    """Return the contact force (N) as an output of the linear model `contact_response`."""
    p = parameters
    state = np.array([[-p.stem_stiffness, -p.stem_damping]])
    spring_share = p.spring_stiffness / p.stiffness  # 1 − α, without cancellation
    law = np.array(
        [[p.stem_stiffness * spring_share, p.stem_damping * spring_share, p.roller_mass]]
    )
    return Outputs(state, law, np.array([p.share * p.preload]))


#: Largest condition number of the matrix of mode shapes at which the motion in flight is computed
#: with the modes. At a larger number two modes are nearly equal, and their digits would cancel.
MAX_CONDITION = 1e3
#: Largest number of steps of Newton's method for the factors of the characteristic polynomial.
MAX_NEWTON_STEPS = 12
#: Relative correction at which Newton's method for the factors of the characteristic polynomial has
#: converged.
NEWTON_RTOL = 1e-15


@lru_cache(maxsize=64)
def free_masses(parameters: TwoMassParameters) -> FreeSystem:
    """Return the equation of motion of both masses in flight.

    The state is (w, ẇ, Y, Ẏ), with the stretch w = y − z of the stem and the centre of mass Y.
    These separate the slow motion from the fast one. In z and y the force of the closing spring
    would be lost in the rounding of the force of the stem, which is 1e5 times as stiff.
    """
    p = parameters
    total = p.roller_mass + p.end_mass
    share = p.roller_mass / total
    # Rows for z̈, √(m₂/m₁) ÿ, √(k₁/m₁) ẇ and √(k₂/m₁) ẏ. The sum of their squares is 2/m₁ times an
    # energy of the rates, which does not grow. It bounds the later acceleration z̈ of the roller.
    roots = np.sqrt(np.array([p.end_mass, p.stem_stiffness, p.spring_stiffness]) / p.roller_mass)
    energy = [
        [0.0, share - 1.0, 0.0, 1.0],
        [0.0, roots[0] * share, 0.0, roots[0]],
        [roots[1], 0.0, 0.0, 0.0],
        [roots[2] * share, 0.0, roots[2], 0.0],
    ]
    end = p.preload / p.end_mass
    load = [0.0, -end, 0.0, -p.preload / total]
    row = np.array([share - 1.0, 0.0, 1.0, 0.0])
    return FreeSystem(p.inner_matrix, np.array(load), row, np.array(energy), _pairs(p))


def to_inner(parameters: TwoMassParameters, state: FloatArray) -> FloatArray:
    """Convert (z, ż, y, ẏ) of two masses to the state (w, ẇ, Y, Ẏ) of a flight, ``(4,)``.

    z is the displacement of the roller mass and y that of the end mass. w = y − z is the stretch of
    the stem, and Y is the centre of mass.
    """
    p, z, y = parameters, state[:2], state[2:]
    stretch = y - z
    centre = z + p.end_mass / (p.roller_mass + p.end_mass) * stretch
    return np.array([stretch[0], stretch[1], centre[0], centre[1]])


def from_inner(parameters: TwoMassParameters, inner: FloatArray) -> FloatArray:
    """Convert states (w, ẇ, Y, Ẏ) of a flight to (z, ż, y, ẏ) of the two masses.

    The shape of both is ``(4,)`` or ``(4, n)``. w is the stretch of the stem, Y the centre of mass,
    z the displacement of the roller mass, and y that of the end mass.
    """
    p = parameters
    stretch, centre = inner[:2], inner[2:]
    contact_mass = centre - p.end_mass / (p.roller_mass + p.end_mass) * stretch
    return np.concatenate([contact_mass, contact_mass + stretch])


def _pairs(p: TwoMassParameters) -> Pairs | None:
    """Return the transformation of the two masses in flight to two decoupled pairs.

    The four eigenvalues can be grouped into two pairs in several ways. The result is the way whose
    pairs are closest to the motion of the stem and of the centre of mass. It is None if no way has
    a condition number below `MAX_CONDITION`.
    """
    candidates = [
        _shape_pairs(p, *sides)
        for factors in _factors(_characteristic(p))
        for sides in (factors, factors[::-1])
    ]
    good = [x for x in candidates if x is not None and _condition(x.shapes) < MAX_CONDITION]
    return min(good, key=lambda x: np.abs(x.shapes[[0, 2], [2, 0]]).max(), default=None)


def _condition(shapes: FloatArray) -> float:
    """Return the condition number of a matrix of mode shapes.

    Its rows and columns are scaled before, because the states have different units.
    """
    rows = np.array(shapes)
    for axis in (0, 1, 0, 1):
        rows = rows / np.linalg.norm(rows, axis=axis, keepdims=True)
    return float(np.linalg.cond(rows))


def _characteristic(p: TwoMassParameters) -> FloatArray:
    """Return the coefficients a₃, a₂, a₁, a₀ of the characteristic polynomial, ``(4,)``.

    The polynomial λ⁴ + a₃ λ³ + a₂ λ² + a₁ λ + a₀ is that of both masses in flight. Each coefficient
    is a sum of positive terms, so no digits cancel.
    """
    m1, m2, k1, k2 = p.roller_mass, p.end_mass, p.stem_stiffness, p.spring_stiffness
    c1, c2 = p.stem_damping, p.damping
    cubic = m1 * (c1 + c2) + m2 * c1
    square = m1 * (k1 + k2) + m2 * k1 + c1 * c2
    return np.array([cubic, square, c1 * k2 + c2 * k1, k1 * k2]) / (m1 * m2)


#: Coefficients p and q of a quadratic factor λ² + p λ + q of a characteristic polynomial.
Factor = tuple[float, float]


def _factors(polynomial: FloatArray) -> list[tuple[Factor, Factor]]:
    """Return all factorisations of a quartic into two real quadratics.

    The quartic λ⁴ + a₃ λ³ + … has the coefficients ``polynomial`` after the first. The factors are
    (λ² + P λ + Q)(λ² + p λ + q) with Q ≥ q, each returned as ((P, Q), (p, q)).
    """
    rate = float(polynomial[3]) ** 0.25
    scale = max(rate, float(np.sqrt(polynomial[1])))
    scaled = polynomial / scale ** np.arange(1, 5)
    roots = np.roots([1.0, *scaled])
    factorisations = []
    for other in (1, 2, 3):
        first_pair = roots[[0, other]]
        second_pair = np.delete(roots, [0, other])
        slow = min(first_pair, second_pair, key=lambda pair: abs(np.prod(pair)))
        if abs(slow.sum().imag) > 1e-6 * np.abs(slow).max():
            continue  # the two roots belong to different conjugate pairs: the factor is not real
        factors = _refine_factors(scaled, -float(slow.sum().real), float(np.prod(slow).real))
        if factors is not None:
            (fast_p, fast_q), (slow_p, slow_q) = factors
            fast = (fast_p * scale, fast_q * scale**2)
            factorisations.append((fast, (slow_p * scale, slow_q * scale**2)))
    return factorisations


def _refine_factors(polynomial: FloatArray, p: float, q: float) -> tuple[Factor, Factor] | None:
    """Refine an approximate factor of a quartic polynomial by Newton's method.

    The quartic λ⁴ + a₃ λ³ + … has the coefficients ``polynomial`` after the first, and the factor
    is λ² + p λ + q. The equations P q + p Q = a₁ and q Q = a₀ are solved, where λ² + P λ + Q is the
    other factor. Returns ((P, Q), (p, q)), or None if the method fails or a factor is unstable.
    """
    a3, a2, a1, a0 = polynomial.tolist()
    for _ in range(MAX_NEWTON_STEPS):
        fast_p, fast_q = a3 - p, a2 - q - p * (a3 - p)
        residual = np.array([fast_p * q + p * fast_q - a1, q * fast_q - a0])
        slopes = np.array(
            [[-q + fast_q + p * (p - fast_p), fast_p - p], [q * (p - fast_p), fast_q - q]]
        )
        try:
            step = np.linalg.solve(slopes, residual)
        except np.linalg.LinAlgError:
            return None
        p, q = p - float(step[0]), q - float(step[1])
        if abs(step[0]) <= NEWTON_RTOL * abs(p) and abs(step[1]) <= NEWTON_RTOL * abs(q):
            break
    fast_p, fast_q = a3 - p, a2 - q - p * (a3 - p)
    is_stable = q > 0.0 and fast_q > 0.0 and min(p, fast_p) > -1e-12
    return ((max(fast_p, 0.0), fast_q), (max(p, 0.0), q)) if is_stable else None


def _shape_pairs(p: TwoMassParameters, stem: Factor, spring: Factor) -> Pairs | None:
    """Return the transformation to one pair for the stem and one for the centre of mass.

    ``stem`` and ``spring`` are the coefficients (2δ, κ) of the pairs (q, q̇). In the first pair the
    stem stretch is (w, ẇ) = (q, q̇), and the centre of mass Y follows from its equation of motion.
    In the second pair (Y, Ẏ) = (q, q̇), and w follows. Returns None if the mode shapes do not exist.
    """
    shapes, matrix = np.eye(4), p.inner_matrix
    for first, pair in ((0, stem), (2, spring)):
        other = 2 - first
        weights = _follower_weights(matrix[other + 1], first, other, pair)
        if weights is None:
            return None
        damping, stiffness = pair
        rate = -stiffness * weights[1], weights[0] - damping * weights[1]
        shapes[other : other + 2, first : first + 2] = weights, rate
    rates, inverse = np.array([stem, spring]), _inverse(shapes)
    return None if inverse is None else Pairs(shapes, inverse, rates[:, 0], rates[:, 1])


def _inverse(shapes: FloatArray) -> FloatArray | None:
    """Return the inverse of a block matrix [[1, G], [H, 1]], or None if it is singular.

    ``shapes`` is the matrix, ``(4, 4)``, with blocks of shape ``(2, 2)``. The inverse is computed
    by blocks, because the entries have very different sizes.
    """
    right, left = shapes[:2, 2:], shapes[2:, :2]
    (a, b), (c, d) = np.eye(2) - right @ left
    divisor = a * d - b * c
    if divisor == 0.0:
        return None
    corner = np.array([[d, -b], [-c, a]]) / divisor
    return np.block(
        [[corner, -corner @ right], [-left @ corner, np.eye(2) + left @ corner @ right]]
    )


def _follower_weights(row: FloatArray, first: int, other: int, pair: Factor) -> Factor | None:
    """Return the weights of q and q̇ in the dependent coordinate of a mode shape.

    In a pair (q, q̇) of the two masses in flight, one coordinate (the stretch of the stem or the
    centre of mass) is q. The other coordinate follows from its equation of motion, ``row``. Its
    weights are f = (c + d B)(a + b B)⁻¹ with the matrix B of the pair, B² = −κ − 2δ B. They are
    written out, so that each is accurate to its last digit. Returns None if a + b B is singular.
    """
    damping, stiffness = pair
    a, b = -stiffness - row[other], -damping - row[other + 1]
    c, d = row[first], row[first + 1]
    divisor = a * (a - damping * b) + stiffness * b**2
    if divisor == 0.0:
        return None
    value = c * (a - damping * b) + stiffness * b * d
    return float(value / divisor), float((d * a - b * c) / divisor)

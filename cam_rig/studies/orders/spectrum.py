"""Spectrum of contact force and sound of a steady turn, by orders of the cam's rotation.

Order n is the frequency of n periods per turn. The coefficients of the force are c_n = (1/T) ∫ F
e^{−inωt} dt over its period T. The sound pressure is p = g ω_c (F − q) with q̇ = ω_c (F − q), with
the gain g and the corner frequency ω_c of the radiation. It multiplies each coefficient by a
factor.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
from scipy.special import spherical_jn

from cam_rig.acoustics import RadiationParameters, level_db
from cam_rig.dynamics import MODELS, FollowerParameters
from cam_rig.dynamics.linear.propagator import exponential
from cam_rig.laws import Law, bernstein
from cam_rig.schema import RigConfig
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.studies.orders.steady_force import SteadyForce, steady_force
from cam_rig.units import TURN, ComplexArray, FloatArray, to_rpm

# Fourier integrals of the terms of a contact force: polynomials, vibrations, landings.
#: Smallest ratio of the angular frequency of a vibration to its decay rate at which the vibration
#: is integrated as a sum of two complex exponentials. At a smaller ratio this sum would be
#: ill-conditioned.
MIN_RATE_RATIO = 0.1


def polynomial_integral(ordinates: FloatArray, phase: FloatArray) -> ComplexArray:
    """Return ∫₀¹ P(u) e^{−iφu} du of a polynomial P at phases φ, shape (n,).

    `ordinates` are the Bernstein ordinates of P, shape (p + 1,), and `phase` are the values of φ. P
    is converted to Legendre polynomials of x = 2u − 1. The integral of each is a spherical Bessel
    function, ∫₋₁¹ P_l e^{−iκx} dx = 2 (−i)^l j_l(κ). No term is therefore larger than the
    polynomial, for any φ.
    """
    terms = legendre_matrix(ordinates.size - 1) @ ordinates
    degrees = np.arange(terms.size)
    bessel = spherical_jn(degrees[:, None], 0.5 * phase[None, :])
    return np.asarray(np.exp(-0.5j * phase) * ((terms * (-1j) ** degrees) @ bessel))


@lru_cache(maxsize=64)
def legendre_matrix(degree: int) -> FloatArray:
    """Return the matrix from Bernstein ordinates to Legendre coefficients.

    Its shape is (p + 1, p + 1) for the degree p. The Legendre polynomials are those of 2u − 1.
    """
    nodes, weights = np.polynomial.legendre.leggauss(degree + 1)
    basis = bernstein.basis(degree, 0.5 * (nodes + 1.0))
    values = np.polynomial.legendre.legvander(nodes, degree)
    half = 0.5 * (2.0 * np.arange(degree + 1) + 1.0)
    matrix = half[:, None] * (values.T @ (weights[:, None] * basis))
    matrix.setflags(write=False)
    return np.asarray(matrix)


def vibration_integral(
    matrix: FloatArray, row: FloatArray, start: FloatArray, length: float, rates: FloatArray
) -> ComplexArray:
    """Return the Fourier integral ∫₀ᴸ c e^{At} z e^{−iΩt} dt of a damped vibration.

    `matrix` is A of shape (2, 2), `row` and `start` are c and z of shape (2,), `length` is L in s,
    and `rates` are Ω in rad/s of shape (n,).
    """
    decay = 0.5 * float(np.trace(matrix))
    square = float(np.linalg.det(matrix)) - decay**2
    if square <= (MIN_RATE_RATIO * decay) ** 2:
        return _resolvent_integral(matrix, row, start, length, rates)
    rate, initial = math.sqrt(square), float(row @ start)
    rotating = initial + 1j * (decay * initial - float(row @ matrix @ start)) / rate
    pole = decay + 1j * rate  # λ: the vibration is the real part of a e^{λt} with complex a
    return np.asarray(
        0.5 * rotating * _exponential_integral(pole - 1j * rates, length)
        + 0.5 * np.conj(rotating) * _exponential_integral(np.conj(pole) - 1j * rates, length)
    )


def _exponential_integral(rates: ComplexArray, length: float) -> ComplexArray:
    """Return ∫₀ᴸ e^{zt} dt, which is L at z = 0 (resonance).

    ``rates`` are z in 1/s, shape (n,). ``length`` is L in s.
    """
    nonzero = np.where(rates == 0.0, 1.0, rates)
    return np.where(rates == 0.0, length, np.expm1(nonzero * length) / nonzero)


def _resolvent_integral(
    matrix: FloatArray, row: FloatArray, start: FloatArray, length: float, rates: FloatArray
) -> ComplexArray:
    """Return c (A − iΩ)⁻¹ (e^{AL−iΩL} − 1) z, the integral of `vibration_integral`.

    The formula is used for overdamped vibrations. The eigenvalues of A are then real, so that A −
    iΩ is not singular. The parameters are those of `vibration_integral`.
    """
    end = exponential(matrix, length) @ start
    change = np.exp(-1j * rates * length)[:, None] * end - start
    shifted = matrix - 1j * rates[:, None, None] * np.eye(2)
    return np.asarray(np.linalg.solve(shifted, change[:, :, None])[:, :, 0] @ row)


def pulse_integral(phase: FloatArray) -> ComplexArray:
    """Return ∫ h e^{−iΩt} dt of a half-sine pulse h of unit area and duration τ.

    `phase` is φ = Ωτ of shape (n,). The integral is e^{−iφ/2} cos(φ/2)/(1 − (φ/π)²). It is
    evaluated in a form that is also valid at φ = π, where its magnitude is π/4.
    """
    half = 0.5 * phase
    shape = 0.5 * math.pi * np.sinc(0.5 - half / math.pi) / (1.0 + phase / math.pi)
    return np.asarray(np.exp(-1j * half) * shape)


#: Lower limit of the r.m.s. pressure (Pa) and the force amplitude (N) in a level, so that the level
#: of zero is finite.
SILENCE = 1e-15


@dataclass(frozen=True, eq=False)
class OrderSpectrum:
    """Spectrum of the contact force and sound of a cam at one speed.

    Attributes
    ----------
    steady
        The steady contact force.
    orders
        Orders from 0, shape (n,). They are fractions if the period is several turns.
    force
        Coefficients c_n in N, shape (n,), with landings as half-sine pulses. The force is c_0 plus
        the real part of 2 Σ c_n e^{inθ}.
    pressure
        The same coefficients of the sound pressure in Pa.
    background_db
        Level of the background noise in dB, which has no orders.
    """

    steady: SteadyForce
    orders: FloatArray
    force: ComplexArray
    pressure: ComplexArray
    background_db: float

    @property
    def rpm(self) -> float:
        """Cam speed at which the spectrum is computed, rpm."""
        return round(to_rpm(self.steady.speed), 9)

    @property
    def frequency(self) -> FloatArray:
        """Frequency of each order in Hz, shape (n,)."""
        return self.orders * self.steady.speed / TURN

    @property
    def amplitude(self) -> FloatArray:
        """Amplitude of the force at each order in N, shape (n,).

        At order 0 it is the mean force.
        """
        return np.abs(self.force) * np.where(self.orders > 0.0, 2.0, 1.0)

    @property
    def force_db(self) -> FloatArray:
        """Amplitude of the force at each order in dB re 1 N, shape (n,)."""
        return np.asarray(20.0 * np.log10(np.maximum(self.amplitude, SILENCE)))

    @property
    def level(self) -> FloatArray:
        """Sound level at each order in dB re 20 µPa, shape (n,).

        Order 0, the constant part of the force, radiates no sound.
        """
        return level_db(np.maximum(math.sqrt(2.0) * np.abs(self.pressure), SILENCE))

    def up_to(self, highest: float) -> OrderSpectrum:
        """Return a copy of the spectrum without the orders above `highest`."""
        size = int(np.searchsorted(self.orders, highest, side="right"))
        return replace(
            self, orders=self.orders[:size], force=self.force[:size], pressure=self.pressure[:size]
        )

    @property
    def loudest(self) -> int:
        """Index of the order with the highest sound level in the arrays of the spectrum."""
        return int(np.argmax(self.level[1:])) + 1

    def order_within(self, share: float) -> float:
        """Return the order up to which the fraction `share` of the sound power occurs.

        The total is the power of all orders of this spectrum.
        """
        power = np.cumsum(np.abs(self.pressure) ** 2)
        return float(self.orders[np.searchsorted(power, share * power[-1])])

    @property
    def total_db(self) -> float:
        """Sound level of all orders together without the background, dB re 20 µPa."""
        power = 2.0 * float(np.sum(np.abs(self.pressure[1:]) ** 2))
        return float(level_db(max(math.sqrt(power), SILENCE)))


def force_orders(steady: SteadyForce, rates: FloatArray, contact_time: float) -> ComplexArray:
    """Return the Fourier coefficients (N) of a steady force, shape (n,).

    They are those at the angular frequencies Ω (rad/s) in ``rates``. A landing is a half-sine pulse
    with the duration `contact_time` (s).
    """
    total = np.zeros(rates.size, dtype=np.complex128)
    for piece in steady.pieces:
        integral = piece.length * polynomial_integral(piece.ordinates, rates * piece.length)
        if piece.free is not None:
            free = piece.free
            integral = integral + vibration_integral(
                free.matrix, free.row, free.start, piece.length, rates
            )
        total += np.exp(-1j * rates * piece.begin) * integral
    pulse = pulse_integral(rates * contact_time)
    for time, impulse in steady.landings:
        total += impulse * np.exp(-1j * rates * time) * pulse
    return total / steady.duration


def spectrum(
    steady: SteadyForce, radiation: RadiationParameters | None, contact_time: float, highest: int
) -> OrderSpectrum:
    """Return the spectrum of a steady force and its sound up to the order `highest`.

    The sound is NaN if ``radiation`` is None. The pulse of a landing has the duration
    `contact_time` (s).
    """
    orders = np.arange(highest * steady.turns + 1) / steady.turns
    rates = orders * steady.speed
    force = force_orders(steady, rates, contact_time)
    if radiation is None:
        return OrderSpectrum(steady, orders, force, np.full_like(force, np.nan), math.nan)
    corner = radiation.corner_rate
    structure = radiation.gain * corner * 1j * rates / (corner + 1j * rates)
    background = math.sqrt(radiation.background_power(steady.speed))
    return OrderSpectrum(steady, orders, force, structure * force, float(level_db(background)))


def order_spectrum(
    law: Law, model: str, rig: RigConfig, speed: float, highest: int
) -> OrderSpectrum:
    """Return the spectrum of force and sound of a cam at a speed (rad/s).

    ``model`` is the name of the follower's model. The spectrum contains the orders up to `highest`.
    The sound is NaN if the rig has no radiation parameters.
    """
    steady = steady_force(law, model, rig, speed)
    lands = MODELS[model].lifts_off
    radiation = None
    if not rig.missing_for_sound(lands):
        radiation = RadiationParameters.from_rig(rig, lands=lands)
    follower = FollowerParameters.from_rig(rig)
    contact_time = 0.0 if follower.stem_stiffness is None else follower.contact_time
    return spectrum(steady, radiation, contact_time, highest)


# Spectra of cams at many speeds.
#: Titles of the displayed quantities by the property of `OrderSpectrum`.
QUANTITIES = {"force_db": "contact force [dB re 1 N]", "level": "sound [dB re 20 µPa]"}
#: Range of the displayed levels below the highest level, dB. Lower levels are not displayed.
RANGE = 60.0
#: Highest order that is computed by default. At 400 rpm its frequency is 667 Hz.
HIGHEST = 100


@dataclass(frozen=True, eq=False)
class CamOrders:
    """Spectra by orders of one cam at several speeds, for a follower model and a rig.

    An order is a frequency as a multiple of the cam's rotational frequency.
    """

    cam: str
    model: str
    rig: RigConfig
    spectra: tuple[OrderSpectrum, ...]

    def at(self, rpm: float) -> OrderSpectrum:
        """Return the spectrum of a cam at the computed speed that is nearest to `rpm`."""
        return min(self.spectra, key=lambda spectrum: abs(spectrum.rpm - rpm))

    def only(self, *rpms: float) -> CamOrders:
        """Return a copy with only the spectra at the computed speeds nearest to `rpms`."""
        return replace(self, spectra=tuple(self.at(rpm) for rpm in rpms))

    def up_to(self, highest: float) -> CamOrders:
        """Return a copy of the spectra of a cam without the orders above `highest`."""
        return replace(self, spectra=tuple(spectrum.up_to(highest) for spectrum in self.spectra))

    @property
    def edges(self) -> FloatArray:
        """Speeds (rpm) at which the strokes of a Campbell diagram end, shape (n + 1,).

        A stroke is a short line at each order and each of the n speeds. The ends are the middles
        between the speeds. The first and the last end are as far from their speed as the nearest
        middle. A single speed gets a range of ±0.5 %.
        """
        rpm = np.array([spectrum.rpm for spectrum in self.spectra])
        if rpm.size == 1:
            return np.array([0.995 * rpm[0], 1.005 * rpm[0]])
        ends = 1.5 * rpm[[0, -1]] - 0.5 * rpm[[1, -2]]
        return np.concatenate((ends[:1], 0.5 * (rpm[1:] + rpm[:-1]), ends[1:]))

    def strokes(self) -> FloatArray:
        """Return the strokes of a Campbell diagram as end points, shape (k, 2, 2).

        The last axis is (rpm, Hz). There is one stroke per order and speed, on the line of the
        order. Order 0 has no stroke.
        """
        strokes = []
        for spectrum, ends in zip(self.spectra, pairwise(self.edges), strict=True):
            per_rpm = spectrum.orders[1:] / 60.0
            points = [np.column_stack([np.full_like(per_rpm, x), per_rpm * x]) for x in ends]
            strokes.append(np.stack(points, axis=1))
        return np.concatenate(strokes)

    def values(self, quantity: str) -> FloatArray:
        """Return the value (dB) of each stroke of the Campbell diagram, shape (k,).

        `quantity` is "force_db" or "level".
        """
        return np.concatenate([getattr(spectrum, quantity)[1:] for spectrum in self.spectra])


def quantities_of(studies: Iterable[CamOrders]) -> dict[str, str]:
    """Return the `QUANTITIES` that the spectra contain.

    The sound level is left out if the rig has no sound parameters.
    """
    has_sound = all(
        math.isfinite(each.background_db) for study in studies for each in study.spectra
    )
    return {name: title for name, title in QUANTITIES.items() if has_sound or name != "level"}


def loudest(studies: Iterable[CamOrders], quantity: str) -> float:
    """Return the largest value (dB) of a quantity over all cams, for a common scale.

    `quantity` is a key of `QUANTITIES`.
    """
    return max(float(study.values(quantity).max()) for study in studies)


def waterfall(
    laws: dict[str, Law],
    model: str,
    rig: RigConfig,
    speeds: Iterable[float],
    highest: int = HIGHEST,
    progress: Progress = NULL_PROGRESS,
) -> tuple[CamOrders, ...]:
    """Return the spectra of force and sound of each cam at each speed.

    `laws` are the laws by cam, and `speeds` are in rad/s. The spectra contain the orders up to
    `highest`.
    """
    studies, all_speeds = [], tuple(speeds)
    progress.start(len(laws) * len(all_speeds))
    for cam, law in laws.items():
        progress.describe(cam)
        spectra = []
        for speed in all_speeds:
            spectra.append(order_spectrum(law, model, rig, speed, highest))
            progress.advance()
        studies.append(CamOrders(cam, model, rig, tuple(spectra)))
    return tuple(studies)

"""Force and sound of a steady turn by orders of the cam: as often a turn as the order says.

c_n = (1/T) ∫ F e^{−inωt} dt over the time T in which the force comes back. The sound is what the
rig's structure makes of it, p = g ω_c (F − q) with q̇ = ω_c (F − q): a factor for each order.
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

# Fourier integrals of what a contact force is made of: polynomials, vibrations, landings.

#: A vibration whose rate is less than this part of its decay is not split into two that rotate.
CREEPING = 0.1


def polynomial_integral(ordinates: FloatArray, phase: FloatArray) -> ComplexArray:
    """∫₀¹ P(u) e^{−iφu} du at phases φ ``(n,)`` of a polynomial with Bernstein ``(p + 1,)``.

    In Legendre polynomials of x = 2u − 1 each term is a spherical Bessel function,
    ∫₋₁¹ P_l e^{−iκx} dx = 2 (−i)^l j_l(κ): no term is larger than the polynomial, for any φ.
    """
    terms = legendre_matrix(ordinates.size - 1) @ ordinates
    degrees = np.arange(terms.size)
    bessel = spherical_jn(degrees[:, None], 0.5 * phase[None, :])
    return np.asarray(np.exp(-0.5j * phase) * ((terms * (-1j) ** degrees) @ bessel))


@lru_cache(maxsize=64)
def legendre_matrix(degree: int) -> FloatArray:
    """Matrix that rewrites Bernstein ordinates in Legendre polynomials of 2u − 1."""
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
    """∫₀ᴸ c e^{At} z e^{−iΩt} dt at Ω = ``rates`` ``(n,)`` in rad/s, of a damped mass.

    ``matrix``: A, ``(2, 2)``; ``row`` and ``start``: c and z, ``(2,)``; ``length``: L, s.
    """
    decay = 0.5 * float(np.trace(matrix))
    square = float(np.linalg.det(matrix)) - decay**2
    if square <= (CREEPING * decay) ** 2:
        return _by_resolvent(matrix, row, start, length, rates)
    rate, first = math.sqrt(square), float(row @ start)
    turning = first + 1j * (decay * first - float(row @ matrix @ start)) / rate
    pole = decay + 1j * rate  # the vibration is the real part of a e^{λt}
    return np.asarray(
        0.5 * turning * _grown(pole - 1j * rates, length)
        + 0.5 * np.conj(turning) * _grown(np.conj(pole) - 1j * rates, length)
    )


def _grown(rates: ComplexArray, length: float) -> ComplexArray:
    """∫₀ᴸ e^{zt} dt, also at and beside z = 0, which is resonance."""
    safe = np.where(rates == 0.0, 1.0, rates)
    return np.where(rates == 0.0, length, np.expm1(safe * length) / safe)


def _by_resolvent(
    matrix: FloatArray, row: FloatArray, start: FloatArray, length: float, rates: FloatArray
) -> ComplexArray:
    """C (A − iΩ)⁻¹ (e^{AL−iΩL} − 1) z: for rates that are real, which no Ω comes near to."""
    end = exponential(matrix, length) @ start
    change = np.exp(-1j * rates * length)[:, None] * end - start
    shifted = matrix - 1j * rates[:, None, None] * np.eye(2)
    return np.asarray(np.linalg.solve(shifted, change[:, :, None])[:, :, 0] @ row)


def pulse_integral(phase: FloatArray) -> ComplexArray:
    """∫ h e^{−iΩt} dt of half a sine of unit area that lasts τ, at φ = Ωτ ``(n,)``.

    e^{−iφ/2} cos(φ/2)/(1 − (φ/π)²), written so that it has its value π/4 at φ = π.
    """
    half = 0.5 * phase
    shape = 0.5 * math.pi * np.sinc(0.5 - half / math.pi) / (1.0 + phase / math.pi)
    return np.asarray(np.exp(-1j * half) * shape)


#: r.m.s. pressure (Pa) that silence counts as, and force (N) that none does.
SILENCE = 1e-15


@dataclass(frozen=True, eq=False)
class OrderSpectrum:
    """A cam at one speed.

    ``orders`` ``(n,)`` go from 0 on, in parts of one where the force comes back after several
    turns. ``force`` ``(n,)`` is c_n in N, landings as half-sine pulses among it: F is c_0 and the
    real part of 2 Σ c_n e^{inθ}. ``pressure`` ``(n,)`` is the same of the sound, Pa. The
    background, ``background_db``, is noise and has no orders.
    """

    steady: SteadyForce
    orders: FloatArray
    force: ComplexArray
    pressure: ComplexArray
    background_db: float

    @property
    def rpm(self) -> float:
        """Cam speed, rpm."""
        return round(to_rpm(self.steady.speed), 9)

    @property
    def frequency(self) -> FloatArray:
        """Of each order, Hz."""
        return self.orders * self.steady.speed / TURN

    @property
    def amplitude(self) -> FloatArray:
        """Of the force at each order, N; the mean force at order 0."""
        return np.abs(self.force) * np.where(self.orders > 0.0, 2.0, 1.0)

    @property
    def force_db(self) -> FloatArray:
        """The amplitude in dB re 1 N."""
        return np.asarray(20.0 * np.log10(np.maximum(self.amplitude, SILENCE)))

    @property
    def level(self) -> FloatArray:
        """Of the sound at each order, dB re 20 µPa; order 0 is silence."""
        return level_db(np.maximum(math.sqrt(2.0) * np.abs(self.pressure), SILENCE))

    def up_to(self, highest: float) -> OrderSpectrum:
        """The same without the orders above one."""
        kept = int(np.searchsorted(self.orders, highest, side="right"))
        return replace(
            self, orders=self.orders[:kept], force=self.force[:kept], pressure=self.pressure[:kept]
        )

    @property
    def loudest(self) -> int:
        """The place of the loudest order in the arrays."""
        return int(np.argmax(self.level[1:])) + 1

    def order_within(self, share: float) -> float:
        """The order up to which a share of the sound's power lies, of all orders there are."""
        power = np.cumsum(np.abs(self.pressure) ** 2)
        return float(self.orders[np.searchsorted(power, share * power[-1])])

    @property
    def total_db(self) -> float:
        """Level of all orders together, without the background, dB."""
        power = 2.0 * float(np.sum(np.abs(self.pressure[1:]) ** 2))
        return float(level_db(max(math.sqrt(power), SILENCE)))


def force_orders(steady: SteadyForce, rates: FloatArray, contact_time: float) -> ComplexArray:
    """C at rates Ω ``(n,)`` in rad/s; a landing's pulse lasts ``contact_time`` s."""
    total = np.zeros(rates.size, dtype=np.complex128)
    for piece in steady.pieces:
        integral = piece.length * polynomial_integral(piece.ordinates, rates * piece.length)
        if piece.free is not None:
            v = piece.free
            integral = integral + vibration_integral(v.matrix, v.row, v.start, piece.length, rates)
        total += np.exp(-1j * rates * piece.begin) * integral
    pulse = pulse_integral(rates * contact_time)
    for time, impulse in steady.landings:
        total += impulse * np.exp(-1j * rates * time) * pulse
    return total / steady.duration


def spectrum(
    steady: SteadyForce, radiation: RadiationParameters | None, contact_time: float, highest: int
) -> OrderSpectrum:
    """Return force and sound up to an order; the sound is NaN without radiation.

    The pulse of a landing lasts `contact_time` (s).
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
    """The steady force of a model at a speed (rad/s), and its sound, up to an order."""
    steady = steady_force(law, model, rig, speed)
    lands = MODELS[model].lifts_off
    radiation = None
    if not rig.missing_for_sound(lands):
        radiation = RadiationParameters.from_rig(rig, lands=lands)
    follower = FollowerParameters.from_rig(rig)
    contact_time = 0.0 if follower.stem_stiffness is None else follower.contact_time
    return spectrum(steady, radiation, contact_time, highest)


# Orders over speed: the spectra of cams at many speeds, one beside the other.

#: What is shown over speed: the spectra's property, and its heading.
QUANTITIES = {"force_db": "contact force [dB re 1 N]", "level": "sound [dB re 20 µPa]"}
#: dB between what is shown brightest and what is not shown.
RANGE = 60.0
#: Highest order by default: 667 Hz at 400 rpm.
HIGHEST = 100


@dataclass(frozen=True, eq=False)
class CamOrders:
    """The spectra of one cam, speed by speed."""

    cam: str
    model: str
    rig: RigConfig
    spectra: tuple[OrderSpectrum, ...]

    def at(self, rpm: float) -> OrderSpectrum:
        """The spectrum of the speed that is nearest to one in rpm."""
        return min(self.spectra, key=lambda spectrum: abs(spectrum.rpm - rpm))

    def only(self, *rpms: float) -> CamOrders:
        """The same at the speeds that are nearest to these."""
        return replace(self, spectra=tuple(self.at(rpm) for rpm in rpms))

    def up_to(self, highest: float) -> CamOrders:
        """The same without the orders above one."""
        return replace(self, spectra=tuple(found.up_to(highest) for found in self.spectra))

    @property
    def edges(self) -> FloatArray:
        """``(n + 1,)`` rpm between the speeds, and as far beyond the first and the last."""
        rpm = np.array([spectrum.rpm for spectrum in self.spectra])
        if rpm.size == 1:
            return np.array([0.995 * rpm[0], 1.005 * rpm[0]])
        ends = 1.5 * rpm[[0, -1]] - 0.5 * rpm[[1, -2]]
        return np.concatenate((ends[:1], 0.5 * (rpm[1:] + rpm[:-1]), ends[1:]))

    def strokes(self) -> FloatArray:
        """``(k, 2, 2)`` (rpm, Hz) of a stroke for each order but 0 at each speed, on its ray."""
        found = []
        for spectrum, ends in zip(self.spectra, pairwise(self.edges), strict=True):
            per_rpm = spectrum.orders[1:] / 60.0
            both = [np.column_stack([np.full_like(per_rpm, x), per_rpm * x]) for x in ends]
            found.append(np.stack(both, axis=1))
        return np.concatenate(found)

    def values(self, quantity: str) -> FloatArray:
        """``(k,)`` dB of each stroke: of "force_db" or "level"."""
        return np.concatenate([getattr(spectrum, quantity)[1:] for spectrum in self.spectra])


def quantities_of(found: Iterable[CamOrders]) -> dict[str, str]:
    """Return the `QUANTITIES` that the spectra have: no sound without its numbers."""
    has_sound = all(math.isfinite(one.background_db) for study in found for one in study.spectra)
    return {name: title for name, title in QUANTITIES.items() if has_sound or name != "level"}


def loudest(found: Iterable[CamOrders], quantity: str) -> float:
    """The largest of all cams, dB: all are shown on one scale."""
    return max(float(study.values(quantity).max()) for study in found)


def waterfall(
    laws: dict[str, Law],
    model: str,
    rig: RigConfig,
    speeds: Iterable[float],
    highest: int = HIGHEST,
    progress: Progress = NULL_PROGRESS,
) -> tuple[CamOrders, ...]:
    """Force and sound of each cam at each of ``speeds`` (rad/s), up to an order."""
    found, all_speeds = [], tuple(speeds)
    progress.start(len(laws) * len(all_speeds))
    for cam, law in laws.items():
        progress.describe(cam)
        spectra = []
        for speed in all_speeds:
            spectra.append(order_spectrum(law, model, rig, speed, highest))
            progress.advance()
        found.append(CamOrders(cam, model, rig, tuple(spectra)))
    return tuple(found)

"""Fourier integrals of what a contact force is made of: polynomials, vibrations, landings.

All are closed forms that keep their digits at every order, the zeroth included. Nothing is sampled,
so nothing leaks from one order to the next, and nothing is folded back.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from scipy.special import spherical_jn

from cam_rig.arrays import ComplexArray, FloatArray
from cam_rig.dynamics.linear.propagator import exponential
from cam_rig.laws import bernstein

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

    Parameters
    ----------
    matrix : A, ``(2, 2)``
    row, start : c and z, ``(2,)``
    length : L, s
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

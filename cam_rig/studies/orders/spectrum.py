"""Force and sound of a steady turn by orders of the cam: as often a turn as the order says.

c_n = (1/T) ∫ F e^{−inωt} dt over the time T in which the force comes back. The sound is what the
rig's structure makes of it, p = g ω_c (F − q) with q̇ = ω_c (F − q): a factor for each order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.acoustics import RadiationParameters, level_db
from cam_rig.arrays import ComplexArray, FloatArray
from cam_rig.dynamics import MODELS
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.studies.orders.fourier import (
    polynomial_integral,
    pulse_integral,
    vibration_integral,
)
from cam_rig.studies.orders.steady_force import SteadyForce, steady_force
from cam_rig.units import TURN, to_rpm

#: r.m.s. pressure (Pa) that silence counts as, and force (N) that none does.
SILENCE = 1e-15


@dataclass(frozen=True, eq=False)
class OrderSpectrum:
    """A cam at one speed.

    Parameters
    ----------
    steady : the force that it is of
    orders : ``(n,)`` from 0 on; in parts of one where the force comes back after several turns
    force : ``(n,)`` c_n in N, the landings as half-sine pulses among it; F is c_0 and the real
        part of 2 Σ c_n e^{inθ}
    pressure : ``(n,)`` the same of the sound pressure, Pa
    background_db : level of the background, which is noise and has no orders
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
            self,
            orders=self.orders[:kept],
            force=self.force[:kept],
            pressure=self.pressure[:kept],
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


def spectrum(steady: SteadyForce, radiation: RadiationParameters, highest: int) -> OrderSpectrum:
    """Force and sound up to an order."""
    orders = np.arange(highest * steady.turns + 1) / steady.turns
    rates = orders * steady.speed
    force = force_orders(steady, rates, radiation.contact_time)
    corner = radiation.corner_rate
    structure = radiation.gain * corner * 1j * rates / (corner + 1j * rates)
    background = math.sqrt(radiation.background_power(steady.speed))
    return OrderSpectrum(steady, orders, force, structure * force, float(level_db(background)))


def order_spectrum(
    law: Law, model: str, rig: RigConfig, speed: float, highest: int
) -> OrderSpectrum:
    """The steady force of a model at a speed (rad/s), and its sound, up to an order.

    Raises
    ------
    ConfigError : the model's force is no closed form, or the rig lacks a number that it needs
    DynamicsError : the law is not for the model, or a mode without damping is in resonance

    Examples
    --------
    >>> import cam_rig
    >>> from cam_rig.units import RPM
    >>> law = cam_rig.build_law(cam_rig.load_cam("eccentric_roller"))
    >>> found = order_spectrum(law, "one_mass", cam_rig.load_rig("tm21"), 200 * RPM, 10)
    >>> int(found.amplitude[1:].argmax()) + 1
    1
    """
    steady = steady_force(law, model, rig, speed)
    lands = MODELS[model].lifts_off
    return spectrum(steady, RadiationParameters.from_rig(rig, lands=lands), highest)

"""One settled turn at each speed: what a cam does to the structure, before any acoustics.

Fits move acoustic constants many times over the same mechanics, so these are kept apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from cam_rig.acoustics import RadiationParameters, level_db
from cam_rig.acoustics.low_pass import structure_response
from cam_rig.arrays import FloatArray
from cam_rig.dynamics import MODELS, Interval
from cam_rig.laws import Law
from cam_rig.units import NS, TURN, to_rpm

#: Hz: levels are within 0.003 dB of those at 384 kHz (docs/accuracy.md).
TURN_RATE_HZ = 12_000
#: The speed response is a polynomial of (rpm − 300)/100.
RESPONSE_AT, RESPONSE_PER = 300.0, 100.0


class Sounding(Protocol):
    """What a cam gives to the rig's structure at each of ``speeds`` (rad/s)."""

    @property
    def speeds(self) -> FloatArray:
        """Of the cam, rad/s, ``(n,)``."""

    def every(self, step: int) -> Sounding:
        """Only each ``step``-th speed."""

    def contact_power(self, corner_rate: float) -> FloatArray:
        """Mean square of ω_c (F − q), ``(n,)`` in (N/s)², for ω_c in rad/s."""

    def landing_power(self, radiation: RadiationParameters) -> FloatArray:
        """Mean square pressure of the landings, ``(n,)`` in Pa²."""


@dataclass(frozen=True, eq=False)
class Turns:
    """The last turn of a run at each of ``speeds`` (rad/s): force (N) and impulse (N·s) blocks."""

    speeds: FloatArray
    forces: tuple[FloatArray, ...]
    impulses: tuple[FloatArray, ...]

    @property
    def rpm(self) -> FloatArray:
        """The speeds in rpm."""
        return to_rpm(self.speeds)

    def every(self, step: int) -> Turns:
        """Only each ``step``-th speed."""
        return Turns(self.speeds[::step], self.forces[::step], self.impulses[::step])

    def contact_power(self, corner_rate: float) -> FloatArray:
        """⟨(ω_c (F − q))²⟩ over a turn repeated for ever, ``(n,)`` in (N/s)²."""
        blocks = zip(self.forces, self.impulses, strict=True)
        return np.array([_contact_power(corner_rate, *block) for block in blocks])

    def landing_power(self, radiation: RadiationParameters) -> FloatArray:
        """Mean square pressure of the landings, ``(n,)`` in Pa²."""
        energy = [float(radiation.landing_energy(impulse).sum()) for impulse in self.impulses]
        return np.array(energy) * self.speeds / TURN


def _contact_power(rate: float, force: FloatArray, impulse: FloatArray) -> float:
    """The structure is linear: a turn from rest, and the start that comes back to itself."""
    started = structure_response(rate, TURN_RATE_HZ, 0.0, float(force[-1]), force, impulse)
    fading = np.exp(-rate / TURN_RATE_HZ * np.arange(1, force.size + 1))
    structure = started + fading * started[-1] / (1.0 - fading[-1])
    return float(np.mean((rate * (force - structure)) ** 2))


def settled_turns(
    law: Law, model: str, parameters: Any, speeds: Sequence[float] | FloatArray
) -> Turns:
    """Run turns at each speed until one is like the next, and keep that one.

    A rigid follower that ends a turn on the cam has forgotten it; otherwise the second is kept.
    """
    forces, impulses = [], []
    for speed in map(float, speeds):
        turn, state = round(TURN / speed * NS), None
        for i in range(2):
            interval = Interval(i * turn, (i + 1) * turn, speed * i * turn / NS, speed)
            state, block = MODELS[model].advance(law, parameters, state, interval, TURN_RATE_HZ)
            if model == "one_mass" and state.in_contact and state.pending_impulse == 0.0:
                break
        forces.append(block.force)
        impulses.append(block.impulse)
    return Turns(np.array(speeds, dtype=float), tuple(forces), tuple(impulses))


@dataclass(frozen=True)
class Acoustics:
    """The fitted constants of a rig's sound.

    ``response`` is empty, or dB of the contact's sound over powers 1, 2, 3 of (rpm − 300)/100:
    how much better the rig passes sound on at one speed than at another, whatever the cam.
    """

    radiation: RadiationParameters
    response: tuple[float, ...] = ()

    def levels(self, turns: Sounding) -> FloatArray:
        """Level in dB at each speed, ``(n,)``.

        Landings do not pass through the speed response: it is measured on a cam that has none,
        at some tens of Hz, and they sound at some kHz.
        """
        r = self.radiation
        background = np.array([r.background_power(float(speed)) for speed in turns.speeds])
        contact = (
            r.gain**2 * turns.contact_power(r.corner_rate) * self._passed(to_rpm(turns.speeds))
        )
        return level_db(np.sqrt(background + contact + turns.landing_power(r)))

    def with_constants(
        self, gain: float, corner: float, response: tuple[float, ...] = ()
    ) -> Acoustics:
        """The same background, other constants."""
        return Acoustics(replace(self.radiation, gain=gain, corner=corner), response)

    def _passed(self, rpm: FloatArray) -> FloatArray:
        x = (rpm - RESPONSE_AT) / RESPONSE_PER
        return np.asarray(10.0 ** (np.polynomial.polynomial.polyval(x, (0.0, *self.response)) / 10))

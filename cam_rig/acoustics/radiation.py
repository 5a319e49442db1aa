"""The acoustic constants of a rig: a structure with one corner, landings, and background.

The pressure follows the rate of the contact force through a structure that cannot follow
beyond its corner:

    p = gain · ω_c (F − q),    q̇ = ω_c (F − q)        (p ≈ gain · Ḟ below the corner)

A landing is a force pulse of impulse J, half a sine of the time the follower's mass takes on
its stem. It is far above the corner, so it radiates ∫p² dt = (gain ω_c J)² π²/(8 T_c) and leaves
q higher by ω_c J: the impact needs no constant of its own. Background (motor, bearings) adds in
energy, rising with speed. This is the energy accountancy of machinery noise (Richards).

Force becomes pressure by these in `pressure`, as energy and as a signal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics import FollowerParameters
from cam_rig.schema import RigConfig
from cam_rig.units import FloatArray

#: Reference sound pressure in air, Pa (IEC 61672).
REFERENCE_PRESSURE = 20e-6


def level_db(pressure: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Level in dB re 20 µPa of an r.m.s. pressure in Pa."""
    return np.asarray(20.0 * np.log10(np.asarray(pressure) / REFERENCE_PRESSURE))


def pressure_pa(level: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """r.m.s. pressure in Pa of a level in dB re 20 µPa."""
    return np.asarray(REFERENCE_PRESSURE * 10.0 ** (np.asarray(level) / 20.0))


@dataclass(frozen=True)
class RadiationParameters:
    """The acoustic constants of a rig."""

    gain: float  #: Pa·s/N, pressure per rate of contact force
    corner: float  #: Hz
    background: float  #: dB at the speed ``background_at`` (rad/s)
    background_at: float
    background_slope: float  #: dB per octave of speed
    contact_time: float  #: s, duration of a landing's force pulse; 0 where nothing can land
    background_corner: float  #: Hz, above which the background falls by 6 dB an octave

    @classmethod
    def from_rig(cls, rig: RigConfig, *, lands: bool = True) -> RadiationParameters:
        """Take the numbers of a rig file; a follower that never ``lands`` needs no stem."""
        r = rig.need_radiation("the sound level")
        if lands:
            rig.need("stem_stiffness", "the sound of a landing")
        follower = FollowerParameters.from_rig(rig)
        return cls(
            gain=r.gain.si,
            corner=r.corner.si,
            background=r.background.si,
            background_at=r.background_at.si,
            background_slope=r.background_slope.si,
            contact_time=follower.contact_time if follower.stem_stiffness else 0.0,
            background_corner=r.background_corner.si,
        )

    @property
    def corner_rate(self) -> float:
        """ω_c in rad/s."""
        return 2.0 * math.pi * self.corner

    def background_power(self, speed: float) -> float:
        """Mean square background pressure, Pa², at a cam speed in rad/s."""
        level = self.background + self.background_slope * math.log2(speed / self.background_at)
        return float(pressure_pa(level)) ** 2

    def landing_energy(self, impulse: FloatArray) -> FloatArray:
        """∫p² dt in Pa²·s radiated by landings of these impulses (N·s)."""
        if not impulse.any():
            return np.zeros_like(impulse)
        peak = self.gain * self.corner_rate * impulse
        return np.asarray(peak**2 * math.pi**2 / (8.0 * self.contact_time))


#: Samples that `first_order` takes together, a power of two.
BLOCK = 64


def structure_response(
    corner_rate: float,
    sample_rate: float,
    start: float,
    previous: float,
    force: FloatArray,
    impulse: FloatArray,
) -> FloatArray:
    """Structure q (N) at the samples, ``(n,)``: q̇ = ω_c (F − q), solved exactly between them.

    ``start`` and ``previous`` are q and force (N) at the sample before the first. ``force`` (N) is
    straight between samples; ``impulse`` (N·s) falls at a sample and lifts q by ω_c J.
    """
    x = corner_rate / sample_rate
    keep = math.exp(-x)
    ramp = -math.expm1(-x) / x
    before, now = ramp - keep, 1.0 - ramp
    earlier = np.concatenate(([previous], force[:-1]))
    drive = before * earlier + now * force + corner_rate * impulse
    return first_order(keep, drive, start)


def first_order(keep: float, drive: FloatArray, start: float) -> FloatArray:
    """The recursion y ← keep · y + drive from y = ``start`` on, ``(n,)``.

    In blocks, all of which go forward together from rest, by doubling; each then gets what the one
    before has left. As quick as scipy's filter, whose import takes half a second.
    """
    blocks = np.zeros((-(-drive.size // BLOCK), BLOCK))
    blocks.reshape(-1)[: drive.size] = drive
    steps = blocks.T.copy()
    shift, kept = 1, keep
    while shift < BLOCK:
        steps[shift:] += kept * steps[:-shift]
        shift, kept = 2 * shift, kept * kept
    powers = np.array([keep**k for k in range(1, BLOCK + 1)])
    left, whole = [start], float(powers[-1])
    for own in steps[-1, :-1].tolist():
        left.append(own + whole * left[-1])
    if drive.size:
        steps += powers[:, None] * np.array(left)
    return np.asarray(steps.T.reshape(-1)[: drive.size])

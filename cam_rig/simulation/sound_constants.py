"""Least-squares fit of the two acoustic constants of a rig to levels of one or more cams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from cam_rig.acoustics import RadiationParameters
from cam_rig.acoustics.pressure import mean_square_rate
from cam_rig.dynamics import FollowerParameters
from cam_rig.laws import Law
from cam_rig.simulation.simulate import Acoustics, Sounding
from cam_rig.units import FloatArray, rms, to_rpm


@dataclass(frozen=True, eq=False)
class PublishedCam:
    """Settled turns of a cam and its published or measured level (dB) at the same speeds."""

    cam: str
    turns: Sounding
    published: FloatArray

    @property
    def rpm(self) -> FloatArray:
        """The speeds in rpm."""
        return to_rpm(self.turns.speeds)

    def every(self, step: int) -> PublishedCam:
        """Return every `step`-th speed only."""
        return PublishedCam(self.cam, self.turns.every(step), self.published[::step])

    def difference(self, acoustics: Acoustics) -> FloatArray:
        """Return simulated minus published level, dB."""
        return acoustics.levels(self.turns) - self.published

    def rms(self, acoustics: Acoustics) -> float:
        """Return the root mean square of that difference, dB."""
        return rms(self.difference(acoustics))


@dataclass(frozen=True, eq=False)
class SteadyTurns:
    """Steady sound, without samples, of a cam that keeps contact at all `speeds` (rad/s)."""

    law: Law
    follower: FollowerParameters
    speeds: FloatArray

    def every(self, step: int) -> SteadyTurns:
        """Return every `step`-th speed only."""
        return SteadyTurns(self.law, self.follower, self.speeds[::step])

    def contact_power(self, corner_rate: float) -> FloatArray:
        """Return ⟨(ω_c (F − q))²⟩ over a turn, `(n,)` in (N/s)²."""
        power = [mean_square_rate(self.law, self.follower, corner_rate, s) for s in self.speeds]
        return np.array(power)

    def landing_power(self, _radiation: RadiationParameters) -> FloatArray:
        """Return zero, as there are no landings, `(n,)` in Pa²."""
        return np.zeros(self.speeds.size)


def two_constants(
    cams: Sequence[PublishedCam], start: Acoustics, corners: tuple[float, float] = (0.0, np.inf)
) -> Acoustics:
    """Fit gain and corner, by least squares of the differences of all cams in dB.

    `corners` are the limits of the corner in Hz.
    """

    def residual(x: FloatArray) -> FloatArray:
        return np.concatenate([cam.difference(at(x)) for cam in cams])

    def at(x: FloatArray) -> Acoustics:
        gain, corner = np.exp(x).tolist()
        return start.with_constants(gain, corner)

    r = start.radiation
    with np.errstate(divide="ignore"):  # log 0 is no limit
        low, high = np.log(corners).tolist()
    bounds = (-np.inf, low), (np.inf, high)
    return at(least_squares(residual, np.log([r.gain, r.corner]), x_scale=0.1, bounds=bounds).x)

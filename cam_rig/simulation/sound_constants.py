"""Least-squares fit of the two acoustic constants of a rig to levels of cams."""

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
    """Settled turns of a cam, and its published or measured level at the same speeds."""

    cam: str
    turns: Sounding
    published: FloatArray  #: level, dB, ``(n,)``

    @property
    def rpm(self) -> FloatArray:
        """Cam speeds, rpm."""
        return to_rpm(self.turns.speeds)

    def every(self, step: int) -> PublishedCam:
        """Return every `step`-th speed only."""
        return PublishedCam(self.cam, self.turns.every(step), self.published[::step])

    def difference(self, acoustics: Acoustics) -> FloatArray:
        """Return simulated minus published level in dB, shape `(n,)`."""
        return acoustics.levels(self.turns) - self.published

    def rms(self, acoustics: Acoustics) -> float:
        """Return the root mean square of the difference, dB."""
        return rms(self.difference(acoustics))


@dataclass(frozen=True, eq=False)
class SteadyTurns:
    """Periodic sound in closed form of a cam that keeps contact at all speeds."""

    law: Law
    follower: FollowerParameters
    speeds: FloatArray  #: rad/s

    def every(self, step: int) -> SteadyTurns:
        """Return every `step`-th speed only."""
        return SteadyTurns(self.law, self.follower, self.speeds[::step])

    def contact_power(self, corner_rate: float) -> FloatArray:
        """Return ⟨(ω_c (F − q))²⟩ over a turn, shape `(n,)` in (N/s)²."""
        power = [mean_square_rate(self.law, self.follower, corner_rate, s) for s in self.speeds]
        return np.array(power)

    def landing_power(self, _radiation: RadiationParameters) -> FloatArray:
        """Return zeros in Pa², shape `(n,)`, because there are no landings."""
        return np.zeros(self.speeds.size)


def fit_two_constants(
    cams: Sequence[PublishedCam], start: Acoustics, corners: tuple[float, float] = (0.0, np.inf)
) -> Acoustics:
    """Fit gain and corner by least squares of the level differences (dB) of all cams.

    Parameters
    ----------
    cams : sequence of PublishedCam
    start : Acoustics
        Initial values, and the constants that are not fitted.
    corners : tuple of float
        Limits of the corner, Hz.
    """

    def residual(x: FloatArray) -> FloatArray:
        return np.concatenate([cam.difference(to_acoustics(x)) for cam in cams])

    def to_acoustics(x: FloatArray) -> Acoustics:
        gain, corner = np.exp(x).tolist()
        return start.with_constants(gain, corner)

    r = start.radiation
    with np.errstate(divide="ignore"):  # log 0 = −∞ means no lower limit
        low, high = np.log(corners).tolist()
    bounds = (-np.inf, low), (np.inf, high)
    fit = least_squares(residual, np.log([r.gain, r.corner_frequency]), x_scale=0.1, bounds=bounds)
    return to_acoustics(fit.x)

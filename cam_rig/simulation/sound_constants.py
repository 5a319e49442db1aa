"""Least-squares fit of a rig's two acoustic constants to the sound levels of cams."""

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
    """Settled turns of a cam, and its published or measured sound level.

    The level is given at the speeds of the turns.
    """

    cam: str
    turns: Sounding
    published: FloatArray  #: published level, dB, ``(n,)``

    @property
    def rpm(self) -> FloatArray:
        """Cam speeds of the turns, rpm."""
        return to_rpm(self.turns.speeds)

    def every(self, step: int) -> PublishedCam:
        """Return the turns and levels of a cam at every `step`-th speed only."""
        return PublishedCam(self.cam, self.turns.every(step), self.published[::step])

    def difference(self, acoustics: Acoustics) -> FloatArray:
        """Return the simulated less the published sound level (dB) at each speed, `(n,)`."""
        return acoustics.levels(self.turns) - self.published

    def rms(self, acoustics: Acoustics) -> float:
        """Return the r.m.s. difference (dB) of simulated and published sound levels.

        It is the root mean square over all speeds of the cam.
        """
        return rms(self.difference(acoustics))


@dataclass(frozen=True, eq=False)
class SteadyTurns:
    """Sources of sound of a cam that keeps contact at all speeds, in closed form."""

    law: Law
    follower: FollowerParameters
    speeds: FloatArray  #: rad/s

    def every(self, step: int) -> SteadyTurns:
        """Return the same sources of sound at every `step`-th cam speed only."""
        return SteadyTurns(self.law, self.follower, self.speeds[::step])

    def contact_power(self, corner_rate: float) -> FloatArray:
        """Return the mean square of ω_c (F − q) over a turn at each speed, (N/s)².

        F is the contact force and q its low-pass filtered value. ω_c is `corner_rate` in rad/s. The
        shape is `(n,)`.
        """
        power = [mean_square_rate(self.law, self.follower, corner_rate, s) for s in self.speeds]
        return np.array(power)

    def landing_power(self, _radiation: RadiationParameters) -> FloatArray:
        """Return the mean square sound pressure of the landings, Pa², shape `(n,)`.

        It is 0, because the follower never leaves the cam.
        """
        return np.zeros(self.speeds.size)


def fit_two_constants(
    cams: Sequence[PublishedCam], start: Acoustics, corners: tuple[float, float] = (0.0, np.inf)
) -> Acoustics:
    """Fit gain and corner frequency to the levels of all cams by least squares.

    The squares are those of the level differences in dB.

    Parameters
    ----------
    cams : sequence of PublishedCam
        Cams with their levels.
    start : Acoustics
        Initial values, and the constants that are not fitted.
    corners : tuple of float, optional
        Limits of the corner frequency, Hz (default: 0 to infinity).
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

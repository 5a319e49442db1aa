"""Fitting the shared acoustic constants to published curves of one cam or more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from cam_rig.acoustics import RadiationParameters
from cam_rig.acoustics.steady import mean_square_rate
from cam_rig.arrays import FloatArray, rms
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.contact_force import loss_intervals
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.simulation.settled_turns import Acoustics, Sounding
from cam_rig.units import to_rpm

#: Terms of the speed response: with its gain a cubic, like a published regression.
RESPONSE_TERMS = 3
#: Step of a numerical derivative, relative in a constant, in dB of a response term.
STEP = 1e-4


@dataclass(frozen=True, eq=False)
class PublishedCam:
    """A cam's settled turns and its published level (dB) at the same speeds."""

    cam: str
    turns: Sounding
    published: FloatArray

    @property
    def rpm(self) -> FloatArray:
        """The speeds in rpm."""
        return to_rpm(self.turns.speeds)

    def every(self, step: int) -> PublishedCam:
        """Only each ``step``-th speed."""
        return PublishedCam(self.cam, self.turns.every(step), self.published[::step])

    def difference(self, acoustics: Acoustics) -> FloatArray:
        """Simulated less published level, dB."""
        return acoustics.levels(self.turns) - self.published

    def rms(self, acoustics: Acoustics) -> float:
        """r.m.s. of that difference, dB."""
        return rms(self.difference(acoustics))


@dataclass(frozen=True, eq=False)
class SteadyTurns:
    """A cam that keeps contact at all ``speeds`` (rad/s): its steady sound, without samples."""

    law: Law
    follower: FollowerParameters
    speeds: FloatArray

    def every(self, step: int) -> SteadyTurns:
        """Only each ``step``-th speed."""
        return SteadyTurns(self.law, self.follower, self.speeds[::step])

    def contact_power(self, corner_rate: float) -> FloatArray:
        """⟨(ω_c (F − q))²⟩ over a turn, ``(n,)`` in (N/s)²."""
        power = [mean_square_rate(self.law, self.follower, corner_rate, s) for s in self.speeds]
        return np.array(power)

    def landing_power(self, _radiation: RadiationParameters) -> FloatArray:
        """There are no landings."""
        return np.zeros(self.speeds.size)


def calibrate(
    law: Law,
    follower: FollowerParameters,
    start: RadiationParameters,
    speeds: FloatArray,
    levels: FloatArray,
) -> tuple[RadiationParameters, float]:
    """Fit gain and corner to the levels (dB) of one cam at ``speeds`` (rad/s).

    Two numbers, least squares in dB, on the exact steady response; the background stays as it is.
    Returns the constants and the r.m.s. difference (dB) that is left.

    Raises
    ------
    DynamicsError : the follower loses contact within the speeds
    """
    for speed in speeds:
        if loss_intervals(law, follower, float(speed)):
            raise DynamicsError(
                f"cam {law.name!r} loses contact at {to_rpm(float(speed)):.0f} rpm; allowed for a "
                "calibration: a cam that keeps contact at every published speed"
            )
    cam = PublishedCam(law.name, SteadyTurns(law, follower, speeds), levels)
    found = two_constants([cam], Acoustics(start))
    return found.radiation, cam.rms(found)


def two_constants(cams: Sequence[PublishedCam], start: Acoustics) -> Acoustics:
    """Gain and corner of least r.m.s. difference over the cams: two numbers."""

    def residual(x: FloatArray) -> FloatArray:
        return np.concatenate([cam.difference(_at(start, x)) for cam in cams])

    r = start.radiation
    found = least_squares(residual, np.log([r.gain, r.corner]), x_scale=0.1)
    return _at(start, found.x)


def _at(start: Acoustics, x: FloatArray) -> Acoustics:
    gain, corner = np.exp(x).tolist()
    return start.with_constants(gain, corner)


def by_substitution(reference: PublishedCam, start: Acoustics) -> Acoustics:
    """Gain and speed response of the reference cam, the corner as two constants have it.

    Five numbers to one cubic, which has four: the reference's own curve says nothing any more.
    It is the method of the reference sound source (ISO 3747): what passes between source and
    microphone is measured with a known source and taken for the same with another.
    """
    base = two_constants([reference], start)
    r = base.radiation

    def at(x: FloatArray) -> Acoustics:
        return base.with_constants(r.gain * float(np.exp(x[0])), r.corner, tuple(x[1:].tolist()))

    def residual(x: FloatArray) -> FloatArray:
        return reference.difference(at(x))

    found = least_squares(residual, np.zeros(1 + RESPONSE_TERMS), x_scale=0.1)
    return at(found.x)


def sensitivity(cam: PublishedCam, acoustics: Acoustics) -> FloatArray:
    """``(n, k)``: how the levels (dB) change with each fitted constant.

    Two constants: log gain and log corner. By substitution: log gain and the response's terms.
    """
    r = acoustics.radiation
    base = acoustics.levels(cam.turns)
    gain = acoustics.with_constants(r.gain * np.exp(STEP), r.corner, acoustics.response)
    moved = [gain]
    if acoustics.response:
        for i in range(RESPONSE_TERMS):
            response = np.array(acoustics.response)
            response[i] += STEP
            moved.append(acoustics.with_constants(r.gain, r.corner, tuple(response.tolist())))
    else:
        moved.append(acoustics.with_constants(r.gain, r.corner * np.exp(STEP)))
    return np.stack([(a.levels(cam.turns) - base) / STEP for a in moved], axis=1)

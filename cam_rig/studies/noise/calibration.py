"""Fitting the shared acoustic constants to published curves of one cam or more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from cam_rig.arrays import FloatArray
from cam_rig.simulation.settled_turns import Acoustics, Turns

#: Terms of the speed response: with its gain a cubic, like a published regression.
RESPONSE_TERMS = 3
#: Step of a numerical derivative, relative in a constant, in dB of a response term.
STEP = 1e-4


@dataclass(frozen=True, eq=False)
class PublishedCam:
    """A cam's settled turns and its published level (dB) at the same speeds."""

    cam: str
    turns: Turns
    published: FloatArray

    def every(self, step: int) -> PublishedCam:
        """Only each ``step``-th speed."""
        return PublishedCam(self.cam, self.turns.every(step), self.published[::step])

    def difference(self, acoustics: Acoustics) -> FloatArray:
        """Simulated less published level, dB."""
        return acoustics.levels(self.turns) - self.published

    def rms(self, acoustics: Acoustics) -> float:
        """r.m.s. of that difference, dB."""
        return rms(self.difference(acoustics))


def rms(difference: FloatArray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(difference**2)))


def two_constants(heard: Sequence[PublishedCam], start: Acoustics) -> Acoustics:
    """Gain and corner of least r.m.s. difference over the cams: two numbers."""

    def residual(x: FloatArray) -> FloatArray:
        return np.concatenate([cam.difference(_at(start, x)) for cam in heard])

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


def sensitivity(heard: PublishedCam, acoustics: Acoustics) -> FloatArray:
    """``(n, k)``: how the levels (dB) change with each fitted constant.

    Two constants: log gain and log corner. By substitution: log gain and the response's terms.
    """
    r = acoustics.radiation
    base = acoustics.levels(heard.turns)
    gain = acoustics.with_constants(r.gain * np.exp(STEP), r.corner, acoustics.response)
    moved = [gain]
    if acoustics.response:
        for i in range(RESPONSE_TERMS):
            response = np.array(acoustics.response)
            response[i] += STEP
            moved.append(acoustics.with_constants(r.gain, r.corner, tuple(response.tolist())))
    else:
        moved.append(acoustics.with_constants(r.gain, r.corner * np.exp(STEP)))
    return np.stack([(a.levels(heard.turns) - base) / STEP for a in moved], axis=1)

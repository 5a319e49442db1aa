"""Which structure between contact force and sound: candidates fitted on one cam, tried on others.

A cam that keeps contact has a force of harmonics n ω, so each candidate is a transfer function
over frequency and its level a sum over harmonics. More constants always fit the cam they are
fitted to better; what they are worth shows on a cam they have not seen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from cam_rig.acoustics import RadiationParameters, level_db
from cam_rig.acoustics.weighting import weighting_power
from cam_rig.arrays import FloatArray, rms
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.contact_force import force_weights
from cam_rig.laws import Law
from cam_rig.units import TURN

#: Samples of a turn and harmonics of it: up to 500 Hz at 200 rpm.
SAMPLES, HARMONICS = 1024, 150
#: Starts of a fit of modes, which may end in more than one place, and their seed.
STARTS, SEED = 8, 1

#: |pressure per force|² from log constants ``x`` and frequency (Hz).
Transfer = Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True)
class Structure:
    """A candidate: its transfer function, where its fit starts, and the frequency weighting."""

    name: str
    transfer: Transfer
    start: tuple[float, ...]
    weighting: str = "Z"


@dataclass(frozen=True)
class StructureFit:
    """r.m.s. difference (dB) on the cam fitted to and on the cams predicted."""

    name: str
    weighting: str
    numbers: int
    fitted_db: float
    predicted_db: dict[str, float]


def _low_pass(x: FloatArray, frequency: FloatArray) -> FloatArray:
    gain, corner = np.exp(x)
    rate = 2.0 * np.pi * frequency
    return np.asarray((gain * rate) ** 2 / (1.0 + (frequency / corner) ** 2))


def _double_low_pass(x: FloatArray, frequency: FloatArray) -> FloatArray:
    gain, corner = np.exp(x)
    return np.asarray((gain * 2.0 * np.pi * frequency / (1.0 + (frequency / corner) ** 2)) ** 2)


def _modes(x: FloatArray, frequency: FloatArray) -> FloatArray:
    total = np.zeros(frequency.shape, dtype=complex)
    for gain, natural, damping in np.exp(x).reshape(-1, 3):
        ratio = frequency / natural
        total += gain / (1.0 - ratio**2 + 2.0j * damping * ratio)
    return np.asarray(np.abs(2.0j * np.pi * frequency * total) ** 2)


_POLE = (1e-4, 20.0)
_LOW_MODE, _HIGH_MODE = (1e-4, 12.0, 0.4), (1e-4, 50.0, 0.4)
STRUCTURES = (
    Structure("low-pass", _low_pass, _POLE),
    Structure("one mode", _modes, _LOW_MODE),
    Structure("two modes", _modes, _LOW_MODE + _HIGH_MODE),
    Structure("double low-pass", _double_low_pass, _POLE),
    Structure("low-pass", _low_pass, _POLE, "C"),
    Structure("double low-pass", _double_low_pass, (1e-2, 2.0), "C"),
    Structure("low-pass", _low_pass, (1e-3, 300.0), "A"),
    Structure("two modes", _modes, (1e-3, 25.0, 0.1, 1e-4, 400.0, 0.4), "A"),
)


def compare_structures(
    laws: dict[str, Law],
    follower: FollowerParameters,
    radiation: RadiationParameters,
    published: dict[str, FloatArray],
    speeds: FloatArray,
    fitted: str,
) -> list[StructureFit]:
    """Fit every candidate to the cam ``fitted``, and predict the others.

    Parameters
    ----------
    laws : cams that keep contact at all ``speeds`` (rad/s)
    radiation : for its background
    published : level in dB at the speeds, by cam
    """
    harmonics = {cam: harmonic_power(law, follower, speeds) for cam, law in laws.items()}
    background = np.array([radiation.background_power(float(speed)) for speed in speeds])
    frequency = np.arange(1, HARMONICS + 1) * speeds[:, None] / TURN
    weights = {w: weighting_power(w, frequency) for w in "ZCA"}

    def difference(structure: Structure, cam: str, x: FloatArray) -> FloatArray:
        passed = structure.transfer(x, frequency) * weights[structure.weighting]
        power = background + np.sum(passed * harmonics[cam], axis=1)
        return level_db(np.sqrt(power)) - published[cam]

    found = []
    for structure in STRUCTURES:
        x = _best(lambda x, s=structure: difference(s, fitted, x), structure.start)  # type: ignore[misc]
        errors = {cam: rms(difference(structure, cam, x)) for cam in laws}
        found.append(
            StructureFit(structure.name, structure.weighting, x.size, errors.pop(fitted), errors)
        )
    return found


def _best(residual: Callable[[FloatArray], FloatArray], start: tuple[float, ...]) -> FloatArray:
    generator = np.random.default_rng(SEED)
    best, least = np.log(start), np.inf
    for i in range(1 if len(start) == 2 else STARTS):
        scatter = generator.normal(size=len(start)) * (0.6 if i else 0.0)
        found = least_squares(
            residual, np.log(start) + scatter, bounds=(-30.0, 30.0), max_nfev=120, ftol=1e-5
        )
        if found.cost < least:
            best, least = found.x, float(found.cost)
    return np.asarray(best)


def harmonic_power(law: Law, follower: FollowerParameters, speeds: FloatArray) -> FloatArray:
    """Mean square of each harmonic of the contact force, ``(len(speeds), HARMONICS)``, N²."""
    angle = TURN * np.arange(SAMPLES) / SAMPLES
    motion = np.stack([law(angle, order) for order in range(3)])
    forces = np.stack([force_weights(follower, float(speed)) @ motion for speed in speeds])
    ordinates = np.fft.rfft(forces, axis=1)[:, 1 : HARMONICS + 1] / SAMPLES
    return np.asarray(2.0 * np.abs(ordinates) ** 2)

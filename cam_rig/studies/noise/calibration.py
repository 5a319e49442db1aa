"""Fits of the acoustic constants, which all cams share, to published noise curves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import least_squares

from cam_rig.acoustics import level_db
from cam_rig.acoustics.sound_level_meter import weighting_power
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.kinetostatic import force_weights
from cam_rig.laws import Law
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.simulate import Acoustics
from cam_rig.simulation.sound_constants import PublishedCam, fit_two_constants
from cam_rig.units import TURN, FloatArray, rms

#: Number of terms of the speed response (level over speed that the rig adds to any cam). Together
#: with the gain it is a cubic, as the published regressions are.
RESPONSE_TERMS = 3
#: Step of a difference quotient: relative for gain and corner frequency, in dB for a term of the
#: speed response.
DERIVATIVE_STEP = 1e-4


def by_substitution(reference: PublishedCam, start: Acoustics) -> Acoustics:
    """Fit gain and speed response to the published levels of the reference cam.

    The reference is the cam on which the acoustic constants are calibrated. The speed response is
    the level over speed that the rig adds to the sound of any cam. The corner frequency is that of
    `fit_two_constants`.

    Five numbers are fitted to one cubic, which has four, so the curve of the reference tests
    nothing. The method is that of the reference sound source (ISO 3747): the transfer between
    source and microphone is measured with a known source and assumed equal for other sources.
    """
    base = fit_two_constants([reference], start)
    r = base.radiation

    def acoustics_at(x: FloatArray) -> Acoustics:
        return base.with_constants(
            r.gain * float(np.exp(x[0])), r.corner_frequency, tuple(x[1:].tolist())
        )

    def residual(x: FloatArray) -> FloatArray:
        return reference.difference(acoustics_at(x))

    solution = least_squares(residual, np.zeros(1 + RESPONSE_TERMS), x_scale=0.1)
    return acoustics_at(solution.x)


def sensitivity(cam: PublishedCam, acoustics: Acoustics) -> FloatArray:
    """Return the derivatives of a cam's sound levels (dB) by the k constants, (n, k).

    The constants are log gain and log corner frequency, or, with a speed response, log gain and the
    terms of the response.
    """
    r = acoustics.radiation
    base = acoustics.levels(cam.turns)
    gain = acoustics.with_constants(
        r.gain * np.exp(DERIVATIVE_STEP), r.corner_frequency, acoustics.response
    )
    changed = [gain]
    if acoustics.response:
        for i in range(RESPONSE_TERMS):
            response = np.array(acoustics.response)
            response[i] += DERIVATIVE_STEP
            changed.append(
                acoustics.with_constants(r.gain, r.corner_frequency, tuple(response.tolist()))
            )
    else:
        changed.append(
            acoustics.with_constants(r.gain, r.corner_frequency * np.exp(DERIVATIVE_STEP))
        )
    return np.stack([(a.levels(cam.turns) - base) / DERIVATIVE_STEP for a in changed], axis=1)


# Comparison of transfer functions between contact force and sound: each is fitted to one cam and
# tested on another.

#: Number of samples of the contact force per turn, for its harmonics.
SAMPLES = 1024
#: Number of harmonics of the turn that radiate sound. At 200 rpm they reach 500 Hz.
HARMONICS = 150
#: Number of initial values from which a fit of resonance modes is started, because it has several
#: local minima.
STARTS = 8
#: Seed of the random initial values of a fit of resonance modes.
SEED = 1

#: Function that returns |pressure per force|² from the logarithms ``x`` of its constants and the
#: frequency (Hz).
Transfer = Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True)
class Structure:
    """Candidate for the transfer function from contact force to sound pressure.

    `start` are the initial constants of its fit. `weighting` is the frequency weighting of the
    sound-level meter: A, C, or Z for none.
    """

    name: str
    transfer: Transfer
    start: tuple[float, ...]
    weighting: str = "Z"


@dataclass(frozen=True)
class StructureFit:
    """Accuracy of a transfer function (contact force to sound) on two cams.

    `fitted_db` is the r.m.s. level difference (dB) on the cam to which it is fitted, `predicted_db`
    that on the other cam. `numbers` is the number of fitted constants.
    """

    name: str
    weighting: str
    numbers: int
    fitted: str
    fitted_db: float
    predicted: str
    predicted_db: float


def _low_pass(x: FloatArray, frequency: FloatArray, poles: int = 1) -> FloatArray:
    gain, corner = np.exp(x)
    rate = 2.0 * np.pi * frequency
    return np.asarray((gain * rate) ** 2 / (1.0 + (frequency / corner) ** 2) ** poles)


_double_low_pass = partial(_low_pass, poles=2)


def _modes(x: FloatArray, frequency: FloatArray) -> FloatArray:
    total = np.zeros(frequency.shape, dtype=complex)
    for gain, natural, damping in np.exp(x).reshape(-1, 3):
        ratio = frequency / natural
        total += gain / (1.0 - ratio**2 + 2.0j * damping * ratio)
    return np.asarray(np.abs(2.0j * np.pi * frequency * total) ** 2)


_POLE = (1e-4, 20.0)
#: Initial values of a fit for the first resonance mode between force and sound: gain, frequency
#: (Hz) and damping ratio.
_LOW_MODE = (1e-4, 12.0, 0.4)
#: Initial values of a fit for the second resonance mode between force and sound: gain, frequency
#: (Hz) and damping ratio.
_HIGH_MODE = (1e-4, 50.0, 0.4)
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
    loaded: LoadedScene, cams: Mapping[str, PublishedCam], fitted: str
) -> list[StructureFit]:
    """Fit every transfer function to one of two cams, and predict the other cam.

    Both cams must keep contact at all speeds. `fitted` is the name of the cam to which is fitted.
    """
    (other,) = cams.keys() - {fitted}
    speeds = np.asarray(cams[fitted].turns.speeds)
    harmonics = {cam: harmonic_power(loaded.laws[cam], loaded.follower, speeds) for cam in cams}
    background = np.array([loaded.radiation.background_power(float(speed)) for speed in speeds])
    frequency = np.arange(1, HARMONICS + 1) * speeds[:, None] / TURN
    weights = {w: weighting_power(w, frequency) for w in "ZCA"}

    def difference(structure: Structure, cam: str, x: FloatArray) -> FloatArray:
        transfer = structure.transfer(x, frequency) * weights[structure.weighting]
        power = background + np.sum(transfer * harmonics[cam], axis=1)
        return level_db(np.sqrt(power)) - cams[cam].published

    fits = []
    for structure in STRUCTURES:
        x = _fit(lambda x, s=structure: difference(s, fitted, x), structure.start)  # type: ignore[misc]
        fitted_rms, predicted_rms = (rms(difference(structure, cam, x)) for cam in (fitted, other))
        kind = structure.name, structure.weighting, x.size
        fits.append(StructureFit(*kind, fitted, fitted_rms, other, predicted_rms))
    return fits


def _fit(residual: Callable[[FloatArray], FloatArray], start: tuple[float, ...]) -> FloatArray:
    generator = np.random.default_rng(SEED)
    best, lowest_cost = np.log(start), np.inf
    for i in range(1 if len(start) == 2 else STARTS):
        scatter = generator.normal(size=len(start)) * (0.6 if i else 0.0)
        solution = least_squares(
            residual, np.log(start) + scatter, bounds=(-30.0, 30.0), max_nfev=120, ftol=1e-5
        )
        if solution.cost < lowest_cost:
            best, lowest_cost = solution.x, float(solution.cost)
    return np.asarray(best)


def harmonic_power(law: Law, follower: FollowerParameters, speeds: FloatArray) -> FloatArray:
    """Return the mean square (N²) of each harmonic of the contact force.

    The follower is one rigid mass. The shape is (len(speeds), HARMONICS), with `speeds` in rad/s.
    """
    angle = TURN * np.arange(SAMPLES) / SAMPLES
    motion = np.stack([law(angle, order) for order in range(3)])
    forces = np.stack([force_weights(follower, float(speed)) @ motion for speed in speeds])
    ordinates = np.fft.rfft(forces, axis=1)[:, 1 : HARMONICS + 1] / SAMPLES
    return np.asarray(2.0 * np.abs(ordinates) ** 2)

"""Start values of an elastic stem, from the pattern in the force residuals of one mass."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics import TwoMassParameters
from cam_rig.laws import Law
from cam_rig.studies.fit_rig.parameters import build_follower
from cam_rig.studies.fit_rig.run.search import Candidate
from cam_rig.studies.fit_rig.run.start import FORCE_PARTS, force_columns
from cam_rig.studies.fit_rig.run.steady_turn import TURN_POINTS
from cam_rig.studies.fit_rig.run.turns import MIN_PRESS_FRACTION
from cam_rig.units import TURN, FloatArray

#: Largest number of equal angular intervals of a turn over which force residuals are averaged.
MAX_TURN_PARTS = 256
#: Smallest number of samples in each angular interval over which force residuals are averaged.
MIN_PART_SAMPLES = 6


def has_residual_pattern(fit: Candidate) -> bool:
    """Return True if force residuals repeat from turn to turn more than noise does.

    Such a pattern is the vibration of a stem or a force sensor
    (``test_a_stem_shows_in_the_force``). The residuals of a correct model are noise
    (``test_noise_gives_no_stem``).
    """
    squares, parts = residual_pattern(fit)
    return squares > parts + math.sqrt(2.0 * parts)


def residual_pattern(fit: Candidate) -> tuple[float, float]:
    """Return a statistic of the force residuals that repeat each turn, and its mean.

    The turn of each steady-speed segment is divided into angular intervals. The statistic is the
    sum over all intervals of n r², with the mean r of the interval's n residuals in standard
    deviations. Its mean under white noise is the number of intervals N, the second result, and its
    standard deviation √(2N). Noise that is correlated over k samples gives k times as much.
    """
    squares = parts = 0.0
    for i, predicted in enumerate(fit.predicted):
        if predicted is None or not predicted.force.residual.size:
            continue
        residuals = predicted.force.residual / fit.likelihood.force_deviation(i)
        count = max(4, min(MAX_TURN_PARTS, residuals.size // MIN_PART_SAMPLES))
        part = (np.mod(predicted.force.angle, TURN) * (count / TURN)).astype(int) % count
        sizes = np.bincount(part, minlength=count)
        sums = np.bincount(part, residuals, minlength=count)
        squares += float((sums[sizes > 0] ** 2 / sizes[sizes > 0]).sum())
        parts += float(np.count_nonzero(sizes))
    return squares, parts


# Search for the stem with which the steady force fits the measured force best.

#: Lowest natural frequency of the trial stems, Hz. The machines of ``test_coverage.py`` have stems
#: from 100 to 460 Hz.
MIN_STEM_HZ = 8.0
#: Highest natural frequency of the trial stems, Hz.
MAX_STEM_HZ = 3000.0
#: Ratio of neighbouring natural frequencies in the first trials of a stem. Finer trials follow
#: around the best frequency.
FREQUENCY_RATIO = 1.1
#: Ratio of neighbouring natural frequencies in the finer trials of a stem. A vibration with little
#: damping is in phase with the measured forces only if the relative error of its frequency is about
#: its damping ratio, which is 0.005 or more.
FINE_FREQUENCY_RATIO = 1.01
#: Exponents of `FINE_FREQUENCY_RATIO` in the finer trials. They cover the range between the
#: neighbours of the best first trial.
FINE_EXPONENTS = range(-10, 11)
#: Fractions of the total mass on the roller's side of the stem that are tried.
ROLLER_SHARES = (0.25, 0.5)
#: Damping ratios of the trial stems.
STEM_DAMPING_RATIOS = (0.005, 0.05)
#: When a stem is added, the parameters of one mass may be refitted only if this changes the forces
#: by at most this r.m.s. fraction.
MAX_MOVABLE_FRACTION = 0.1
#: Log likelihood ratio that the three parameters of a stem reach by chance in one of twenty cases:
#: half the 95 % quantile of χ² with three degrees of freedom. The best of n tried stems reaches ln
#: n more.
CHANCE_LOG_RATIO = 3.91
#: Largest number of force samples per steady-speed segment that are used to try a stem.
MAX_STEM_SAMPLES = 600
#: Number of computed force values per period of the stem's vibration. Linear interpolation between
#: them has an error of 0.5 % of the vibration.
POINTS_PER_PERIOD = 32
#: Largest number of computed force values per turn. With it, the interpolation error is larger if
#: the stem vibrates more than 2048 times per turn.
MAX_POINTS = 2**16


class StemTrial(NamedTuple):
    """Trial of a stem: squared errors (N²) of the forces, frequency and parameters.

    ``sse`` is the sum of squared errors with the parameters of one mass unchanged, ``sse_refitted``
    that with these parameters refitted for the stem. ``rate`` is the stem's natural frequency in
    rad/s. ``parameters`` are the stem's parameters (SI) by rig-file key.
    """

    sse: float
    sse_refitted: float
    rate: float
    parameters: dict[str, float]


def find_stem(one_mass: Candidate) -> tuple[dict[str, float], float]:
    """Return the stem whose steady force fits the measured forces best.

    The first result contains the stem's parameters (SI) by name. The second is the logarithm of its
    likelihood ratio to a rigid stem. The other parameters are those of the fit ``one_mass``. That
    fit has absorbed a part of the stem's effect, so each stem is tried with these parameters
    unchanged and refitted. The best refitted stem is returned if it is far likelier
    (``test_errors_of_two_masses``, seeds 115 and 179). It is not returned if it is likelier only by
    chance, as the best of many trials (seeds 59, 79 and 199).
    """
    values, forces = one_mass.values, _pressing_samples(one_mass)
    by_error = attrgetter("sse"), attrgetter("sse_refitted")
    count = round(math.log(MAX_STEM_HZ / MIN_STEM_HZ) / math.log(FREQUENCY_RATIO))
    rates = [TURN * MIN_STEM_HZ * FREQUENCY_RATIO**k for k in range(count)]
    trials = list(_try_stems(values, forces, rates))
    for near in {min(trials, key=key).rate for key in by_error}:
        rates = [near * FINE_FREQUENCY_RATIO**k for k in FINE_EXPONENTS]
        trials += _try_stems(values, forces, rates)
    unchanged, best = (min(trials, key=key) for key in by_error)
    half = 0.5 * forces.measured.size
    gain = half * math.log(unchanged.sse_refitted / best.sse_refitted)
    if gain < CHANCE_LOG_RATIO + math.log(len(trials)):
        best = unchanged
    rigid = forces.parts @ [values[name] for name in FORCE_PARTS]
    return best.parameters, half * math.log(forces.sse(rigid)[1] / best.sse_refitted)


@dataclass(frozen=True, eq=False)
class PressingSamples:
    """Force samples of all steady speeds in which the follower presses on the cam.

    They include the contributions of the parameters of one mass to the steady force.
    """

    #: Speed (rad/s) and cam angles (rad) of the samples of each steady-speed segment.
    segments: list[tuple[float, FloatArray]]
    #: Measured contact forces of all steady-speed segments in N, ``(n,)``.
    measured: FloatArray
    #: Contribution to the force per unit of each parameter of `FORCE_PARTS` at the samples, ``(n,
    #: 4)``.
    parts: FloatArray
    #: Orthonormal basis of the columns of ``parts``, the force per parameter, ``(n, 4)``.
    columns: FloatArray
    #: Fourier coefficients of the law's lift over a turn, m.
    lift: NDArray[np.complex128]

    @classmethod
    def of(
        cls, law: Law, segments: list[tuple[float, FloatArray]], measured: FloatArray
    ) -> PressingSamples:
        """Return the samples in contact, with the contributions to the steady force.

        ``law`` is the law of the cam. ``segments`` are the speed (rad/s) and the cam angles (rad)
        of the samples at each steady speed, ``measured`` all forces in N.
        """
        speeds = np.concatenate([np.full(angle.size, speed) for speed, angle in segments])
        parts, sizes = force_columns(law, speeds, np.concatenate([angle for _, angle in segments]))
        angles = np.arange(float(MAX_POINTS)) * (TURN / MAX_POINTS)
        lift = np.fft.rfft(law.motion_at(angles)[0], norm="forward")
        return cls(segments, measured, parts * sizes, np.asarray(np.linalg.qr(parts)[0]), lift)

    def on_a_stem(self, p: TwoMassParameters) -> FloatArray:
        """Return the steady contact force (N) of two masses, as if the cam could pull.

        ``p`` is the follower, and the result has the shape ``(n,)``, one force per sample. It is
        the inertia force of the roller plus the force in the stem. For each harmonic of the lift s
        with the frequency Ω, the force in the stem is Z₁ Z₂ / (Z₁ + Z₂) s. Here Z₁ = k₁ + c₁ iΩ is
        the dynamic stiffness of the stem, and Z₂ = k₂ + c₂ iΩ − m₂ Ω² that of the end mass with
        spring and damper.
        """
        natural_rate, forces = math.sqrt(p.stiffness / p.end_mass), []
        for speed, angle in self.segments:
            points = min(max(TURN_POINTS, POINTS_PER_PERIOD * natural_rate / speed), MAX_POINTS)
            lift = self.lift[: 2 ** math.ceil(math.log2(points) - 1.0) + 1]
            rate = 1j * speed * np.arange(lift.size)
            stem = p.stem_stiffness + p.stem_damping * rate
            end = p.spring_stiffness + p.damping * rate + p.end_mass * rate**2
            force = np.fft.irfft(lift * (stem * end / (stem + end)), norm="forward")
            force, position = np.append(force, force[0]), np.mod(angle, TURN) * (force.size / TURN)
            forces.append(np.interp(position, np.arange(force.size), force))
        inertia = p.roller_mass * self.parts[:, 0]
        return np.asarray(inertia + np.concatenate(forces) + p.share * p.preload)

    def sse(self, forces: FloatArray) -> tuple[float, float]:
        """Return the sums of squared errors (N²) of predicted forces: as given, and refitted.

        The refit changes the parameters of the model of one mass (mass, spring, preload, damping)
        to first order, which is valid only for small changes of the forces. For a very soft stem
        the change would be large. It is then left out, and both results are equal.
        """
        errors = forces - self.measured
        move = self.columns.T @ errors
        total, movable, measured = (float(x @ x) for x in (errors, move, self.measured))
        return total, total - (movable if movable < MAX_MOVABLE_FRACTION**2 * measured else 0.0)


def _pressing_samples(one_mass: Candidate) -> PressingSamples:
    """Return the force samples in contact of all steady-speed segments.

    Each segment is thinned to at most `MAX_STEM_SAMPLES` samples.
    """
    like, segments, forces = one_mass.likelihood, [], []
    for i in range(len(one_mass.segments)):
        _, samples = like.samples(i)
        pressing = np.flatnonzero(
            samples.value > MIN_PRESS_FRACTION * samples.value.max(initial=0.0)
        )
        thinned = samples.where(pressing[:: -(-pressing.size // MAX_STEM_SAMPLES) or 1])
        segments.append((like.speed_of(one_mass.x, i), like.angles(one_mass.x, i, thinned.since)))
        forces.append(thinned.value)
    return PressingSamples.of(like.law, segments, np.concatenate(forces))


def _try_stems(
    values: dict[str, float], forces: PressingSamples, rates: list[float]
) -> Iterator[StemTrial]:
    """Yield a trial for each stem with one of the natural frequencies ``rates``.

    They are in rad/s. Each is tried with all `ROLLER_SHARES` and `STEM_DAMPING_RATIOS`. ``values``
    are the other parameters of the follower (SI) by name.
    """
    for rate, share, ratio in product(rates, ROLLER_SHARES, STEM_DAMPING_RATIOS):
        end_mass = values["mass"] * (1.0 - share)
        parameters = {
            "stem_stiffness": max(end_mass * rate**2 - values["spring_stiffness"], end_mass * rate),
            "roller_share": share,
            "stem_damping": 2.0 * ratio * end_mass * rate,
        }
        follower = build_follower(values | parameters, None)
        assert isinstance(follower, TwoMassParameters)
        yield StemTrial(*forces.sse(forces.on_a_stem(follower)), rate, parameters)

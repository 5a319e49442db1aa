"""Noise curves of three cams by method of calibration, with bands and crossings.

A noise curve is the sound level over the cam speed. There are three methods of calibrating the
acoustic constants on the reference cam:

* Two constants: gain and corner frequency are fitted. The geometry of the arc cam is that of its
  file, which was fitted to the differences of simulated levels and published regression.
* Two constants, arc cam refitted: its geometry is fitted to the differences of the two cubic
  regressions over speed instead.
* By substitution: gain and speed response are fitted, so the reference cam also measures how the
  rig transmits sound at each speed. The arc cam is refitted too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from cam_rig.simulation.regression import (
    REGRESSION_DEGREE,
    crossings,
    cubic_projection,
    nearest_crossing,
    regression,
)
from cam_rig.simulation.simulate import Acoustics
from cam_rig.simulation.sound_constants import PublishedCam, fit_two_constants
from cam_rig.studies.noise.arc_cam import ArcShape
from cam_rig.studies.noise.calibration import by_substitution, sensitivity
from cam_rig.studies.noise.roles import NoiseSetup, StudyRoles
from cam_rig.units import FloatArray, rms

# Confidence intervals of the noise curves and of their crossings, by a bootstrap of the level
# differences.

#: Number of neighbouring speeds whose level differences the bootstrap draws together: a third of
#: all speeds.
BLOCK = 7
#: Number of random series that the bootstrap draws.
DRAWS = 2000
#: Seed of the random generator of the bootstrap.
SEED = 1
#: Percentage of the bootstrap draws outside a 95 % band, on each side.
TAIL = 2.5


def resample(residual: FloatArray, generator: np.random.Generator) -> FloatArray:
    """Return random series for a bootstrap, composed of blocks of a residual.

    ``residual`` are level differences over the speeds, shape (n,). The result is (DRAWS, n). Blocks
    of `BLOCK` neighbouring values preserve the correlation between speeds.
    """
    count = residual.size
    blocks = -(-count // BLOCK)
    starts = generator.integers(0, count, size=(DRAWS, blocks))
    index = (starts[:, :, None] + np.arange(BLOCK)) % count
    return np.asarray(residual[index.reshape(DRAWS, -1)[:, :count]])


@dataclass(frozen=True, eq=False)
class Band:
    """Band that contains 95 % of the bootstrap draws: lower and upper level in dB.

    Both have one value per speed, shape (n,).
    """

    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, draws: FloatArray) -> Band:
        """Return the band that contains 95 % of bootstrap draws, shape (DRAWS, n)."""
        low, high = np.percentile(draws, [TAIL, 100.0 - TAIL], axis=0)
        return cls(low, high)

    def holds(self, level: FloatArray) -> float:
        """Return the fraction of the speeds at which a noise curve is in the band.

        ``level`` are the levels (dB) of the curve, ``(n,)``.
        """
        return float(np.mean((level >= self.low) & (level <= self.high)))


@dataclass(frozen=True)
class Crossing:
    """Speed in rpm at which two noise curves cross, with its confidence interval.

    The curves are cubic regressions over speed. The interval is from a bootstrap.

    Parameters
    ----------
    rpm : float, optional
        Speed of the crossing. None if the regressions do not cross within the speeds.
    low, high : float
        Limits of the 95 % interval in rpm, NaN if fewer than two draws cross.
    deviation : float
        Standard deviation of the draws in rpm, NaN if fewer than two draws cross.
    missing : float
        Fraction of the draws that do not cross within the speeds.
    points_rpm : float, optional
        Speed in rpm at which the simulated levels themselves cross, or None.
    """

    rpm: float | None
    low: float
    high: float
    deviation: float
    missing: float
    points_rpm: float | None = None


def all_crossings(rpm: FloatArray, first: FloatArray, second: FloatArray) -> FloatArray:
    """Return all speeds (rpm) at which two cubic regressions over speed cross.

    ``first`` and ``second`` are their values at the speeds, ``(n,)``.
    """
    fit, scale = _difference(rpm, first, second)
    return crossings(fit, (rpm[0], rpm[-1]), scale=scale, shift=1.0)


def crossing(rpm: FloatArray, first: FloatArray, second: FloatArray, near: float) -> float | None:
    """Return the speed (rpm) at which two cubic regressions over speed cross.

    If there are several crossings, it is that nearest to ``near`` (rpm). The result is None if they
    do not cross. ``first`` and ``second`` are their values at the speeds, ``(n,)``.
    """
    fit, scale = _difference(rpm, first, second)
    return nearest_crossing(fit, (rpm[0], rpm[-1]), near, scale=scale, shift=1.0)


def _difference(rpm: FloatArray, first: FloatArray, second: FloatArray) -> tuple[FloatArray, float]:
    """Return the cubic of the difference of two curves, and the scale of the speed.

    The cubic has coefficients of the powers of rpm/scale − 1, where scale is the mean speed in rpm.
    The values of the curves have the shape (n,), or (DRAWS, n) for bootstrap draws.
    """
    scale = float(rpm.mean())
    fit = np.polynomial.polynomial.polyfit(rpm / scale - 1.0, (first - second).T, REGRESSION_DEGREE)
    return np.asarray(fit, dtype=np.float64), scale


def points_crossing(
    rpm: FloatArray, first: FloatArray, second: FloatArray, near: float
) -> float | None:
    """Return the speed (rpm) at which two polylines of sound levels cross.

    The polylines connect the levels ``first`` and ``second`` at the speeds ``rpm``. If there are
    several crossings, it is that nearest to ``near`` (rpm). The result is None if they do not
    cross.
    """
    gap = first - second
    index = np.flatnonzero(np.sign(gap[1:]) != np.sign(gap[:-1]))
    fraction = gap[index] / (gap[index] - gap[index + 1])
    speeds = rpm[index] + fraction * (rpm[index + 1] - rpm[index])
    return float(speeds[np.argmin(np.abs(speeds - near))]) if speeds.size else None


def crossing_interval(
    rpm: FloatArray,
    best: tuple[FloatArray, FloatArray],
    draws: tuple[FloatArray, FloatArray],
    near: float,
) -> Crossing:
    """Return the crossing of two regressions, with its interval from bootstrap draws.

    ``best`` are the two regressions, shape (n,), and ``draws`` their draws, shape (DRAWS, n). Of
    several crossings the one nearest to ``near`` (rpm) is used.
    """
    fits, scale = _difference(rpm, *draws)
    ends = (rpm[0], rpm[-1])
    crossings_rpm = [nearest_crossing(fit, ends, near, scale=scale, shift=1.0) for fit in fits.T]
    crossed = np.array([rpm for rpm in crossings_rpm if rpm is not None])
    low = high = deviation = np.nan
    if crossed.size > 1:
        low, high = np.percentile(crossed, [TAIL, 100.0 - TAIL]).tolist()
        deviation = float(np.std(crossed, ddof=1))
    missing = 1.0 - crossed.size / len(crossings_rpm)
    return Crossing(crossing(rpm, *best, near), low, high, deviation, missing)


@dataclass(frozen=True, eq=False)
class StudiedCurve:
    """Noise curve (sound level over speed) of one cam by one method of calibration.

    Parameters
    ----------
    method, cam, role : str
        Method of calibration, name of the cam, and origin of its level: calibrated, predicted or
        identified.
    numbers : int
        Number of constants fitted to the published curve of this cam, a cubic with four numbers.
    rpm : ndarray
        Speeds in rpm, shape (n,).
    level_db, regression_db, published_db : ndarray
        Simulated levels, their cubic regression over speed, and the published regression, in dB,
        shape (n,).
    coefficients : ndarray
        Coefficients of the regression, dB/rpm^i.
    rms_db, rms_regression_db : float
        R.m.s. difference in dB between the simulated levels, or their regression, and the published
        regression.
    confidence : Band
        95 % band of the regression, which results from the fitted constants.
    expected : Band
        95 % band in which the published regression is expected.
    """

    method: str
    cam: str
    role: str
    numbers: int
    rpm: FloatArray
    level_db: FloatArray
    regression_db: FloatArray
    coefficients: FloatArray
    published_db: FloatArray
    rms_db: float
    rms_regression_db: float
    confidence: Band
    expected: Band

    @property
    def largest(self) -> tuple[float, float]:
        """Largest difference (dB) between simulated and published level, and its speed.

        The speed is in rpm. An r.m.s. difference would not show this value.
        """
        difference = self.level_db - self.published_db
        index = int(np.argmax(np.abs(difference)))
        return float(difference[index]), round(float(self.rpm[index]), 9)


@dataclass(frozen=True)
class PairCrossing:
    """Crossing of two cams' published curves, and of their simulated curves.

    ``published_rpm`` is the speed at which the published curves cross. ``computed`` is the crossing
    of the simulated curves by one method of calibration that is nearest to it.
    """

    method: str
    between: tuple[str, str]
    published_rpm: float
    computed: Crossing


@dataclass(frozen=True, eq=False)
class Method:
    """Method of calibration with its constants, noise curves and crossings.

    Parameters
    ----------
    name : str
        Name of the method.
    acoustics : Acoustics
        Acoustic constants shared by all cams.
    shape : ArcShape
        Geometry of the arc cam.
    curves : dict
        Noise curves by cam.
    crossing : Crossing
        Crossing of the two cams that the paper names.
    pairs : tuple of PairCrossing
        Crossings of every two cams, one for each crossing of their published curves.
    """

    name: str
    acoustics: Acoustics
    shape: ArcShape
    curves: dict[str, StudiedCurve]
    crossing: Crossing
    pairs: tuple[PairCrossing, ...]

    @property
    def predicted_rms_db(self) -> float:
        """R.m.s. level difference (dB) over the cams to which no number was fitted.

        It is infinite if there is no such cam.
        """
        unseen = [curve.rms_db for curve in self.curves.values() if curve.numbers == 0]
        return rms(np.array(unseen)) if unseen else np.inf


def with_two_constants(study: NoiseSetup, refit: bool) -> Method:
    """Return the noise curves after a calibration of gain and corner frequency.

    They are calibrated on the reference cam. If `refit` is True, the geometry of the arc cam (of
    tangent circular arcs) is fitted with these constants. Otherwise it is that of its file.
    """
    name = "two constants, arc cam refitted" if refit else "two constants"
    return _method(name, study, lambda cam: fit_two_constants([cam], study.start), refit)


def with_substitution(study: NoiseSetup) -> Method:
    """Return the predicted noise curves (level over speed) of the method "by substitution".

    Gain and speed response are calibrated on the measured levels of the reference cam. The speed
    response is the level over speed that the rig adds to the sound of any cam. The geometry of the
    arc cam (of tangent circular arcs) is then fitted to its measured levels with this calibration.
    """
    return _method("by substitution", study, lambda cam: by_substitution(cam, study.start), True)


def _method(
    name: str, study: NoiseSetup, calibrate: Callable[[PublishedCam], Acoustics], refit: bool
) -> Method:
    """Calibrate by one method, and return its noise curves, bands and crossings.

    ``calibrate`` fits the acoustic constants to one cam. The bootstrap needs the level differences
    (dB) of the method on a cam to which it was not fitted. They are those of the reference cam
    after a calibration on the predicted cam.
    """
    reference = study.cams[study.roles.reference]
    acoustics, project = calibrate(reference), cubic_projection(study.rpm)
    prediction_error = reference.difference(calibrate(study.cams[study.roles.predicted]))
    shape = study.fit_shape(acoustics) if refit else study.shape
    # Matrix from levels to the values to which the geometry was fitted: the regression, or the
    # levels themselves.
    projection = project if refit else np.eye(study.rpm.size)
    arcs, shape_slope = study.problem.cam_of(shape), study.problem.sensitivity(shape, acoustics)
    roles, cams = study.roles, study.cams | {arcs.cam: arcs}
    errors = dict.fromkeys(cams, -prediction_error) | {arcs.cam: -arcs.difference(acoustics)}
    generator = np.random.default_rng(SEED)
    fitted, residuals = ({cam: resample(errors[cam], generator) for cam in cams} for _ in range(2))
    slopes = {name: sensitivity(cam, acoustics) for name, cam in cams.items()}
    constants = fitted[roles.reference] @ _refit(project @ slopes[roles.reference], project).T
    shifts = {cam: constants @ slope.T for cam, slope in slopes.items()}
    change = (fitted[arcs.cam] - shifts[arcs.cam]) @ _refit(projection @ shape_slope, projection).T
    shifts[arcs.cam] = shifts[arcs.cam] + change @ shape_slope.T
    numbers = {roles.reference: 2 + len(acoustics.response), roles.arcs: 2 if refit else 3}
    curves = {
        cam: _curve(name, study, h, acoustics, numbers.get(cam, 0), shifts[cam], residuals[cam])
        for cam, h in cams.items()
    }
    drawn = {c: curves[c].regression_db + (shifts[c] + residuals[c]) @ project for c in cams}

    def find_crossing(first: str, second: str, near: float) -> Crossing:
        best = (curves[first].regression_db, curves[second].regression_db)
        interval = crossing_interval(study.rpm, best, (drawn[first], drawn[second]), near)
        levels = (curves[first].level_db, curves[second].level_db)
        return replace(interval, points_rpm=points_crossing(study.rpm, *levels, near))

    pairs = tuple(
        PairCrossing(name, (first, second), near, find_crossing(first, second, near))
        for first, second in combinations(curves, 2)
        for near in all_crossings(
            study.rpm, curves[first].published_db, curves[second].published_db
        ).tolist()
    )
    named = study.crossover
    return Method(name, acoustics, shape, curves, find_crossing(*named.between, named.rpm), pairs)


def _refit(slopes: FloatArray, projection: FloatArray) -> FloatArray:
    """Return the matrix from changes of n levels to changes of k fitted numbers.

    Its shape is (k, n). ``slopes`` are the derivatives of the levels by the numbers, (n, k).
    ``projection`` is the matrix from levels to the values that are fitted.
    """
    return np.asarray(np.linalg.pinv(slopes, rcond=1e-2) @ projection)


def _curve(
    method: str,
    study: NoiseSetup,
    cam: PublishedCam,
    acoustics: Acoustics,
    numbers: int,
    shifts: FloatArray,
    residuals: FloatArray,
) -> StudiedCurve:
    level = acoustics.levels(cam.turns)
    project = cubic_projection(study.rpm)
    fitted = project @ level
    return StudiedCurve(
        method=method,
        cam=cam.cam,
        # each method calibrates on the reference cam again, so this origin applies
        role=study.loaded.fitted_origin(cam.cam),
        numbers=numbers,
        rpm=study.rpm,
        level_db=level,
        regression_db=fitted,
        coefficients=regression(study.rpm, level),
        published_db=cam.published,
        rms_db=rms(level - cam.published),
        rms_regression_db=rms(fitted - cam.published),
        confidence=Band.of(fitted + shifts @ project),
        expected=Band.of(fitted + (shifts + residuals) @ project),
    )


# Leave-one-out test: the acoustic constants are fitted to two of the three cams, and tested on the
# third.

#: Number of times that the shape of the arc cam (of tangent circular arcs) and the acoustic
#: constants are fitted in turn.
ROUNDS = 2


@dataclass(frozen=True)
class LeftOut:
    """Result of the leave-one-out test for one cam.

    The acoustic constants are fitted to the other two cams. The geometry of the arc cam is fitted
    together with them. If the arc cam is left out, its geometry is fitted to its curve afterwards.

    Parameters
    ----------
    cam : str
        Cam that is left out.
    numbers : int
        Number of constants fitted to the other cams.
    acoustics : Acoustics
        Acoustic constants from the other cams.
    rms_db : dict
        R.m.s. level difference in dB on each cam.
    rms_regression_db : float
        R.m.s. difference in dB of the cubic regression of the cam that is left out.
    """

    cam: str
    numbers: int
    acoustics: Acoustics
    rms_db: dict[str, float]
    rms_regression_db: float


def leave_one_out(study: NoiseSetup) -> list[LeftOut]:
    """Fit the acoustic constants without each of the three cams in turn.

    The results have the order of the cams in the scene. See `LeftOut`.
    """
    return [_leave_out(study, cam) for cam in study.cams]


def _leave_out(study: NoiseSetup, cam: str) -> LeftOut:
    arcs = study.roles.arcs
    others = tuple(name for name in study.cams if name != cam)
    calibrated = [study.cams[name] for name in others if name != arcs]
    acoustics = fit_two_constants(calibrated, study.start)
    for _ in range(1 if cam == arcs else ROUNDS):
        shape = study.fit_shape(acoustics)
        cams = study.cams | {arcs: study.problem.cam_of(shape)}
        acoustics = fit_two_constants([cams[name] for name in others], study.start)
    return LeftOut(
        cam=cam,
        numbers=2 if cam == arcs else 4,
        acoustics=acoustics,
        rms_db={name: other.rms(acoustics) for name, other in cams.items()},
        rms_regression_db=rms(cubic_projection(study.rpm) @ cams[cam].difference(acoustics)),
    )


# Claims of the paper on which cam is quieter, tested on its published curves and on the simulated
# curves.

#: Noise curves on which a claim of the paper about the loudness of its cams is tested: table
#: heading, and function that returns the levels.
TESTED_ON: dict[str, Callable[[StudiedCurve], FloatArray]] = {
    "published curves": lambda curve: curve.published_db,
    "regressions": lambda curve: curve.regression_db,
    "points": lambda curve: curve.level_db,
}


@dataclass(frozen=True)
class NoiseClaim:
    """Claim of the paper on which of its cams is quieter, and its test.

    Parameters
    ----------
    words, source : str
        Text of the claim, and its position in the paper.
    tested_on : str
        Key of `TESTED_ON`: the curves on which the claim is tested.
    holds, cases : int
        Number of speeds at which the claim is true, and number of tested speeds.
    fails_rpm : tuple of float, optional
        Lowest and highest speed in rpm at which the claim is false, or None.
    """

    words: str
    source: str
    tested_on: str
    holds: int
    cases: int
    fails_rpm: tuple[float, float] | None


def noise_claims(
    roles: StudyRoles, curves: Mapping[str, StudiedCurve], crossover_rpm: float
) -> list[NoiseClaim]:
    """Test the published claims on which of the cams is quieter.

    The claims are those of the study on which the project is based. They are tested at the speeds
    below and above ``crossover_rpm`` (rpm), the speed of equal levels that it states. ``curves``
    are the noise curves by cam, and ``roles`` the roles of the cams.
    """
    rpm = curves[roles.arcs].rpm
    below, above = rpm < crossover_rpm, rpm > crossover_rpm
    limit = f"{crossover_rpm:g} rpm"
    arcs, reference, proposed = roles.arcs, roles.reference, roles.predicted
    quieter = f"{proposed} is quieter than"
    tests = (
        (f"{arcs} is the quietest below {limit}", "fig. 16", arcs, (reference, proposed), below),
        (f"{quieter} {arcs} above {limit}", "fig. 16", proposed, (arcs,), above),
        (f"{quieter} {reference} above {limit}", "conclusions", proposed, (reference,), above),
    )
    claims = []
    for claim, source, cam, others, mask in tests:
        for name, curve_of in TESTED_ON.items():
            loudness = [curve_of(curves[other])[mask] for other in others]
            holds = curve_of(curves[cam])[mask] < np.min(loudness, axis=0)
            failures = rpm[mask][~holds]
            fails = (float(failures[0]), float(failures[-1])) if failures.size else None
            cases = int(mask.sum())
            claims.append(NoiseClaim(claim, source, name, int(holds.sum()), cases, fails))
    return claims

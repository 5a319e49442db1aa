"""The three curves by one way of calibrating, with their bands and their crossing.

Three ways stand side by side:

* two constants, gain and corner of the structure, with the arc cam as its file has it: there
  the simulated points were compared with the published regression;
* the same with the arc cam fitted anew, its regression compared with the published one;
* by substitution: the reference also measures how the rig passes sound on at each speed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from cam_rig.simulation.regression import (
    REGRESSION_DEGREE,
    crossings,
    cubic,
    nearest_crossing,
    regression,
)
from cam_rig.simulation.simulate import Acoustics
from cam_rig.simulation.sound_constants import PublishedCam, two_constants
from cam_rig.studies.noise.arc_cam import ArcShape
from cam_rig.studies.noise.calibration import by_substitution, sensitivity
from cam_rig.studies.noise.roles import NoiseSetup, StudyRoles
from cam_rig.units import FloatArray, rms

# Confidence intervals of the noise curves and their crossing, by a bootstrap of the fit errors.

#: Neighbouring speeds that are drawn together: a third of the range.
BLOCK = 7
#: Draws, and the seed of them.
DRAWS, SEED = 2000, 1
#: Percent outside a 95 % band, on either side.
TAIL = 2.5


def resample(residual: FloatArray, generator: np.random.Generator) -> FloatArray:
    """``(DRAWS, n)`` series like ``residual`` ``(n,)``, put together from blocks of it."""
    count = residual.size
    blocks = -(-count // BLOCK)
    starts = generator.integers(0, count, size=(DRAWS, blocks))
    index = (starts[:, :, None] + np.arange(BLOCK)) % count
    return np.asarray(residual[index.reshape(DRAWS, -1)[:, :count]])


@dataclass(frozen=True, eq=False)
class Band:
    """Where 95 % of the draws lie, dB at each speed, ``(n,)``."""

    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, draws: FloatArray) -> Band:
        """The band of draws ``(DRAWS, n)``."""
        low, high = np.percentile(draws, [TAIL, 100.0 - TAIL], axis=0)
        return cls(low, high)

    def holds(self, level: FloatArray) -> float:
        """Share of the speeds at which a curve ``(n,)`` lies within."""
        return float(np.mean((level >= self.low) & (level <= self.high)))


@dataclass(frozen=True)
class Crossing:
    """Speed in rpm at which two regressions cross, with its confidence interval.

    ``low`` and ``high`` hold 95 % of the draws, of which a share ``missing`` does not cross at all
    within the speeds. ``points_rpm`` is where the simulated levels themselves cross.
    """

    rpm: float | None
    low: float
    high: float
    deviation: float
    missing: float
    points_rpm: float | None = None


def all_crossings(rpm: FloatArray, one: FloatArray, two: FloatArray) -> FloatArray:
    """Where two cubics, given by their values ``(n,)``, cross, rpm."""
    fit, scale = _difference(rpm, one, two)
    return crossings(fit, (rpm[0], rpm[-1]), scale=scale, shift=1.0)


def crossing(rpm: FloatArray, one: FloatArray, two: FloatArray, near: float) -> float | None:
    """The one of `all_crossings` nearest to ``near`` rpm; None when there is none."""
    fit, scale = _difference(rpm, one, two)
    return nearest_crossing(fit, (rpm[0], rpm[-1]), near, scale=scale, shift=1.0)


def _difference(rpm: FloatArray, one: FloatArray, two: FloatArray) -> tuple[FloatArray, float]:
    """Coefficients of one less the other, each ``(n,)`` or draws, over rpm/scale − 1; the scale."""
    scale = float(rpm.mean())
    fit = np.polynomial.polynomial.polyfit(rpm / scale - 1.0, (one - two).T, REGRESSION_DEGREE)
    return np.asarray(fit, dtype=np.float64), scale


def points_crossing(rpm: FloatArray, one: FloatArray, two: FloatArray, near: float) -> float | None:
    """Where two series of levels ``(n,)``, joined by straight lines, cross nearest to ``near``."""
    gap = one - two
    at = np.flatnonzero(np.sign(gap[1:]) != np.sign(gap[:-1]))
    share = gap[at] / (gap[at] - gap[at + 1])
    found = rpm[at] + share * (rpm[at + 1] - rpm[at])
    return float(found[np.argmin(np.abs(found - near))]) if found.size else None


def crossing_interval(
    rpm: FloatArray,
    best: tuple[FloatArray, FloatArray],
    draws: tuple[FloatArray, FloatArray],
    near: float,
) -> Crossing:
    """The crossing of two regressions, with what draws ``(DRAWS, n)`` of both say about it."""
    fits, scale = _difference(rpm, *draws)
    ends = (rpm[0], rpm[-1])
    found = [nearest_crossing(fit, ends, near, scale=scale, shift=1.0) for fit in fits.T]
    there = np.array([rpm for rpm in found if rpm is not None])
    low = high = deviation = np.nan
    if there.size > 1:
        low, high = np.percentile(there, [TAIL, 100.0 - TAIL]).tolist()
        deviation = float(np.std(there, ddof=1))
    missing = 1.0 - there.size / len(found)
    return Crossing(crossing(rpm, *best, near), low, high, deviation, missing)


@dataclass(frozen=True, eq=False)
class StudiedCurve:
    """One cam by one way of calibrating. Levels in dB at each speed.

    ``numbers`` were fitted to this cam's own published curve, a cubic of four. ``rms_db`` is of
    the simulated points to the published regression, ``rms_regression_db`` of their regression
    to it. ``confidence`` is the band of the regression from what was fitted, ``expected`` where the
    published one should lie.
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
        """By how much (dB) a point is off at most, which an r.m.s. hides, and at which rpm."""
        difference = self.level_db - self.published_db
        at = int(np.argmax(np.abs(difference)))
        return float(difference[at]), round(float(self.rpm[at]), 9)


@dataclass(frozen=True)
class PairCrossing:
    """Where the published curves of two cams cross, and where those of a method do."""

    method: str
    between: tuple[str, str]
    published_rpm: float
    found: Crossing


@dataclass(frozen=True, eq=False)
class Method:
    """One way of calibrating: shared constants, curves by cam, and where they cross.

    ``crossing`` is of the two cams that the paper names, ``pairs`` of every two at each speed at
    which their published curves cross.
    """

    name: str
    acoustics: Acoustics
    shape: ArcShape
    curves: dict[str, StudiedCurve]
    crossing: Crossing
    pairs: tuple[PairCrossing, ...]

    @property
    def predicted_rms_db(self) -> float:
        """r.m.s. difference (dB) of the points on what no number was fitted to."""
        unseen = [curve.rms_db for curve in self.curves.values() if curve.numbers == 0]
        return rms(np.array(unseen)) if unseen else np.inf


def with_two_constants(study: NoiseSetup, refit: bool) -> Method:
    """Gain and corner from the reference; the arc cam as its file has it, or fitted anew."""
    name = "two constants, arc cam refitted" if refit else "two constants"
    return _method(name, study, lambda cam: two_constants([cam], study.start), refit)


def with_substitution(study: NoiseSetup) -> Method:
    """Gain and speed response from the reference; the arc cam's geometry fitted to that."""
    return _method("by substitution", study, lambda cam: by_substitution(cam, study.start), True)


def _method(
    name: str, study: NoiseSetup, calibrated: Callable[[PublishedCam], Acoustics], refit: bool
) -> Method:
    """Curves and bands.

    The difference (dB) of this way on a cam it was not fitted to is the reference's, with the parts
    of reference and predicted cam exchanged.
    """
    reference = study.cams[study.roles.reference]
    acoustics, project = calibrated(reference), cubic(study.rpm)
    unseen = reference.difference(calibrated(study.cams[study.roles.predicted]))
    shape = study.fit_shape(acoustics) if refit else study.shape
    compared = project if refit else np.eye(study.rpm.size)  # what the geometry was fitted to
    arcs, slope = study.problem.cam_of(shape), study.problem.sensitivity(shape, acoustics)
    roles, cams = study.roles, study.cams | {arcs.cam: arcs}
    unlike = dict.fromkeys(cams, -unseen) | {arcs.cam: -arcs.difference(acoustics)}
    generator = np.random.default_rng(SEED)
    fitted, left = ({cam: resample(unlike[cam], generator) for cam in cams} for _ in range(2))
    slopes = {cam: sensitivity(one, acoustics) for cam, one in cams.items()}
    constants = fitted[roles.reference] @ _refit(project @ slopes[roles.reference], project).T
    moved = {cam: constants @ one.T for cam, one in slopes.items()}
    change = (fitted[arcs.cam] - moved[arcs.cam]) @ _refit(compared @ slope, compared).T
    moved[arcs.cam] = moved[arcs.cam] + change @ slope.T
    numbers = {roles.reference: 2 + len(acoustics.response), roles.arcs: 2 if refit else 3}
    curves = {
        cam: _curve(name, study, h, acoustics, numbers.get(cam, 0), moved[cam], left[cam])
        for cam, h in cams.items()
    }
    drawn = {c: curves[c].regression_db + (moved[c] + left[c]) @ project for c in cams}

    def found(one: str, two: str, near: float) -> Crossing:
        best = (curves[one].regression_db, curves[two].regression_db)
        interval = crossing_interval(study.rpm, best, (drawn[one], drawn[two]), near)
        levels = (curves[one].level_db, curves[two].level_db)
        return replace(interval, points_rpm=points_crossing(study.rpm, *levels, near))

    pairs = tuple(
        PairCrossing(name, (one, two), near, found(one, two, near))
        for one, two in combinations(curves, 2)
        for near in all_crossings(
            study.rpm, curves[one].published_db, curves[two].published_db
        ).tolist()
    )
    named = study.crossover
    return Method(name, acoustics, shape, curves, found(*named.between, named.rpm), pairs)


def _refit(slope: FloatArray, compared: FloatArray) -> FloatArray:
    """``(k, n)``: takes a change of the published levels to that of the fitted numbers."""
    return np.asarray(np.linalg.pinv(slope, rcond=1e-2) @ compared)


def _curve(
    method: str,
    study: NoiseSetup,
    cam: PublishedCam,
    acoustics: Acoustics,
    numbers: int,
    moved: FloatArray,
    left: FloatArray,
) -> StudiedCurve:
    level = acoustics.levels(cam.turns)
    project = cubic(study.rpm)
    fitted = project @ level
    return StudiedCurve(
        method=method,
        cam=cam.cam,
        role=study.loaded.fitted_origin(cam.cam),  # true here: each method calibrates anew
        numbers=numbers,
        rpm=study.rpm,
        level_db=level,
        regression_db=fitted,
        coefficients=regression(study.rpm, level),
        published_db=cam.published,
        rms_db=rms(level - cam.published),
        rms_regression_db=rms(fitted - cam.published),
        confidence=Band.of(fitted + moved @ project),
        expected=Band.of(fitted + (moved + left) @ project),
    )


# Each cam left out in turn: the acoustic constants are fitted to the other two alone.

#: Rounds of fitting shape and constants in turn.
ROUNDS = 2


@dataclass(frozen=True)
class LeftOut:
    """A cam left out, the constants of the other two, and the fit error (dB) on each cam.

    ``numbers`` were fitted together to the other cams. The arc cam's geometry is its own: it is
    fitted with the constants where the cam is among the others, and to its own curve, after the
    constants, where it is the one left out. ``rms_regression_db`` is of the cam left out.
    """

    cam: str
    numbers: int
    acoustics: Acoustics
    rms_db: dict[str, float]
    rms_regression_db: float


def leave_one_out(study: NoiseSetup) -> list[LeftOut]:
    """All three, in the order of the scene."""
    return [_leave_out(study, cam) for cam in study.cams]


def _leave_out(study: NoiseSetup, cam: str) -> LeftOut:
    arcs = study.roles.arcs
    trained = tuple(name for name in study.cams if name != cam)
    known = [study.cams[name] for name in trained if name != arcs]
    acoustics = two_constants(known, study.start)
    for _ in range(1 if cam == arcs else ROUNDS):
        shape = study.fit_shape(acoustics)
        cams = study.cams | {arcs: study.problem.cam_of(shape)}
        acoustics = two_constants([cams[name] for name in trained], study.start)
    return LeftOut(
        cam=cam,
        numbers=2 if cam == arcs else 4,
        acoustics=acoustics,
        rms_db={name: one.rms(acoustics) for name, one in cams.items()},
        rms_regression_db=rms(cubic(study.rpm) @ cams[cam].difference(acoustics)),
    )


# What the paper claims of noise, tested on its own curves and on those of the study.

#: Curves that a claim is tested on: its heading, and which of a studied curve it takes.
TESTED_ON: dict[str, Callable[[StudiedCurve], FloatArray]] = {
    "published curves": lambda curve: curve.published_db,
    "regressions": lambda curve: curve.regression_db,
    "points": lambda curve: curve.level_db,
}


@dataclass(frozen=True)
class NoiseClaim:
    """A claim of the paper on the levels of its cams, and what it was tested on.

    ``holds`` counts the speeds at which it holds, of ``cases``; ``fails_rpm`` are the lowest and
    highest speed at which it does not, None where it always holds.
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
    """The paper's claims below and above its speed at which its two rivals are equally loud."""
    rpm = curves[roles.arcs].rpm
    below, above = rpm < crossover_rpm, rpm > crossover_rpm
    at = f"{crossover_rpm:g} rpm"
    arcs, conventional, proposed = roles.arcs, roles.reference, roles.predicted
    quieter = f"{proposed} is quieter than"
    named = (
        (f"{arcs} is the quietest below {at}", "fig. 16", arcs, (conventional, proposed), below),
        (f"{quieter} {arcs} above {at}", "fig. 16", proposed, (arcs,), above),
        (f"{quieter} {conventional} above {at}", "conclusions", proposed, (conventional,), above),
    )
    found = []
    for words, source, cam, others, where in named:
        for name, take in TESTED_ON.items():
            loudness = [take(curves[other])[where] for other in others]
            holds = take(curves[cam])[where] < np.min(loudness, axis=0)
            against = rpm[where][~holds]
            fails = (float(against[0]), float(against[-1])) if against.size else None
            cases = int(where.sum())
            found.append(NoiseClaim(words, source, name, int(holds.sum()), cases, fails))
    return found

"""The three curves by one way of calibrating, with their bands and their crossing.

Three ways stand side by side:

* two constants, gain and corner of the structure, with the arc cam as its file has it: there
  the simulated points were compared with the published regression;
* the same with the arc cam fitted anew, its regression compared with the published one;
* by substitution: the reference also measures how the rig passes sound on at each speed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from cam_rig.arrays import FloatArray, rms
from cam_rig.simulation.regression import cubic, regression
from cam_rig.simulation.settled_turns import Acoustics
from cam_rig.studies.noise import bootstrap
from cam_rig.studies.noise.arc_shape import ArcShape, ShapeFit
from cam_rig.studies.noise.bootstrap import Band, Crossing
from cam_rig.studies.noise.calibration import (
    PublishedCam,
    by_substitution,
    sensitivity,
    two_constants,
)
from cam_rig.studies.noise.setup import NoiseSetup


@dataclass(frozen=True, eq=False)
class StudiedCurve:
    """One cam by one way of calibrating. Levels in dB at each speed.

    ``numbers`` were fitted to this cam's own published curve, a cubic of four. ``rms_db`` is of
    the simulated points to the published regression, ``rms_regression_db`` of their regression
    to it. ``confidence`` is the band of the regression from what was fitted, ``expected`` where the
    published one should lie.
    """

    cam: str
    role: str
    numbers: int
    level_db: FloatArray
    regression_db: FloatArray
    coefficients: FloatArray
    published_db: FloatArray
    rms_db: float
    rms_regression_db: float
    confidence: Band
    expected: Band

    @property
    def largest_at(self) -> int:
        """Index of the speed at which a point is furthest from the published curve."""
        return int(np.argmax(np.abs(self.level_db - self.published_db)))

    @property
    def largest_db(self) -> float:
        """That difference, dB: what an r.m.s. hides."""
        return float((self.level_db - self.published_db)[self.largest_at])


@dataclass(frozen=True)
class PairCrossing:
    """Where the published curves of two cams cross, and where those of the study do."""

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
    reference = study.cams[study.roles.reference]
    acoustics = two_constants([reference], study.start)
    swapped = two_constants([study.cams[study.roles.predicted]], study.start)
    unseen = reference.difference(swapped)
    if refit:
        fit = study.problem.seen(study.fit_shape(acoustics), acoustics)
        return _method("two constants, arc cam refitted", study, fit, cubic(study.rpm), unseen)
    fit = study.problem.seen(study.shape, acoustics)
    return _method("two constants", study, fit, np.eye(study.rpm.size), unseen)


def with_substitution(study: NoiseSetup) -> Method:
    """Gain and speed response from the reference; the arc cam's geometry fitted to that."""
    reference = study.cams[study.roles.reference]
    acoustics = by_substitution(reference, study.start)
    fit = study.problem.seen(study.fit_shape(acoustics), acoustics)
    swapped = by_substitution(study.cams[study.roles.predicted], study.start)
    unseen = reference.difference(swapped)
    return _method("by substitution", study, fit, cubic(study.rpm), unseen)


def _method(
    name: str, study: NoiseSetup, fit: ShapeFit, compared: FloatArray, unseen: FloatArray
) -> Method:
    """Curves and bands.

    Parameters
    ----------
    compared : ``(n, n)``, what of a difference the geometry was fitted to
    unseen : difference (dB) of this way on a cam it was not fitted to: the reference's,
        with the parts of reference and predicted cam exchanged
    """
    roles, acoustics, project = study.roles, fit.acoustics, cubic(study.rpm)
    cams = study.cams | {roles.arcs: fit.cam}
    unlike = dict.fromkeys(cams, -unseen) | {roles.arcs: -fit.cam.difference(acoustics)}
    generator = np.random.default_rng(bootstrap.SEED)
    fitted, left = (
        {cam: bootstrap.resample(unlike[cam], generator) for cam in cams} for _ in range(2)
    )
    slopes = {cam: sensitivity(h, acoustics) for cam, h in cams.items()}
    constants = fitted[roles.reference] @ _refit(project @ slopes[roles.reference], project).T
    moved = {cam: constants @ slope.T for cam, slope in slopes.items()}
    shape = (fitted[roles.arcs] - moved[roles.arcs]) @ _refit(
        compared @ fit.sensitivity, compared
    ).T
    moved[roles.arcs] = moved[roles.arcs] + shape @ fit.sensitivity.T
    refitted = fit.shape != study.shape
    numbers = {roles.reference: 2 + len(acoustics.response), roles.arcs: 2 if refitted else 3}
    curves = {
        cam: _curve(
            study, h, acoustics, numbers.get(cam, 0), moved[cam] @ project, left[cam] @ project
        )
        for cam, h in cams.items()
    }
    drawn = {c: curves[c].regression_db + (moved[c] + left[c]) @ project for c in cams}

    def found(one: str, two: str, near: float) -> Crossing:
        best = (curves[one].regression_db, curves[two].regression_db)
        interval = bootstrap.crossing_interval(study.rpm, best, (drawn[one], drawn[two]), near)
        levels = (curves[one].level_db, curves[two].level_db)
        return replace(interval, points_rpm=bootstrap.points_crossing(study.rpm, *levels, near))

    pairs = tuple(
        PairCrossing((one, two), near, found(one, two, near))
        for one, two in combinations(curves, 2)
        for near in bootstrap.all_crossings(
            study.rpm, curves[one].published_db, curves[two].published_db
        ).tolist()
    )
    return Method(name, acoustics, fit.shape, curves, found(*_crossing_cams(study)), pairs)


def _refit(slope: FloatArray, compared: FloatArray) -> FloatArray:
    """``(k, n)``: takes a change of the published levels to that of the fitted numbers."""
    return np.asarray(np.linalg.pinv(slope, rcond=1e-2) @ compared)


def _crossing_cams(study: NoiseSetup) -> tuple[str, str, float]:
    published = study.loaded.published
    assert published is not None  # the study has its levels
    one, two = published.crossover.between
    return one, two, published.crossover.rpm


def _curve(
    study: NoiseSetup,
    cam: PublishedCam,
    acoustics: Acoustics,
    numbers: int,
    moved: FloatArray,
    left: FloatArray,
) -> StudiedCurve:
    level = acoustics.levels(cam.turns)
    fitted = cubic(study.rpm) @ level
    return StudiedCurve(
        cam=cam.cam,
        role=study.loaded.part(cam.cam),  # true here: each method calibrates anew
        numbers=numbers,
        level_db=level,
        regression_db=fitted,
        coefficients=regression(study.rpm, level),
        published_db=cam.published,
        rms_db=rms(level - cam.published),
        rms_regression_db=rms(fitted - cam.published),
        confidence=Band.of(fitted + moved),
        expected=Band.of(fitted + moved + left),
    )

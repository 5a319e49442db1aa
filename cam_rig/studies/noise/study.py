"""Noise study: comparison of simulated sound levels with published regressions.

This module runs the parts of the study, and defines its result with tables and tests of the paper's
claims.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np

from cam_rig.arguments import check_arguments
from cam_rig.dynamics import TwoMassParameters
from cam_rig.schema import RigConfig, load_rig
from cam_rig.schema.load import resolve_rig_path
from cam_rig.schema.published import Crossover
from cam_rig.show.result import NULL_PROGRESS, Column, Footnote, Progress, Records, Result
from cam_rig.simulation.inputs import Scene, resolve_scene
from cam_rig.simulation.scene import LoadedScene
from cam_rig.studies.noise.calibration import StructureFit, compare_structures
from cam_rig.studies.noise.methods import (
    LeftOut,
    Method,
    leave_one_out,
    noise_claims,
    with_substitution,
    with_two_constants,
)
from cam_rig.studies.noise.roles import NoiseSetup, StudyRoles
from cam_rig.studies.noise.variants import (
    FACTORS,
    HighDwellStudy,
    OneRig,
    study_high_dwell,
    with_elastic_stem,
    with_rigid_stem,
)
from cam_rig.units import FloatArray

#: Names of the parts of a noise study in their order, which the progress bar displays.
PARTS = (
    "the cams' turns",
    "structures",
    "two constants",
    "by substitution",
    "leave one out",
    "one rig",
    "lift, high dwell and joints",
)

#: Stride of the displayed table of sound levels: it has a row for every n-th speed.
EVERY = 2


class LevelAt(NamedTuple):
    """Sound levels (dB) of a cam at one speed (rpm), by one method of calibration.

    ``confidence`` and ``expected`` are the ends of the 95 % bands of `StudiedCurve` at this speed.
    """

    method: str
    cam: str
    rpm: float
    published: float
    level: float
    confidence: tuple[float, float]
    expected: tuple[float, float]


class OnCam(NamedTuple):
    """Table row: one cam, and a result that covers several cams.

    ``of`` is the result: a rig, or a leave-one-out test.
    """

    of: OneRig | LeftOut
    cam: str


class Changed(NamedTuple):
    """Sound level (dB) of one cam of the factorial study at one speed (rpm).

    The factorial study varies lift (m), high dwell (rad) and rise law. ``change`` are the smallest
    and the largest difference from the reference cam over all speeds, dB.
    """

    lift: float
    high_dwell: float
    rise: str
    change: tuple[float, float]
    rpm: float
    level: float


def _constants(of: str = "") -> tuple[Column, ...]:
    return (
        Column("gain", "Pa·s/N", ".4g", of=f"{of}acoustics.radiation.gain"),
        Column("cut_off", "Hz", ".4g", "cut-off", f"{of}acoustics.radiation.corner_frequency"),
    )


def _shape(of: str = "", hidden: bool = False) -> tuple[Column, ...]:
    """Return the table columns of the arc cam's geometry: lift, event and flank.

    The event is the angle of rise and fall together. ``of`` is the path of the object with the
    shape, ending with a dot.
    """
    return (
        Column("lift", "mm", ".2f", "arc cam: lift", f"{of}shape.lift", hidden=hidden),
        Column("event", "°", ".1f", of=f"{of}shape.event", hidden=hidden),
        Column("flank", "m", ".2f", of=f"{of}shape.flank", hidden=hidden),
    )


def _response(i: int) -> Callable[[Method], float | None]:
    return lambda method: method.acoustics.response[i] if method.acoustics.response else None


def _crossing(hidden: bool, before: str = "", of: str = "computed") -> tuple[Column, ...]:
    """Return the table columns of a crossing of two regressions and its interval.

    ``before`` is a prefix of the keys. ``of`` is the name of the field with the crossing.
    """
    kinds = (
        ("crossing", ".1f", "regressions", "rpm", "nowhere"),
        ("deviation", ".1f", "standard deviation", "deviation", ""),
        ("low", ".0f", "95 % from", "low", ""),
        ("high", ".0f", "to", "high", ""),
        ("points", ".1f", "points", "points_rpm", "nowhere"),
    )
    share = Column(f"{before}missing", "%", ".0f", "draws without", f"{of}.missing", hidden=hidden)
    columns = [
        Column(f"{before}{key}", "rpm", fmt, title, f"{of}.{field}", missing=empty, hidden=hidden)
        for key, fmt, title, field, empty in kinds
    ]
    return (*columns[:-1], share, columns[-1])


@dataclass(frozen=True, eq=False, repr=False)
class NoiseStudyResult(Result):
    """Result of a noise study: noise curves by method of calibration, with tests.

    Attributes
    ----------
    named : Crossover
        Crossing of two cams that the paper states.
    titles : dict
        Titles of the cams by name.
    roles : StudyRoles
        Role of each cam.
    rpm : FloatArray
        Speeds in rpm, shape (n,).
    structures : tuple of StructureFit
        Comparison of transfer functions between contact force and sound.
    methods : tuple of Method
        Methods of calibration with their noise curves.
    excluded : tuple of LeftOut
        Results of the leave-one-out test.
    one_rig : tuple of OneRig
        Noise with the rig that is identified from jump speeds.
    high_dwell : HighDwellStudy or None
        Factorial of lift, high dwell and joints. None if the reference cam does not allow it.
    """

    schema = "cam_rig.noise.1"
    plot_function = "cam_rig.studies.noise.figures:figure"
    columns: ClassVar = {
        "curves": (
            Column("calibration", of="method"),
            Column("cam"),
            Column("role"),
            Column("numbers_fitted", "", "d", "numbers fitted to it", "numbers"),
            Column("rms_points", "dB", ".2f", "points", "rms_db"),
            Column("rms_regression", "dB", ".2f", "regression", "rms_regression_db"),
            Column("largest", "dB", "+.2f", "largest difference", "largest.0"),
            Column("largest_at", "rpm", ".0f", "at", "largest.1"),
            Column(
                "half_band",
                "dB",
                ".1f",
                "95 % band, half",
                lambda c: 0.5 * float((c.expected.high - c.expected.low).mean()),
            ),
            Column("published_inside", "%", ".0f", of=lambda c: c.expected.holds(c.published_db)),
            *(
                Column(f"c{i}", of=f"coefficients.{i}", hidden=True, doc=f"dB/rpm^{i}")
                for i in range(4)
            ),
        ),
        "crossings": (
            Column("calibration", of="method"),
            Column("cams", of=lambda pair: " and ".join(pair.between)),
            Column("published", "rpm", ".1f", "published curves", "published_rpm"),
            *_crossing(hidden=False),
        ),
        "claims": (
            Column("claim", of="words"),
            Column("source", heading="in the paper"),
            Column("tested_on"),
            Column("holds", "", "d", doc="speeds at which it holds"),
            Column("cases", "", "d", doc="tested speeds"),
            Column("fails_from", "rpm", "g", of="fails_rpm.0"),
            Column("fails_to", "rpm", "g", of="fails_rpm.1"),
        ),
        "methods": (
            Column("calibration", of="name"),
            *_constants(),
            *(
                Column(f"response_{i + 1}", "dB", "+.2f", f"response x{power}", _response(i))
                for i, power in enumerate(("", "²", "³"))
            ),
            *_shape(),
            Column("rms_predicted", "dB", of="predicted_rms_db", hidden=True),
            *_crossing(True, "named_", "crossing"),
        ),
        "structures": (
            Column("structure", of="name"),
            Column("weighting"),
            Column("numbers_fitted", "", "d", of="numbers"),
            Column("fitted_to", of="fitted"),
            Column("rms_fitted", "dB", ".2f", "fitted to {}", "fitted_db"),
            Column("rms_predicted", "dB", ".2f", "predicted from {}", "predicted_db"),
            Column("predicted", hidden=True),
        ),
        "excluded": (
            Column("excluded", of="of.cam"),
            Column("numbers_fitted", "", "d", "numbers fitted to the others", "of.numbers"),
            *_constants("of."),
            Column("rms_regression", "dB", ".2f", "regression", "of.rms_regression_db"),
            Column("cam"),
            Column("rms_points", "dB", ".2f", of=lambda row: row.of.rms_db[row.cam]),
        ),
        "one_rig": (
            Column("rig", of="of.name"),
            Column("crossing", "rpm", ".1f", of="of.crossing_rpm"),
            Column("cam"),
            Column(
                "rms_points", "dB", ".2f", of=lambda row: row.of.rms_db[row.cam], missing="not run"
            ),
            *(replace(column, hidden=True) for column in _constants("of.")),
            *_shape("of.", hidden=True),
        ),
        "high_dwell": (
            Column("lift", "mm", ".2f"),
            Column("high_dwell", "°", ".1f"),
            Column("rise"),
            Column("change_from", "dB", "+.1f", of="change.0"),
            Column("change_to", "dB", "+.1f", "to", "change.1"),
            Column("rpm", "rpm", "g"),
            Column("level", "dB", ".1f"),
        ),
        "high_dwell_shares": (
            Column("by", of=lambda share: " × ".join(FACTORS[axis] for axis in share[0])),
            Column("share", "%", ".1f", of="1"),
        ),
        "levels": (
            Column("calibration", of="method"),
            Column("rpm", "rpm", "g", "speed"),
            Column("cam"),
            Column("published", "dB", ".1f"),
            Column("level", "dB", ".1f", "here"),
            *(
                Column(f"{band}_{end}", "dB", of=f"{band}.{i}", hidden=True)
                for band in ("confidence", "expected")
                for i, end in enumerate(("low", "high"))
            ),
        ),
        "study": (
            Column("reference", of="roles.reference"),
            Column("predicted", of="roles.predicted"),
            Column("arcs", of="roles.arcs"),
            Column("best_calibration", of="best.name"),
        ),
    }

    named: Crossover
    titles: dict[str, str]
    roles: StudyRoles
    rpm: FloatArray
    structures: tuple[StructureFit, ...]
    methods: tuple[Method, ...]
    excluded: tuple[LeftOut, ...]
    one_rig: tuple[OneRig, ...]
    high_dwell: HighDwellStudy | None = None

    @property
    def best(self) -> Method:
        """Method of calibration with the best prediction.

        The criterion is the r.m.s. difference on cams to which no number was fitted, not the
        crossing. Of equal methods the first is chosen, which has the fewest fitted numbers.
        """
        return min(self.methods, key=lambda method: round(method.predicted_rms_db, 3))

    def tables(self) -> list[Records]:
        """Return the tables of the study, ``curves`` first.

        ``curves`` has one row per method of calibration and cam.
        """
        named, best = self.named, self.best
        way_text = best.name if best.name.startswith("by ") else f"with {best.name}"
        return [
            self.table(
                "curves",
                "Noise of three cams by three calibrations: r.m.s. difference to published",
                (curve for method in self.methods for curve in method.curves.values()),
                "A published regression has four numbers: a fit of as many proves nothing.",
            ),
            self.table(
                "crossings",
                "Speeds at which two cams are equally loud",
                (pair for method in self.methods for pair in method.pairs),
                f"The paper names {' and '.join(named.between)}, {named.rpm:g} rpm. Standard "
                "deviation and 95 %: of the bootstrap's draws that cross at all.",
            ),
            self.table(
                "claims",
                "The paper's claims of noise, tested",
                noise_claims(self.roles, best.curves, named.rpm),
                f"Regressions and points: simulated, calibrated {way_text}, which gives the best "
                "prediction.",
                pivot="tested_on",
            ),
            self.table(
                "methods",
                "Constants by calibration",
                self.methods,
                Footnote("Response: x = (rpm − 300)/100.", lambda m: bool(m.acoustics.response)),
            ),
            *self._further(),
            self.table("study", "Role of each cam", [self], single=True, hidden=True),
        ]

    def _further(self) -> list[Records]:
        """Return the tables that follow the tables of the calibrations.

        They show the transfer functions, the cams left out, one rig for jump and noise, the
        factorial study of lift, high dwell and joints, and the levels.
        """
        best, thinned = self.best, set(self.rpm[::EVERY])
        base, middle = self.methods[1], self.rpm[self.rpm.size // 2]
        rms_db = {cam: curve.rms_db for cam, curve in base.curves.items()}
        scene_rig = OneRig(base.name, base.acoustics, rms_db, base.shape, base.crossing.rpm)
        ends = {self.rpm[0], middle, self.rpm[-1]}
        return [
            self.table(
                "structures",
                "Transfer functions between contact force and sound: r.m.s. difference",
                self.structures,
                pivot="fitted_to",
            ),
            self.table(
                "excluded",
                "Each cam left out: gain and cut-off from the other two, r.m.s. difference",
                (OnCam(row, cam) for row in self.excluded for cam in row.rms_db),
                "Regression: of the cam that is left out. Under the cams: of their points.",
                pivot="cam",
            ),
            self.table(
                "one_rig",
                "One rig for jump and noise: r.m.s. difference of the points to published",
                (OnCam(rig, cam) for rig in (scene_rig, *self.one_rig) for cam in rig.rms_db),
                Footnote(
                    "Not run: a search of minutes, cam-rig noise --one-rig.",
                    lambda row: row.of.shape is None,
                ),
                pivot="cam",
            ),
            self.table(
                "high_dwell",
                "Lift, high dwell and joints: level of the reference cam changed in each",
                self._changed(),
                pivot="rpm",
                row_filter=lambda row: row.rpm in ends,
            ),
            self.table(
                "high_dwell_shares",
                "Shares of the variation of the mean level",
                self.high_dwell.shares.items() if self.high_dwell else (),
                "Joints: with the reference's rise, or with one whose acceleration jumps at each "
                "dwell.",
            ),
            self.table(
                "levels",
                "The paper's Table 3: levels, published and simulated {calibration}",
                self._levels(),
                group_by="calibration",
                pivot="cam",
                row_filter=lambda row: row.method == best.name and row.rpm in thinned,
            ),
        ]

    def _changed(self) -> Iterator[Changed]:
        if self.high_dwell is not None:
            for cam, levels in self.high_dwell.levels_db.items():
                differences = levels - self.high_dwell.reference
                change = float(differences.min()), float(differences.max())
                for rpm, level in zip(self.rpm.tolist(), levels.tolist(), strict=True):
                    yield Changed(*cam, change, rpm, level)

    def _levels(self) -> Iterator[LevelAt]:
        for method in self.methods:
            for curve in method.curves.values():
                bands = [
                    zip(band.low.tolist(), band.high.tolist(), strict=True)
                    for band in (curve.confidence, curve.expected)
                ]
                levels = (self.rpm, curve.published_db, curve.level_db)
                for row in zip(*(series.tolist() for series in levels), *bands, strict=True):
                    yield LevelAt(method.name, curve.cam, *row)


def study_noise(
    loaded: LoadedScene, rig: RigConfig, arcs: bool = False, progress: Progress = NULL_PROGRESS
) -> NoiseStudyResult:
    """Run all parts of a noise study.

    Parameters
    ----------
    loaded : LoadedScene
        Scene with the three cams.
    rig : RigConfig
        Rig identified from jump speeds, with two masses.
    arcs : bool
        True to fit the arc cam also on that rig, which takes minutes (default: False).
    progress : Progress
        Receiver of the progress.
    """
    parts = progress.track(PARTS)
    next(parts)
    # raises an error for an unsuitable rig before the long computation
    TwoMassParameters.from_rig(rig)
    study = NoiseSetup.of(loaded)
    smooth = {cam: study.cams[cam] for cam in (study.roles.reference, study.roles.predicted)}
    next(parts)
    structures = tuple(fit for cam in smooth for fit in compare_structures(loaded, smooth, cam))
    next(parts)
    methods = [with_two_constants(study, refit) for refit in (False, True)]
    next(parts)
    methods.append(with_substitution(study))
    next(parts)
    excluded = tuple(leave_one_out(study))
    next(parts)
    rigs = (with_rigid_stem(study, rig), with_elastic_stem(study, rig, arcs, progress))
    rpm, results = np.round(study.rpm, 9), (structures, tuple(methods), excluded, rigs)
    result = NoiseStudyResult(study.crossover, loaded.titles, study.roles, rpm, *results)
    next(parts)
    best = result.best
    return replace(result, high_dwell=study_high_dwell(study, best.acoustics, best.shape.lift))


@check_arguments
def noise_study(
    scene: Scene = "tm21_sweep",
    rig: str | Path | RigConfig = "paper_table2",
    one_rig: bool = False,
    *,
    progress: Progress = NULL_PROGRESS,
) -> NoiseStudyResult:
    """Calibrate noise on one cam, predict another, and identify the third.

    The study takes about ten seconds. The command is ``cam-rig noise``.

    Parameters
    ----------
    scene : str, Path or Scene, optional
        Scene with published curves: a name in ``config/scenes``, a path, or the result of
        `load_scene` (default: ``tm21_sweep``).
    rig : Rig, str or Path, optional
        Rig identified from jump speeds (default: ``paper_table2``).
    one_rig : bool, optional
        True to fit the arc cam also on that rig, which takes minutes (default: False).
    progress : Progress, optional
        Receiver of the progress.

    Returns
    -------
    NoiseStudyResult
        Curves, crossings and claims by method of calibration, and the further parts of the study.

    Raises
    ------
    ConfigError
        If the scene does not have the three cams with their published curves, or the rig has one
        mass.

    Examples
    --------
    >>> import cam_rig
    >>> result = cam_rig.noise_study()  # doctest: +SKIP
    """
    loaded = resolve_scene(scene)
    if not isinstance(rig, RigConfig):
        rig = load_rig(resolve_rig_path(rig, loaded.scene_file))
    return study_noise(loaded, rig, one_rig, progress)

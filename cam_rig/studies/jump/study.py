"""The four numbers of the two-mass rig that the paper does not print, from its jump speeds.

Event angle of every rise and fall, stem stiffness, roller's share of the mass and preload, fitted
to the four laws that the paper defines. Four numbers to four speeds is identification, not proof:
what was not fitted (the fifth law, the times) is the test.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import astuple, dataclass, replace
from typing import Any, ClassVar

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from cam_rig.arguments import checked
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.two_masses import FROM_REST, find_jump_speed, require_run
from cam_rig.errors import CamRigError, ConfigError
from cam_rig.laws import Law, build_law
from cam_rig.laws.cam import CamSet
from cam_rig.schema import CamConfig, PublishedTables, load_tables
from cam_rig.schema.load import tables_path
from cam_rig.show.result import NULL_PROGRESS, Column, Progress, Records, Result
from cam_rig.simulation.asked import Cams, Rig, asked_cams
from cam_rig.studies.jump.comparison import JumpResult, Reference, find_jumps, references
from cam_rig.units import RPM, TURN, FloatArray, rms


def event_of(cams: Iterable[CamConfig]) -> float:
    """The angle (rad) of a rise, of the first cam that has dwells."""
    for cam in cams:
        moving = [s.span.si for s in cam.segments if s.law != "dwell"]
        if len(moving) < len(cam.segments):
            return 0.5 * sum(moving)
    raise ConfigError("no cam has a dwell; needed: one, its rises have the event angle")


def with_event(cam: CamConfig, event: float, high_dwell: float | None = None) -> CamConfig:
    """A cam with every rise and fall over ``event`` rad; a whole turn stays.

    Parts of a rise share its angle as they did. The high dwell takes ``high_dwell`` rad and the
    low ones what is left; without it all dwells share that as they did.
    """
    if all(s.law != "dwell" for s in cam.segments):
        return cam
    kinds = _kinds(cam)
    if high_dwell is None:
        kinds = ["low" if kind == "high" else kind for kind in kinds]
    angles = {"event": 2.0 * event, "high": high_dwell or 0.0}
    angles["low"] = TURN - sum(angles.values())
    sums = dict.fromkeys(kinds, 0.0)
    for kind, segment in zip(kinds, cam.segments, strict=True):
        sums[kind] += segment.span.si
    segments = []
    for kind, s in zip(kinds, cam.segments, strict=True):
        value = s.span.numbers[0] * angles[kind] / sums[kind]
        span = s.span.model_copy(update={s.span.origin: value})
        segments.append(s.model_copy(update={"span": span}))
    return cam.model_copy(update={"segments": segments})


def _kinds(cam: CamConfig) -> list[str]:
    """Of each segment: event, or the dwell it is, high above half the lift."""
    kinds, place = [], 0.0
    for segment in cam.segments:
        place = getattr(segment, "to", place)
        dwell = "high" if place > 0.5 else "low"
        kinds.append(dwell if segment.law == "dwell" else "event")
    return kinds


#: Largest factor on either side of a start, and the step of a numerical derivative.
REACH, STEP = 3.0, 1e-3
#: Relative step on either side for the confidence intervals of the numbers.
ABOUT = 0.02
#: Starts, the file's own first; how far they scatter; and their seed.
STARTS, SCATTER, SEED = 3, np.array([0.02, 0.4, 0.15, 0.3]), 1
#: Most steps of one start.
MAX_STEPS = 20
#: A search begins at this part of the published speed.
BELOW = 0.6
#: Table 2 prints its speeds in steps of this, rpm.
ROUNDED_TO = 5.0


@dataclass(frozen=True)
class Numbers:
    """Event angle (rad), stem stiffness (N/m), roller's share of the mass, preload (N)."""

    event: float
    stem_stiffness: float
    roller_share: float
    preload: float

    def times(self, x: FloatArray) -> Numbers:
        """Each number times e^x."""
        return Numbers(*(np.array(astuple(self)) * np.exp(x)).tolist())


@dataclass(frozen=True)
class Solution:
    """Numbers, where they come from, and the r.m.s. of the speeds' relative differences."""

    start: str
    numbers: Numbers
    rms: float


@dataclass(frozen=True, eq=False)
class Refit:
    """What the search found, its relative differences by cam, and each standard deviation.

    ``deviation`` is the relative standard deviation that the rounding of the published speeds alone
    leaves on event, stem, share and preload, about the best solution; ``rounding`` is that of the
    speeds. ``solutions`` are where each start ended, the best first.
    """

    start: Numbers
    before: dict[str, float]
    after: dict[str, float]
    deviation: FloatArray
    rounding: float
    solutions: tuple[Solution, ...]

    @property
    def numbers(self) -> Numbers:
        """The best."""
        return self.solutions[0].numbers

    @property
    def rms(self) -> tuple[float, float]:
        """r.m.s. of the relative differences before and after."""
        return rms(list(self.before.values())), rms(list(self.after.values()))


@dataclass(frozen=True, repr=False)
class RefitResult(Result):
    """A refit, and the jump speeds of all cams on the rig that it gives."""

    schema = "cam_rig.jump_refit.1"
    columns: ClassVar = {
        "solutions": (
            Column("start", heading="rig"),
            Column("rms", "%", ".2f", "r.m.s. difference"),
            Column("event", "°", ".5g", "event angle", "numbers.event"),
            Column("stem_stiffness", "N/m", ".5g", of="numbers.stem_stiffness"),
            Column("roller_share", "", ".5g", "mass split, roller", "numbers.roller_share"),
            Column("preload", "N", ".5g", of="numbers.preload"),
        ),
        "standard_errors": (
            Column("event", "%", ".1f", "event angle", "deviation.0"),
            Column("stem_stiffness", "%", ".1f", of="deviation.1"),
            Column("roller_share", "%", ".1f", of="deviation.2"),
            Column("preload", "%", ".1f", of="deviation.3"),
            Column("rounding", "%", ".2f", "rounding of a speed"),
        ),
    }

    refit: Refit
    jumps: JumpResult

    def tables(self) -> list[Records]:
        """``solutions``, the rig as it is first; ``standard_errors``; those of the jump speeds."""
        found = self.refit
        rows = [Solution("as it is", found.start, found.rms[0]), *found.solutions]
        return [
            self.table("solutions", "Refit of four numbers to four jump speeds", rows),
            self.table(
                "standard_errors",
                "Standard errors from the rounding of the paper's Table 2 alone, near the best",
                [found],
                single=True,
            ),
            *self.jumps.tables(),
        ]

    def summary(self) -> list[str]:
        """How well it fits, and what the comparison with Table 2 comes to."""
        (before, after), rounding = self.refit.rms, self.refit.rounding
        words = [
            f"rig as it is: {100 * before:.2f} % r.m.s.; refitted: {100 * after:.2f} % r.m.s.; "
            f"rounding of Table 2 alone: {100 * rounding:.2f} %"
        ]
        if before - after < rounding:
            words.append(
                "the two solutions differ by less than the rounding: Table 2 does not tell them "
                "apart"
            )
        return words + self.jumps.summary()


def refit_rig(
    cam_set: CamSet, published: PublishedTables, duration: float, progress: Progress = NULL_PROGRESS
) -> RefitResult:
    """Fit the rig's four unprinted numbers anew, and try them on all cams."""
    require_run(duration)
    parameters = TwoMassParameters.from_rig(cam_set.rig)
    fitted = {cam: published.table_2_jump[cam].rpm for cam in published.table_2_defined}
    if not set(fitted) <= set(cam_set.cams):
        raise ConfigError(
            f"--refit: cams are {', '.join(cam_set.cams)}; needed: {', '.join(fitted)}"
        )
    found = refit(cam_set.cams, fitted, parameters, duration, progress)
    best = found.numbers
    rig = cam_set.rig.with_follower(
        stem_stiffness=best.stem_stiffness, roller_share=best.roller_share, preload=best.preload
    ).model_copy(update={"name": f"{cam_set.rig.name}_refitted"})
    cams = {name: with_event(cam, best.event) for name, cam in cam_set.cams.items()}
    laws = {name: build_law(cam) for name, cam in cams.items()}
    known = {
        cam: Reference(row.rpm, row.time_s, "fitted" if cam in fitted else "test")
        for cam, row in published.table_2_jump.items()
    }
    jumps = find_jumps(CamSet(cams, laws, rig), known, duration, None, progress)
    return RefitResult(found, jumps)


def refit(
    cams: dict[str, CamConfig],
    published: dict[str, float],
    parameters: TwoMassParameters,
    duration: float,
    progress: Progress = NULL_PROGRESS,
) -> Refit:
    """Search the four numbers, from the rig's own and scattered about it; ``published`` in rpm."""
    event = event_of(cams[cam] for cam in published)
    share = parameters.roller_mass / (parameters.roller_mass + parameters.end_mass)
    start = Numbers(event, parameters.stem_stiffness, share, parameters.preload)
    best = math.inf
    progress.start(None, "searching")

    def difference(cam: str, numbers: Numbers) -> float:
        """Found less published speed, relative; a trial without a jump speed is far off."""
        rpm = published[cam]
        laws, trial = refitted({cam: cams[cam]}, parameters, numbers)
        try:
            return find_jump_speed(laws[cam], trial, duration, BELOW * rpm) / RPM / rpm - 1.0
        except CamRigError:
            return -(1.0 - BELOW)

    def differences(x: FloatArray) -> FloatArray:
        nonlocal best
        numbers = start.times(x)
        found = [difference(cam, numbers) for cam in published]
        best = min(best, rms(found))
        progress.describe(f"best {100 * best:.3f} % r.m.s.")
        return np.array(found)

    ended = _solutions(differences, start)
    names = list(published)
    rounding = ROUNDED_TO / math.sqrt(12.0) / np.array(list(published.values()))
    spread = np.linalg.pinv(_slopes(differences, ended[0].x)) * rounding
    return Refit(
        start=start,
        before=dict(zip(names, differences(np.zeros(4)).tolist(), strict=True)),
        after=dict(zip(names, ended[0].fun.tolist(), strict=True)),
        deviation=np.sqrt((spread**2).sum(axis=1)),
        rounding=rms(rounding),
        solutions=tuple(
            Solution(f"refitted, {i}", start.times(s.x), rms(s.fun)) for i, s in enumerate(ended, 1)
        ),
    )


def refitted(
    cams: dict[str, CamConfig], parameters: TwoMassParameters, numbers: Numbers
) -> tuple[dict[str, Law], TwoMassParameters]:
    """The laws and the follower as the numbers make them."""
    total = parameters.roller_mass + parameters.end_mass
    follower = replace(
        parameters,
        stem_stiffness=numbers.stem_stiffness,
        roller_mass=numbers.roller_share * total,
        end_mass=(1.0 - numbers.roller_share) * total,
        preload=numbers.preload,
    )
    laws = {name: build_law(with_event(cam, numbers.event)) for name, cam in cams.items()}
    return laws, follower


def _solutions(
    differences: Callable[[FloatArray], FloatArray], start: Numbers
) -> list[OptimizeResult]:
    """Where several starts end, the rig's own among them; the best first."""
    generator = np.random.default_rng(SEED)
    most = np.log([1.15, REACH, min(REACH, 0.95 / start.roller_share), REACH])
    options = dict[str, Any](diff_step=np.full(4, STEP), x_scale=SCATTER, max_nfev=MAX_STEPS)
    solutions = []
    for i in range(STARTS):
        x = np.clip(generator.normal(size=4) * SCATTER * (i > 0), -0.9 * most, 0.9 * most)
        solutions.append(least_squares(differences, x, bounds=(-most, most), **options))
    return sorted(solutions, key=lambda s: float(s.cost))


def _slopes(differences: Callable[[FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """``(4, 4)``: how the differences change with each number, over `ABOUT` on either side.

    A speed may step where another resonance is the first to lift; a wide step sees past that.
    """
    sides = [(differences(x + step), differences(x - step)) for step in ABOUT * np.eye(4)]
    return np.stack([(up - down) / (2.0 * ABOUT) for up, down in sides], axis=1)


# What is asked for: the jump speeds of cams, or the rig fitted anew.


@checked
def jump(
    cams: Cams = None,
    rig: Rig = None,
    *,
    from_rest: float | None = None,
    steady: bool = False,
    ramp: float | None = None,
    refit: bool = False,
    progress: Progress = NULL_PROGRESS,
) -> JumpResult | RefitResult:
    """The jump speed of cams to 0.01 rpm, beside the paper's Table 2.

    `jump_speed` is that of one law on a rig of one's own, or on many.

    The command is ``cam-rig jump``.

    Parameters
    ----------
    cams : a name, a path or a cam, or several; or one scene. None: the paper's Table 2
    rig : a name, a path or a rig; None: the scene's, or the only one beside the cams, else
        ``paper_table2``
    from_rest : s, length of runs from rest at one speed; None: 1.7 s, as the paper
    steady : in steady state instead
    ramp : rpm/s, along a ramp from rest instead
    refit : fit the four numbers of the rig that the paper does not print anew; a minute
    progress : told how far it is

    Raises
    ------
    ConfigError : an unknown cam, rig or scene; more than one kind of run, or a wrong one
    DynamicsError : a cam that never jumps

    Examples
    --------
    >>> import cam_rig
    >>> cam_rig.jump(["poly345"], steady=True).to_pandas().rpm.round(1).tolist()
    [414.5]
    """
    if sum((steady, ramp is not None, from_rest is not None)) > 1:
        raise ConfigError("steady, ramp and from rest are three kinds of run; allowed: one of them")
    if refit and (steady or ramp is not None):
        raise ConfigError("a refit is of runs from rest; allowed: without steady and ramp")
    published, cam_set = load_tables(tables_path()), asked_cams(cams, rig)
    seconds = FROM_REST if from_rest is None else from_rest
    if refit:
        return refit_rig(cam_set, published, seconds, progress)
    duration = None if steady else seconds
    return find_jumps(cam_set, references(cam_set, published), duration, ramp, progress)

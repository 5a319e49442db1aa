"""Parameters of the two-mass rig, fitted to the jump speeds of the paper.

The paper does not state them. Event angle of every rise and fall, stem stiffness, mass share of the
roller, and preload are fitted to the four laws of table 2 that the paper defines. Four numbers that
are fitted to four speeds are not verified by these speeds. The fifth law and the times, which are
not fitted, are the test.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

import cam_rig
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.two_masses import REST_DURATION_S, find_jump_speed
from cam_rig.errors import CamRigError, ConfigError
from cam_rig.laws import Law, build_law
from cam_rig.schema import CamConfig, load_tables
from cam_rig.schema.load import tables_path
from cam_rig.units import RPM, TURN, FloatArray, rms
from examples.paper.common import CAMS, RIG, Table, parser, publish


def event_of(cams: Iterable[CamConfig]) -> float:
    """Return the angle (rad) of a rise of the first cam that has dwells."""
    for cam in cams:
        moving = [s.span.si for s in cam.segments if s.law != "dwell"]
        if len(moving) < len(cam.segments):
            return 0.5 * sum(moving)
    raise ConfigError("no cam has a dwell; needed: one, its rises have the event angle")


def with_event(cam: CamConfig, event: float, high_dwell: float | None = None) -> CamConfig:
    """Return a cam whose rises and falls each extend over ``event`` rad.

    A cam that moves during the whole turn is returned unchanged. Segments of a rise share its angle
    in the same proportion as before. The high dwell extends over ``high_dwell`` rad, and the low
    dwells over the rest. Without ``high_dwell`` all dwells share the rest in the same proportion as
    before.
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
    """Return the type of each segment: event, low dwell, or high dwell.

    A high dwell is above half the lift.
    """
    kinds, end = [], 0.0
    for segment in cam.segments:
        end = getattr(segment, "to", end)
        dwell = "high" if end > 0.5 else "low"
        kinds.append(dwell if segment.law == "dwell" else "event")
    return kinds


#: Largest factor between a parameter and its start value.
MAX_FACTOR = 3.0
#: Step of numerical derivatives in the search.
DERIVATIVE_STEP = 1e-3
#: Relative step on both sides for the standard errors of the parameters.
ERROR_STEP = 0.02
#: Number of starts. The first is at the parameters of the rig file.
STARTS = 3
#: Standard deviations of the logarithms of the other starts.
SCATTER = np.array([0.02, 0.4, 0.15, 0.3])
#: Random seed of the other starts.
SEED = 1
#: Largest number of steps per search.
MAX_STEPS = 20
#: First speed of a search for a jump speed, relative to the published speed.
START_RATIO = 0.6
#: Step (rpm) of the speeds in table 2.
ROUNDED_TO = 5.0


@dataclass(frozen=True)
class Numbers:
    """Event angle (rad), stem stiffness (N/m), mass share of the roller, preload (N)."""

    event: float
    stem_stiffness: float
    roller_share: float
    preload: float

    def times(self, x: FloatArray) -> Numbers:
        """Return the parameters multiplied by e^x."""
        return Numbers(*(np.array(astuple(self)) * np.exp(x)).tolist())


@dataclass(frozen=True)
class Solution:
    """Parameters, name of the start, and r.m.s. of the relative differences."""

    start: str
    numbers: Numbers
    rms: float


@dataclass(frozen=True, eq=False)
class Refit:
    """Result of the fit: solutions, relative differences, and standard deviations.

    ``before`` and ``after`` are relative differences by cam. ``deviation`` is the relative standard
    deviation of event, stem, share and preload that the rounding of the published speeds causes
    near the best solution. ``rounding`` is that of the speeds. ``solutions`` has the result of each
    start, the best first.
    """

    start: Numbers
    before: dict[str, float]
    after: dict[str, float]
    deviation: FloatArray
    rounding: float
    solutions: tuple[Solution, ...]

    @property
    def numbers(self) -> Numbers:
        """Parameters of the best solution."""
        return self.solutions[0].numbers

    @property
    def rms(self) -> tuple[float, float]:
        """R.m.s. of the relative differences before and after the fit."""
        return rms(list(self.before.values())), rms(list(self.after.values()))


def refit(
    cams: dict[str, CamConfig],
    published: dict[str, float],
    parameters: TwoMassParameters,
    duration: float,
    describe: Callable[[str], object] = lambda _text: None,
) -> Refit:
    """Search for the four parameters, from those of the rig and from random starts.

    ``published`` are jump speeds in rpm.
    """
    event = event_of(cams[cam] for cam in published)
    share = parameters.roller_mass / (parameters.roller_mass + parameters.end_mass)
    start = Numbers(event, parameters.stem_stiffness, share, parameters.preload)
    best = math.inf

    def difference(cam: str, numbers: Numbers) -> float:
        """Return the relative difference from the published speed.

        A trial without a jump speed has a large difference.
        """
        rpm = published[cam]
        laws, trial = refitted({cam: cams[cam]}, parameters, numbers)
        try:
            return find_jump_speed(laws[cam], trial, duration, START_RATIO * rpm) / RPM / rpm - 1.0
        except CamRigError:
            return -(1.0 - START_RATIO)

    def differences(x: FloatArray) -> FloatArray:
        nonlocal best
        numbers = start.times(x)
        values = [difference(cam, numbers) for cam in published]
        best = min(best, rms(values))
        describe(f"best {100 * best:.3f} % r.m.s.")
        return np.array(values)

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
    """Return the laws and the follower with the fitted parameters."""
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
    """Return the results of all starts, the best first.

    The first start is at the parameters of the rig.
    """
    generator = np.random.default_rng(SEED)
    most = np.log([1.15, MAX_FACTOR, min(MAX_FACTOR, 0.95 / start.roller_share), MAX_FACTOR])
    options = dict[str, Any](
        diff_step=np.full(4, DERIVATIVE_STEP), x_scale=SCATTER, max_nfev=MAX_STEPS
    )
    solutions = []
    for i in range(STARTS):
        x = np.clip(generator.normal(size=4) * SCATTER * (i > 0), -0.9 * most, 0.9 * most)
        solutions.append(least_squares(differences, x, bounds=(-most, most), **options))
    return sorted(solutions, key=lambda s: float(s.cost))


def _slopes(differences: Callable[[FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """Return the derivatives of the differences by the parameters, ``(4, 4)``.

    The step is `ERROR_STEP` on both sides. It averages over steps of the jump speed, which occur
    where contact is first lost at another resonance.
    """
    sides = [(differences(x + step), differences(x - step)) for step in ERROR_STEP * np.eye(4)]
    return np.stack([(up - down) / (2.0 * ERROR_STEP) for up, down in sides], axis=1)


def tables(result: Refit) -> list[Table]:
    """Return a table of the rig and of all solutions, and a table of standard errors."""
    rows = [Solution("as it is", result.start, result.rms[0]), *result.solutions]
    return [
        Table(
            "Refit of four numbers to four jump speeds",
            "rig | r.m.s. difference [%] :.2f | event angle [°] :.5g | stem stiffness [N/m] :.5g "
            "| mass split, roller :.5g | preload [N] :.5g",
            [
                (
                    row.start,
                    100.0 * row.rms,
                    math.degrees(row.numbers.event),
                    row.numbers.stem_stiffness,
                    row.numbers.roller_share,
                    row.numbers.preload,
                )
                for row in rows
            ],
        ),
        Table(
            "Standard errors from the rounding of the paper's Table 2 alone, near the best",
            "event angle [%] :.1f | stem stiffness [%] :.1f | roller share [%] :.1f "
            "| preload [%] :.1f | rounding of a speed [%] :.2f",
            [(*(100.0 * result.deviation).tolist(), 100.0 * result.rounding)],
        ),
    ]


def jumps(result: Refit, duration: float) -> Table:
    """Return a table of the jump speeds of all cams of table 2 on the fitted rig."""
    best, rig = result.numbers, cam_rig.load_rig(RIG)
    rig = rig.with_follower(
        stem_stiffness=best.stem_stiffness, roller_share=best.roller_share, preload=best.preload
    )
    published, rows = load_tables(tables_path()), []
    for cam in CAMS:
        law = build_law(with_event(cam_rig.load_cam(cam), best.event))
        rpm, printed = cam_rig.jump_speed(law, rig, duration=duration).rpm, published.table_2_jump
        role = "fitted" if cam in published.table_2_defined else "test"
        rows.append((cam, rpm, printed[cam].rpm, 100.0 * (rpm / printed[cam].rpm - 1.0), role))
    columns = "cam | jump speed [rpm] :.2f | Table 2 [rpm] :.0f | difference [%] :+.2f | role"
    return Table("Jump speeds on the refitted rig", columns, rows)


def summary(result: Refit) -> list[str]:
    """Return the r.m.s. differences before and after, and that of rounding, as text."""
    before, after = result.rms
    return [
        f"rig as it is: {100 * before:.2f} % r.m.s.; refitted: {100 * after:.2f} % r.m.s.; "
        f"rounding of Table 2 alone: {100 * result.rounding:.2f} %"
    ]


def study(duration: float = REST_DURATION_S, describe: Callable[[str], object] = print) -> Refit:
    """Fit the four parameters of the shipped rig to the laws that the paper defines."""
    published = load_tables(tables_path())
    speeds = {cam: published.table_2_jump[cam].rpm for cam in published.table_2_defined}
    cams = {cam: cam_rig.load_cam(cam) for cam in speeds}
    parameters = TwoMassParameters.from_rig(cam_rig.load_rig(RIG))
    return refit(cams, speeds, parameters, duration, describe)


# -- degree of the fifth law of the paper, which the paper does not state

#: Cam with the fifth law of the paper.
BY_SEGMENTS = "bezier_segments"
#: Degrees of the available half-rises (laws thesis, eq. 3.4-3.9).
DEGREES = (4, 6, 8)
_HALF = re.compile(r"bezier\d+_(start|end)")


def jump_by_degree(
    cam: CamConfig, parameters: TwoMassParameters, duration: float
) -> dict[int, float]:
    """Return the jump speed (rpm) from rest with half-rises of each degree.

    The result is empty for a cam without half-rises.
    """
    if not any(_HALF.fullmatch(segment.law) for segment in cam.segments):
        return {}
    result = {}
    for degree in DEGREES:
        segments = [
            segment.model_copy(update={"law": _HALF.sub(rf"bezier{degree}_\1", segment.law)})
            for segment in cam.segments
        ]
        law = build_law(cam.model_copy(update={"segments": segments}))
        result[degree] = find_jump_speed(law, parameters, duration) / RPM
    return result


def main(argv: Sequence[str] | None = None) -> None:
    """Run the experiment, which needs a minute."""
    arguments = parser(__doc__)
    arguments.add_argument(
        "--from-rest", type=float, default=REST_DURATION_S, help="length of a run, s (%(default)s)"
    )
    given = arguments.parse_args(argv)
    result = study(given.from_rest)
    publish(given.out, [*tables(result), jumps(result, given.from_rest)], {}, summary(result))


if __name__ == "__main__":
    main()

"""Search for the identified numbers of a reading of table 2 of the paper.

The miss of a trial is a distance in speed (rpm) for each cam: contact must be lost at the printed
speed, and not at 5 rpm or more below it. With the printed times, it must be lost for the first time
in the turn of the printed time. The miss follows from the forces of the turns and their change over
5 rpm, so that it decreases towards a solution. The search is global (differential evolution), and
all trials of a generation are computed together.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, differential_evolution

import cam_rig
from cam_rig.schema.quantity import Quantity
from cam_rig.units import RPM, TURN, FloatArray
from examples.paper.common import parser
from examples.paper.readings import (
    FIRST_RPM,
    FOLLOWER,
    GRID_RPM,
    TABLE_2,
    load_readings,
    read,
    tables,
)
from examples.paper.refit import with_event
from examples.paper.turns import Rigs, ShapeTable, turn_minima

#: Bounds of the free parameters in SI units, in the order of the search.
BOUNDS = {
    "event": (math.radians(95.0), math.radians(140.0)),
    "high_dwell": (math.radians(20.0), math.radians(160.0)),
    "stem_stiffness": (1e5, 1e8),
    "roller_share": (0.05, 0.95),
    "stem_damping": (0.01, 30.0),
    "damping": (0.01, 30.0),
    "preload": (0.0, 60.0),
}
#: Parameters whose logarithm is searched.
LOGARITHMIC = frozenset({"stem_stiffness", "stem_damping", "damping"})
#: Points per turn at slower speeds, where the envelope of the vibration is sufficient.
OUTLINE_POINTS = 160
#: Upper limit (rpm) of the miss of a trial.
MAX_MISS = 50.0
#: Smallest accepted window (rpm) of a printed time.
MIN_WINDOW = 0.02
#: Miss (rpm) that is added if contact is first lost in the printed turn at no speed.
NO_WINDOW = 2.0
#: Smallest change of the force (N/rpm), so that a miss is finite.
MIN_SLOPE = 0.2
#: Smallest width of the low dwell (rad).
MIN_LOW_DWELL = math.radians(5.0)
#: Options of the differential evolution: 40 trials per parameter, computed together, no early end.
EVOLUTION: dict[str, Any] = {
    "popsize": 40,
    "vectorized": True,
    "updating": "deferred",
    "init": "sobol",
    "polish": False,
    "tol": 0.0,
    "atol": 0.0,
    "mutation": (0.4, 0.9),
    "recombination": 0.8,
}


@dataclass(frozen=True, eq=False)
class Trials:
    """Cam of the table, for many trial rigs.

    The spans (rad) of its pieces are row 0 of `spans` `(3, n)`, plus the event angle times row 1,
    plus the high dwell times row 2. `printed` is its speed (rpm) and time (s).
    """

    shape: ShapeTable
    outline: ShapeTable
    spans: FloatArray
    printed: tuple[float, float]

    @classmethod
    def of(cls, cam: str, printed: tuple[float, float]) -> Trials:
        """Prepare a shipped cam for any event angle and high dwell.

        A cam that moves during the whole turn does not depend on them.
        """
        event, high, step = BOUNDS["event"][0], BOUNDS["high_dwell"][0], 0.25
        config = cam_rig.load_cam(cam)
        law, wider, longer = (
            cam_rig.build_law(with_event(config, event + de, high + dh))
            for de, dh in ((0.0, 0.0), (step, 0.0), (0.0, step))
        )
        slopes = np.stack([wider.spans - law.spans, longer.spans - law.spans]) / step
        spans = np.concatenate([[law.spans - np.array([event, high]) @ slopes], slopes])
        return cls(ShapeTable.of(law), ShapeTable.of(law, OUTLINE_POINTS), spans, printed)

    def misses(
        self, numbers: Mapping[str, FloatArray], run: float, nearby: bool
    ) -> tuple[FloatArray, FloatArray]:
        """Return the distances (rpm) of each trial from printed speed and time.

        The shape of both is `(b,)`. Up to the next slower speed of the grid the envelope of the
        vibration must be in contact, which `nearby` omits. The miss of the time is the distance of
        the printed speed from a speed at which the force is zero for the first time in the turn
        nearest to the printed time.
        """
        event, high = numbers["event"], numbers["high_dwell"]
        spans = self.spans[0] + np.outer(event, self.spans[1]) + np.outer(high, self.spans[2])
        roller = numbers["roller_share"] * numbers["mass"]
        rigs = Rigs(roller, numbers["mass"] - roller, *(numbers[name] for name in FOLLOWER))
        rpm, time = self.printed
        turns = math.ceil(run * rpm / 60.0)
        force, angle = turn_minima(self.shape, spans, rigs, rpm * RPM, turns)
        slower_turns = turn_minima(self.shape, spans, rigs, (rpm - GRID_RPM) * RPM, turns)
        least, below = force.min(axis=1), slower_turns.force.min(axis=1)
        slope = np.maximum((below - least) / GRID_RPM, MIN_SLOPE)
        miss = np.maximum(np.maximum(least, -below), 0.0) / slope
        for slower in np.arange(rpm if nearby else FIRST_RPM, rpm - 1.5 * GRID_RPM, GRID_RPM):
            outline = turn_minima(self.outline, spans, rigs, slower * RPM, turns)
            lost = outline.force.min(axis=1) < 0.0
            miss = np.maximum(miss, np.where(lost, rpm - slower, 0.0))
        lowest = angle[np.arange(force.shape[0]), force.argmin(axis=1)]
        nearest = np.rint((time * rpm * RPM - lowest) / TURN).astype(np.intp)
        return miss, _time_miss(force, np.clip(nearest, 1, force.shape[1] - 1), slope)


def _time_miss(force: FloatArray, first: NDArray[np.intp], slope: FloatArray) -> FloatArray:
    """Return the distance (rpm) from a first loss of contact in turn `first`.

    The window of the turn must be at least `MIN_WINDOW` rpm.
    """
    lowest, rows = np.minimum.accumulate(force, axis=1), np.arange(force.shape[0])
    at_first, before = lowest[rows, first] / slope, lowest[rows, first - 1] / slope
    miss = np.maximum(np.maximum(0.0, at_first + MIN_WINDOW), np.maximum(0.0, -before))
    narrow = np.maximum(0.0, MIN_WINDOW - (before - at_first))
    return np.asarray(miss + np.where(narrow > 0.0, NO_WINDOW + narrow, 0.0))


class Best(NamedTuple):
    """Best trial: free parameters in SI units, miss (rpm), and number of trials."""

    numbers: dict[str, float]
    miss: float
    trials: int


def search(
    fixed: Mapping[str, float],
    free: Sequence[str],
    run: float,
    *,
    use_times: bool = False,
    nearby: bool = False,
    generations: int = 60,
    seed: int = 1,
    table: Mapping[str, tuple[float, float]] = TABLE_2,
) -> Best:
    """Search for the `free` parameters with the smallest sum of misses of all cams.

    `free` are keys of `BOUNDS`. `fixed` parameters are in SI units, and `run` is the duration (s)
    of each run from rest. With `use_times` the printed times are included.
    """
    trials, count = [Trials.of(cam, printed) for cam, printed in table.items()], 0

    def numbers_at(x: FloatArray) -> dict[str, FloatArray]:
        """Return all parameters, `(b,)` each, at positions `(free, b)` of the search."""
        numbers = {key: np.full(x.shape[1], value) for key, value in fixed.items()}
        for key, row in zip(free, x, strict=True):
            numbers[key] = np.exp(row) if key in LOGARITHMIC else row
        longest = TURN - 2.0 * numbers["event"] - MIN_LOW_DWELL
        return numbers | {"high_dwell": np.minimum(numbers["high_dwell"], longest)}

    def miss(x: FloatArray) -> Any:  # the type stubs allow only one trial per call
        numbers = numbers_at(x)
        parts = [trial.misses(numbers, run, nearby) for trial in trials]
        speeds, times = (
            np.minimum(part, MAX_MISS).sum(axis=0) for part in zip(*parts, strict=True)
        )
        return speeds + times if use_times else speeds

    def report(intermediate_result: Any) -> bool:
        nonlocal count
        count += 1
        print(f"generation {count}: best misses {intermediate_result.fun:.2f} rpm in all")
        return bool(intermediate_result.fun <= 0.0)

    limits = [np.log(BOUNDS[key]) if key in LOGARITHMIC else np.array(BOUNDS[key]) for key in free]
    options = EVOLUTION | {"maxiter": generations, "rng": seed, "callback": report}
    result = differential_evolution(miss, Bounds(*np.stack(limits, axis=1)), **options)
    best = numbers_at(result.x[:, None])
    numbers = {key: float(best[key][0]) for key in free}
    return Best(numbers, float(result.fun), (count + 1) * result.population.shape[0])


def main(argv: Sequence[str] | None = None) -> None:
    """Search for a minute or more, and print the results of the best trial."""
    readings, run = load_readings()
    command = parser(__doc__)
    command.add_argument("name", choices=sorted(readings), help="reading to search again")
    command.add_argument("--use-times", action="store_true", help="by the printed times too")
    command.add_argument("--nearby", action="store_true", help="omit the slower speeds")
    command.add_argument("--generations", type=int, default=60, help="number (%(default)s)")
    command.add_argument("--seed", type=int, default=1, help="of the search (%(default)s)")
    chosen = command.parse_args(argv)
    reading = readings[chosen.name]
    numbers = {key: value.si for key, value in reading if isinstance(value, Quantity)}
    free = [key for key in BOUNDS if key in reading.fitted]
    best = search(
        numbers,
        free,
        run,
        use_times=chosen.use_times,
        nearby=chosen.nearby,
        generations=chosen.generations,
        seed=chosen.seed,
    )
    changed = {key: getattr(reading, key).with_si(value) for key, value in best.numbers.items()}
    for table in tables([read(chosen.name, reading.model_copy(update=changed), run)]):
        print(table)
    print(f"best of {best.trials} trials, misses {best.miss:.2f} rpm in all")


if __name__ == "__main__":
    main()

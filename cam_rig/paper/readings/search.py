"""The search behind the readings of Table 2: which rig shows its speeds, and its times.

Of every trial it is asked by how many rpm each cam misses the table: at the printed speed contact
must be lost, 5 rpm and more below it must not; and where times are sought too, at the printed speed
it must be lost first in the turn of the printed time. Both are distances in speed, from the forces
of the turns and how they change over 5 rpm, so that a trial that misses knows how far.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, differential_evolution

from cam_rig.errors import ConfigError
from cam_rig.laws import build_law
from cam_rig.paper.readings.readings import (
    FIRST_RPM,
    OF_FOLLOWER,
    Rigs,
    ShapeTable,
    turn_minima,
)
from cam_rig.schema import CamConfig, TableReading
from cam_rig.schema.published import PublishedJump
from cam_rig.schema.quantity import Quantity
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.studies.jump.study import ROUNDED_TO, with_event
from cam_rig.units import RPM, TURN, FloatArray

#: What may be sought, where (SI; the logarithm of three of them), in the order of a trial.
BOUNDS = {
    "event": (math.radians(95.0), math.radians(140.0)),
    "high_dwell": (math.radians(20.0), math.radians(160.0)),
    "stem_stiffness": (1e5, 1e8),
    "roller_share": (0.05, 0.95),
    "stem_damping": (0.01, 30.0),
    "damping": (0.01, 30.0),
    "preload": (0.0, 60.0),
}

LOGARITHMIC = frozenset({"stem_stiffness", "stem_damping", "damping"})
#: Points a turn at the slower speeds, where the envelope of the vibration stands for it.
OUTLINE = 160
#: A trial's miss counts up to this, rpm; a time needs a window of at least this many rpm.
MAX_MISS, MIN_WINDOW = 50.0, 0.02
#: What it costs, rpm, where no speed has the printed turn as the first.
NO_WINDOW = 2.0
#: The force falls by this much (N) a rpm at least, so that a miss is finite.
MIN_SLOPE = 0.2
#: Trials side by side, for each number sought.
POPULATION = 40
#: A generation is tried at once; no tolerance ends the search before its last one.
EVOLUTION = dict[str, Any](vectorized=True, updating="deferred", init="sobol", polish=False)
EVOLUTION |= {"tol": 0.0, "atol": 0.0, "mutation": (0.4, 0.9), "recombination": 0.8}
#: The last low dwell is at least this long, rad.
MIN_LOW_DWELL = math.radians(5.0)


@dataclass(frozen=True, eq=False)
class Trials:
    """One cam of the table, to be tried on many rigs.

    Its pieces' spans (rad) are the first row of ``spans`` ``(3, n)``, plus the event times the
    second, plus the high dwell times the third.
    """

    shape: ShapeTable
    outline: ShapeTable
    spans: FloatArray
    printed: PublishedJump

    @classmethod
    def of(cls, cam: CamConfig, printed: PublishedJump) -> Trials:
        """For a cam with any event and high dwell; a law in u is the same at all of them."""
        event, high, step = BOUNDS["event"][0], BOUNDS["high_dwell"][0], 0.25
        laws = [
            build_law(with_event(cam, event + de, high + dh))
            for de, dh in ((0.0, 0.0), (step, 0.0), (0.0, step))
        ]
        here, wider, longer = (law.spans for law in laws)
        slopes = np.stack([wider - here, longer - here]) / step
        return cls(
            ShapeTable.of(laws[0]),
            ShapeTable.of(laws[0], OUTLINE),
            np.concatenate([[here - np.array([event, high]) @ slopes], slopes]),
            printed,
        )

    def misses(
        self, numbers: Mapping[str, FloatArray], run: float, nearby: bool
    ) -> tuple[FloatArray, FloatArray]:
        """By how many rpm each trial misses the printed speed and time, ``(b,)`` each.

        At the printed speed and the next slower one of the grid a miss is a force over how it
        changes with the speed. At still slower ones the envelope of the vibration must keep
        contact, else the miss is how much slower; ``nearby`` leaves these out. The time's miss is
        how far the force at the printed speed is from being zero first in the turn that is nearest
        to the printed time, as a change of speed.
        """
        event, high = numbers["event"], numbers["high_dwell"]
        spans = self.spans[0] + np.outer(event, self.spans[1]) + np.outer(high, self.spans[2])
        rigs, rpm = rigs_of(numbers), self.printed.rpm
        turns = math.ceil(run * rpm / 60.0)
        force, angle = turn_minima(self.shape, spans, rigs, rpm * RPM, turns)
        next_slower = turn_minima(self.shape, spans, rigs, (rpm - ROUNDED_TO) * RPM, turns)
        here, below = force.min(axis=1), next_slower.force.min(axis=1)
        slope = np.maximum((below - here) / ROUNDED_TO, MIN_SLOPE)
        miss = np.maximum(np.maximum(here, -below), 0.0) / slope
        first = rpm if nearby else FIRST_RPM
        for slower in np.arange(first, rpm - 1.5 * ROUNDED_TO, ROUNDED_TO):
            found = turn_minima(self.outline, spans, rigs, slower * RPM, turns)
            lost = found.force.min(axis=1) < 0.0
            miss = np.maximum(miss, np.where(lost, rpm - slower, 0.0))
        # the turn in which the deepest place is nearest to the printed time
        deepest = angle[np.arange(force.shape[0]), force.argmin(axis=1)]
        nearest = np.rint((self.printed.time_s * rpm * RPM - deepest) / TURN).astype(np.intp)
        turn = np.clip(nearest, 1, force.shape[1] - 1)
        return miss, _time_miss(force, turn, slope)


def _time_miss(force: FloatArray, first: NDArray[np.intp], slope: FloatArray) -> FloatArray:
    """By how much (rpm) contact is not first lost in turn ``first``, with a window to spare."""
    deepest = np.minimum.accumulate(force, axis=1)
    rows = np.arange(force.shape[0])
    there, before = deepest[rows, first] / slope, deepest[rows, first - 1] / slope
    miss = np.maximum(np.maximum(0.0, there + MIN_WINDOW), np.maximum(0.0, -before))
    narrow = np.maximum(0.0, MIN_WINDOW - (before - there))
    return np.asarray(miss + np.where(narrow > 0.0, NO_WINDOW + narrow, 0.0))


def rigs_of(numbers: Mapping[str, FloatArray]) -> Rigs:
    """Two-mass followers from trial numbers, ``(b,)`` each, SI."""
    roller = numbers["roller_share"] * numbers["mass"]
    return Rigs(roller, numbers["mass"] - roller, *(numbers[name] for name in OF_FOLLOWER))


@dataclass(frozen=True)
class Found:
    """The best rig of a search: its sought numbers (SI), and the sum of what it misses, rpm."""

    numbers: dict[str, float]
    miss: float
    trials: int


@dataclass(frozen=True, eq=False)
class ReadingSearch:
    """The table's cams, the numbers that are given and those that are sought.

    Numbers are in SI, ``sought`` ones keys of `BOUNDS`, a ``run`` in s from rest. The printed times
    may count; ``nearby``, contact need only hold at the next slower speed of the table's grid.
    """

    trials: Mapping[str, Trials]
    given: Mapping[str, float]
    sought: tuple[str, ...]
    with_times: bool
    run: float
    nearby: bool = False

    @classmethod
    def of(
        cls,
        reading: TableReading,
        cams: Mapping[str, CamConfig],
        printed: Mapping[str, PublishedJump],
        with_times: bool,
        run: float,
        nearby: bool = False,
    ) -> ReadingSearch:
        """Seek the numbers that a reading identified, with the others as they are."""
        sought = tuple(key for key in BOUNDS if key in reading.fitted)
        if not sought:
            raise ConfigError(
                f"{reading.title}: nothing in it is identified; needed: one of {', '.join(BOUNDS)}"
            )
        given = {key: value.si for key, value in reading if isinstance(value, Quantity)}
        trials = {cam: Trials.of(cams[cam], row) for cam, row in printed.items()}
        return cls(trials, given, sought, with_times, run, nearby)

    def numbers(self, x: FloatArray) -> dict[str, FloatArray]:
        """Trial numbers from places ``(sought, b)`` of the search, ``(b,)`` each."""
        found = {key: np.full(x.shape[1], value) for key, value in self.given.items()}
        for key, row in zip(self.sought, x, strict=True):
            found[key] = np.exp(row) if key in LOGARITHMIC else row
        found["high_dwell"] = np.minimum(
            found["high_dwell"], TURN - 2.0 * found["event"] - MIN_LOW_DWELL
        )
        return found

    def misses(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Of every cam, in speed and in time, ``(cams, b)`` each, rpm."""
        numbers = self.numbers(x)
        found = [trial.misses(numbers, self.run, self.nearby) for trial in self.trials.values()]
        speeds, times = (np.array(rows) for rows in zip(*found, strict=True))
        return speeds, times if self.with_times else np.zeros_like(times)

    def best(self, generations: int, seed: int, progress: Progress = NULL_PROGRESS) -> Found:
        """Search by differential evolution, the trials of a generation side by side."""
        progress.start(generations)

        def missed(x: FloatArray) -> Any:  # an array of trials at a time
            both = [np.minimum(part, MAX_MISS).sum(axis=0) for part in self.misses(x)]
            return both[0] + both[1]

        done = [0]

        def tell(intermediate_result: Any) -> Any:
            done[0] += 1
            progress.advance()
            progress.describe(f"best misses {intermediate_result.fun:.2f} rpm in all")
            return intermediate_result.fun <= 0.0

        limits = Bounds(*zip(*map(_bounds, self.sought), strict=True))
        options = dict[str, Any](popsize=POPULATION, maxiter=generations, rng=seed, callback=tell)
        found = differential_evolution(missed, limits, **EVOLUTION, **options)
        numbers = self.numbers(found.x[:, None])
        return Found(
            {key: float(numbers[key][0]) for key in self.sought},
            miss=float(found.fun),
            trials=(done[0] + 1) * found.population.shape[0],
        )


def _bounds(key: str) -> tuple[float, float]:
    low, high = BOUNDS[key]
    return (math.log(low), math.log(high)) if key in LOGARITHMIC else (low, high)

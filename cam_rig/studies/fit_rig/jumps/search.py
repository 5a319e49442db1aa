"""Search for the follower whose jump speeds are closest to those in a table."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby, product

import numpy as np
from scipy.optimize import least_squares, nnls

from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.jump.two_masses import MAX_RPM
from cam_rig.errors import CamRigError
from cam_rig.laws import Law
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.studies.fit_rig.jumps.table import JumpTable
from cam_rig.studies.fit_rig.parameters import (
    TWO_MASS_ONLY,
    build_follower,
    from_search,
    search_limits,
    search_scale,
    to_search,
)
from cam_rig.units import RPM, TURN, FloatArray, rms

#: Keys of the free parameters of one rigid mass.
RIGID = ("mass", "spring_stiffness", "preload", "damping")
#: Keys of the free parameters that a stem adds to `RIGID`.
STEM = ("stem_stiffness", "roller_share")
#: Step of a search variable for a difference quotient, relative to the variable.
DERIVATIVE_STEP = 1e-4
#: Factors of the stem stiffness of additional starts, up to a nearly rigid stem.
STIFFNESS_FACTORS = (10.0, 100.0)
#: Number of additional starts with a stiffer stem that are searched: the best of those tried. A
#: search of two masses takes half a minute.
STIFF_STARTS = 2
#: Number of cam angles per turn at which a start may assume that all readings jump.
BALANCE_ANGLES = 120


@dataclass(frozen=True, eq=False)
class JumpModel:
    """Jump speeds (rpm) of a table's set-ups, as a function of the free parameters.

    ``progress`` is notified of each set-up of a step of the search.
    """

    law: Law
    table: JumpTable
    free: tuple[str, ...]
    fixed: dict[str, float]
    progress: Progress

    @cached_property
    def _setups(self) -> tuple[list[dict[str, float]], list[int]]:
        """Distinct set-ups of the table, and the index of the set-up of each reading."""
        setups = [tuple(sorted(reading.setup.items())) for reading in self.table.readings]
        index = {setup: i for i, setup in enumerate(dict.fromkeys(setups))}
        return [dict(setup) for setup in index], [index[setup] for setup in setups]

    def values(self, x: FloatArray, setup: dict[str, float]) -> dict[str, float]:
        """Return all parameters of the follower in a set-up, by name.

        ``x`` are the search variables. The mass is the follower's plus the added mass.
        """
        values = self.fixed | from_search(self.free, x)
        added_mass = setup.get("mass", 0.0)
        return values | setup | {"mass": max(values["mass"] + added_mass, 1e-9)}

    def speeds(self, x: FloatArray) -> FloatArray:
        """Return the computed jump speeds of all readings in rpm, ``(n,)``.

        ``x`` are the search variables. Equal set-ups are computed once.
        """
        setups, indices = self._setups
        speeds = np.full(len(setups), MAX_RPM)
        self.progress.start(len(setups), "set-ups of a step of the search")
        for i, setup in enumerate(setups):
            self.progress.advance()
            values = self.values(x, setup)
            follower = build_follower(values, values.get("stem_stiffness"))
            with suppress(CamRigError):
                speeds[i] = find_jump(self.law, follower, None).rpm
        return speeds[indices]

    def relative_errors(self, x: FloatArray) -> FloatArray:
        """Return the relative errors of the computed jump speeds, ``(n,)``.

        ``x`` are the search variables.
        """
        return (self.speeds(x) - self.table.rpm) / self.table.rpm

    def search_point(self, values: dict[str, float]) -> tuple[float, ...]:
        """Convert parameter values to search variables within their limits."""
        low, high = search_limits(self.free)
        x = [to_search(name, values[name]) for name in self.free]
        return tuple(np.clip(x, low + 1e-9, high - 1e-9).tolist())


def search_jumps(trial: JumpModel) -> FloatArray:
    """Return the search variables of the least-squares fit, the best of all starts."""
    if not trial.free:
        return np.empty(0)
    rigid = "roller_share" not in trial.fixed  # two masses take a hundred times as long
    tolerance, max_steps = (1e-12, 200) if rigid else (1e-8, 50)
    results = [
        least_squares(
            trial.relative_errors,
            x,
            bounds=search_limits(trial.free),
            x_scale=np.array(list(map(search_scale, trial.free, x))),
            diff_step=np.full(len(x), DERIVATIVE_STEP),
            xtol=tolerance,
            ftol=tolerance,
            gtol=1e-14,
            max_nfev=max_steps,
        )
        for x in _starts(trial)
    ]
    return np.asarray(min(results, key=lambda result: result.cost).x)


def _starts(trial: JumpModel) -> list[tuple[float, ...]]:
    """Return the search variables from which searches start.

    A stem may be nearly rigid. The best starts with a stiffer stem are therefore added. Case: exact
    speeds of two masses, where the best single start leads to another follower
    (``test_roller_share_is_identified``).
    """
    candidates = [trial.fixed | start for start in ({}, *_balanced_starts(trial))]
    starts = dict.fromkeys(map(trial.search_point, candidates))
    if "stem_stiffness" in trial.free:
        stiff = [
            trial.search_point(values | {"stem_stiffness": values["stem_stiffness"] * factor})
            for values, factor in product(candidates, STIFFNESS_FACTORS)
        ]
        stiff.sort(key=lambda x: rms(trial.relative_errors(np.array(x))))
        starts |= dict.fromkeys(stiff[:STIFF_STARTS])
    return list(starts)


def _balanced_starts(trial: JumpModel) -> Iterator[dict[str, float]]:
    """Yield values of one mass with which all readings jump at the same cam angle.

    Damping raises the jump speeds of a rise and lowers those of a fall. The sum of squares
    therefore has a minimum for each part of the turn in which s'' < 0 and s' keeps its sign. Case:
    random machines far from the start (``test_result_does_not_depend_on_the_start``).
    """
    fixed = {name: value for name, value in trial.fixed.items() if name not in TWO_MASS_ONLY}
    free = tuple(name for name in trial.free if name in RIGID)
    rigid = replace(trial, free=free, fixed=fixed, progress=NULL_PROGRESS)
    angles = np.linspace(0.0, TURN, BALANCE_ANGLES, endpoint=False)
    motion = np.stack([trial.law(angles, order) for order in range(3)], axis=1)
    for (decelerates, _), part in groupby(motion, key=lambda m: (m[2] < 0.0, m[1] < 0.0)):
        if decelerates and free:
            candidates = (_solve_balance(rigid, *m) for m in part)
            yield min(
                candidates,
                key=lambda values: rms(rigid.relative_errors(np.array(rigid.search_point(values)))),
            )


def _solve_balance(
    rigid: JumpModel, lift: float, slope: float, curvature: float
) -> dict[str, float]:
    """Return the parameters with which all readings jump at one cam angle.

    They satisfy m s'' Ω² + c s' Ω + k s + preload = 0 with s, s' and s'' of the angle, by least
    squares. The equation is linear in the parameters.
    """
    speed = rigid.table.rpm * RPM
    weights = {
        "mass": np.full_like(speed, curvature),
        "spring_stiffness": lift / speed**2,
        "preload": 1.0 / speed**2,
        "damping": slope / speed,
    }
    fixed_part = np.zeros_like(speed)
    for name, weight in weights.items():
        fixed_part += weight * [reading.setup.get(name, 0.0) for reading in rigid.table.readings]
        if name not in rigid.free and (name == "mass" or name not in rigid.table.columns):
            fixed_part += weight * rigid.fixed[name]
    matrix = np.stack([weights[name] for name in rigid.free], axis=1)
    size = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    solution = dict(zip(rigid.free, nnls(matrix / size, -fixed_part)[0] / size, strict=True))
    # no follower jumps with a parameter of 0, except the damping
    return rigid.fixed | {n: float(v) for n, v in solution.items() if v > 0.0 or n == "damping"}


#: Ratio of the smaller to the larger of the changes in the two directions, below which a derivative
#: is taken as zero.
ONE_SIDED_RTOL = 1e-3


def _jacobian(trial: JumpModel, x: FloatArray) -> FloatArray:
    jacobian = np.empty((len(trial.table.readings), x.size))
    low, high = search_limits(trial.free)
    scales = np.array(list(map(search_scale, trial.free, x.tolist())))
    speeds = trial.speeds(x)
    for k, step in enumerate(np.diag(DERIVATIVE_STEP * scales)):
        ends = [np.clip(x + sign * step, low, high) for sign in (1.0, -1.0)]
        above, below = (trial.speeds(end) for end in ends)
        jacobian[:, k] = (above - below) / (ends[0] - ends[1])[k]
        # a speed that changes in one direction only fits all values in the other direction
        sides = np.abs([above - speeds, speeds - below])
        if low[k] < ends[1][k] and ends[0][k] < high[k]:
            jacobian[sides.min(axis=0) < ONE_SIDED_RTOL * sides.max(axis=0), k] = 0.0
    return jacobian

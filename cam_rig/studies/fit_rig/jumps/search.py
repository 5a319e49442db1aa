"""Search for the follower whose jump speeds are closest to those of a table.

A search variable is the value or the logarithm of a free parameter.
"""

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

#: Rig-file keys of the free parameters of a follower with one rigid mass.
RIGID = ("mass", "spring_stiffness", "preload", "damping")
#: Rig-file keys of the additional free parameters of a follower with two masses and a stem.
STEM = ("stem_stiffness", "roller_share")
#: Step of a search variable for a difference quotient, relative to the scale of the variable.
DERIVATIVE_STEP = 1e-4
#: Factors by which the stem stiffness of a start point is increased to obtain additional start
#: points, up to a nearly rigid stem.
STIFFNESS_FACTORS = (10.0, 100.0)
#: Number of start points with a stiffer stem from which a search is run: those with the smallest
#: error. The number is small because a search of two masses takes half a minute.
STIFF_STARTS = 2
#: Number of cam angles per turn for which start values are computed. Each assumes that contact is
#: lost at this angle in all readings.
BALANCE_ANGLES = 120


@dataclass(frozen=True, eq=False)
class JumpModel:
    """Jump speeds (rpm) of a table's set-ups, as a function of the free parameters.

    A set-up is the added mass, spring and preload of one reading. ``free`` are the names of the
    free parameters, ``fixed`` all start or known values in SI. ``progress`` is notified of each
    computed set-up.
    """

    law: Law
    table: JumpTable
    free: tuple[str, ...]
    fixed: dict[str, float]
    progress: Progress

    @cached_property
    def _setups(self) -> tuple[list[dict[str, float]], list[int]]:
        """Distinct set-ups of the table, and the index of each reading's set-up.

        A set-up is the added mass, spring and preload with which a jump speed was measured.
        """
        setups = [tuple(sorted(reading.setup.items())) for reading in self.table.readings]
        index = {setup: i for i, setup in enumerate(dict.fromkeys(setups))}
        return [dict(setup) for setup in index], [index[setup] for setup in setups]

    def values(self, x: FloatArray, setup: dict[str, float]) -> dict[str, float]:
        """Return all parameters (SI) of the follower in one set-up, by name.

        A set-up is a combination of added mass (kg), preload (N) and similar changes for which the
        table has a measured jump speed. ``setup`` contains these changes by name. ``x`` are the
        search variables. The returned mass is that of the follower plus the added mass.
        """
        values = self.fixed | from_search(self.free, x)
        added_mass = setup.get("mass", 0.0)
        return values | setup | {"mass": max(values["mass"] + added_mass, 1e-9)}

    def speeds(self, x: FloatArray) -> FloatArray:
        """Return the computed jump speeds of all readings in rpm, ``(n,)``.

        ``x`` are the search variables. Each distinct set-up is computed once. A follower without a
        jump speed gets `MAX_RPM`.
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
        """Return (computed - measured) / measured jump speed of all readings, ``(n,)``.

        ``x`` are the search variables.
        """
        return (self.speeds(x) - self.table.rpm) / self.table.rpm

    def search_point(self, values: dict[str, float]) -> tuple[float, ...]:
        """Convert parameter values (SI) to search variables, clipped to their limits."""
        low, high = search_limits(self.free)
        x = [to_search(name, values[name]) for name in self.free]
        return tuple(np.clip(x, low + 1e-9, high - 1e-9).tolist())


def search_jumps(trial: JumpModel) -> FloatArray:
    """Return the search variables of the least-squares fit to jump speeds, ``(n,)``.

    A search is run from each start point, and the result with the smallest error is returned. The
    result is empty if no parameter is free.
    """
    if not trial.free:
        return np.empty(0)
    rigid = "roller_share" not in trial.fixed  # jump speeds of two masses take 100 times as long
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
    """Return the points (values of the search variables) from which searches are run.

    The stem of the measured follower may be nearly rigid, so the best points with a stiffer stem
    are added. Case: exact speeds of two masses, where a search from the best single point converges
    to a different follower (``test_roller_share_is_identified``).
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
    """Yield start values of one mass with which all readings lift off at one angle.

    Damping raises the jump speed if contact is lost in a rise, and lowers it in a fall. The sum of
    squares therefore has a separate minimum for each part of the turn in which s'' < 0 and s' keeps
    its sign. The best cam angle of each such part gives one start. Case: random machines far from
    the start values (``test_result_does_not_depend_on_the_start``).
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
    """Return the parameters (SI) with which all readings lift off at one cam angle.

    ``lift``, ``slope`` and ``curvature`` are s, s' and s'' of the law at this angle. The parameters
    satisfy m s'' Ω² + c s' Ω + k s + preload = 0 for the speeds Ω of all readings, by least
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
    # Only the damping may be 0. Any other parameter of 0 is replaced by its start value.
    return rigid.fixed | {n: float(v) for n, v in solution.items() if v > 0.0 or n == "damping"}


#: If a step of a parameter down and a step up change a jump speed by amounts whose ratio (smaller
#: to larger) is below this value, the derivative is set to zero.
ONE_SIDED_RTOL = 1e-3


def _jacobian(trial: JumpModel, x: FloatArray) -> FloatArray:
    """Return the derivatives of jump speeds (rpm) by the search variables, ``(m, n)``.

    They are central differences at the search variables ``x``. A derivative is set to zero if the
    speed changes on one side only: the values on the other side then fit equally well, and the
    reading does not identify the parameter.
    """
    jacobian = np.empty((len(trial.table.readings), x.size))
    low, high = search_limits(trial.free)
    scales = np.array(list(map(search_scale, trial.free, x.tolist())))
    speeds = trial.speeds(x)
    for k, step in enumerate(np.diag(DERIVATIVE_STEP * scales)):
        ends = [np.clip(x + sign * step, low, high) for sign in (1.0, -1.0)]
        above, below = (trial.speeds(end) for end in ends)
        jacobian[:, k] = (above - below) / (ends[0] - ends[1])[k]
        # If a speed changes for steps to one side only, all values on the other side fit equally
        # well, so the reading does not identify the parameter there.
        sides = np.abs([above - speeds, speeds - below])
        if low[k] < ends[1][k] and ends[0][k] < high[k]:
            jacobian[sides.min(axis=0) < ONE_SIDED_RTOL * sides.max(axis=0), k] = 0.0
    return jacobian

"""Identification of a follower from its jump speeds in several set-ups.

At the jump speed the lowest contact force of a turn is zero. The parameters in a table are fixed
for each reading. The others have one value for all readings. A mass in a table is the added mass.
The mass of the follower itself is a free parameter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby, product
from typing import ClassVar

import numpy as np
from scipy.optimize import least_squares, nnls
from scipy.stats import t as student

from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.jump.two_masses import MAX_RPM, MIN_RPM
from cam_rig.errors import CamRigError, ConfigError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.show.result import NULL_PROGRESS, Column, Progress, Records
from cam_rig.studies.fit_rig.jump_table import JumpReading, JumpTable
from cam_rig.studies.fit_rig.numbers import (
    MAX_RELATIVE_ERROR,
    NUMBERS,
    TWO_MASS_ONLY,
    WITHIN_95,
    ParameterEstimate,
    RigParameters,
    build_follower,
    check_fixed,
    correlation_matrix,
    from_search,
    interval_text,
    search_limits,
    slope,
    to_search,
)
from cam_rig.studies.fit_rig.search import normal_inverse
from cam_rig.units import RPM, TURN, FloatArray, rms, round_to_error

# Search for the follower whose jump speeds are closest to those of a table.

#: Free parameters of one rigid mass.
RIGID = ("mass", "spring_stiffness", "preload", "damping")
#: Free parameters of a stem, in addition to those.
STEM = ("stem_stiffness", "roller_share")
#: Relative step of a search variable for derivatives.
RELATIVE_STEP = 1e-4
#: Factors by which the stems of additional starts are stiffer.
STIFFNESS_FACTORS = (10.0, 100.0)
#: Number of additional starts with a stiffer stem, the best of those tried.
STIFF_STARTS = 2
#: Number of cam angles per turn at which a start assumes that all readings jump.
BALANCE_ANGLES = 120


@dataclass(frozen=True, eq=False)
class JumpModel:
    """Jump speeds in rpm as a function of the free parameters.

    ``progress`` is notified of each set-up of a step of the search.
    """

    law: Law
    table: JumpTable
    free: tuple[str, ...]
    fixed: dict[str, float]
    progress: Progress

    @cached_property
    def _setups(self) -> tuple[list[dict[str, float]], list[int]]:
        """Distinct set-ups, and the index of the set-up of each reading."""
        known = [tuple(sorted(reading.known.items())) for reading in self.table.readings]
        index = {setup: i for i, setup in enumerate(dict.fromkeys(known))}
        return [dict(setup) for setup in index], [index[setup] for setup in known]

    def values(self, x: FloatArray, known: dict[str, float]) -> dict[str, float]:
        """Return all parameters of a set-up.

        The mass is the follower's plus the added mass.
        """
        values = self.fixed | from_search(self.free, x)
        on = known.get("mass", 0.0)
        return values | known | {"mass": max(values["mass"] + on, 1e-9)}

    def speeds(self, x: FloatArray) -> FloatArray:
        """Return the jump speeds of all readings in rpm, ``(n,)``.

        Equal set-ups are computed once.
        """
        setups, indices = self._setups
        speeds = np.full(len(setups), MAX_RPM)
        self.progress.start(len(setups), "set-ups of a step of the search")
        for i, known in enumerate(setups):
            self.progress.advance()
            values = self.values(x, known)
            follower = build_follower(values, values.get("stem_stiffness"))
            with suppress(CamRigError):
                speeds[i] = find_jump(self.law, follower, None).rpm
        return speeds[indices]

    def off(self, x: FloatArray) -> FloatArray:
        """Return the relative errors of all readings, ``(n,)``."""
        return (self.speeds(x) - self.table.rpm) / self.table.rpm

    def point(self, values: dict[str, float]) -> tuple[float, ...]:
        """Return the search variables of these values, within their limits."""
        low, high = search_limits(self.free)
        x = [to_search(name, values[name]) for name in self.free]
        return tuple(np.clip(x, low + 1e-9, high - 1e-9).tolist())


def search_jumps(trial: JumpModel) -> FloatArray:
    """Return the least-squares solution from the best of all starts."""
    if not trial.free:
        return np.empty(0)
    rigid = "roller_share" not in trial.fixed  # two masses take a hundred times as long
    near, steps = (1e-12, 200) if rigid else (1e-8, 50)
    results = [
        least_squares(
            trial.off,
            x,
            bounds=search_limits(trial.free),
            x_scale=search_scales(trial.free, from_search(trial.free, np.array(x))),
            diff_step=np.full(len(x), RELATIVE_STEP),
            xtol=near,
            ftol=near,
            gtol=1e-14,
            max_nfev=steps,
        )
        for x in _starts(trial)
    ]
    return np.asarray(min(results, key=lambda result: result.cost).x)


def _starts(trial: JumpModel) -> list[tuple[float, ...]]:
    """Return the starts of the searches.

    A stem may be nearly rigid. The best starts with a stiffer stem are therefore added.
    """
    candidates = [trial.fixed | start for start in ({}, *_balanced_starts(trial))]
    starts = dict.fromkeys(map(trial.point, candidates))
    if "stem_stiffness" in trial.free:
        stiff = [
            trial.point(v | {"stem_stiffness": v["stem_stiffness"] * times})
            for v, times in product(candidates, STIFFNESS_FACTORS)
        ]
        stiff.sort(key=lambda x: rms(trial.off(np.array(x))))
        starts |= dict.fromkeys(stiff[:STIFF_STARTS])
    return list(starts)


def _balanced_starts(trial: JumpModel) -> Iterator[dict[str, float]]:
    """Yield values of one mass with which all readings jump at the same cam angle.

    Damping raises the jump speeds of a rise and lowers those of a fall. The sum of squares
    therefore has a minimum for each part of the turn in which s'' < 0 and s' keeps its sign.
    """
    fixed = {name: v for name, v in trial.fixed.items() if name not in TWO_MASS_ONLY}
    free = tuple(name for name in trial.free if name in RIGID)
    rigid = replace(trial, free=free, fixed=fixed, progress=NULL_PROGRESS)
    angles = np.linspace(0.0, TURN, BALANCE_ANGLES, endpoint=False)
    motion = np.stack([trial.law(angles, order) for order in range(3)], axis=1)
    for (pulls, _), part in groupby(motion, key=lambda m: (m[2] < 0.0, m[1] < 0.0)):
        if pulls and free:
            candidates = (_solve_balance(rigid, *m) for m in part)
            yield min(candidates, key=lambda v: rms(rigid.off(np.array(rigid.point(v)))))


def _solve_balance(rigid: JumpModel, s: float, slope: float, curvature: float) -> dict[str, float]:
    """Return all parameters so that m s'' Ω² + c s' Ω + k s + preload = 0.

    The equation is linear in the parameters.
    """
    speed = rigid.table.rpm * RPM
    weights = {
        "mass": np.full_like(speed, curvature),
        "spring_stiffness": s / speed**2,
        "preload": 1.0 / speed**2,
        "damping": slope / speed,
    }
    fixed_part = np.zeros_like(speed)
    for name, weight in weights.items():
        fixed_part += weight * [reading.known.get(name, 0.0) for reading in rigid.table.readings]
        if name not in rigid.free and (name == "mass" or name not in rigid.table.columns):
            fixed_part += weight * rigid.fixed[name]
    matrix = np.stack([weights[name] for name in rigid.free], axis=1)
    size = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    solution = dict(zip(rigid.free, nnls(matrix / size, -fixed_part)[0] / size, strict=True))
    # no follower jumps with a parameter of 0, except the damping
    return rigid.fixed | {n: float(v) for n, v in solution.items() if v > 0.0 or n == "damping"}


def search_scales(names: tuple[str, ...], values: dict[str, float]) -> FloatArray:
    """Return the scale of each search variable, ``(n,)``."""
    return np.array([1.0 if NUMBERS[n].logarithm else max(abs(values[n]), 1.0) for n in names])


# Result and its uncertainty.

#: Relative scatter of the readings above which they fit no follower.
MAX_SCATTER = 0.04
#: Scatter relative to a given error above which the scatter replaces it.
MAX_ERROR_RATIO = 2.0
#: Smallest start value of the follower's mass, kg.
MIN_OWN_MASS = 0.05
#: Ratio of the changes in the two directions below which a derivative is taken as zero.
ONE_SIDED_RTOL = 1e-3
#: Fraction of the sum of squares above which one reading is an outlier.
OUTLIER_SHARE = 0.55


def _get_setup(name: str) -> Callable[[tuple[JumpReading, float]], float | None]:
    """Return a function for the value of a set-up in a row of reading and fitted rpm."""
    return lambda row: row[0].known.get(name)


@dataclass(frozen=True, eq=False, repr=False)
class JumpFit(RigParameters):
    """Follower parameters identified from measured jump speeds.

    ``speeds`` are the fitted jump speeds in rpm, in the order of the readings. ``error`` is the
    standard deviation of a reading in rpm, given or from the residuals. ``degrees_of_freedom`` is
    the number of readings less that of free parameters.
    """

    schema = "cam_rig.fit_jumps.1"
    plot_function = "cam_rig.studies.fit_rig.figures:jump_figure"
    columns: ClassVar = RigParameters.columns | {
        "jump_speeds": (
            Column("line", "", "d", of="0.line"),
            Column("mass", "kg", ".6g", "mass put on", _get_setup("mass")),
            Column("spring_stiffness", "N/m", ".6g", "spring", _get_setup("spring_stiffness")),
            Column("preload", "N", ".6g", of=_get_setup("preload")),
            Column("read_rpm", "rpm", ".2f", "read", "0.rpm"),
            Column("fitted_rpm", "rpm", ".2f", "fitted", "1"),
            Column("residual_rpm", "rpm", ".2f", "residual", lambda row: row[0].rpm - row[1]),
        ),
        "fit": (
            Column("source", of="read.file"),
            Column("cam", of="law.name"),
            Column("model"),
            Column("error_rpm", "rpm", of="error", doc="standard deviation of a reading"),
            Column("error_given"),
            Column("degrees_of_freedom"),
            Column("notes", of="read.notes", doc="how the table was read"),
            Column("conclusions", of=lambda fit: [*fit.conclusions()]),
        ),
    }

    read: JumpTable
    speeds: tuple[float, ...]
    error: float
    error_given: bool
    degrees_of_freedom: int
    assumed: tuple[str, ...] = ()

    @property
    def residuals(self) -> FloatArray:
        """Residuals, fitted less measured, rpm."""
        return np.array(self.speeds) - self.read.rpm

    @property
    def residual(self) -> str:
        """Error of a reading as text for a rig file."""
        return f"{self.error:.3g} rpm a reading, {len(self.speeds)} readings"

    def tables(self) -> list[Records]:
        """Return the tables of parameters, and of measured and fitted jump speeds."""
        names = tuple(number.name for number in self.identified)
        rows = list(zip(self.read.readings, self.speeds, strict=True))
        caption = f"{self.read.file}: the follower"
        return [
            *self.number_tables(caption, names),
            self.table("jump_speeds", "Jump speeds", rows),
            self.table("fit", "The fit", [self], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """Return the notes on how the table was read, the parameters, and warnings."""
        return [*(f"{self.read.file}: {note}" for note in self.read.notes), *self.conclusions()]

    def conclusions(self) -> Iterator[str]:
        """Yield the identified parameters, then reasons and warnings."""
        parameters = ", ".join(number.to_sentence() for number in self.identified)
        yield (
            f"Identified: {parameters}."
            if parameters
            else "Nothing of the follower is identifiable."
        )
        yield from (n.to_sentence() for n in self.numbers if n.value is None)
        if "mass" in self.read.columns:
            yield "The mass is that of the follower without the added mass."
        if not self.error_given:
            yield (
                f"The error of a reading is taken from the residuals: {self.error:.3g} rpm, of "
                f"{self.degrees_of_freedom} readings more than free parameters; intervals of 95 % "
                f"reach {_coverage_factor(False, self.degrees_of_freedom):.3g} standard errors."
            )
        residuals = self.residuals
        worst = int(np.abs(residuals).argmax())
        share = OUTLIER_SHARE * float(residuals @ residuals)
        if self.degrees_of_freedom > 1 and residuals[worst] ** 2 > share:
            reading = self.read.readings[worst]
            yield f"Line {reading.line} is {-residuals[worst]:.3g} rpm off the others: an outlier?"


def fit_jumps(
    law: Law,
    table: JumpTable,
    base: RigConfig,
    model: str | None = None,
    fixed: dict[str, float] | None = None,
    error: float | None = None,
    progress: Progress = NULL_PROGRESS,
) -> JumpFit:
    """Identify a follower from its jump speeds.

    Parameters
    ----------
    law : law of the cam
    table : measured jump speeds and their set-ups
    base : rig with the start values
    model : one_mass (default) or two_mass, both in steady state
    fixed : known values in SI by name
    error : standard deviation of a reading in rpm (default: from the residuals)
    progress : receiver of the progress

    Raises
    ------
    ConfigError : too few readings, readings outside the limits, or readings that fit no follower
    """
    fixed, two = dict(fixed or {}), model == "two_mass"
    check_fixed(fixed, model)
    if clash := sorted(set(fixed) & (set(table.columns) - {"mass"})):
        raise ConfigError(f"{table.file}: has {', '.join(clash)} too; allowed: given once")
    names = (*RIGID, *STEM) if two else RIGID
    free = tuple(n for n in names if n not in fixed and (n == "mass" or n not in table.columns))
    count = len(table.readings)
    if count < len(free) or (error is None and count == len(free)):
        need = len(free) + (error is None)
        raise ConfigError(
            f"{table.file}: {count} readings for {len(free)} numbers ({', '.join(free)}); "
            f"needed: {need} or more, so measure more, or give some with --fix"
            f"{' and the error of a reading with --tolerance' if error is None else ''}"
        )
    _check_readings(table)
    values = _start_values(table, base, fixed, two)
    trial = JumpModel(law, table, free, values, progress)
    x = search_jumps(trial)
    speeds, surplus = trial.speeds(x), count - len(free)
    deviation, followed = _deviation(trial, speeds, surplus, error)
    within = _coverage_factor(followed, surplus)
    covariance, null_groups = normal_inverse(_slopes(trial, x) / deviation)
    estimates = [
        *_estimates(trial, x, np.sqrt(np.diag(covariance)), null_groups, within),
        *(ParameterEstimate(name, value, None, "given") for name, value in fixed.items()),
    ]
    order = (*names, *fixed)
    estimates.sort(key=lambda number: order.index(number.name))
    if "restitution" not in fixed:
        reason = "no landing is in a jump speed"
        estimates.append(ParameterEstimate.unidentified("restitution", reason))
    indices = [free.index(n.name) for n in estimates if n.name in free and n.value is not None]
    correlation = correlation_matrix(covariance[np.ix_(indices, indices)])
    parameters = "two_mass" if two else "one_mass", tuple(estimates), correlation, table
    return JumpFit(law, *parameters, tuple(speeds.tolist()), deviation, followed, surplus)


def _coverage_factor(error_given: bool, surplus: int) -> float:
    """Return half the width of an interval of 95 % in standard errors.

    An error from few residuals uses Student's distribution.
    """
    return WITHIN_95 if error_given else float(student.ppf(0.975, max(surplus, 1)))


def _check_readings(table: JumpTable) -> None:
    """Raise an error for a speed or a value outside the limits."""
    for reading in table.readings:
        for name, value in reading.known.items():
            limits = NUMBERS[name]
            if value > limits.high:
                raise ConfigError(
                    f"{table.file}: line {reading.line}: {name} is {value:g} {limits.unit}; "
                    f"allowed: up to {limits.high:g} {limits.unit}"
                )
        if not MIN_RPM <= (rpm := reading.speed / RPM) <= MAX_RPM:
            raise ConfigError(
                f"{table.file}: line {reading.line}: the jump speed is {rpm:g} rpm; allowed: "
                f"from {MIN_RPM:g} to {MAX_RPM:g} rpm"
            )


def _deviation(
    trial: JumpModel, speeds: FloatArray, surplus: int, error: float | None
) -> tuple[float, bool]:
    """Return the standard deviation of a reading (rpm), and True if it is given."""
    left = speeds - trial.table.rpm
    scatter = rms(left) * math.sqrt(left.size / surplus) if surplus else 0.0
    if (speeds >= MAX_RPM).any() or scatter > MAX_SCATTER * float(speeds.mean()):
        worst = int(np.abs(left).argmax())
        raise ConfigError(
            f"{trial.table.file}: the readings are {rms(left):.3g} rpm r.m.s. from any follower "
            f"found on cam {trial.law.name}, line {trial.table.readings[worst].line} the farthest "
            f"by {-left[worst]:.3g} rpm; allowed: {100.0 * MAX_SCATTER:g} % of the speed; was that "
            "cam on, are the units right, is there a preload? A --rig nearer to it may help the "
            "search"
        )
    if error and scatter <= MAX_ERROR_RATIO * error:
        return error, True
    return max(scatter, 1e-9 * float(speeds.max())), False


def _start_values(
    table: JumpTable, base: RigConfig, fixed: dict[str, float], two: bool
) -> dict[str, float]:
    follower = base.follower
    values = {name: base.need(name, "the fit").si for name in RIGID}
    values["restitution"] = 0.0  # no landing is in a jump speed
    if two:
        if "stem_stiffness" not in fixed:
            by, one_mass = "the start of a fit of two masses", "take --model one_mass"
            values["stem_stiffness"] = base.need("stem_stiffness", by, one_mass).si
        share, damping = follower.roller_share, follower.stem_damping
        values["roller_share"] = 0.4 if share is None else share.si
        values["stem_damping"] = values["damping"] if damping is None else damping.si
    if "mass" in table.columns and (least := min(r.known["mass"] for r in table.readings)) > 0.0:
        values["mass"] = max(0.5 * least, MIN_OWN_MASS)
    values["preload"] = max(values["preload"], 1.0)  # without one there is no jump speed
    return values | fixed


def _slopes(trial: JumpModel, x: FloatArray) -> FloatArray:
    slopes = np.empty((len(trial.table.readings), x.size))
    low, high = search_limits(trial.free)
    sizes = search_scales(trial.free, from_search(trial.free, x))
    speeds = trial.speeds(x)
    for k, step in enumerate(np.diag(RELATIVE_STEP * sizes)):
        ends = [np.clip(x + sign * step, low, high) for sign in (1.0, -1.0)]
        up, down = (trial.speeds(end) for end in ends)
        slopes[:, k] = (up - down) / (ends[0] - ends[1])[k]
        # a speed that changes in one direction only fits all values in the other direction
        sides = np.abs([up - speeds, speeds - down])
        if low[k] < ends[1][k] and ends[0][k] < high[k]:
            slopes[sides.min(axis=0) < ONE_SIDED_RTOL * sides.max(axis=0), k] = 0.0
    return slopes


def _estimates(
    trial: JumpModel,
    x: FloatArray,
    errors: FloatArray,
    null_groups: tuple[tuple[int, ...], ...],
    within: float,
) -> Iterator[ParameterEstimate]:
    for k, (name, value) in enumerate(from_search(trial.free, x).items()):
        error = float(errors[k]) * slope(name, value)
        others = [trial.free[i] for group in null_groups if k in group for i in group if i != k]
        reason = _reason(name, value, error, within, others, trial.table)
        if (k,) in null_groups:
            reason = "no jump speed changes with it: give it if it is known"
        if reason:
            yield ParameterEstimate.unidentified(name, reason, error)
        else:
            yield ParameterEstimate(name, value, error, "identified", within=within)


def _reason(
    name: str, value: float, error: float, within: float, others: list[str], table: JumpTable
) -> str:
    if others:
        more = "" if "mass" in table.columns else ", or a column of masses put on"
        apart = ", ".join(dict.fromkeys(others))
        return f"not identifiable apart from {apart}: give one of them{more}"
    half = within * error
    if half < MAX_RELATIVE_ERROR * WITHIN_95 * value:
        return ""
    if name == "mass" and value < error and "mass" in table.columns:
        text = f"{round_to_error(value, error)} ± {round_to_error(error, error)} kg"
        return f"it is {text} in addition to the added mass: is that the total mass?"
    return f"{interval_text(value, half, NUMBERS[name].unit)}: too wide"

"""Identification of a follower from its jump speeds in several set-ups.

The jump speed is the cam speed at which the lowest contact force of a turn is zero. A set-up is the
added mass, spring and preload of one reading. The parameters that are columns of the table are
fixed to the reading's value. The others have one value for all readings. A mass in the table is an
added mass. The mass of the follower itself is a free parameter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.stats import t as student

from cam_rig.dynamics.jump.two_masses import MAX_RPM, MIN_RPM
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.show.result import NULL_PROGRESS, Column, Progress, Records
from cam_rig.studies.fit_rig.estimate import (
    MAX_RELATIVE_ERROR,
    NORMAL_95,
    ParameterEstimate,
    RigParameters,
    correlation_matrix,
    interval_text,
)
from cam_rig.studies.fit_rig.jumps.search import RIGID, STEM, JumpModel, _jacobian, search_jumps
from cam_rig.studies.fit_rig.jumps.table import JumpReading, JumpTable
from cam_rig.studies.fit_rig.normal_equations import normal_inverse
from cam_rig.studies.fit_rig.parameters import PARAMETERS, check_fixed, from_search, parameter_slope
from cam_rig.units import RPM, FloatArray, rms, round_to_error

#: Largest scatter of the residuals with which a fitted follower is accepted, as a fraction of the
#: mean jump speed.
MAX_SCATTER = 0.04
#: Largest ratio of the residuals' scatter to the error of a reading that the user has given. At a
#: larger ratio the given error is replaced by the scatter.
MAX_ERROR_RATIO = 2.0
#: Smallest start value of the follower's mass without the added masses of the table, kg.
MIN_OWN_MASS = 0.05
#: Fraction of the sum of squared residuals above which a single reading is reported as an outlier.
OUTLIER_SHARE = 0.55


def _setup_value(name: str) -> Callable[[tuple[JumpReading, float]], float | None]:
    """Return a function that reads one column of the table of jump speeds.

    ``name`` is the column: an added mass, a spring or a preload. The argument of the function is a
    pair of a reading and its fitted jump speed (rpm). It returns the value in SI, or None if the
    measured table has no such column.
    """
    return lambda row: row[0].setup.get(name)


@dataclass(frozen=True, eq=False, repr=False)
class JumpFit(RigParameters):
    """Follower parameters identified from measured jump speeds.

    ``read`` is the measured table. ``speeds`` are the fitted jump speeds in rpm, in the order of
    the readings. ``error`` is the standard deviation of a reading in rpm. It was given by the user
    if ``error_given`` is True, otherwise estimated from the residuals. ``degrees_of_freedom`` is
    the number of readings less the number of free parameters. ``assumed`` has one sentence for each
    group of values that the rig file takes from another rig.
    """

    schema = "cam_rig.fit_jumps.1"
    plot_function = "cam_rig.studies.fit_rig.figures:jump_figure"
    columns: ClassVar = RigParameters.columns | {
        "jump_speeds": (
            Column("line", "", "d", of="0.line"),
            Column("mass", "kg", ".6g", "mass put on", _setup_value("mass")),
            Column("spring_stiffness", "N/m", ".6g", "spring", _setup_value("spring_stiffness")),
            Column("preload", "N", ".6g", of=_setup_value("preload")),
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
        """Residuals of the jump speeds (fitted minus measured) in rpm, ``(n,)``."""
        return np.array(self.speeds) - self.read.rpm

    @property
    def residual_text(self) -> str:
        """Standard deviation of a measured jump speed as text for the rig file."""
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
        """Return notes on how the table was read, the fitted parameters, and warnings."""
        return [*(f"{self.read.file}: {note}" for note in self.read.notes), *self.conclusions()]

    def conclusions(self) -> Iterator[str]:
        """Yield the identified parameters as a sentence, then reasons and warnings.

        The reasons explain missing values. The warnings concern the error of the readings and
        outliers.
        """
        parameters = ", ".join(number.to_sentence() for number in self.identified)
        yield (
            f"Identified: {parameters}."
            if parameters
            else "No parameter of the follower is identifiable."
        )
        yield from (n.to_sentence() for n in self.numbers if n.value is None)
        if "mass" in self.read.columns:
            yield "The mass is that of the follower without the added mass."
        if not self.error_given:
            yield (
                "The error of a reading is estimated from the residuals: "
                f"{self.error:.3g} rpm, with {self.degrees_of_freedom} degrees of freedom; "
                "intervals of 95 % "
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
    law : Law
        Law of the cam.
    table : JumpTable
        Measured jump speeds and their set-ups.
    base : RigConfig
        Rig with the start values of the search.
    model : str, optional
        ``one_mass`` (default) or ``two_mass``, both in steady state.
    fixed : dict of str to float, optional
        Known values in SI by name.
    error : float, optional
        Standard deviation of a reading in rpm (default: from the residuals).
    progress : Progress, optional
        Receiver of the progress.

    Raises
    ------
    ConfigError
        If there are too few readings, or readings outside the limits, or readings that fit no
        follower.
    """
    fixed, has_two_masses = dict(fixed or {}), model == "two_mass"
    check_fixed(fixed, model)
    if clash := sorted(set(fixed) & (set(table.columns) - {"mass"})):
        raise ConfigError(
            f"{table.file}: --fix cannot be combined with a column of {', '.join(clash)}; remove "
            "one of them"
        )
    names = (*RIGID, *STEM) if has_two_masses else RIGID
    free = tuple(n for n in names if n not in fixed and (n == "mass" or n not in table.columns))
    count = len(table.readings)
    if count < len(free) or (error is None and count == len(free)):
        need = len(free) + (error is None)
        raise ConfigError(
            f"{table.file}: {len(free)} free parameters ({', '.join(free)}) require at least "
            f"{need} readings, got {count}; measure more, or set parameters with --fix"
            f"{' and the error of a reading with --tolerance' if error is None else ''}"
        )
    _check_readings(table)
    values = _read_start_values(table, base, fixed, has_two_masses)
    trial = JumpModel(law, table, free, values, progress)
    x = search_jumps(trial)
    speeds, surplus = trial.speeds(x), count - len(free)
    deviation, error_is_given = _reading_deviation(trial, speeds, surplus, error)
    coverage_factor = _coverage_factor(error_is_given, surplus)
    covariance, null_groups = normal_inverse(_jacobian(trial, x) / deviation)
    estimates = [
        *_estimates(trial, x, np.sqrt(np.diag(covariance)), null_groups, coverage_factor),
        *(ParameterEstimate(name, value, None, "given") for name, value in fixed.items()),
    ]
    order = (*names, *fixed)
    estimates.sort(key=lambda number: order.index(number.name))
    if "restitution" not in fixed:
        reason = "no landing is in a jump speed"
        estimates.append(ParameterEstimate.unidentified("restitution", reason))
    indices = [free.index(n.name) for n in estimates if n.name in free and n.value is not None]
    correlation = correlation_matrix(covariance[np.ix_(indices, indices)])
    parameters = "two_mass" if has_two_masses else "one_mass", tuple(estimates), correlation, table
    return JumpFit(law, *parameters, tuple(speeds.tolist()), deviation, error_is_given, surplus)


def _coverage_factor(error_given: bool, surplus: int) -> float:
    """Return half the width of a 95 % interval in standard errors.

    It is 1.96 if the error of a reading was given. An error estimated from the residuals has few
    degrees of freedom ``surplus``, so Student's t distribution is used.
    """
    return NORMAL_95 if error_given else float(student.ppf(0.975, max(surplus, 1)))


def _check_readings(table: JumpTable) -> None:
    """Raise a `ConfigError` if a jump speed or a set-up value is outside its limits.

    A set-up value is an added mass, spring or preload of the table.
    """
    for reading in table.readings:
        for name, value in reading.setup.items():
            limits = PARAMETERS[name]
            if value > limits.high:
                raise ConfigError(
                    f"{table.file}: line {reading.line}: {name} must be at most {limits.high:g} "
                    f"{limits.unit}, got {value:g}"
                )
        if not MIN_RPM <= (rpm := reading.speed / RPM) <= MAX_RPM:
            raise ConfigError(
                f"{table.file}: line {reading.line}: the jump speed must be between {MIN_RPM:g} "
                f"and {MAX_RPM:g} rpm, got {rpm:g}"
            )


def _reading_deviation(
    trial: JumpModel, speeds: FloatArray, surplus: int, error: float | None
) -> tuple[float, bool]:
    """Return the standard deviation of a reading (rpm), and True if it was given.

    ``speeds`` are the fitted jump speeds (rpm), ``surplus`` the number of readings less the number
    of free parameters, and ``error`` the given deviation or None. The given deviation is replaced
    if the residuals are much larger. Raises a `ConfigError` if they are so large that no follower
    fits.
    """
    residuals = speeds - trial.table.rpm
    scatter = rms(residuals) * math.sqrt(residuals.size / surplus) if surplus else 0.0
    if (speeds >= MAX_RPM).any() or scatter > MAX_SCATTER * float(speeds.mean()):
        worst = int(np.abs(residuals).argmax())
        raise ConfigError(
            f"{trial.table.file}: no follower was found on cam {trial.law.name} whose jump speeds "
            f"are within {100.0 * MAX_SCATTER:g} % of the readings: the difference is "
            f"{rms(residuals):.3g} rpm r.m.s., the largest {-residuals[worst]:.3g} rpm in line "
            f"{trial.table.readings[worst].line}; check the cam, the units and the preload, or "
            "start from a similar --rig"
        )
    if error and scatter <= MAX_ERROR_RATIO * error:
        return error, True
    return max(scatter, 1e-9 * float(speeds.max())), False


def _read_start_values(
    table: JumpTable, base: RigConfig, fixed: dict[str, float], has_two_masses: bool
) -> dict[str, float]:
    """Return the start values of all follower parameters in SI, by name.

    They are those of the rig ``base``, overridden by ``fixed``. If the table has added masses, the
    follower's mass starts at half the smallest of them. ``has_two_masses`` is True to include the
    parameters of a stem.
    """
    follower = base.follower
    values = {name: base.need(name, "the fit").si for name in RIGID}
    values["restitution"] = 0.0  # the restitution affects only landings, not the jump speed
    if has_two_masses:
        if "stem_stiffness" not in fixed:
            purpose, one_mass = "the start of a fit of two masses", "use --model one_mass"
            values["stem_stiffness"] = base.need("stem_stiffness", purpose, one_mass).si
        share, damping = follower.roller_share, follower.stem_damping
        values["roller_share"] = 0.4 if share is None else share.si
        values["stem_damping"] = values["damping"] if damping is None else damping.si
    if "mass" in table.columns and (lightest := min(r.setup["mass"] for r in table.readings)) > 0.0:
        values["mass"] = max(0.5 * lightest, MIN_OWN_MASS)
    values["preload"] = max(values["preload"], 1.0)  # a follower without preload has no jump speed
    return values | fixed


def _estimates(
    trial: JumpModel,
    x: FloatArray,
    errors: FloatArray,
    null_groups: tuple[tuple[int, ...], ...],
    coverage_factor: float,
) -> Iterator[ParameterEstimate]:
    """Yield an estimate for each free parameter, with its standard error or a reason.

    ``x`` are the fitted search variables and ``errors`` their standard errors. ``null_groups`` are
    the unidentifiable groups of `normal_inverse`. ``trial`` is the model of the jump speeds.
    ``coverage_factor`` is half the width of a 95 % interval in standard errors.
    """
    for k, (name, value) in enumerate(from_search(trial.free, x).items()):
        error = float(errors[k]) * parameter_slope(name, value)
        others = [trial.free[i] for group in null_groups if k in group for i in group if i != k]
        reason = _unidentified_reason(name, value, error, coverage_factor, others, trial.table)
        if (k,) in null_groups:
            reason = "no jump speed depends on it: set it with --fix"
        if reason:
            yield ParameterEstimate.unidentified(name, reason, error)
        else:
            yield ParameterEstimate(
                name, value, error, "identified", coverage_factor=coverage_factor
            )


def _unidentified_reason(
    name: str,
    value: float,
    error: float,
    coverage_factor: float,
    others: list[str],
    table: JumpTable,
) -> str:
    """Return the reason why a parameter is not identified, or an empty text if it is.

    ``others`` are the parameters that it cannot be separated from. Without them, the reason is a 95
    % interval that is too wide for ``value``. Values are in SI. ``error`` is the standard error of
    the parameter ``name``, and ``coverage_factor`` half the width of a 95 % interval in standard
    errors. ``table`` is the measured table.
    """
    if others:
        more = "" if "mass" in table.columns else ", or add a column of added masses"
        names = ", ".join(dict.fromkeys(others))
        return f"not identifiable apart from {names}: set one of them with --fix{more}"
    half = coverage_factor * error
    if half < MAX_RELATIVE_ERROR * NORMAL_95 * value:
        return ""
    if name == "mass" and value < error and "mass" in table.columns:
        text = f"{round_to_error(value, error)} ± {round_to_error(error, error)} kg"
        return f"it is {text} in addition to the added mass: is that the total mass?"
    return f"{interval_text(value, half, PARAMETERS[name].unit)}: too wide"

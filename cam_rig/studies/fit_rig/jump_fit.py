"""The numbers of a rig from its jump speeds with several masses and springs.

At the jump speed the least contact force of a turn is zero. What a table gives for a reading is
known; what it does not is one number for all readings. The mass of a table is what was put on: the
follower's own is sought beside it.
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
from cam_rig.dynamics.jump.two_masses import FASTEST, SLOWEST
from cam_rig.errors import CamRigError, ConfigError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.show.result import NULL_PROGRESS, Column, Progress, Records
from cam_rig.studies.fit_rig.jump_table import JumpReading, JumpTable
from cam_rig.studies.fit_rig.numbers import (
    NUMBERS,
    OF_TWO,
    TOLD,
    WITHIN_95,
    FoundNumber,
    FoundNumbers,
    correlation_of,
    follower_of,
    from_search,
    interval_words,
    require_in_model,
    search_limits,
    slope,
    to_search,
)
from cam_rig.studies.fit_rig.search import normal_inverse
from cam_rig.units import RPM, TURN, FloatArray, rms, rounded_to_error

# The numbers of a follower whose jump speeds are nearest to those of a table.

#: Sought of one rigid mass; a stem's beside them.
RIGID = ("mass", "spring_stiffness", "preload", "damping")
STEM = ("stem_stiffness", "roller_share")
#: Step of what is sought, of its size.
STEP = 1e-4
#: Times that a stem may be stiffer than where a search begins, and how many such it begins at.
STIFFER, NEAREST = (10.0, 100.0), 2
#: Cam angles of a turn at which readings may jump where a search begins.
ANGLES = 120


@dataclass(frozen=True, eq=False)
class JumpModel:
    """Jump speeds (rpm) of what is sought; told are the set-ups of each step of a search."""

    law: Law
    table: JumpTable
    sought: tuple[str, ...]
    given: dict[str, float]
    progress: Progress

    @cached_property
    def _setups(self) -> tuple[list[dict[str, float]], list[int]]:
        """What was put on, each once, and of each reading which it is."""
        known = [tuple(sorted(reading.known.items())) for reading in self.table.readings]
        index = {setup: i for i, setup in enumerate(dict.fromkeys(known))}
        return [dict(setup) for setup in index], [index[setup] for setup in known]

    def values(self, x: FloatArray, known: dict[str, float]) -> dict[str, float]:
        """All numbers of a set-up: the own mass and what was put on are one."""
        values = self.given | from_search(self.sought, x)
        on = known.get("mass", 0.0)
        return values | known | {"mass": max(values["mass"] + on, 1e-9)}

    def speeds(self, x: FloatArray) -> FloatArray:
        """Of all readings, ``(n,)``; those of one set-up are one speed."""
        setups, which = self._setups
        found = np.full(len(setups), FASTEST)
        self.progress.start(len(setups), "set-ups of a step of the search")
        for i, known in enumerate(setups):
            self.progress.advance()
            values = self.values(x, known)
            follower = follower_of(values, values.get("stem_stiffness"))
            with suppress(CamRigError):
                found[i] = find_jump(self.law, follower, None).rpm
        return found[which]

    def off(self, x: FloatArray) -> FloatArray:
        """By how much each reading is missed, in parts of it, ``(n,)``."""
        return (self.speeds(x) - self.table.rpm) / self.table.rpm

    def point(self, values: dict[str, float]) -> tuple[float, ...]:
        """Of all numbers those that are sought, as they are sought, within their limits."""
        low, high = search_limits(self.sought)
        x = [to_search(name, values[name]) for name in self.sought]
        return tuple(np.clip(x, low + 1e-9, high - 1e-9).tolist())


def searched(trial: JumpModel) -> FloatArray:
    """Least squares of the speeds, from every start."""
    if not trial.sought:
        return np.empty(0)
    rigid = "roller_share" not in trial.given  # two masses take a hundred times as long
    near, steps = (1e-12, 200) if rigid else (1e-8, 50)
    results = [
        least_squares(
            trial.off,
            x,
            bounds=search_limits(trial.sought),
            x_scale=sizes_of(trial.sought, from_search(trial.sought, np.array(x))),
            diff_step=np.full(len(x), STEP),
            xtol=near,
            ftol=near,
            gtol=1e-14,
            max_nfev=steps,
        )
        for x in _starts(trial)
    ]
    return np.asarray(min(results, key=lambda result: result.cost).x)


def _starts(trial: JumpModel) -> list[tuple[float, ...]]:
    """What a search begins at: the nearest of the stiffer stems, as a stem may be nearly rigid."""
    found = [trial.given | values for values in ({}, *_balanced(trial))]
    starts = dict.fromkeys(map(trial.point, found))
    if "stem_stiffness" in trial.sought:
        stiff = [
            trial.point(v | {"stem_stiffness": v["stem_stiffness"] * times})
            for v, times in product(found, STIFFER)
        ]
        stiff.sort(key=lambda x: rms(trial.off(np.array(x))))
        starts |= dict.fromkeys(stiff[:NEAREST])
    return list(starts)


def _balanced(trial: JumpModel) -> Iterator[dict[str, float]]:
    """Numbers of one mass with which all readings jump at one cam angle, a set for each part.

    Damping raises the jump speeds of a rise and lowers those of a fall, so the squares have a least
    for each part of the turn where s'' < 0 and s' keeps its sign.
    """
    given = {name: v for name, v in trial.given.items() if name not in OF_TWO}
    sought = tuple(name for name in trial.sought if name in RIGID)
    rigid = replace(trial, sought=sought, given=given, progress=NULL_PROGRESS)
    angles = np.linspace(0.0, TURN, ANGLES, endpoint=False)
    motion = np.stack([trial.law(angles, order) for order in range(3)], axis=1)
    for (pulls, _), part in groupby(motion, key=lambda m: (m[2] < 0.0, m[1] < 0.0)):
        if pulls and sought:
            found = (_balance(rigid, *m) for m in part)
            yield min(found, key=lambda v: rms(rigid.off(np.array(rigid.point(v)))))


def _balance(rigid: JumpModel, s: float, slope: float, curvature: float) -> dict[str, float]:
    """All numbers, so that m s'' Ω² + c s' Ω + k s + preload = 0, which is linear in them."""
    speed = rigid.table.rpm * RPM
    weights = {
        "mass": np.full_like(speed, curvature),
        "spring_stiffness": s / speed**2,
        "preload": 1.0 / speed**2,
        "damping": slope / speed,
    }
    known = np.zeros_like(speed)
    for name, weight in weights.items():
        known += weight * [reading.known.get(name, 0.0) for reading in rigid.table.readings]
        if name not in rigid.sought and (name == "mass" or name not in rigid.table.columns):
            known += weight * rigid.given[name]
    matrix = np.stack([weights[name] for name in rigid.sought], axis=1)
    size = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    found = dict(zip(rigid.sought, nnls(matrix / size, -known)[0] / size, strict=True))
    # what the balance leaves at 0 no follower jumps with, but for its damping
    return rigid.given | {n: float(v) for n, v in found.items() if v > 0.0 or n == "damping"}


def sizes_of(names: tuple[str, ...], values: dict[str, float]) -> FloatArray:
    """What steps of what is sought are to be measured by, ``(n,)``."""
    return np.array([1.0 if NUMBERS[n].logarithm else max(abs(values[n]), 1.0) for n in names])


# What they say of the rig, and how far it may be trusted.

#: Readings that scatter by more than this part of their speed fit no follower; an error that was
#: given is not followed where they scatter by more than so many of it.
NO_FIT, TOO_FAR = 0.04, 2.0
#: Least own mass (kg) with which a search begins.
LIGHT = 0.05
#: Of a change that one way is less than this part of that the other way, there is none.
ONE_SIDED = 1e-3
#: One jump speed with more than this part of all that is left, as squares, is an outlier.
OUTLYING = 0.55


def _put_on(name: str) -> Callable[[tuple[JumpReading, float]], float | None]:
    """What was put on for a jump speed, of one kind; a row is a reading and its fitted rpm."""
    return lambda row: row[0].known.get(name)


@dataclass(frozen=True, eq=False, repr=False)
class JumpFit(FoundNumbers):
    """What jump speeds say of a rig.

    ``speeds`` (rpm) are those of the numbers found, in the readings' order; ``error`` (rpm) one
    standard deviation of a reading, given or by what is left; ``free`` is how many readings there
    are more than numbers sought.
    """

    schema = "cam_rig.fit_jumps.1"
    plot_function = "cam_rig.studies.fit_rig.figures:jump_figure"
    columns: ClassVar = FoundNumbers.columns | {
        "jump_speeds": (
            Column("line", "", "d", of="0.line"),
            Column("mass", "kg", ".6g", "mass put on", _put_on("mass")),
            Column("spring_stiffness", "N/m", ".6g", "spring", _put_on("spring_stiffness")),
            Column("preload", "N", ".6g", of=_put_on("preload")),
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
            Column("degrees_of_freedom", of="free"),
            Column("notes", of="read.notes", doc="how the table was read"),
            Column("conclusions", of=lambda fit: [*fit.conclusions()]),
        ),
    }

    read: JumpTable
    speeds: tuple[float, ...]
    error: float
    error_given: bool
    free: int
    assumed: tuple[str, ...] = ()

    @property
    def left(self) -> FloatArray:
        """Found less read, rpm."""
        return np.array(self.speeds) - self.read.rpm

    @property
    def residual(self) -> str:
        """In words, for a rig file."""
        return f"{self.error:.3g} rpm a reading, {len(self.speeds)} readings"

    def tables(self) -> list[Records]:
        """The follower's numbers, and the jump speeds as read and of these."""
        names = tuple(number.name for number in self.identified)
        rows = list(zip(self.read.readings, self.speeds, strict=True))
        caption = f"{self.read.file}: the follower"
        return [
            *self.number_tables(caption, names),
            self.table("jump_speeds", "Jump speeds", rows),
            self.table("fit", "The fit", [self], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """How the table was read, the answer, and how far it may be trusted."""
        return [*(f"{self.read.file}: {note}" for note in self.read.notes), *self.conclusions()]

    def conclusions(self) -> Iterator[str]:
        """The answer first, then how far it may be trusted."""
        found = ", ".join(number.in_a_sentence() for number in self.identified)
        yield f"Identified: {found}." if found else "Nothing of the follower is identifiable."
        yield from (n.in_a_sentence() for n in self.numbers if n.value is None)
        if "mass" in self.read.columns:
            yield "The mass is the follower's own, beside what was put on."
        if not self.error_given:
            yield (
                f"The error of a reading is taken from the residuals: {self.error:.3g} rpm, of "
                f"{self.free} readings more than free parameters; intervals of 95 % reach "
                f"{_reach(False, self.free):.3g} standard errors."
            )
        worst = int(np.abs(self.left).argmax())
        if self.free > 1 and self.left[worst] ** 2 > OUTLYING * float(self.left @ self.left):
            reading = self.read.readings[worst]
            yield f"Line {reading.line} is {-self.left[worst]:.3g} rpm off the others: an outlier?"


def fit_jumps(
    law: Law,
    table: JumpTable,
    base: RigConfig,
    model: str | None = None,
    given: dict[str, float] | None = None,
    error: float | None = None,
    progress: Progress = NULL_PROGRESS,
) -> JumpFit:
    """Find a follower's numbers from the speeds at which it jumps.

    ``base``: rig at whose numbers the search begins; ``model``: one_mass (None too) or two_mass:
    two masses, in steady state; ``given``: numbers that are known, by name, SI; ``error``: rpm, one
    standard deviation of a reading; None takes it from what is left.
    """
    given, two = dict(given or {}), model == "two_mass"
    require_in_model(given, model)
    if clash := sorted(set(given) & (set(table.columns) - {"mass"})):
        raise ConfigError(f"{table.file}: has {', '.join(clash)} too; allowed: given once")
    names = (*RIGID, *STEM) if two else RIGID
    sought = tuple(n for n in names if n not in given and (n == "mass" or n not in table.columns))
    count = len(table.readings)
    if count < len(sought) or (error is None and count == len(sought)):
        need = len(sought) + (error is None)
        raise ConfigError(
            f"{table.file}: {count} readings for {len(sought)} numbers ({', '.join(sought)}); "
            f"needed: {need} or more, so measure more, or give some with --given"
            f"{' and the error of a reading with --tolerance' if error is None else ''}"
        )
    _require_in_reach(table)
    values = _start(table, base, given, two)
    trial = JumpModel(law, table, sought, values, progress)
    x = searched(trial)
    speeds, free = trial.speeds(x), count - len(sought)
    deviation, followed = _deviation(trial, speeds, free, error)
    within = _reach(followed, free)
    covariance, null_groups = normal_inverse(_slopes(trial, x) / deviation)
    found = [
        *_identified(trial, x, np.sqrt(np.diag(covariance)), null_groups, within),
        *(FoundNumber(name, value, None, "given") for name, value in given.items()),
    ]
    order = (*names, *given)
    found.sort(key=lambda number: order.index(number.name))
    if "restitution" not in given:
        found.append(FoundNumber.unidentified("restitution", "no landing is in a jump speed"))
    kept = [sought.index(n.name) for n in found if n.name in sought and n.value is not None]
    correlation = correlation_of(covariance[np.ix_(kept, kept)])
    told = "two_mass" if two else "one_mass", tuple(found), correlation, table
    return JumpFit(law, *told, tuple(speeds.tolist()), deviation, followed, free)


def _reach(error_given: bool, free: int) -> float:
    """Standard errors to either side of 95 %: of an error from few readings, Student's."""
    return WITHIN_95 if error_given else float(student.ppf(0.975, max(free, 1)))


def _require_in_reach(table: JumpTable) -> None:
    """Refuse a speed that no jump has, or a number beyond the limits of a follower's."""
    for reading in table.readings:
        for name, value in reading.known.items():
            limits = NUMBERS[name]
            if value > limits.high:
                raise ConfigError(
                    f"{table.file}: line {reading.line}: {name} is {value:g} {limits.unit}; "
                    f"allowed: up to {limits.high:g} {limits.unit}"
                )
        if not SLOWEST <= (rpm := reading.speed / RPM) <= FASTEST:
            raise ConfigError(
                f"{table.file}: line {reading.line}: the jump speed is {rpm:g} rpm; allowed: "
                f"from {SLOWEST:g} to {FASTEST:g} rpm"
            )


def _deviation(
    trial: JumpModel, speeds: FloatArray, free: int, error: float | None
) -> tuple[float, bool]:
    """Standard deviation (rpm) of a reading, and whether it is the one that was given."""
    left = speeds - trial.table.rpm
    scatter = rms(left) * math.sqrt(left.size / free) if free else 0.0
    if (speeds >= FASTEST).any() or scatter > NO_FIT * float(speeds.mean()):
        worst = int(np.abs(left).argmax())
        raise ConfigError(
            f"{trial.table.file}: the readings are {rms(left):.3g} rpm r.m.s. from any follower "
            f"found on cam {trial.law.name}, line {trial.table.readings[worst].line} the farthest "
            f"by {-left[worst]:.3g} rpm; allowed: {100.0 * NO_FIT:g} % of the speed; was that cam "
            "on, are the units right, is there a preload? A --rig nearer to it may help the search"
        )
    if error and scatter <= TOO_FAR * error:
        return error, True
    return max(scatter, 1e-9 * float(speeds.max())), False


def _start(
    table: JumpTable, base: RigConfig, given: dict[str, float], two: bool
) -> dict[str, float]:
    follower = base.follower
    values = {name: base.need(name, "the fit").si for name in RIGID}
    values["restitution"] = 0.0  # no landing is in a jump speed
    if two:
        if "stem_stiffness" not in given:
            by, one_mass = "the start of a fit of two masses", "take --model one_mass"
            values["stem_stiffness"] = base.need("stem_stiffness", by, one_mass).si
        share, damping = follower.roller_share, follower.stem_damping
        values["roller_share"] = 0.4 if share is None else share.si
        values["stem_damping"] = values["damping"] if damping is None else damping.si
    if "mass" in table.columns and (least := min(r.known["mass"] for r in table.readings)) > 0.0:
        values["mass"] = max(0.5 * least, LIGHT)
    values["preload"] = max(values["preload"], 1.0)  # without one there is no jump speed
    return values | given


def _slopes(trial: JumpModel, x: FloatArray) -> FloatArray:
    slopes = np.empty((len(trial.table.readings), x.size))
    low, high = search_limits(trial.sought)
    sizes = sizes_of(trial.sought, from_search(trial.sought, x))
    here = trial.speeds(x)
    for k, step in enumerate(np.diag(STEP * sizes)):
        ends = [np.clip(x + sign * step, low, high) for sign in (1.0, -1.0)]
        up, down = (trial.speeds(end) for end in ends)
        slopes[:, k] = (up - down) / (ends[0] - ends[1])[k]
        # what one way alone moves a speed is not told by it: all the other way fits as well
        sides = np.abs([up - here, here - down])
        if low[k] < ends[1][k] and ends[0][k] < high[k]:
            slopes[sides.min(axis=0) < ONE_SIDED * sides.max(axis=0), k] = 0.0
    return slopes


def _identified(
    trial: JumpModel,
    x: FloatArray,
    errors: FloatArray,
    null_groups: tuple[tuple[int, ...], ...],
    within: float,
) -> Iterator[FoundNumber]:
    for k, (name, value) in enumerate(from_search(trial.sought, x).items()):
        error = float(errors[k]) * slope(name, value)
        others = [trial.sought[i] for group in null_groups if k in group for i in group if i != k]
        reason = _reason(name, value, error, within, others, trial.table)
        if (k,) in null_groups:
            reason = "no jump speed changes with it: give it if it is known"
        if reason:
            yield FoundNumber.unidentified(name, reason, error)
        else:
            yield FoundNumber(name, value, error, "identified", within=within)


def _reason(
    name: str, value: float, error: float, within: float, others: list[str], table: JumpTable
) -> str:
    if others:
        more = "" if "mass" in table.columns else ", or a column of masses put on"
        apart = ", ".join(dict.fromkeys(others))
        return f"not identifiable apart from {apart}: give one of them{more}"
    half = within * error
    if half < TOLD * WITHIN_95 * value:
        return ""
    if name == "mass" and value < error and "mass" in table.columns:
        shown = f"{rounded_to_error(value, error)} ± {rounded_to_error(error, error)} kg"
        return f"it is {shown} beside what was put on: is that the total mass?"
    return f"{interval_words(value, half, NUMBERS[name].unit)}: too wide"

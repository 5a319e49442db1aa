"""The numbers of a rig from its jump speeds with several masses and springs.

At the jump speed the least contact force of a turn is zero. What a table gives for a reading is
known; what it does not is one number for all readings. The mass of a table is what was put on: the
follower's own is sought beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.jump.search import FASTEST, SLOWEST
from cam_rig.errors import CamRigError, ConfigError
from cam_rig.laws import Law
from cam_rig.measured.rig_fit.estimates import TOLD
from cam_rig.measured.rig_fit.found import (
    CORRELATION_COLUMNS,
    NUMBER_COLUMNS,
    FoundNumber,
    interval_words,
    number_sentences,
    number_tables,
    told,
)
from cam_rig.measured.rig_fit.jump_table import JumpReading, JumpTable
from cam_rig.measured.rig_fit.numbers import (
    NUMBERS,
    follower_of,
    from_search,
    require_in_model,
    search_limits,
    slope,
    to_search,
)
from cam_rig.measured.rig_fit.start import WITHIN_95
from cam_rig.schema import RigConfig
from cam_rig.show.result import SILENT, Column, Progress, Records, Result
from cam_rig.units import RPM, FloatArray, rms, to_rpm

#: Sought of one rigid mass; a stem's beside them.
RIGID = ("mass", "spring_stiffness", "preload", "damping")

STEM = ("stem_stiffness", "roller_share")

#: Step of what is sought, of its size.
STEP = 1e-4

#: Directions told by less than this part of the best are told by nothing.
BLIND = 1e-7

#: Part of a direction that a number of it has at least.
SHARE = 0.05

#: Readings that scatter by more than this part of their speed fit no follower; an error that was
#: given is not followed where they scatter by more than so many of it.
NO_FIT, TOO_FAR = 0.04, 2.0

#: Least own mass (kg) with which a search begins.
LIGHT = 0.05


#: One jump speed with more than this part of all that is left, as squares, is an outlier.
OUTLYING = 0.55


@dataclass(frozen=True)
class FittedJump:
    """A jump speed as read and of the numbers found, rpm, and what was put on for it."""

    reading: JumpReading
    fitted: float

    @property
    def read(self) -> float:
        """As read, rpm."""
        return float(to_rpm(self.reading.speed))


def _known(name: str) -> Callable[[FittedJump], float | None]:
    return lambda row: row.reading.known.get(name)


@dataclass(frozen=True, eq=False, repr=False)
class JumpFit(Result):
    """What jump speeds say of a rig.

    ``speeds`` (rpm) are those of the numbers found, in the readings' order; ``error`` (rpm) one
    standard deviation of a reading, given or by what is left; ``free`` is how many readings there
    are more than numbers sought.
    """

    schema = "cam_rig.fit_jumps.1"
    drawn_by = "cam_rig.measured.rig_fit.figures:jump_figure"
    columns: ClassVar = {
        "numbers": NUMBER_COLUMNS,
        "correlation": CORRELATION_COLUMNS,
        "jump_speeds": (
            Column("line", "", "d", of="reading.line"),
            Column("mass", "kg", ".6g", "mass put on", _known("mass")),
            Column("spring_stiffness", "N/m", ".6g", "spring", _known("spring_stiffness")),
            Column("preload", "N", ".6g", of=_known("preload")),
            Column("read_rpm", "rpm", ".2f", "read", "read"),
            Column("fitted_rpm", "rpm", ".2f", "fitted", "fitted"),
            Column("residual_rpm", "rpm", ".2f", "residual", lambda row: row.read - row.fitted),
        ),
        "fit": (
            Column("source", of="read.file"),
            Column("cam", of="law.name"),
            Column("model"),
            Column("error_rpm", "rpm", of="error", about="standard deviation of a reading"),
            Column("error_given"),
            Column("degrees_of_freedom", of="free"),
            Column("notes", of="read.notes", about="how the table was read"),
            Column("conclusions", of=lambda fit: [*fit.conclusions()]),
        ),
    }

    law: Law
    read: JumpTable
    model: str
    numbers: tuple[FoundNumber, ...]
    correlation: FloatArray
    speeds: tuple[float, ...]
    error: float
    error_given: bool
    free: int

    @property
    def identified(self) -> tuple[FoundNumber, ...]:
        """The numbers that the readings tell."""
        return tuple(n for n in self.numbers if n.origin == "identified")

    @property
    def left(self) -> FloatArray:
        """Found less read, rpm."""
        return np.array(self.speeds) - to_rpm(np.array([r.speed for r in self.read.readings]))

    @property
    def residual(self) -> str:
        """In words, for a rig file."""
        return f"{self.error:.3g} rpm a reading, {len(self.speeds)} readings"

    def tables(self) -> list[Records]:
        """The follower's numbers, and the jump speeds as read and of these."""
        names = tuple(number.name for number in self.identified)
        rows = map(FittedJump, self.read.readings, self.speeds)
        caption = f"{self.read.file}: the follower"
        return [
            *number_tables(caption, self.numbers, names, self.correlation),
            self.table("jump_speeds", "Jump speeds", rows),
            self.table("fit", "The fit", [self], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """How the table was read, the answer, and how far it may be trusted."""
        return [*(f"{self.read.file}: {note}" for note in self.read.notes), *self.conclusions()]

    def conclusions(self) -> Iterator[str]:
        """The answer first, then how far it may be trusted."""
        found = told(self.identified)
        yield f"Identified: {found}." if found else "Nothing of the follower is identifiable."
        yield from number_sentences(self.numbers)
        if "mass" in self.read.columns:
            yield "The mass is the follower's own, beside what was put on."
        if not self.error_given:
            yield (
                f"The error of a reading is taken from the residuals: {self.error:.3g} rpm, of "
                f"{self.free} readings more than free parameters; "
                f"intervals of 95 % reach {self.numbers[0].within:.3g} standard errors."
            )
        worst = int(np.abs(self.left).argmax())
        if self.free > 1 and self.left[worst] ** 2 > OUTLYING * float(self.left @ self.left):
            reading = self.read.readings[worst]
            yield f"Line {reading.line} is {-self.left[worst]:.3g} rpm off the others: an outlier?"


@dataclass(frozen=True, eq=False)
class _JumpModel:
    """Jump speeds (rpm) of what is sought; told are the set-ups of each step of a search."""

    law: Law
    readings: tuple[JumpReading, ...]
    sought: tuple[str, ...]
    given: dict[str, float]
    progress: Progress

    @cached_property
    def _setups(self) -> tuple[list[dict[str, float]], list[int]]:
        """What was put on, each once, and of each reading which it is."""
        known = [tuple(sorted(reading.known.items())) for reading in self.readings]
        index = {setup: i for i, setup in enumerate(dict.fromkeys(known))}
        return [dict(setup) for setup in index], [index[setup] for setup in known]

    def values(self, x: FloatArray, known: dict[str, float]) -> dict[str, float]:
        """All numbers of a set-up: the own mass and what was put on are one."""
        found = {n: from_search(n, float(v)) for n, v in zip(self.sought, x, strict=True)}
        values = self.given | found
        on = known.get("mass", 0.0)
        return values | known | {"mass": max(values["mass"] + on, 1e-9)}

    def speeds(self, x: FloatArray) -> FloatArray:
        """Of all readings, ``(n,)``; those of one set-up are one speed."""
        setups, which = self._setups
        found = np.empty(len(setups))
        self.progress.begin(len(setups), "set-ups of a step of the search")
        for i, known in enumerate(setups):
            self.progress.advance()
            found[i] = self._speed(self.values(x, known))
        return found[which]

    def _speed(self, values: dict[str, float]) -> float:
        follower = follower_of(values, values.get("stem_stiffness"))
        try:
            return find_jump(self.law, follower, None).rpm
        except CamRigError:
            return FASTEST


def fit_jumps(
    law: Law,
    table: JumpTable,
    base: RigConfig,
    model: str | None = None,
    given: dict[str, float] | None = None,
    error: float | None = None,
    progress: Progress = SILENT,
) -> JumpFit:
    """Find a follower's numbers from the speeds at which it jumps.

    Parameters
    ----------
    base : rig at whose numbers the search begins
    model : one_mass (None too) or two_mass: two masses, in steady state
    given : numbers that are known, by name, SI
    error : rpm, one standard deviation of a reading; None takes it from what is left
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
    trial = _JumpModel(law, table.readings, sought, values, progress)
    x = _searched(trial, values)
    speeds = trial.speeds(x)
    left = speeds - to_rpm(np.array([r.speed for r in table.readings]))
    free = count - len(sought)
    deviation, followed = _deviation(table, law, speeds, left, free, error)
    # an error that is estimated of few readings has Student's distribution
    within = WITHIN_95 if followed else float(student.ppf(0.975, max(free, 1)))
    numbers, correlation = _told(trial, x, deviation, given, names, table, within)
    kind, found = "two_mass" if two else "one_mass", tuple(speeds.tolist())
    return JumpFit(law, table, kind, numbers, correlation, found, deviation, followed, free)


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
    table: JumpTable,
    law: Law,
    speeds: FloatArray,
    left: FloatArray,
    free: int,
    error: float | None,
) -> tuple[float, bool]:
    """Standard deviation (rpm) of a reading, and whether it is the one that was given."""
    scatter = rms(left) * math.sqrt(left.size / free) if free else 0.0
    if (speeds >= FASTEST).any() or scatter > NO_FIT * float(speeds.mean()):
        raise ConfigError(
            f"{table.file}: the readings are {rms(left):.3g} rpm r.m.s. from any follower found on "
            f"cam {law.name}; allowed: {100.0 * NO_FIT:g} % of the speed; was that cam on, "
            "are the units right, is there a preload? A --rig nearer to it may help the search"
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
    return values | given


def _searched(trial: _JumpModel, values: dict[str, float]) -> FloatArray:
    """Least squares of the speeds, from the start and from springs and preloads about it."""
    wanted = to_rpm(np.array([reading.speed for reading in trial.readings]))
    if not trial.sought:
        return np.empty(0)

    def off(x: FloatArray) -> FloatArray:
        return (trial.speeds(x) - wanted) / wanted

    low, high = search_limits(trial.sought)
    best, found = math.inf, np.empty(0)
    rigid = "roller_share" not in values  # two masses take a hundred times as long
    for factor in (1.0, 0.2, 5.0) if rigid else (1.0,):
        begin = values | {"preload": max(values["preload"], 1.0) * factor}
        x = np.array([to_search(name, begin[name]) for name in trial.sought])
        result = least_squares(
            off,
            np.clip(x, low + 1e-9, high - 1e-9),
            bounds=(low, high),
            x_scale=np.array([_size(name, begin[name]) for name in trial.sought]),
            diff_step=np.full(x.size, STEP),
            xtol=1e-12 if rigid else 1e-8,
            ftol=1e-12 if rigid else 1e-8,
            gtol=1e-14,
            max_nfev=200 if rigid else 50,
        )
        if result.cost < best:
            best, found = float(result.cost), result.x
    return found


def _size(name: str, value: float) -> float:
    return 1.0 if NUMBERS[name].logarithm else max(abs(value), 1.0)


def _told(
    trial: _JumpModel,
    x: FloatArray,
    deviation: float,
    given: dict[str, float],
    names: tuple[str, ...],
    table: JumpTable,
    within: float,
) -> tuple[tuple[FoundNumber, ...], FloatArray]:
    """The numbers with standard errors, or why there is none; and their correlation."""
    values = {n: from_search(n, float(v)) for n, v in zip(trial.sought, x, strict=True)}
    sizes = np.array([_size(name, values[name]) for name in trial.sought])
    slopes = np.empty((len(trial.readings), x.size))
    low, high = search_limits(trial.sought)
    for k, step in enumerate(np.diag(STEP * sizes)):
        ends = [np.clip(x + sign * step, low, high) for sign in (1.0, -1.0)]
        up, down = (trial.speeds(end) for end in ends)
        slopes[:, k] = (up - down) * sizes[k] / (ends[0] - ends[1])[k]
    _, singular, directions = np.linalg.svd(slopes / deviation, full_matrices=False)
    seen = singular > BLIND * singular.max(initial=0.0)
    blind = [np.abs(direction) > SHARE for direction in directions[~seen]]
    inverse = directions[seen].T / singular[seen]
    covariance = inverse @ inverse.T
    errors = np.sqrt(np.diag(covariance)) * sizes
    found, kept = [], []
    for name in names:
        if name in table.columns and name != "mass":
            continue
        if name in given:
            found.append(FoundNumber(name, given[name], None, "given"))
            continue
        k = trial.sought.index(name)
        error = float(errors[k]) * slope(name, values[name])
        others = [
            other
            for group in blind
            if group[k]
            for i, other in enumerate(trial.sought)
            if group[i] and i != k
        ]
        reason = _reason(name, values[name], error, within, others, table)
        if reason:
            found.append(FoundNumber.unidentified(name, reason, error))
        else:
            found.append(FoundNumber(name, values[name], error, "identified", within=within))
            kept.append(k)
    part = covariance[np.ix_(kept, kept)]
    scale = np.sqrt(np.diag(part))
    found += [
        FoundNumber(name, value, None, "given")
        for name, value in given.items()
        if name not in names
    ]
    if "restitution" not in given:
        found.append(FoundNumber.unidentified("restitution", "no landing is in a jump speed"))
    return tuple(found), part / np.outer(scale, scale)


def _reason(
    name: str, value: float, error: float, within: float, others: list[str], table: JumpTable
) -> str:
    """Why a number is not identified; empty where it is."""
    if others:
        more = "" if "mass" in table.columns else ", or a column of masses put on"
        apart = ", ".join(dict.fromkeys(others))
        return f"not identifiable apart from {apart}: give one of them{more}"
    half = within * error
    if half < TOLD * WITHIN_95 * value:
        return ""
    if name == "mass" and value < half and "mass" in table.columns:
        return f"it is 0 ± {error:.2g} kg beside what was put on: is that the total mass?"
    return f"{interval_words(value, half, NUMBERS[name].unit)}: too wide"

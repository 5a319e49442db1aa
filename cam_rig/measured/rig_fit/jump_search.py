"""The numbers of a follower whose jump speeds are nearest to those of a table."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby, product

import numpy as np
from scipy.optimize import least_squares, nnls

from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.jump.search import FASTEST
from cam_rig.errors import CamRigError
from cam_rig.laws import Law
from cam_rig.measured.rig_fit.jump_table import JumpTable
from cam_rig.measured.rig_fit.numbers import (
    NUMBERS,
    OF_TWO,
    follower_of,
    from_search,
    search_limits,
    to_search,
)
from cam_rig.show.result import SILENT, Progress
from cam_rig.units import RPM, TURN, FloatArray, rms

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
        self.progress.begin(len(setups), "set-ups of a step of the search")
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
    results = [
        least_squares(
            trial.off,
            x,
            bounds=search_limits(trial.sought),
            x_scale=sizes_of(trial.sought, from_search(trial.sought, np.array(x))),
            diff_step=np.full(len(x), STEP),
            xtol=1e-12 if rigid else 1e-8,
            ftol=1e-12 if rigid else 1e-8,
            gtol=1e-14,
            max_nfev=200 if rigid else 50,
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
    rigid = replace(trial, sought=sought, given=given, progress=SILENT)
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

"""Jump speeds beside the published ones."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cam_rig.dynamics import TwoMassParameters
from cam_rig.errors import DynamicsError
from cam_rig.experiment.jump import Jump, jump_speed
from cam_rig.experiment.jump_ramp import jump_along_ramp
from cam_rig.experiment.jump_search import RPM
from cam_rig.laws import Law
from cam_rig.schema import PublishedTables


@dataclass(frozen=True)
class JumpRow:
    """A cam's jump from rest, in steady state or along a ramp, and what is published of it.

    ``steady`` is there beside a run from rest. ``defined`` says that the paper gives the law's
    equation: those cams identified the rig, the others test it.
    """

    cam: str
    found: Jump
    steady: Jump | None = None
    published_rpm: float | None = None
    published_time: float | None = None
    defined: bool = False

    @property
    def difference(self) -> float | None:
        """Found less published speed, relative to the published."""
        return None if self.published_rpm is None else self.found.rpm / self.published_rpm - 1.0


def find_jumps(
    laws: dict[str, Law],
    parameters: TwoMassParameters,
    published: PublishedTables,
    duration: float | None,
    ramp: float | None = None,
) -> list[JumpRow]:
    """The jump of every cam.

    Parameters
    ----------
    duration : s from rest at one speed, with the steady state beside it; None for that alone
    ramp : rpm/s, along a ramp from rest instead

    Raises
    ------
    DynamicsError : a duration or a ramp that is not above 0; a cam without a jump speed
    """
    if duration is not None and not (math.isfinite(duration) and duration > 0.0):
        raise DynamicsError(f"the run from rest lasts {duration:g} s; allowed: above 0")
    rows = []
    for cam, law in laws.items():
        if ramp is not None:
            rows.append(_row(cam, jump_along_ramp(law, parameters, ramp * RPM), None, published))
            continue
        found = jump_speed(law, parameters, duration)
        steady = _steady(law, parameters) if duration is not None else None
        rows.append(_row(cam, found, steady, published))
    return rows


def _steady(law: Law, parameters: TwoMassParameters) -> Jump | None:
    """The steady jump speed beside one from rest; None where a stem without damping has none."""
    if parameters.stem_damping + parameters.damping == 0.0:
        return None
    return jump_speed(law, parameters, None)


def _row(cam: str, found: Jump, steady: Jump | None, published: PublishedTables) -> JumpRow:
    known = published.table_2_jump.get(cam)
    if known is None:
        return JumpRow(cam, found, steady)
    defined = cam in published.table_2_defined
    return JumpRow(cam, found, steady, known.rpm, known.time_s, defined)


def rms_difference(rows: Iterable[JumpRow]) -> float:
    """r.m.s. of the relative differences of the cams that identified the rig; NaN for none."""
    known = [r.difference for r in rows if r.defined and r.difference is not None]
    return math.sqrt(float(np.mean(np.square(known)))) if known else math.nan


def same_ranking(rows: Iterable[JumpRow]) -> bool:
    """Whether the published cams come in the published order."""
    known = [r for r in rows if r.published_rpm is not None]
    ours = sorted(known, key=lambda r: r.found.rpm)
    theirs = sorted(known, key=lambda r: r.published_rpm or 0.0)
    return [r.cam for r in ours] == [r.cam for r in theirs]


def turn_of(row: JumpRow) -> tuple[float, float] | None:
    """How many turns after the start the cam is left, found and published."""
    if row.published_time is None or row.published_rpm is None:
        return None
    return row.found.time * row.found.rpm / 60.0, row.published_time * row.published_rpm / 60.0

"""Jump speeds beside the published ones."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from cam_rig.arrays import rms
from cam_rig.dynamics import TwoMassParameters
from cam_rig.laws import Law, build_law
from cam_rig.schema import CamConfig
from cam_rig.studies.jump.any_rig import AnyFollower, find_jump
from cam_rig.studies.jump.jump_speed import Jump, jump_speed, require_run
from cam_rig.studies.jump.published import Reference
from cam_rig.studies.jump.ramp import jump_along_ramp
from cam_rig.studies.jump.search import sought_speed
from cam_rig.units import RPM


@dataclass(frozen=True)
class JumpRow:
    """A cam's jump from rest, in steady state or along a ramp, and what is published of it.

    ``steady`` is there beside a run from rest. ``role`` is fitted where the cam identified the
    rig, test where it did not, and empty on another rig. Along a ramp nothing is compared: the
    published speeds are constant ones.
    """

    cam: str
    found: Jump
    steady: Jump | None = None
    published_rpm: float | None = None
    published_time: float | None = None
    role: str = ""
    ramp: float | None = None

    @property
    def difference(self) -> float | None:
        """Found less published speed, relative to the published; None along a ramp."""
        if self.ramp is not None:
            return None
        return None if self.published_rpm is None else self.found.rpm / self.published_rpm - 1.0


@dataclass(frozen=True)
class Comparison:
    """Jump speeds against Table 2.

    Parameters
    ----------
    rms : r.m.s. of the relative differences of ``cams`` cams: of those that identified the rig
        where ``fitted``, else of all that are published
    same_ranking : whether the published cams come in the published order
    turns, published_turns : fewest and most turns before contact is first lost
    """

    rms: float
    cams: int
    fitted: bool
    same_ranking: bool
    turns: tuple[float, float]
    published_turns: tuple[float, float]


def find_jumps(
    laws: dict[str, Law],
    parameters: AnyFollower,
    published: dict[str, Reference],
    duration: float | None,
    ramp: float | None = None,
    on_cam: Callable[[str], None] = lambda _: None,
) -> list[JumpRow]:
    """The jump of every cam.

    Parameters
    ----------
    duration : s from rest at one speed, with the steady state beside it; None for that alone
    ramp : rpm/s, along a ramp from rest instead
    on_cam : told each cam as it begins

    Raises
    ------
    DynamicsError : a duration or a ramp out of its limits; a cam without a jump speed
    """
    if duration is not None:
        require_run(duration)
    rows = []
    for cam, law in laws.items():
        on_cam(cam)
        steady = None
        if ramp is not None:
            found = jump_along_ramp(law, parameters, ramp * RPM)
        else:
            found = find_jump(law, parameters, duration)
            steady = _steady(law, parameters) if duration is not None else None
        rows.append(_row(cam, found, steady, published.get(cam), ramp))
    return rows


def _steady(law: Law, parameters: AnyFollower) -> Jump | None:
    """The steady jump speed beside one from rest.

    None where a stem without damping has none, and for one mass, where it is the same.
    """
    if not isinstance(parameters, TwoMassParameters):
        return None
    if parameters.stem_damping + parameters.damping == 0.0:
        return None
    return jump_speed(law, parameters, None)


def _row(
    cam: str, found: Jump, steady: Jump | None, known: Reference | None, ramp: float | None
) -> JumpRow:
    if known is None:
        return JumpRow(cam, found, steady, ramp=ramp)
    return JumpRow(cam, found, steady, known.rpm, known.time, known.role, ramp)


def compare(rows: list[JumpRow]) -> Comparison | None:
    """What a comparison with Table 2 comes to; None where nothing is to compare."""
    fitted = [row for row in rows if row.role == "fitted"]
    known = fitted or [row for row in rows if row.difference is not None]
    turns = [turn for turn in map(turn_of, rows) if turn is not None]
    if not turns or all(row.difference is None for row in rows):
        return None
    ours, theirs = ((min(t), max(t)) for t in zip(*turns, strict=True))
    return Comparison(
        rms_difference(known), len(known), bool(fitted), same_ranking(rows), ours, theirs
    )


def rms_difference(rows: Iterable[JumpRow]) -> float:
    """r.m.s. of the relative differences of the cams that have one; NaN for none."""
    known = [r.difference for r in rows if r.difference is not None]
    return rms(known) if known else math.nan


def same_ranking(rows: Iterable[JumpRow]) -> bool:
    """Whether the published cams come in the published order."""
    known = [r for r in rows if r.published_rpm is not None]
    ours = sorted(known, key=lambda r: r.found.rpm)
    theirs = sorted(known, key=lambda r: r.published_rpm or 0.0)
    return [r.cam for r in ours] == [r.cam for r in theirs]


def turn_of(row: JumpRow) -> tuple[float, float] | None:
    """How many turns after the start contact is lost, found and published."""
    if row.published_time is None or row.published_rpm is None:
        return None
    return row.found.time * row.found.rpm / 60.0, row.published_time * row.published_rpm / 60.0


#: The half-rises there are (laws thesis, eq. 3.4-3.9).
DEGREES = (4, 6, 8)


def jump_by_degree(
    cam: CamConfig, parameters: TwoMassParameters, duration: float
) -> dict[int, float]:
    """Jump speed (rpm) from rest with every half-rise of a cam of each degree.

    Empty for a cam that has no half-rises.
    """
    if not any(_HALF.fullmatch(segment.law) for segment in cam.segments):
        return {}
    return {
        degree: sought_speed(build_law(_with_degree(cam, degree)), parameters, duration) / RPM
        for degree in DEGREES
    }


_HALF = re.compile(r"bezier\d+_(start|end)")


def _with_degree(cam: CamConfig, degree: int) -> CamConfig:
    segments = [
        segment.model_copy(update={"law": _HALF.sub(rf"bezier{degree}_\1", segment.law)})
        for segment in cam.segments
    ]
    return cam.model_copy(update={"segments": segments})

"""Jump speeds beside the published ones."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from cam_rig.dynamics import MODELS, Interval, TwoMassParameters
from cam_rig.dynamics.interval import FollowerState
from cam_rig.dynamics.jump.any_follower import AnyFollower, JumpRow, find_jump
from cam_rig.dynamics.jump.jump_speed import Jump, jump_speed, require_run
from cam_rig.dynamics.jump.search import FASTEST, sought_speed
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law, build_law
from cam_rig.laws.cam import CamSet
from cam_rig.schema import CamConfig, PublishedTables, RigConfig, load_rig
from cam_rig.schema.load import WORDS, bare, config_root, same_as_shipped
from cam_rig.units import NS, RPM, TURN, rms

# What is published of the cams at hand, and what it was used for: told by content, not by name.

#: The rig that was identified from the jump speeds.
IDENTIFIED = "paper_table2"


@dataclass(frozen=True)
class Reference:
    """A published jump speed (rpm) and time (s); ``role`` is fitted, test, or empty."""

    rpm: float
    time: float
    role: str = ""


def references(cam_set: CamSet, published: PublishedTables) -> dict[str, Reference]:
    """What is published of a set of cams, by cam."""
    rig = is_identified(cam_set.rig)
    found = {}
    for name, cam in cam_set.cams.items():
        known = published.table_2_jump.get(name)
        if known is None or not same_as_shipped(cam, WORDS | {"span"}):
            continue
        role = ""
        if rig and same_as_shipped(cam, WORDS):
            role = "fitted" if name in published.table_2_defined else "test"
        found[name] = Reference(known.rpm, known.time_s, role)
    return found


def is_identified(rig: RigConfig) -> bool:
    """Whether a rig's follower is the one that was identified from the jump speeds."""
    shipped = load_rig(config_root() / "rigs" / f"{IDENTIFIED}.yaml")
    return bool(bare(rig.follower, WORDS) == bare(shipped.follower, WORDS))


# The jump speed of a cam that speeds up evenly from rest.

#: Slowest and steepest ramp, rpm/s: hours of turns, and a jump within the first turn.
SLOWEST, STEEPEST = 1.0, 1e5

#: Events are exact at any rate; samples are not looked at.
SAMPLE_RATE_HZ = 1000


def jump_along_ramp(law: Law, parameters: AnyFollower, rate: float) -> Jump:
    """Where the follower first loses contact on a cam that starts from rest at θ = 0.

    Parameters
    ----------
    rate : rad/s², of the cam
    """
    if not SLOWEST <= rate / RPM * (1.0 + 1e-12) <= STEEPEST * (1.0 + 2e-12):
        raise DynamicsError(
            f"the ramp is {rate / RPM:g} rpm/s; allowed: {SLOWEST:g} to {STEEPEST:g} rpm/s"
        )
    two = isinstance(parameters, TwoMassParameters)
    advance = MODELS["two_mass" if two else "one_mass"].advance
    state: FollowerState | None = None
    start = 0
    if law.lift == 0.0:  # a disc: it would be turned to the fastest speed for nothing
        raise _stays(law)
    for turn in range(1, math.ceil((FASTEST * RPM) ** 2 / (2.0 * rate) / TURN) + 1):
        stop, begun = round(math.sqrt(2.0 * TURN * turn / rate) * NS), start / NS
        tick = Interval(start, stop, 0.5 * rate * begun**2, rate * begun, rate)
        state, block = advance(law, parameters, state, tick, SAMPLE_RATE_HZ)
        if block.events:
            first = block.events[0]
            return Jump(rate * first.time, first.angle % TURN, first.time)
        start = stop
    raise _stays(law)


def _stays(law: Law) -> DynamicsError:
    return DynamicsError(
        f"cam {law.name!r}: the follower keeps contact up to {FASTEST:g} rpm; allowed for a "
        "jump speed: a cam on which contact is lost"
    )


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

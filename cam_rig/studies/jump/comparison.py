"""Jump speeds beside the published ones."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar

from cam_rig.dynamics import MODELS, FollowerParameters, Interval, TwoMassParameters
from cam_rig.dynamics.interval import FollowerState
from cam_rig.dynamics.jump.any_follower import (
    AnyFollower,
    described,
    described_run,
    find_jump,
    follower_of,
)
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.dynamics.jump.two_masses import (
    FASTEST,
    FROM_REST,
    Jump,
    keeps_contact,
    require_run,
)
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.laws.cam import CamSet
from cam_rig.schema import PublishedTables, load_rig
from cam_rig.schema.load import WORDS, bare, config_root, same_as_shipped
from cam_rig.show.result import NULL_PROGRESS, Column, Footnote, Progress, Records, Result
from cam_rig.show.tables import pluralize
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
    shipped = load_rig(config_root() / "rigs" / f"{IDENTIFIED}.yaml")
    identified = bare(cam_set.rig.follower, WORDS) == bare(shipped.follower, WORDS)
    found = {}
    for name, cam in cam_set.cams.items():
        known = published.table_2_jump.get(name)
        if known is None or not same_as_shipped(cam, WORDS | {"span"}):
            continue
        role = ""
        if identified and same_as_shipped(cam, WORDS):
            role = "fitted" if name in published.table_2_defined else "test"
        found[name] = Reference(known.rpm, known.time_s, role)
    return found


@dataclass(frozen=True)
class JumpRow:
    """A cam's jump from rest, in steady state or along a ramp (rpm/s), and what is published of it.

    ``steady`` is there beside a run from rest, ``rigid_rpm``, of one rigid mass, beside two masses.
    ``role`` is fitted where the cam identified the rig, test where it did not, and empty on another
    rig. Along a ramp nothing is compared: the published speeds are constant ones.
    """

    cam: str
    found: Jump
    steady: Jump | None = None
    published_rpm: float | None = None
    published_time: float | None = None
    role: str = ""
    ramp: float | None = None
    rigid_rpm: float | None = None

    @property
    def difference(self) -> float | None:
        """Found less published speed, relative to the published; None along a ramp."""
        if self.ramp is not None:
            return None
        return None if self.published_rpm is None else self.found.rpm / self.published_rpm - 1.0

    @property
    def turns(self) -> tuple[float, float] | None:
        """How many turns after the start contact is lost, found and published."""
        if self.published_time is None or self.published_rpm is None:
            return None
        ours = self.found.time * self.found.rpm / 60.0
        return ours, self.published_time * self.published_rpm / 60.0


@dataclass(frozen=True)
class Comparison:
    """Jump speeds against Table 2.

    ``rms`` of the relative differences is over ``cams`` cams: those that identified the rig where
    ``fitted``, else all that are published. ``turns`` are the fewest and most before contact is
    first lost.
    """

    rms: float
    cams: int
    fitted: bool
    same_ranking: bool
    turns: tuple[float, float]
    published_turns: tuple[float, float]


@dataclass(frozen=True, repr=False)
class JumpResult(Result):
    """The jump of every cam, in a run of ``duration`` s from rest, or in steady state for None."""

    schema = "cam_rig.jump.1"
    plot_function = "cam_rig.studies.jump.figures:figure"
    columns: ClassVar = {
        "jump": (
            Column("cam"),
            Column("role", heading="use", cell=lambda row: "" if row.ramp else row.role),
            Column("rpm", "rpm", ".2f", "jump speed", "found.rpm"),
            Column("published_rpm", "rpm", "g", "paper"),
            Column("difference", "%", "+.2f"),
            Column("steady_rpm", "rpm", ".2f", "steady state", "steady.rpm"),
            Column("rigid_rpm", "rpm", ".1f", "rigid"),
            Column("angle", "°", ".1f", "cam angle", "found.angle"),
            Column("time", "s", ".3f", of="found.time"),
            Column("published_time", "s", ".2f", "paper"),
        ),
        "run": (
            Column("rig", of="cam_set.rig.name"),
            Column("follower"),
            Column("duration", "s", doc="from rest; none in steady state and along a ramp"),
            Column("ramp", "rpm/s"),
        ),
    }
    notes = (
        Footnote(
            "Fitted: the rig's four unprinted numbers were identified from it. Test: nothing was "
            "fitted to it.",
            lambda row: row.role and row.ramp is None,
        ),
        "Cam angle and time: of the first loss of contact at the jump speed.",
        Footnote("Rigid: one mass on the same spring.", lambda row: row.rigid_rpm is not None),
    )

    cam_set: CamSet
    rows: tuple[JumpRow, ...]
    duration: float | None = FROM_REST

    @property
    def rpm(self) -> dict[str, float]:
        """The jump speeds by cam."""
        return {row.cam: row.found.rpm for row in self.rows}

    @property
    def follower(self) -> str:
        """Two masses or one, in words."""
        return described(follower_of(self.cam_set.rig))

    @property
    def ramp(self) -> float | None:
        """The ramp (rpm/s), where it is one."""
        return next((row.ramp for row in self.rows), None)

    @property
    def run(self) -> str:
        """Which follower, and how it runs, in words."""
        if self.ramp is not None:
            return f"{self.follower}, along a ramp of {self.ramp:g} rpm/s"
        return described_run(follower_of(self.cam_set.rig), self.duration)

    @property
    def comparison(self) -> Comparison | None:
        """What a comparison with Table 2 comes to; None where nothing is to compare."""
        fitted = [row for row in self.rows if row.role == "fitted"]
        known = fitted or [row for row in self.rows if row.difference is not None]
        turns = [row.turns for row in self.rows if row.turns is not None]
        if not turns or all(row.difference is None for row in self.rows):
            return None
        ours, theirs = ((min(t), max(t)) for t in zip(*turns, strict=True))
        printed = [row for row in self.rows if row.published_rpm is not None]
        ranked = sorted(printed, key=lambda row: row.found.rpm)
        same = ranked == sorted(printed, key=lambda row: row.published_rpm or 0.0)
        return Comparison(rms_difference(known), len(known), bool(fitted), same, ours, theirs)

    def tables(self) -> list[Records]:
        """``jump``, a row a cam, and ``run``."""
        caption = f"Jump speed on rig {self.cam_set.rig.name}: {self.run}"
        return [
            self.table("jump", caption, self.rows, *self.notes),
            self.table("run", "The runs", [self], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """What the comparison with Table 2 comes to."""
        if self.ramp is not None:
            words = "along a ramp: the speeds of Table 2 are constant ones, so nothing is compared"
            return [words]
        found = self.comparison
        if found is None:
            return ["nothing is published of these cams"]
        of = "that identified the rig" if found.fitted else "not used to identify the rig"
        ranking = f"; ranking {'as' if found.same_ranking else 'not as'} published"
        ours, theirs = (
            f"{low:.1f}" if low == high else f"{low:.1f} to {high:.1f}"
            for low, high in (found.turns, found.published_turns)
        )
        return [
            f"{100.0 * found.rms:.2f} % r.m.s. from Table 2 on {pluralize(found.cams, 'cam')} {of}"
            f"{ranking if len(self.rows) > 1 else ''}; contact first lost after {ours} turns, "
            f"published {theirs}"
        ]


def rms_difference(rows: Iterable[JumpRow]) -> float:
    """r.m.s. of the relative differences of the cams that have one; NaN for none."""
    known = [row.difference for row in rows if row.difference is not None]
    return rms(known) if known else math.nan


def find_jumps(
    cam_set: CamSet,
    published: dict[str, Reference],
    duration: float | None = FROM_REST,
    ramp: float | None = None,
    progress: Progress = NULL_PROGRESS,
) -> JumpResult:
    """The jump of every cam in ``duration`` s from rest at one speed, and in steady state.

    None for that alone; along a ``ramp`` (rpm/s) from rest instead.
    """
    if duration is not None:
        require_run(duration)
    follower, rows = follower_of(cam_set.rig), []
    for cam in progress.track(cam_set.laws):
        law, beside = cam_set.laws[cam], dict[str, Any](ramp=ramp)
        if (known := published.get(cam)) is not None:
            beside |= {"published_rpm": known.rpm, "published_time": known.time, "role": known.role}
        if ramp is not None:
            rows.append(JumpRow(cam, jump_along_ramp(law, follower, ramp * RPM), **beside))
            continue
        found, steady, rigid = find_jump(law, follower, duration), None, None
        if isinstance(follower, TwoMassParameters):  # one mass is rigid, from rest as settled
            rigid = rigid_jump_speed(law, FollowerParameters.from_rig(cam_set.rig)) / RPM
            if duration is not None and follower.stem_damping + follower.damping > 0.0:
                steady = find_jump(law, follower, None)
        rows.append(JumpRow(cam, found, steady, rigid_rpm=rigid, **beside))
    return JumpResult(cam_set, tuple(rows), None if ramp else duration)


# The jump speed of a cam that speeds up evenly from rest.

#: Slowest and steepest ramp, rpm/s: hours of turns, and a jump within the first turn.
SLOWEST, STEEPEST = 1.0, 1e5
#: Events are exact at any rate; samples are not looked at.
SAMPLE_RATE_HZ = 1000


def jump_along_ramp(law: Law, parameters: AnyFollower, rate: float) -> Jump:
    """First loss of contact on a cam that speeds up from rest at θ = 0 by ``rate`` rad/s²."""
    if not SLOWEST <= rate / RPM * (1.0 + 1e-12) <= STEEPEST * (1.0 + 2e-12):
        raise ConfigError(
            f"the ramp is {rate / RPM:g} rpm/s; allowed: {SLOWEST:g} to {STEEPEST:g} rpm/s"
        )
    two = isinstance(parameters, TwoMassParameters)
    advance = MODELS["two_mass" if two else "one_mass"].advance
    state: FollowerState | None = None
    start = 0
    if law.lift == 0.0:  # a disc: it would be turned to the fastest speed for nothing
        raise keeps_contact(law)
    for turn in range(1, math.ceil((FASTEST * RPM) ** 2 / (2.0 * rate) / TURN) + 1):
        stop, begun = round(math.sqrt(2.0 * TURN * turn / rate) * NS), start / NS
        tick = Interval(start, stop, 0.5 * rate * begun**2, rate * begun, rate)
        state, block = advance(law, parameters, state, tick, SAMPLE_RATE_HZ)
        if block.events:
            first = block.events[0]
            return Jump(rate * first.time, first.angle % TURN, first.time)
        start = stop
    raise keeps_contact(law)

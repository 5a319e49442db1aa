"""Jump speeds of cams, compared with the jump speeds published in the paper."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar

from cam_rig.dynamics import MODELS, FollowerParameters, Interval, TwoMassParameters
from cam_rig.dynamics.interval import FollowerState
from cam_rig.dynamics.jump.any_follower import (
    AnyFollower,
    describe_follower,
    describe_run,
    find_jump,
    follower_of,
)
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.dynamics.jump.two_masses import (
    MAX_RPM,
    REST_DURATION_S,
    Jump,
    no_jump_error,
    require_run,
)
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.laws.cam import CamSet
from cam_rig.schema import PublishedTables, load_rig
from cam_rig.schema.load import ORIGIN_NOTES, config_root, has_shipped_motion, plain_data
from cam_rig.show.result import (
    NULL_PROGRESS,
    Column,
    Footnote,
    Progress,
    Records,
    Result,
    subject_line,
)
from cam_rig.show.tables import pluralize
from cam_rig.units import NS, RPM, TURN, rms

# Published jump speeds. They are assigned to cams whose files have the content of a shipped cam.
#: Name of the shipped rig whose parameters were identified from jump speeds in Table 2 of the paper
#: on which the project is based.
IDENTIFIED = "paper_table2"


@dataclass(frozen=True)
class Reference:
    """Published jump speed (rpm) of a cam, and the time (s) at which contact is lost.

    `role` is "fitted" if the parameters of the rig were identified from this speed, and "test" if
    they were not. It is empty on another rig, or if the event angles of the cam (spans of its rises
    and falls) differ from those of the shipped cam.
    """

    rpm: float
    time: float
    role: str = ""


def references(cam_set: CamSet, published: PublishedTables) -> dict[str, Reference]:
    """Return the published jump speeds of a set of cams, by cam.

    A cam is included if its motion is that of a shipped cam with a published speed. The event
    angles (spans of its rises and falls) may differ.
    """
    shipped = load_rig(config_root() / "rigs" / f"{IDENTIFIED}.yaml")
    identified = plain_data(cam_set.rig.follower, ORIGIN_NOTES) == plain_data(
        shipped.follower, ORIGIN_NOTES
    )
    by_cam = {}
    for name, cam in cam_set.cams.items():
        row = published.table_2_jump.get(name)
        if row is None or not has_shipped_motion(cam, ORIGIN_NOTES | {"span"}):
            continue
        role = ""
        if identified and has_shipped_motion(cam, ORIGIN_NOTES):
            role = "fitted" if name in published.table_2_defined else "test"
        by_cam[name] = Reference(row.rpm, row.time_s, role)
    return by_cam


@dataclass(frozen=True)
class JumpRow:
    """Jump speed and first lift-off of a cam, with the published values.

    Parameters
    ----------
    cam : str
        Name of the cam.
    jump : Jump
        Jump from rest, in steady state or along a ramp.
    steady : Jump, optional
        Jump in steady state, if `jump` is a jump from rest.
    published_rpm, published_time : float, optional
        Published jump speed in rpm and time in s.
    role : str
        "fitted" if the rig was identified from this cam, "test" if not, empty on another rig.
    ramp : float, optional
        Slope of the ramp in rpm/s. Along a ramp the speeds are not compared, because the
        published speeds are constant speeds.
    rigid_rpm : float, optional
        Jump speed in rpm of one rigid mass, if the follower has two masses.
    """

    cam: str
    jump: Jump
    steady: Jump | None = None
    published_rpm: float | None = None
    published_time: float | None = None
    role: str = ""
    ramp: float | None = None
    rigid_rpm: float | None = None

    @property
    def difference(self) -> float | None:
        """Relative difference of the computed from the published jump speed.

        It is None along a ramp and without a published speed.
        """
        if self.ramp is not None:
            return None
        return None if self.published_rpm is None else self.jump.rpm / self.published_rpm - 1.0

    @property
    def turns(self) -> tuple[float, float] | None:
        """Numbers of turns before contact is lost: computed, and published.

        It is None without a published jump speed.
        """
        if self.published_time is None or self.published_rpm is None:
            return None
        ours = self.jump.time * self.jump.rpm / 60.0
        return ours, self.published_time * self.published_rpm / 60.0


@dataclass(frozen=True)
class Comparison:
    """Agreement of computed jump speeds with the paper's Table 2.

    The paper is the published study of the TM21 test rig on which the project is based.

    Parameters
    ----------
    rms : float
        Root mean square of the relative differences.
    cams : int
        Number of cams in `rms`.
    fitted : bool
        True if `rms` is over the cams from which the rig was identified, False if it is over all
        published cams.
    same_ranking : bool
        True if the speeds have the published order.
    turns, published_turns : tuple of float
        Minimum and maximum number of turns before contact is first lost.
    """

    rms: float
    cams: int
    fitted: bool
    same_ranking: bool
    turns: tuple[float, float]
    published_turns: tuple[float, float]


@dataclass(frozen=True, repr=False)
class JumpResult(Result):
    """Jump speeds of cams, with the first lift-off.

    ``rows`` has one element per cam. ``duration`` is that of the runs from rest in s, or None in
    steady state and along a ramp.
    """

    schema = "cam_rig.jump.1"
    plot_function = "cam_rig.studies.jump.figures:figure"
    columns: ClassVar = {
        "jump": (
            Column("cam"),
            Column("role", heading="use", cell=lambda row: "" if row.ramp else row.role),
            Column("rpm", "rpm", ".2f", "jump speed", "jump.rpm"),
            Column("published_rpm", "rpm", "g", "paper"),
            Column("difference", "%", "+.2f"),
            Column("steady_rpm", "rpm", ".2f", "steady state", "steady.rpm"),
            Column("rigid_rpm", "rpm", ".1f", "rigid"),
            Column("angle", "°", ".1f", "cam angle", "jump.angle"),
            Column("time", "s", ".3f", of="jump.time"),
            Column("published_time", "s", ".2f", "paper"),
        ),
        "run": (
            Column("rig", of="cam_set.rig.name"),
            Column("follower"),
            Column("duration", "s", doc="from rest; null in steady state and along a ramp"),
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
    duration: float | None = REST_DURATION_S

    @property
    def subject(self) -> str:
        """Cams, rig, and the model of the follower: two masses or one."""
        has_two = isinstance(follower_of(self.cam_set.rig), TwoMassParameters)
        model = "two_mass" if has_two else "one_mass"
        return subject_line(self.cam_set.laws, self.cam_set.rig.name, model)

    @property
    def rpm(self) -> dict[str, float]:
        """Computed jump speeds in rpm, by cam."""
        return {row.cam: row.jump.rpm for row in self.rows}

    @property
    def follower(self) -> str:
        """Kind of the follower as text: two masses, or one rigid mass."""
        return describe_follower(follower_of(self.cam_set.rig))

    @property
    def ramp(self) -> float | None:
        """Slope of the speed ramp (rpm/s), or None if the cam speed is constant."""
        return next((row.ramp for row in self.rows), None)

    @property
    def run(self) -> str:
        """Description of the follower and of its run (from rest, steady or ramp) as text."""
        if self.ramp is not None:
            return f"{self.follower}, along a ramp of {self.ramp:g} rpm/s"
        return describe_run(follower_of(self.cam_set.rig), self.duration)

    @property
    def comparison(self) -> Comparison | None:
        """Agreement with the paper's Table 2, or None if no published speed is comparable.

        The paper is the published study of the TM21 test rig on which the project is based.
        """
        fitted = [row for row in self.rows if row.role == "fitted"]
        compared = fitted or [row for row in self.rows if row.difference is not None]
        turns = [row.turns for row in self.rows if row.turns is not None]
        if not turns or all(row.difference is None for row in self.rows):
            return None
        found_range, published_range = ((min(t), max(t)) for t in zip(*turns, strict=True))
        printed = [row for row in self.rows if row.published_rpm is not None]
        ranked = sorted(printed, key=lambda row: row.jump.rpm)
        same = ranked == sorted(printed, key=lambda row: row.published_rpm or 0.0)
        ranges = found_range, published_range
        return Comparison(rms_difference(compared), len(compared), bool(fitted), same, *ranges)

    def tables(self) -> list[Records]:
        """Return the tables ``jump``, with one row per cam, and ``run``."""
        caption = f"Jump speed on rig {self.cam_set.rig.name}: {self.run}"
        return [
            self.table("jump", caption, self.rows, *self.notes),
            self.table("run", "The runs", [self], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """Return a sentence on the agreement with the paper's Table 2.

        The paper is the published study of the TM21 test rig on which the project is based.
        """
        if self.ramp is not None:
            return ["along a ramp: no comparison, because the speeds of Table 2 are constant"]
        comparison = self.comparison
        if comparison is None:
            return ["no jump speed of these cams is published"]
        use = "that identified the rig" if comparison.fitted else "not used to identify the rig"
        cams = f"{pluralize(comparison.cams, 'cam')} {use}"
        ranking = f"; ranking {'as' if comparison.same_ranking else 'not as'} published"
        turns, published_turns = (
            f"{low:.1f}" if low == high else f"{low:.1f} to {high:.1f}"
            for low, high in (comparison.turns, comparison.published_turns)
        )
        return [
            f"{100.0 * comparison.rms:.2f} % r.m.s. from Table 2 on {cams}"
            f"{ranking if len(self.rows) > 1 else ''}; contact first lost after {turns} turns, "
            f"published {published_turns}"
        ]


def rms_difference(rows: Iterable[JumpRow]) -> float:
    """Return the r.m.s. relative difference from the published jump speeds.

    It is NaN if no cam has a published speed. ``rows`` has one element per cam.
    """
    differences = [row.difference for row in rows if row.difference is not None]
    return rms(differences) if differences else math.nan


def find_jumps(
    cam_set: CamSet,
    published: dict[str, Reference],
    duration: float | None = REST_DURATION_S,
    ramp: float | None = None,
    progress: Progress = NULL_PROGRESS,
) -> JumpResult:
    """Find the jump speeds of a set of cams.

    Parameters
    ----------
    cam_set : CamSet
        Cams with their laws, and the rig.
    published : dict
        Published jump speeds by cam.
    duration : float or None
        Duration in s of runs from rest at constant speed. For two masses the jump in steady state
        is found too. None for the steady state only.
    ramp : float, optional
        Slope in rpm/s of a ramp from rest, which replaces the runs at constant speed.
    progress : Progress
        Receiver of the progress.
    """
    if duration is not None:
        require_run(duration)
    follower, rows = follower_of(cam_set.rig), []
    for cam in progress.track(cam_set.laws):
        law, details = cam_set.laws[cam], dict[str, Any](ramp=ramp)
        if (reference := published.get(cam)) is not None:
            details |= {"published_rpm": reference.rpm, "published_time": reference.time}
            details["role"] = reference.role
        if ramp is not None:
            rows.append(JumpRow(cam, jump_along_ramp(law, follower, ramp * RPM), **details))
            continue
        jump, steady, rigid = find_jump(law, follower, duration), None, None
        # One rigid mass does not vibrate, so its jump speed from rest is that in steady state.
        if isinstance(follower, TwoMassParameters):
            rigid = rigid_jump_speed(law, FollowerParameters.from_rig(cam_set.rig)) / RPM
            if duration is not None and follower.stem_damping + follower.damping > 0.0:
                steady = find_jump(law, follower, None)
        rows.append(JumpRow(cam, jump, steady, rigid_rpm=rigid, **details))
    return JumpResult(cam_set, tuple(rows), None if ramp else duration)


# Jump speed of a cam with constant acceleration from rest.

#: Smallest slope of a ramp, rpm/s. A smaller slope would require the simulation of hours of
#: rotation.
MIN_RAMP = 1.0
#: Largest slope of a ramp, rpm/s. At this slope contact is lost within the first turn.
MAX_RAMP = 1e5
#: Sample rate (Hz) of a run along a speed ramp. Only lift-offs and landings of the run are used,
#: which do not depend on the sample rate.
SAMPLE_RATE_HZ = 1000


def jump_along_ramp(law: Law, parameters: AnyFollower, rate: float) -> Jump:
    """Find the first loss of contact on a cam with a constant acceleration from rest.

    ``rate`` is the acceleration in rad/s². The run starts at θ = 0.

    Raises
    ------
    ConfigError
        If the ramp is not within 1 to 1e5 rpm/s.
    DynamicsError
        If the cam keeps contact up to the highest speed.
    """
    if not MIN_RAMP <= rate / RPM * (1.0 + 1e-12) <= MAX_RAMP * (1.0 + 2e-12):
        raise ConfigError(
            f"the ramp must be between {MIN_RAMP:g} and {MAX_RAMP:g} rpm/s, got {rate / RPM:g}"
        )
    two = isinstance(parameters, TwoMassParameters)
    advance = MODELS["two_mass" if two else "one_mass"].advance
    state: FollowerState | None = None
    start = 0
    if law.lift == 0.0:  # a circular disc keeps contact at every speed, so no run is needed
        raise no_jump_error(law)
    for turn in range(1, math.ceil((MAX_RPM * RPM) ** 2 / (2.0 * rate) / TURN) + 1):
        stop, start_time = round(math.sqrt(2.0 * TURN * turn / rate) * NS), start / NS
        tick = Interval(start, stop, 0.5 * rate * start_time**2, rate * start_time, rate)
        state, block = advance(law, parameters, state, tick, SAMPLE_RATE_HZ)
        if block.events:
            first = block.events[0]
            return Jump(rate * first.time, first.angle % TURN, first.time)
        start = stop
    raise no_jump_error(law)

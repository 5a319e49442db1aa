"""Which start ends in which motion: the basins of one speed, and what each motion looks like."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np

from cam_rig.arguments import checked
from cam_rig.dynamics import MODELS, Interval
from cam_rig.dynamics.events.backend import expect_many
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.turn_map import StroboscopicMap
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.show.result import NULL_PROGRESS, Column, Progress, Records, Result
from cam_rig.simulation.asked import speeds_within
from cam_rig.studies.bounce.motion import PERIODIC, TurnMotion, bouncing, motion_of
from cam_rig.studies.bounce.result import EXPONENT
from cam_rig.units import NS, RPM, FloatArray

#: Turns after which a start is looked at, and turns that tell the motion.
SETTLE, KEPT = 200, 40
#: Starts along each side.
GRID = 40
#: Starts reach so many times as far as the motion from the cam.
REACH = 2.0
#: Motions whose hardest landings differ by no more than this part are one.
SAME = 1e-3
#: Samples of a turn in a phase portrait; turns of one that does not repeat.
POINTS, SHOWN = 1500, 8


@dataclass(frozen=True, eq=False)
class EndMotion(TurnMotion):
    """A motion that some starts end in."""

    landings_per_turn: float
    hardest: float  #: m/s, fastest landing of the last turns
    states: FloatArray  #: ``(n, 2)`` gap (m) and its rate (m/s) at cam angle 0
    name: str = ""  #: a letter, by which `Basins.ends` names it
    share: float = 0.0  #: of the starts

    def same_as(self, other: EndMotion) -> bool:
        """Whether both are one: irregular ones are, periodic ones by period and landings."""
        if (self.motion, self.period) != (other.motion, other.period):
            return False
        if self.motion != PERIODIC:
            return True
        return abs(self.hardest - other.hardest) <= SAME * max(self.hardest, other.hardest)


@dataclass(frozen=True, repr=False, eq=False)
class Basins(Result):
    """Starts at cam angle 0 over gap and rate, and the motion that each ends in.

    Parameters
    ----------
    gap, opening : ``(n,)`` m and m/s, of the starts
    ends : ``(n, n)`` index of the motion, by opening and gap
    """

    schema = "cam_rig.bounce_basins.1"
    plot_function = "cam_rig.studies.bounce.figures:basin_figure"
    columns: ClassVar = {
        "motions": (
            Column("name", heading="motion"),
            Column("motion", heading="kind"),
            Column("period", "", "d", doc="in turns"),
            Column("landings_per_turn", "1/turn", ".3g", "landings"),
            *EXPONENT,
            Column("hardest", "m/s", ".3f", "hardest landing"),
            Column("share", "%", ".1f", "starts"),
        ),
        "starts": (
            Column("gap", "mm", of=lambda found: np.tile(found.gap, found.opening.size)),
            Column("opening", "m/s", of=lambda found: np.repeat(found.opening, found.gap.size)),
            Column(
                "name",
                heading="motion",
                of=lambda found: [found.motions[i].name for i in found.ends.ravel()],
            ),
        ),
    }

    law: Law
    rig: RigConfig
    parameters: FollowerParameters
    rpm: float
    gap: FloatArray
    opening: FloatArray
    ends: np.ndarray
    motions: tuple[EndMotion, ...]

    def tables(self) -> list[Records]:
        """``motions``; in data where each start ends."""
        e = self.parameters.restitution
        caption = f"{self.law.name} on rig {self.rig.name} at {self.rpm:g} rpm, restitution {e:g}"
        return [
            self.table("motions", caption, self.motions),
            self.array_table("starts"),
        ]

    def portrait(self, motion: EndMotion) -> tuple[FloatArray, FloatArray]:
        """``(n,)`` gap (m) and its rate (m/s) through the turns of a motion."""
        turn_map = StroboscopicMap(self.law, self.parameters, self.rpm * RPM)
        state = turn_map.follower(motion.states[-1].tolist())
        stop = round(len(motion.states) * turn_map.duration * NS)
        interval, rate = Interval(0, stop, 0.0, turn_map.speed), round(POINTS / turn_map.duration)
        _, block = MODELS["one_mass"].advance(self.law, self.parameters, state, interval, rate)
        cam = self.law.motion_at(turn_map.speed * block.time)
        return block.lift - cam[0], block.velocity - turn_map.speed * cam[1]


def _ends(
    law: Law, parameters: FollowerParameters, speed: float, starts: Sequence[tuple[float, float]]
) -> list[EndMotion]:
    """The motion in which each gap (m) and rate (m/s) ends, at a speed (rad/s)."""
    turn_map, ends = StroboscopicMap(law, parameters, speed), []
    for start in starts:
        run = turn_map.run(SETTLE + KEPT, start)
        found = motion_of(turn_map, run, KEPT)
        turns = found.period or SHOWN
        end = EndMotion(
            **vars(found),
            landings_per_turn=float(run.landings[-turns:].mean()),
            hardest=float(run.max_landing_speeds[-turns:].max()),
            states=run.states[-turns:],
        )
        ends.append(end)
    return ends


@checked
def basins(
    law: Law,
    rig: RigConfig,
    *,
    rpm: float,
    restitution: float | None = None,
    grid: int = GRID,
    executor: Executor | None = None,
    progress: Progress = NULL_PROGRESS,
) -> Basins:
    """Which start ends in which motion at one speed, of one rigid mass.

    Parameters
    ----------
    rpm : cam speed
    restitution : of a landing, from 0 to below 1; None is the rig's
    grid : starts along the gap, from 0, and along its rate, to either side; both twice as far as
        the motion from the cam comes
    executor : where they are computed; None is this process
    progress : told how far it is

    Raises
    ------
    ConfigError : a grid that is none, or the rig tells no restitution
    DynamicsError : a restitution or a speed that is none, or a turn of more than 10 000 landings

    Examples
    --------
    >>> import cam_rig
    >>> from cam_rig.studies.bounce.basins import basins
    >>> law = cam_rig.build_law(cam_rig.load_cam("tm21"))
    >>> found = basins(law, cam_rig.load_rig("tm21"), rpm=500, restitution=0.7, grid=2)
    >>> [(one.period, one.landings_per_turn, one.share) for one in found.motions]
    [(1, 3.0, 1.0)]
    """
    if grid < 2:
        raise ConfigError(f"grid: is {grid}; allowed: 2 or more starts along each side")
    p, speed = bouncing(rig, restitution), speeds_within(rpm)[0] * RPM
    assert isinstance(p, FollowerParameters)  # starts over gap and rate are those of one mass
    expect_many()
    gap, opening = _axes(StroboscopicMap(law, p, speed), grid)
    lines = [[(float(one), float(rate)) for one in gap] for rate in opening]
    progress.start(grid, law.name)
    ends, motions = list[int](), list[EndMotion]()
    for line in (map if executor is None else executor.map)(partial(_ends, law, p, speed), lines):
        for end in line:
            at = next((i for i, one in enumerate(motions) if one.same_as(end)), len(motions))
            if at == len(motions):
                motions.append(end)
            ends.append(at)
        progress.advance()
    counts = np.bincount(ends, minlength=len(motions))
    order = np.argsort(-counts, kind="stable")
    named = tuple(
        replace(motions[i], name=_letters(place), share=float(counts[i] / len(ends)))
        for place, i in enumerate(order.tolist())
    )
    places = np.argsort(order)[np.array(ends)].reshape(grid, grid)
    return Basins(law, rig, p, rpm, gap, opening, places, named)


def _axes(turn_map: StroboscopicMap, grid: int) -> tuple[FloatArray, FloatArray]:
    """Gaps (m) and rates (m/s) of the starts, by how far the motion from the cam comes."""
    run = turn_map.run(SETTLE + KEPT)
    least = 0.1 * turn_map.law.lift * np.array([1.0, turn_map.speed])  # on the cam at angle 0
    far = REACH * np.maximum(np.abs(run.states[-KEPT:]).max(axis=0), least)
    return np.linspace(0.0, far[0], grid), np.linspace(-far[1], far[1], grid)


def _letters(place: int) -> str:
    """A to Z, then AA, AB and so on."""
    head, last = divmod(place, 26)
    return (_letters(head - 1) if head else "") + chr(ord("A") + last)

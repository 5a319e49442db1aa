"""Basins of attraction at one speed: the motion in which each initial state ends.

An initial state is a gap between follower and cam, and the rate of this gap, at cam angle 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np

from cam_rig.arguments import check_arguments
from cam_rig.dynamics import MODELS, Interval
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.turn_map import StroboscopicMap
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.show.result import NULL_PROGRESS, Column, Progress, Records, Result
from cam_rig.simulation.inputs import check_speeds
from cam_rig.studies.bounce.motion import PERIODIC, TurnMotion, bouncing, motion_of
from cam_rig.studies.bounce.result import EXPONENT
from cam_rig.units import NS, RPM, FloatArray

#: Number of turns from each initial state that are computed before the motion is classified.
TRANSIENT_TURNS = 200
#: Number of turns after the `TRANSIENT_TURNS` from which the motion is classified.
CLASSIFIED_TURNS = 40
#: Default number of initial states along each side of the grid of gap and gap rate.
DEFAULT_GRID = 40
#: Largest gap and gap rate of the initial states, as a multiple of the largest gap and gap rate of
#: the motion that starts at rest on the cam.
RANGE_FACTOR = 2.0
#: Largest relative difference between the speeds of the fastest landings of two motions at which
#: they count as the same motion.
LANDING_RTOL = 1e-3
#: Number of samples per turn in a phase portrait (curve of gap rate over gap).
SAMPLES_PER_TURN = 1500
#: Number of turns in the phase portrait of a motion without a period.
PORTRAIT_TURNS = 8


@dataclass(frozen=True, eq=False)
class EndMotion(TurnMotion):
    """Final motion of the follower, to which some of the initial states lead.

    An initial state is a gap between follower and cam, and the rate of this gap, at cam angle 0.
    """

    landings_per_turn: float
    max_landing_speed: float  #: speed of the fastest landing in the last turns, m/s
    states: FloatArray  #: ``(n, 2)`` gap (m) and its rate (m/s) at cam angle 0
    name: str = ""  #: letter that identifies the motion
    share: float = 0.0  #: fraction of the initial states that end in this motion

    def same_as(self, other: EndMotion) -> bool:
        """Return True if two final motions count as the same motion.

        Two periodic motions are the same if their period and the speed of their fastest landing
        agree. Two other motions are the same if they are of the same kind, such as irregular.
        """
        if (self.motion, self.period) != (other.motion, other.period):
            return False
        if self.motion != PERIODIC:
            return True
        return abs(self.max_landing_speed - other.max_landing_speed) <= LANDING_RTOL * max(
            self.max_landing_speed, other.max_landing_speed
        )


@dataclass(frozen=True, repr=False, eq=False)
class Basins(Result):
    """Initial states at cam angle 0, and the motion in which each of them ends.

    An initial state is a gap between follower and cam, and the rate of this gap.

    Attributes
    ----------
    law : Law
        Motion law of the cam.
    rig : RigConfig
        Rig with the follower.
    parameters : FollowerParameters
        Follower as one rigid mass.
    rpm : float
        Cam speed, rpm.
    gap, gap_rate : FloatArray
        Gaps (m) and gap rates (m/s) of the initial states, ``(n,)`` each.
    ends : ndarray of int
        Index into ``motions`` for each initial state, ``(n, n)``: rows by gap rate, columns by gap.
    motions : tuple of EndMotion
        Final motions, the most frequent first.
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
            Column("max_landing_speed", "m/s", ".3f", "fastest landing"),
            Column("share", "%", ".1f", "starts"),
        ),
        "starts": (
            Column("gap", "mm", of=lambda result: np.tile(result.gap, result.gap_rate.size)),
            Column(
                "gap_rate", "m/s", of=lambda result: np.repeat(result.gap_rate, result.gap.size)
            ),
            Column(
                "name",
                heading="motion",
                of=lambda result: [result.motions[i].name for i in result.ends.ravel()],
            ),
        ),
    }

    law: Law
    rig: RigConfig
    parameters: FollowerParameters
    rpm: float
    gap: FloatArray
    gap_rate: FloatArray
    ends: np.ndarray
    motions: tuple[EndMotion, ...]

    def tables(self) -> list[Records]:
        """Return the tables ``motions`` (final motions) and ``starts`` (initial states).

        The table ``starts`` is not displayed, only exported to files.
        """
        e = self.parameters.restitution
        caption = f"{self.law.name} on rig {self.rig.name} at {self.rpm:g} rpm, restitution {e:g}"
        return [
            self.table("motions", caption, self.motions),
            self.array_table("starts"),
        ]

    def portrait(self, motion: EndMotion) -> tuple[FloatArray, FloatArray]:
        """Return the phase portrait of a motion: gap (m) and gap rate (m/s).

        Both have the shape ``(n,)``. The samples cover one period, or `PORTRAIT_TURNS` turns of a
        motion without a period.
        """
        turn_map = StroboscopicMap(self.law, self.parameters, self.rpm * RPM)
        state = turn_map.follower(motion.states[-1].tolist())
        stop = round(len(motion.states) * turn_map.duration * NS)
        interval = Interval(0, stop, 0.0, turn_map.speed)
        rate = round(SAMPLES_PER_TURN / turn_map.duration)
        _, block = MODELS["one_mass"].advance(self.law, self.parameters, state, interval, rate)
        cam = self.law.motion_at(turn_map.speed * block.time)
        return block.lift - cam[0], block.velocity - turn_map.speed * cam[1]


def _ends(
    law: Law, parameters: FollowerParameters, speed: float, starts: Sequence[tuple[float, float]]
) -> list[EndMotion]:
    """Return the final motion for each of several initial states at a speed (rad/s).

    ``starts`` are pairs of gap (m) and gap rate (m/s) at cam angle 0.
    """
    turn_map, ends = StroboscopicMap(law, parameters, speed), []
    for start in starts:
        run = turn_map.run(TRANSIENT_TURNS + CLASSIFIED_TURNS, start)
        motion = motion_of(turn_map, run, CLASSIFIED_TURNS)
        turns = motion.period or PORTRAIT_TURNS
        end = EndMotion(
            **vars(motion),
            landings_per_turn=float(run.landings[-turns:].mean()),
            max_landing_speed=float(run.max_landing_speeds[-turns:].max()),
            states=run.states[-turns:],
        )
        ends.append(end)
    return ends


@check_arguments
def basins(
    law: Law,
    rig: RigConfig,
    *,
    rpm: float,
    restitution: float | None = None,
    grid: int = DEFAULT_GRID,
    executor: Executor | None = None,
    progress: Progress = NULL_PROGRESS,
) -> Basins:
    """Find the final motion for each initial state of one rigid mass at one speed.

    The initial states are a grid of gaps between follower and cam, and of gap rates, at cam angle
    0.

    Parameters
    ----------
    law : Law
        Displacement law of the cam.
    rig : RigConfig
        Rig with the follower.
    rpm : float
        Cam speed, rpm.
    restitution : float, optional
        Coefficient of restitution of a landing, 0 to below 1 (default: the rig's value).
    grid : int, optional
        Number of initial states along each side of the grid, 2 or more (default: 40). The gap
        ranges from 0, the gap rate to either side of 0. Both ranges are twice those of the motion
        that starts on the cam.
    executor : Executor, optional
        Executor that computes the motions (default: this process).
    progress : Progress, optional
        Receiver of the progress.

    Returns
    -------
    Basins
        Final motion of each initial state.

    Raises
    ------
    ConfigError
        If ``grid`` is below 2, or neither ``restitution`` nor the rig has a restitution.
    DynamicsError
        If restitution or speed is invalid, or a turn has more than 10 000 landings.

    Examples
    --------
    >>> import cam_rig
    >>> from cam_rig.studies.bounce.basins import basins
    >>> law = cam_rig.build_law(cam_rig.load_cam("tm21"))
    >>> result = basins(law, cam_rig.load_rig("tm21"), rpm=500, restitution=0.7, grid=2)
    >>> [(motion.period, motion.landings_per_turn, motion.share) for motion in result.motions]
    [(1, 3.0, 1.0)]
    """
    if grid < 2:
        raise ConfigError(f"grid must be 2 or more starts along each side, got {grid}")
    p, speed = bouncing(rig, restitution), check_speeds(rpm)[0] * RPM
    # only the state of one mass consists of gap and gap rate
    assert isinstance(p, FollowerParameters)
    gap, gap_rate = _axes(StroboscopicMap(law, p, speed), grid)
    lines = [[(float(x), float(rate)) for x in gap] for rate in gap_rate]
    progress.start(grid, law.name)
    ends, motions = list[int](), list[EndMotion]()
    for line in (map if executor is None else executor.map)(partial(_ends, law, p, speed), lines):
        for end in line:
            index = next((i for i, m in enumerate(motions) if m.same_as(end)), len(motions))
            if index == len(motions):
                motions.append(end)
            ends.append(index)
        progress.advance()
    counts = np.bincount(ends, minlength=len(motions))
    order = np.argsort(-counts, kind="stable")
    named = tuple(
        replace(motions[i], name=_letters(rank), share=float(counts[i] / len(ends)))
        for rank, i in enumerate(order.tolist())
    )
    end_indices = np.argsort(order)[np.array(ends)].reshape(grid, grid)
    return Basins(law, rig, p, rpm, gap, gap_rate, end_indices, named)


def _axes(turn_map: StroboscopicMap, grid: int) -> tuple[FloatArray, FloatArray]:
    """Return gaps (m) and gap rates (m/s) of the grid of initial states.

    Both have the shape ``(grid,)``. Both ranges are `RANGE_FACTOR` times the range of the motion
    that starts on the cam.
    """
    run = turn_map.run(TRANSIENT_TURNS + CLASSIFIED_TURNS)
    # for a motion that stays on the cam
    min_range = 0.1 * turn_map.law.lift * np.array([1.0, turn_map.speed])
    ranges = RANGE_FACTOR * np.maximum(
        np.abs(run.states[-CLASSIFIED_TURNS:]).max(axis=0), min_range
    )
    return np.linspace(0.0, ranges[0], grid), np.linspace(-ranges[1], ranges[1], grid)


def _letters(index: int) -> str:
    """Return the name of a motion by its index: A to Z, then AA, AB and so on."""
    head, last = divmod(index, 26)
    return (_letters(head - 1) if head else "") + chr(ord("A") + last)

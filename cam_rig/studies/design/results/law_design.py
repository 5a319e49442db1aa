"""A designed law: beside its start, with what was asked of it, and the bound where there is one."""

from __future__ import annotations

import math
from dataclasses import dataclass

from cam_rig.laws import Law
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.studies.design.events import LawEvent
from cam_rig.studies.design.local.multistart import Multistart
from cam_rig.studies.design.quantities import Sense
from cam_rig.studies.design.request import DesignRequest
from cam_rig.studies.design.terms import Term

#: A result within this part of its bound is called certified.
CERTIFIED = 2e-3


@dataclass(frozen=True)
class Measure:
    """A goal or a limit of a design, SI (dB for levels).

    ``bound`` is what no law of the class passes, for the goal alone; ``limit`` for limits alone.
    """

    term: Term
    sense: Sense
    start: float
    result: float
    bound: float | None = None
    limit: float | None = None
    active: bool = False


@dataclass(frozen=True, eq=False)
class LawDesign:
    """The best law found, its cam and file; ``measures`` has the goal first.

    ``tops`` are the cam angles (rad) within events where start and law reach their lift;
    ``rounds`` is how many programs were solved; ``multistart`` is of a design that is not convex,
    which has no bound, and ``spans_bound`` of one whose events have other spans: what no law with
    just these spans passes. One whose search was interrupted is not ``ended``.
    """

    request: DesignRequest
    start: Law
    law: Law
    cam: CamConfig
    text: str
    rig: RigConfig
    events: tuple[LawEvent, ...]
    tops: tuple[float, ...]
    measures: tuple[Measure, ...]
    rounds: int
    multistart: Multistart | None = None
    spans_bound: float | None = None
    ended: bool = True

    @property
    def goal(self) -> Measure:
        """The goal's."""
        return self.measures[0]

    @property
    def gap(self) -> float:
        """How far the result is from its bound, in parts of it; of a level, of its pressure.

        Infinite where there is no bound.
        """
        if self.goal.bound is None:
            return math.inf
        if self.goal.term.name == "sound_level_rigid":
            return float(10.0 ** (abs(self.goal.result - self.goal.bound) / 20.0) - 1.0)
        size = max(abs(self.goal.bound), 1e-300)
        return abs(self.goal.result - self.goal.bound) / size

    @property
    def certified(self) -> bool:
        """Whether the bound proves that little could be better."""
        return self.gap <= CERTIFIED

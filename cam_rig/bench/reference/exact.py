"""The reference: every linear phase in closed form, with 50 digits and more to spare.

Shares no code with the rig's dynamics.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import mpmath as mp  # type: ignore[import-untyped]
import numpy as np

from cam_rig.bench.cases.case import Case, Solution
from cam_rig.bench.cases.models import BenchModel
from cam_rig.bench.cases.phase import Number, Vector
from cam_rig.bench.reference.exact_flow import Flow, first_crossing, flow
from cam_rig.bench.reference.exact_law import ExactPiece, exact_pieces
from cam_rig.units import TURN

DIGITS = 60


@dataclass
class _Course:
    """Gathers what is shown at the output times, and the events."""

    case: Case
    model: BenchModel
    displacement: list[list[float]] = field(default_factory=list)
    velocity: list[list[float]] = field(default_factory=list)
    events: list[tuple[str, float]] = field(default_factory=list)

    def show(self, run: Flow, start: Number, end: Number) -> None:
        """Output times up to local time ``end``."""
        while len(self.displacement) < self.case.times.size:
            time = mp.mpf(float(self.case.times[len(self.displacement)])) - start
            if time > end:
                return
            x, v = run.phase.shown(run.state(time), run.piece.motion(time))
            self.displacement.append([float(a) for a in x])
            self.velocity.append([float(a) for a in v])

    def through(self, piece: ExactPiece, start: Number, name: str, q: Vector) -> tuple[str, Vector]:
        """One piece of one turn, phase after phase; ``start`` is its time in s."""
        phases, time = self.model.phases(), mp.mpf(0)
        if phases[name].on_cam and phases[name].guard_value(q, piece.motion(time)) < 0:
            name, q = self._switch(name, q, piece, time, start)
        while True:
            run = flow(phases[name], piece, time, q)
            crossing = first_crossing(run, piece.duration) if run.phase.guard is not None else None
            time = piece.duration if crossing is None else crossing
            self.show(run, start, time)
            q = run.state(time)
            if crossing is None:
                return name, q
            name, q = self._switch(name, q, piece, time, start)

    def _switch(
        self, name: str, q: Vector, piece: ExactPiece, time: Number, start: Number
    ) -> tuple[str, Vector]:
        name, q, kinds = self.model.switch(name, q, piece.motion(time))
        self.events += [(kind, float(start + time)) for kind in kinds]
        return name, q


def solve(case: Case) -> Solution:
    """The case to (at least) 50 digits, rounded to doubles at the end."""
    assert isinstance(case.model, BenchModel)
    with mp.workdps(DIGITS):
        course = _Course(case, case.model.typed(mp.mpf))
        pieces = exact_pieces(case.law, case.speed)
        name, q = course.model.begin()
        for turn in range(case.turns):
            for piece in pieces:
                start = turn * mp.mpf(TURN) / mp.mpf(case.speed) + piece.start
                name, q = course.through(piece, start, name, q)
        return Solution(
            np.array(course.displacement).T, np.array(course.velocity).T, tuple(course.events)
        )

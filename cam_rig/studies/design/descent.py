"""From one law downhill: programs in which what is not convex is linear, each near the last law.

The convex limits stay as they are, so every law on the way keeps them. A step is taken only where
the exact quantities of the new law keep the other limits too, and the goal is better.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from scipy import sparse

from cam_rig.errors import DesignError, DynamicsError
from cam_rig.laws import Law
from cam_rig.profile.contact import Motion
from cam_rig.quantities.terms import sign_of
from cam_rig.quantities.values import SAMPLES, Branches, maxima
from cam_rig.studies.design.convex_program import Affine, ProgramSolution, RowBlock
from cam_rig.studies.design.cutting_planes import Cuts, FewRows, Solver
from cam_rig.studies.design.rows import add, force_parts, rows_of
from cam_rig.studies.design.space import Asked, DesignProblem, dwells, measured
from cam_rig.studies.design.two_mass_contact import Residual
from cam_rig.units import FloatArray

#: Steps of one descent, at most, and how often the rows of a step are corrected.
STEPS, CORRECTED = 60, 2
#: How far the ordinates (in lifts) may go in a step: at first, at most, and where it ends.
FIRST_REACH, MOST_REACH, LEAST_REACH = 0.1, 2.0, 1e-5
#: A step of less than this part of the goal ends it, the second time.
LITTLE = 2e-5
#: So does the promise of less than this part of the goal within the first reach.
PROMISED = 1e-5
#: A step that gains less than the first part of what its program promised is too long; one that
#: gains more than the second may be longer.
POOR, GOOD = 0.25, 0.7
#: Limits are met with so much of their scale to spare; a law keeps those that it is no more over.
SPARE, MOST_SPARE, KEPT = 1e-7, 1e-3, 1e-9
#: That is no more than this part of the room that the last law has.
ROOM = 0.5
#: Slopes of branches are central differences over this part of the largest s, s' or s'', those of
#: a value over this part of the lift: flights begin and end within it.
STEP, VALUE_STEP = 1e-5, 1e-3
#: A joint is looked at so much of a piece before and behind it; so much (dB) measures a level.
BESIDE, LEVEL_SCALE = 1e-6, 10.0
#: While limits are broken, a law is sought that keeps them with this to spare, no more.
INSIDE = 0.02


@dataclass(frozen=True, eq=False)
class PointwiseTerm:
    """A goal (``allowed`` NaN) or a limit on the greatest of branches, of s, s' and s''."""

    problem: DesignProblem
    name: str
    branches: Branches
    allowed: float

    @cached_property
    def scale(self) -> float:
        """What its rows are measured by: the largest size of a branch on the start."""
        u = np.linspace(0.0, 1.0, SAMPLES)
        values = np.abs(self.branches(Motion.on_pieces(self.problem.start, u)))
        return float(values[np.isfinite(values)].max(initial=0.0)) or 1.0

    def worst(self, law: Law) -> float:
        """The greatest value."""
        return max(value for value, _ in maxima(law, self.branches))

    @property
    def at_rest(self) -> float:
        """Its value in the dwells, which no law of the class changes; −∞ without one."""
        levels = [self.problem.start.at(start)[0] for start, _ in dwells(self.problem.start)]
        if not levels:
            return -np.inf
        motion = Motion(np.zeros(len(levels)), np.array(levels), *np.zeros((2, len(levels))))
        return float(self.branches(motion).max())

    @cached_property
    def _grid(self) -> FloatArray:
        """Angles in all pieces of the events, on both sides of the joints between them."""
        space = self.problem.space
        inner = space.law_class.pieces
        parts = (np.arange(inner)[:, None] + (np.arange(space.parts) + 0.5) / space.parts).ravel()
        joints = (np.arange(1, inner)[:, None] + np.array([-BESIDE, BESIDE])).ravel()
        places = np.concatenate([parts, joints])
        return np.concatenate([one.start + one.span / inner * places for one in space.events])

    def _inside(self, angles: FloatArray) -> FloatArray:
        """Those of the angles that are in events and not at their ends, where nothing is free."""
        space = self.problem.space
        least = 0.25 / (space.law_class.pieces * space.parts)
        place = np.array([(angles - event.start) / event.span for event in space.events])
        return np.asarray(angles[((least < place) & (place < 1.0 - least)).any(axis=0)])

    def rows(self, unknowns: FloatArray, tried: list[FloatArray]) -> Affine:
        """The branches near a law as functions of the unknowns, over the events and at its maxima.

        Where laws were ``tried`` from there their maxima are among them, and the rows give the
        exact values of the last one.
        """
        space = self.problem.space
        laws = [space.law(x, "design") for x in (unknowns, *tried)]
        tops = np.array([angle for law in laws for _, angle in maxima(law, self.branches)])
        at = np.concatenate([self._grid, self._inside(tops)])
        parts = [space.at(order, at) for order in range(3)]
        motion = Motion(at, *(part(unknowns) for part in parts))
        slopes = [self._slope(motion, order) for order in range(3)]
        found = []
        for branch, value in enumerate(self.branches(motion)):
            total = Affine(value, sparse.csr_array(parts[0].matrix.shape))
            for part, slope in zip(parts, slopes, strict=True):
                total += part.plus(-part(unknowns)).mapped(sparse.diags_array(slope[branch]))
            found.append(total)
        rows = Affine.stacked(found)
        if tried:
            exact = self.branches(Motion(at, *(part(tried[-1]) for part in parts)))
            rows = rows.plus(exact.ravel() - rows(tried[-1]))
        return rows

    def _slope(self, motion: Motion, order: int) -> FloatArray:
        """By how much the branches grow with s, s' or s''."""
        name = ("s", "slope", "curvature")[order]
        own = getattr(motion, name)
        step = STEP * float(np.abs(own).max())
        high, low = (self.branches(replace(motion, **{name: own + x})) for x in (step, -step))
        return np.asarray((high - low) / (2.0 * step))


@dataclass(eq=False)
class ValueTerm:
    """A goal or a limit that has nothing but a value: its slopes are differences of it."""

    problem: DesignProblem
    asked: Asked

    def __post_init__(self) -> None:
        asked = self.asked
        self.name, self._sign = asked.name, sign_of(asked.sense)
        self.allowed = math.nan if asked.value is None else self._sign * asked.value
        # the start's own level is no measure of what it changes by
        self.scale = LEVEL_SCALE if asked.term.quantity.unit == "dB" else asked.scale

    def worst(self, law: Law) -> float:
        """What is to be small."""
        return self._sign * measured(self.problem, law, self.asked.term, self.asked.sense)

    def rows(self, unknowns: FloatArray, tried: list[FloatArray]) -> Affine:
        """The value near a law; the exact one of the last law that was tried from there."""
        at, slope = tried[-1] if tried else unknowns, self._slope(unknowns.tobytes())
        constant = self._value(at) - slope @ at
        return Affine(constant, sparse.csr_array(slope))

    @lru_cache(maxsize=1)  # noqa: B019 - a term lives as long as its search
    def _slope(self, unknowns: bytes) -> FloatArray:
        """By how much the value grows with each unknown, ``(1, m)``; a step is tried more often."""
        space = self.problem.space
        steps = VALUE_STEP * np.eye(space.free)
        free, slope = np.frombuffer(unknowns)[: space.free], np.zeros((1, space.unknowns))
        for index, step in enumerate(steps):
            high, low = (self._value(space.joined(free + sign * step)) for sign in (1.0, -1.0))
            slope[0, index] = (high - low) / (2.0 * VALUE_STEP)
        return slope

    def _value(self, unknowns: FloatArray) -> float:
        return self.worst(self.problem.space.law(unknowns, "design"))


class Place(NamedTuple):
    """A law on the way: ``over`` is by how much it breaks its limits, in parts of their scales.

    ``goal`` is what is to be small, in parts of its scale; ``active`` names the limits that held it
    in the program that it comes from.
    """

    unknowns: FloatArray
    over: float
    goal: float
    active: tuple[str, ...] = ()


LocalTerm = PointwiseTerm | ValueTerm


@dataclass(eq=False)
class Descent:
    """The search of one goal, local or convex, under limits of both kinds.

    ``solver`` has the convex limits, of which ``cuts`` are those whose rows are found in rounds,
    and kept; ``on_place`` is told each law that keeps all limits.
    """

    solver: Solver
    goal: LocalTerm | Asked
    limits: list[LocalTerm]
    cuts: list[Cuts]
    on_place: Callable[[Place], None] = lambda _: None
    reach: float = field(default=FIRST_REACH, init=False)
    _residual: list[Cuts] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.problem, self._free = self.solver.problem, self.solver.problem.space.free
        assert not any(math.isnan(limit.allowed) for limit in self.limits)
        own = self.goal
        #: Whether the goal is the rigid jump speed.
        self._speed = isinstance(own, Asked) and rows_of(own.term).run is not None

    def place(self, unknowns: FloatArray) -> Place:
        """A law's exact values."""
        law = self.problem.space.law(unknowns, "design")
        each = ((limit.worst(law) - limit.allowed) / limit.scale for limit in self.limits)
        over = max(each, default=-np.inf)
        if isinstance(self.goal, Asked):
            sign = sign_of(self.goal.sense)
            value = sign * measured(self.problem, law, self.goal.term, self.goal.sense)
        else:
            value = self.goal.worst(law)
        return Place(unknowns, over, value / self.goal.scale)

    def run(self, unknowns: FloatArray) -> Place:
        """Downhill from a law that keeps the convex limits, to where no step is better."""
        here, self.reach, idle = self.place(unknowns), FIRST_REACH, 0
        for _ in range(STEPS):
            if here.over <= KEPT:
                self.on_place(here)
            better = self._step(here)
            if better is None:
                self.reach *= 0.25
                if self.reach < LEAST_REACH:
                    break
                continue
            gain = here.goal - better.goal
            if here.over > KEPT:
                gain = max(gain, here.over - better.over)
            idle = idle + 1 if gain < LITTLE * max(abs(better.goal), LITTLE) else 0
            here = better
            if idle == 2:
                break
        if here.over <= KEPT:
            self.on_place(here)
        return here

    def _step(self, here: Place) -> Place | None:
        """A better law within reach.

        Where a law that a program gives is not better, or breaks its limits, the rows of the next
        one are put right by what that law exactly comes to, and tighter by what it is over.
        """
        tried: list[FloatArray] = []
        spare = SPARE
        for _ in range(1 + CORRECTED):
            try:
                found = self._solved(here, tried, spare)
            except DesignError:  # nothing within reach, or the solver fails
                return None
            if not tried and self._settled(here, found):
                self.reach = 0.0
                return None
            there = self.place(found.unknowns)._replace(active=found.active)
            if here.over > KEPT:
                if there.over < max(0.9 * here.over, KEPT):
                    return there
            elif there.over <= KEPT and there.goal < here.goal:
                self._adapt(here, there, found.level)
                return there
            tried.append(found.unknowns)
            spare += max(0.0, min(there.over, MOST_SPARE))
        return None

    def _settled(self, here: Place, found: ProgramSolution) -> bool:
        """Whether a law keeps its limits and a program promises next to nothing for its reach."""
        promised, part = here.goal + found.level, PROMISED * min(1.0, self.reach / FIRST_REACH)
        return here.over <= KEPT and not self._speed and promised < part * abs(here.goal)

    def _adapt(self, here: Place, there: Place, level: float) -> None:
        """How far to go in the next step, by what this one gained of what was promised."""
        gain, promised = here.goal - there.goal, here.goal + level
        if self._speed:  # its level is a force
            promised = gain
        moved = np.abs(there.unknowns - here.unknowns)[: self._free].max()
        if gain < POOR * promised:
            self.reach *= 0.5
        elif gain > GOOD * promised and moved > 0.9 * self.reach:
            self.reach = min(2.0 * self.reach, MOST_REACH)

    def _solved(self, here: Place, tried: list[FloatArray], spare: float) -> ProgramSolution:
        """The best law of the program near a law; while it breaks limits, the goal waits."""
        program = self.solver.static(True)
        cuts: list[Cuts] = [FewRows([self._within(here)], every=1), *self.cuts]
        for limit in self.limits:
            room = limit.rows(here.unknowns, tried) * (-1.0 / limit.scale)
            room = room.plus(limit.allowed / limit.scale)
            # beside a dwell that is at the limit there is next to no room, and always
            room = room.plus(-np.clip(ROOM * room(here.unknowns), 0.0, spare))
            program.at_least(limit.name, room, -1.0 if here.over > KEPT else 0.0)
        if here.over > KEPT:
            program.at_least("inside", Affine.number(INSIDE, program.unknowns), -1.0)
        elif not isinstance(self.goal, Asked):
            rows = self.goal.rows(here.unknowns, tried) * (-1.0 / self.goal.scale)
            program.at_least(self.goal.name, rows, -1.0)
        elif self._speed:
            if not np.isfinite(here.goal):
                raise DynamicsError(
                    "the class has laws that keep contact at every speed; allowed: a limit on what "
                    "lets it, such as peak_acceleration<=start"
                )
            # where the level is zero at a law's jump speed, what is above it jumps later
            rows = force_parts(self.problem, -here.goal * self.goal.scale, True)
            program.at_least(self.goal.name, rows, -1.0)
        elif rows_of(self.goal.term).in_rounds:
            self._residual = self._residual or [Residual(self.problem, self.goal, True)]
            cuts += self._residual
        else:
            add(program, self.problem, self.goal, True)
        return self.solver.settled(program, cuts)

    def _within(self, here: Place) -> RowBlock:
        """The ordinates are within reach."""
        free = self._free
        eye = sparse.eye_array(free, self.problem.space.unknowns)
        at = here.unknowns[:free]
        constant = np.concatenate([self.reach - at, self.reach + at])
        rows = Affine(constant, sparse.vstack([eye, -eye], "csr"))
        return RowBlock("reach", rows, np.zeros(2 * free), "nonneg")

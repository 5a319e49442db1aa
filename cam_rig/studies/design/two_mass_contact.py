"""The contact force of two masses at every speed up to one, in every turn, as rows of a program.

Resonances are narrower than any grid of speeds one could afford as rows: a program is given what
is lowest, the law is looked at over the grid, and what it falls below becomes rows, until nothing
does. What the grid misses, the exact jump search finds: its speed joins the grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy import sparse

from cam_rig.dynamics.jump.two_masses import Jump
from cam_rig.errors import DynamicsError
from cam_rig.quantities.values import MISSED, minima, peaks, speeds_of
from cam_rig.studies.design.convex_program import Affine, ProgramSolution, RowBlock
from cam_rig.studies.design.modal_amplitude import Cells, ForceAtSpeed
from cam_rig.studies.design.space import SPARE, Asked, DesignProblem
from cam_rig.units import RPM, TURN, FloatArray, to_rpm

#: The grid goes down to this part of the speed, in steps that turn the phase by this much (rad)
#: over the time in which vibration decays; and has no more speeds than that.
DOWN_TO, PHASE_STEP, MAX_SPEEDS = 0.45, 0.5, 400
#: Where contact is lost below the grid, it goes down to this part of that speed; never below one.
FARTHER_DOWN, LEAST_SPEED = 0.7, 10.0 * RPM
#: Every so many-th speed of the grid is taken in any case, the fastest among them.
EVERY = 6
#: Rows of a turn at one speed that a law makes, at most: where it is lowest.
LOWEST = 4
#: Speeds with no more room than this part of the scale are looked at in every round.
CLOSE = 0.1
#: Rows that a solution is farther above than this part of the scale are left.
NEAR = 0.15
#: A law is below what the program allowed by more than this part of the scale.
BELOW = 6e-3
#: Rows of speeds above this part of the fastest are never left: the fastest may fall.
KEEP_ABOVE = 0.95
#: The level is at most so many times the scale.
TOP = 100.0
#: Rows are left where the level has fallen by this much since they last were.
FALLEN = 1e-3
#: Least force, in parts of its scale, that is kept at first: what lies between the places that are
#: looked at is lower. Where the exact search finds that it is lower by more, so many times more.
MARGIN, WIDER = 0.01, 1.6
#: Turns of a run from rest that are looked at, as far as it goes, beside the settled one.
TURNS = (1.0, 2.0, 3.0, 5.0, 8.0, 13.0, 21.0, 34.0)


@dataclass(eq=False)
class ContactKept:
    """Rows F ≥ t (in parts of the problem's scale of force) at speeds up to one.

    ``duration`` is that of the run from rest, s; None is the steady state. ``margin`` is the least
    force, in parts of the scale, where no goal asks for more.
    """

    problem: DesignProblem
    duration: float | None
    fastest: float
    name: str = "contact kept"
    limit: bool = False
    margin: float = MARGIN
    more: dict[float, float] = field(default_factory=dict)
    _rows: list[tuple[float, Affine, FloatArray]] = field(default_factory=list)
    _lowest: float = np.inf

    def __post_init__(self) -> None:
        self._look_down_to(DOWN_TO * self.fastest)
        rate = self.problem.mode.rate
        decay = min(1.0 / max(-rate.real, 1e-300), self.duration or np.inf)
        fine = PHASE_STEP / (abs(rate) * decay)
        if self.duration is not None and self.fastest * self.duration < 2.0 * TURN:
            turns = self.fastest * self.duration / TURN
            raise DynamicsError(
                f"a run from rest of {self.duration:g} s has {turns:.2g} turns at "
                f"{to_rpm(self.fastest):.4g} rpm; allowed for a design: 2 and more, or the goal "
                "jump_speed_steady"
            )
        self.step = max(min(0.02, fine), math.log(1.0 / DOWN_TO) / MAX_SPEEDS)
        self.anchor = self.fastest

    def _look_down_to(self, slowest: float) -> None:
        """Begin the grid at a speed (rad/s)."""
        self.slowest = slowest
        self.cells = Cells(self.problem.space, self.problem.mode, slowest)
        self._known: dict[float, ForceAtSpeed] = {}
        self._room: dict[float, float] = {}

    def _speeds(self) -> list[float]:
        """The grid up to the fastest, that itself, and what the exact search has found."""
        ratio = 1.0 + self.step
        top = math.floor(self._place + 1e-9)
        count = math.ceil(math.log(self.fastest / self.slowest) / math.log(ratio))
        grid = [self.anchor * ratio**k for k in range(top, top - count, -1)]
        extra = [speed for speed in self.more if speed < self.fastest]
        found = sorted({self.fastest, *grid, *extra})
        return [speed for speed in found if self._turns(speed)[-1] > 0.0]

    @property
    def _place(self) -> float:
        """Where the fastest stands in the grid."""
        return math.log(self.fastest / self.anchor) / math.log(1.0 + self.step)

    def move(self, factor: float) -> None:
        """Change the fastest by a factor, to a speed of the grid where that is a step or more."""
        before, self.fastest = self.fastest, self.fastest * factor
        if abs(factor - 1.0) > 0.7 * self.step:
            on_grid = self.anchor * (1.0 + self.step) ** round(self._place)
            self.fastest = on_grid if on_grid != before else self.fastest
        self._lowest = np.inf  # a level may be higher than the lowest so far

    def _turns(self, speed: float) -> list[float]:
        """Which turns are looked at, at a speed: whole ones, the run's end may cut the last."""
        if self.duration is None:
            return [math.inf]
        last = math.floor(speed * self.duration / TURN)
        seen = self.more.get(speed, 1.0)
        return sorted({seen, *(turn for turn in TURNS if turn < last), float(last)})

    def refine(self, jump: Jump, solution: ProgramSolution) -> None:
        """Look closer where and when the exact model loses contact; else widen the margin."""
        if jump.speed < self.slowest:
            self._look_down_to(max(FARTHER_DOWN * jump.speed, LEAST_SPEED))
        turn = 1.0 + math.floor(jump.speed * jump.time / TURN)
        self.more |= {jump.speed * (1.0 + self.step * k): turn for k in (-0.25, 1e-4, 0.25)}
        if not self.cut(solution):
            self.margin *= WIDER
            self._lowest = np.inf

    def _at(self, speed: float) -> ForceAtSpeed:
        if speed not in self._known:
            self._known[speed] = ForceAtSpeed(self.cells, speed)
        return self._known[speed]

    def look(self, unknowns: FloatArray, level: float) -> int:
        """Make rows of where the force is below a level; how many there are.

        In dwells, where only vibration lowers it, below the margin. Of neighbouring speeds the
        worst is taken, and of its turns the worst. Speeds at which it was close when last looked
        at come first: all are looked at where these make no row.
        """
        speeds = self._speeds()
        close = [speed for speed in speeds if self._room.get(speed, 0.0) < CLOSE]
        return self._rows_below(close, unknowns, level) or self._rows_below(speeds, unknowns, level)

    def _rows_below(self, speeds: list[float], unknowns: FloatArray, level: float) -> int:
        found = [self._below(speed, unknowns, level) for speed in speeds]
        dip = minima(np.array([values.min() for _, values in found]))
        dip[::-EVERY] = True
        made = 0
        for place in np.flatnonzero(dip):
            speed, (turn, values) = speeds[place], found[place]
            lowest = np.flatnonzero(minima(values) & (values < -0.5 * BELOW))
            chosen = lowest[np.argsort(values[lowest])[:LOWEST]]
            if chosen.size:
                force = self._at(speed)
                goal = force.first.moving[chosen] & (not self.limit)
                self._rows.append((speed, force.rows(chosen, turn), np.where(goal, -1.0, 0.0)))
                made += chosen.size
        return made

    def _below(self, speed: float, unknowns: FloatArray, level: float) -> tuple[float, FloatArray]:
        """The worst turn at a speed, and the force less what is wanted, in parts of the scale."""
        here, turns = self._at(speed), np.array(self._turns(speed))
        wanted = np.where(here.first.moving, level, self.margin)
        above = here.values(unknowns, turns) / self.problem.force_scale - wanted
        worst = int(np.argmin(above.min(axis=1)))
        self._room[speed] = float(above[worst].min())
        return float(turns[worst]), above[worst]

    def cut(self, solution: ProgramSolution) -> bool:
        """Leave the rows far above, add those below; whether there are any."""
        level = self.margin if self.limit else solution.level
        if level < self._lowest - FALLEN:  # else rows would come and go for ever
            self._lowest = level
            self._thin(solution)
        return self.look(solution.unknowns, level) > 0

    @property
    def blocks(self) -> list[RowBlock]:
        """The rows so far, of speeds up to the fastest."""
        scale = self.problem.force_scale
        chosen = [row for row in self._rows if row[0] <= self.fastest]
        if not self.limit:  # a level is finite before the first rows
            top = Affine.number(TOP * scale, self.problem.space.unknowns).dense()
            chosen.append((self.fastest, top, np.full(1, -1.0)))
        if not chosen:
            return []
        joined = Affine.stacked([rows for _, rows, _ in chosen])
        weight = np.concatenate([weight for _, _, weight in chosen])
        constant = joined.constant / scale - np.where(weight < 0.0, 0.0, self.margin)
        affine = Affine(constant, sparse.csr_array(joined.matrix / scale))
        necessary = self.margin == 0.0
        return [RowBlock(self.name, affine, weight, "nonneg", necessary=necessary)]

    def _thin(self, solution: ProgramSolution) -> None:
        """Leave the rows that the solution is far above."""
        kept = []
        for speed, rows, weight in self._rows:
            force = rows(solution.unknowns) / self.problem.force_scale
            near = force < np.where(weight < 0.0, solution.level, self.margin) + NEAR
            near |= speed > KEEP_ABOVE * self.fastest
            if near.any():
                kept.append((speed, rows.rows(near), weight[near]))
        self._rows = kept


# Residual vibration: the amplitude that an event alone leaves, at every speed of a range.

#: Every so many-th speed is in the first program.
FIRST_EVERY = 8
#: A cut is made where the law exceeds what the program allowed by so much.
WORSE = 1e-4
#: Numbers of a table of phases that is made at once.
MAX_TABLE = 2_000_000


@lru_cache(maxsize=4)
def _left(problem: DesignProblem, low: float, high: float) -> tuple[FloatArray, list[Affine]]:
    """Speeds (rad/s) of a range, and what each event leaves at them."""
    events = problem.space.events
    cells = Cells(problem.space, problem.mode, low)
    speeds = speeds_of(problem.mode, max(event.span for event in events), low, high)
    return speeds, [left_by_event(cells, e, speeds) for e in range(len(events))]


def left_by_event(cells: Cells, event: int, speeds: FloatArray) -> Affine:
    """What an event leaves at its end, in the unknowns, at speeds (rad/s), by Gauss points."""
    mode, (slope, curvature, columns) = cells.mode, cells.driving[event]
    points, weights = cells.gauss
    width = cells.width(event)
    angles = (width * (np.arange(cells.count)[:, None] + points)).ravel()
    share = np.tile(weights, cells.count) * width / (mode.rate - mode.rate.conjugate())
    constant = np.zeros(speeds.size, complex)
    matrix = np.zeros((speeds.size, cells.space.unknowns), complex)
    step = max(1, MAX_TABLE // angles.size)
    for first in range(0, speeds.size, step):
        some = slice(first, first + step)
        rate = mode.rate / speeds[some, None]
        fading = np.exp(rate * (cells.space.events[event].span - angles)) * share
        drive = slope.mapped(fading * mode.drive[0])
        drive += curvature.mapped(fading * (mode.drive[1] * speeds[some, None]))
        constant[some], matrix[some, columns] = drive.constant, drive.matrix
    return Affine(constant, matrix)


@dataclass(eq=False)
class Residual:
    """Cones |2a| ≤ limit (or t) of every event at speeds of a range."""

    problem: DesignProblem
    asked: Asked
    hull: bool
    blocks: list[RowBlock] = field(default_factory=list)

    def __post_init__(self) -> None:
        term = self.asked.term
        self.cells = Cells(self.problem.space, self.problem.mode, term.low)
        self.speeds, self.left = _left(self.problem, term.low, term.high)
        for affine in self.left:
            self._add(affine.rows(slice(None, None, FIRST_EVERY)))

    def cut(self, solution: ProgramSolution) -> bool:
        """Add the speeds at which the law is worst, if worse than allowed; whether there are."""
        allowed = self.asked.value
        if allowed is None:
            allowed = -solution.level * self.asked.scale
        elif self.hull:
            allowed *= 1.0 - WORSE
        cut = False
        for event, affine in enumerate(self.left):
            found = 2.0 * np.abs(affine(solution.unknowns))
            high = peaks(self.speeds, found, allowed * (1.0 - MISSED))
            highest = left_by_event(self.cells, event, high)
            worse = 2.0 * np.abs(highest(solution.unknowns)) > allowed * (1.0 + WORSE)
            if worse.any():
                self._add(highest.rows(worse))
                cut = True
        return cut

    def _add(self, at: Affine) -> None:
        count, size, scale = at.constant.size, self.problem.space.unknowns, self.asked.scale
        constant, matrix = np.zeros((count, 3)), np.zeros((count, 3, size))
        for place, part in ((1, np.real), (2, np.imag)):
            constant[:, place] = 2.0 * part(at.constant) / scale
            matrix[:, place] = 2.0 * part(at.matrix) / scale
        weight = np.zeros((count, 3))
        weight[:, 0] = self.asked.weight
        if self.asked.value is not None:
            kept, spare = (1.0 - WORSE, SPARE) if self.hull else (1.0, 0.0)
            constant[:, 0] = self.asked.value / scale * kept - spare
        rows = Affine(constant.ravel(), sparse.csr_array(matrix.reshape(-1, size)))
        self.blocks.append(RowBlock(self.asked.name, rows, weight.ravel(), "cone", 3))

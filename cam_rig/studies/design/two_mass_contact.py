"""Contact force of two masses as rows of a program, at all speeds up to a limit.

A row is an inequality of a convex program: the contact force at one cam angle, turn and speed is at
least the level. A grid of rows that resolves the resonances would be too large, so a program
contains only minima of the force. The law that it returns is evaluated over the grid. New minima
below the level become rows, until no force is below it. The exact jump search finds a loss of
contact between the speeds of the grid, and its speed is added to the grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy import sparse

from cam_rig.dynamics.jump.two_masses import Jump
from cam_rig.errors import DynamicsError
from cam_rig.quantities.values import PEAK_SEARCH_RTOL, minima, peaks, speeds_of
from cam_rig.studies.design.convex_program import Affine, ProgramSolution, RowBlock
from cam_rig.studies.design.modal_amplitude import Cells, ForceAtSpeed
from cam_rig.studies.design.space import SPARE, DesignProblem, ScaledLimit
from cam_rig.units import RPM, TURN, FloatArray, to_rpm

#: Lowest speed of the grid of cam speeds at which contact forces are evaluated, as a fraction of
#: the highest speed.
MIN_SPEED_RATIO = 0.45
#: Largest difference in phase (rad) between the vibrations at neighbouring speeds of the grid of
#: cam speeds, after the time in which the vibration decays.
PHASE_STEP = 0.5
#: Largest number of cam speeds at which the contact force of a law is evaluated.
MAX_SPEEDS = 400
#: Lowest speed of the grid of cam speeds after an extension, as a fraction of the speed below the
#: grid at which contact was lost.
EXTENSION_RATIO = 0.7
#: Lowest cam speed at which contact forces are evaluated, rad/s.
MIN_SPEED = 10.0 * RPM
#: Every n-th evaluated speed, counted from the highest, gets inequalities where the contact force
#: is too low. The speeds between them get inequalities only at minima of the force over the speed.
SPEED_STRIDE = 6
#: Largest number of inequalities that are added per speed after one solution of the program: those
#: at the lowest minima of the contact force.
MAX_ROWS = 4
#: If the contact force at a speed was within this distance of the required force, the speed is
#: evaluated first in the next round. The distance is relative to `DesignProblem.force_scale`.
CLOSE_DISTANCE = 0.1
#: Distance of the contact force above the required force at which an inequality is removed from the
#: program, relative to `DesignProblem.force_scale`.
REMOVE_ABOVE = 0.15
#: An inequality is added to the program if the contact force is below the required force by more
#: than half of this value, relative to `DesignProblem.force_scale`.
ROW_LEVEL_ATOL = 6e-3
#: Fraction of the highest cam speed above which inequalities are never removed, because the highest
#: speed may be lowered later.
KEEP_ABOVE = 0.95
#: Upper limit of the least contact force that a program maximises, relative to
#: `DesignProblem.force_scale`. It keeps the program bounded while it has no other inequalities.
MAX_LEVEL = 100.0
#: Decrease of the least contact force, since inequalities were last removed, at which they are
#: removed again. It is relative to `DesignProblem.force_scale`.
MIN_LEVEL_FALL = 1e-3
#: Initial required contact force, relative to `DesignProblem.force_scale`. It is above 0, because
#: the force is lower between the evaluated angles and speeds.
MARGIN = 0.01
#: Factor by which the required contact force is increased. It is applied if the exact jump search
#: finds a loss of contact of the program's law, and no new inequality of the program excludes it.
MARGIN_FACTOR = 1.6
#: Turns of a run from rest in which the contact force is evaluated, by their number from 1. Turns
#: after the end of the run are left out, and the last turn of the run is added.
TURNS = (1.0, 2.0, 3.0, 5.0, 8.0, 13.0, 21.0, 34.0)


@dataclass(eq=False)
class ContactRows:
    """Inequalities F ≥ t for the contact force of two masses, up to a highest speed.

    The level t is the variable that a program maximises. F and t are relative to the problem's
    ``force_scale``. ``fastest`` (rad/s) is the highest speed. ``duration`` (s) is that of the run
    from rest, None for the steady state. If ``limit`` is True, the inequalities belong to a limit
    and require ``margin`` instead of t. In dwells the margin is required in any case.
    ``extra_turns`` maps additional speeds (rad/s) to the turn in which contact was lost.
    """

    problem: DesignProblem
    duration: float | None
    fastest: float
    name: str = "contact kept"
    limit: bool = False
    margin: float = MARGIN
    extra_turns: dict[float, float] = field(default_factory=dict)
    _rows: list[tuple[float, Affine, FloatArray]] = field(default_factory=list)
    _lowest_level: float = np.inf

    def __post_init__(self) -> None:
        self._start_grid(MIN_SPEED_RATIO * self.fastest)
        rate = self.problem.mode.rate
        decay = min(1.0 / max(-rate.real, 1e-300), self.duration or np.inf)
        phase_ratio = PHASE_STEP / (abs(rate) * decay)
        if self.duration is not None and self.fastest * self.duration < 2.0 * TURN:
            turns = self.fastest * self.duration / TURN
            raise DynamicsError(
                "a run from rest must have 2 or more turns for a design, got "
                f"{turns:.2g} in {self.duration:g} s at {to_rpm(self.fastest):.4g} rpm; use the "
                "goal jump_speed_steady"
            )
        self.step = max(min(0.02, phase_ratio), math.log(1.0 / MIN_SPEED_RATIO) / MAX_SPEEDS)
        self.anchor = self.fastest

    def _start_grid(self, slowest: float) -> None:
        """Create the grid of cam speeds, from the lowest speed ``slowest`` (rad/s).

        Contact forces that were computed for an earlier grid are discarded.
        """
        self.slowest = slowest
        self.cells = Cells(self.problem.space, self.problem.mode, slowest)
        self._forces: dict[float, ForceAtSpeed] = {}
        self._distances: dict[float, float] = {}

    def _speeds(self) -> list[float]:
        """Return the cam speeds (rad/s) at which contact forces are evaluated, rising.

        They are a grid up to the highest speed, and speeds at which the exact search has found a
        loss of contact.
        """
        ratio = 1.0 + self.step
        top_index = math.floor(self._grid_position + 1e-9)
        count = math.ceil(math.log(self.fastest / self.slowest) / math.log(ratio))
        grid = [self.anchor * ratio**k for k in range(top_index, top_index - count, -1)]
        extra = [speed for speed in self.extra_turns if speed < self.fastest]
        speeds = sorted({self.fastest, *grid, *extra})
        return [speed for speed in speeds if self._turns(speed)[-1] > 0.0]

    @property
    def _grid_position(self) -> float:
        """Position of the highest speed on the grid of cam speeds, in grid steps.

        It is counted from the highest speed at which the search started.
        """
        return math.log(self.fastest / self.anchor) / math.log(1.0 + self.step)

    def move(self, factor: float) -> None:
        """Multiply the highest speed of the search by a factor.

        The new speed is rounded to a speed of the grid if the change is about a grid step or more.
        """
        before, self.fastest = self.fastest, self.fastest * factor
        if abs(factor - 1.0) > 0.7 * self.step:
            on_grid = self.anchor * (1.0 + self.step) ** round(self._grid_position)
            self.fastest = on_grid if on_grid != before else self.fastest
        self._lowest_level = np.inf  # at another speed the level may be higher again

    def _turns(self, speed: float) -> list[float]:
        """Return the numbers of the turns whose contact force is evaluated at a speed.

        Turns of a run from rest are counted from 1, and only turns that the run completes are
        included. In the steady state the only number is ∞. ``speed`` is in rad/s.
        """
        if self.duration is None:
            return [math.inf]
        last = math.floor(speed * self.duration / TURN)
        extra_turn = self.extra_turns.get(speed, 1.0)
        return sorted({extra_turn, *(turn for turn in TURNS if turn < last), float(last)})

    def refine(self, jump: Jump, solution: ProgramSolution) -> None:
        """Add the speed of a loss of contact to the grid of speeds.

        ``jump`` is the loss of contact that the exact jump search found for the law of
        ``solution``. If the program gets no new inequality at this speed, the required contact
        force (``margin``) is increased.
        """
        if jump.speed < self.slowest:
            self._start_grid(max(EXTENSION_RATIO * jump.speed, MIN_SPEED))
        turn = 1.0 + math.floor(jump.speed * jump.time / TURN)
        self.extra_turns |= {jump.speed * (1.0 + self.step * k): turn for k in (-0.25, 1e-4, 0.25)}
        if not self.add_violated(solution):
            self.margin *= MARGIN_FACTOR
            self._lowest_level = np.inf

    def _force_at(self, speed: float) -> ForceAtSpeed:
        if speed not in self._forces:
            self._forces[speed] = ForceAtSpeed(self.cells, speed)
        return self._forces[speed]

    def add_rows_below(self, unknowns: FloatArray, level: float) -> int:
        """Add inequalities where the contact force of a law is too low, and count them.

        The force is compared with ``level``, in units of the force scale. In dwells, where only
        vibration lowers the force, it is compared with the margin. An inequality is added at the
        minimum among neighbouring speeds, and only for the turn with the least force. Speeds at
        which the force was close to the level before are evaluated first. All speeds are evaluated
        only if these give no inequality.
        """
        speeds = self._speeds()
        close = [speed for speed in speeds if self._distances.get(speed, 0.0) < CLOSE_DISTANCE]
        return self._rows_below(close, unknowns, level) or self._rows_below(speeds, unknowns, level)

    def _rows_below(self, speeds: list[float], unknowns: FloatArray, level: float) -> int:
        minima_of_speeds = [self._worst_turn(speed, unknowns, level) for speed in speeds]
        dip = minima(np.array([values.min() for _, values in minima_of_speeds]))
        dip[::-SPEED_STRIDE] = True
        count = 0
        for index in np.flatnonzero(dip):
            speed, (turn, values) = speeds[index], minima_of_speeds[index]
            minima_indices = np.flatnonzero(minima(values) & (values < -0.5 * ROW_LEVEL_ATOL))
            chosen = minima_indices[np.argsort(values[minima_indices])[:MAX_ROWS]]
            if chosen.size:
                force = self._force_at(speed)
                goal = force.first.moving[chosen] & (not self.limit)
                self._rows.append((speed, force.rows(chosen, turn), np.where(goal, -1.0, 0.0)))
                count += chosen.size
        return count

    def _worst_turn(
        self, speed: float, unknowns: FloatArray, level: float
    ) -> tuple[float, FloatArray]:
        """Return the turn with the least contact force at a speed (rad/s).

        The second result is the force in this turn minus the required force at each evaluated
        angle, relative to the force scale. The required force is ``level``, or the margin in
        dwells.
        """
        force, turns = self._force_at(speed), np.array(self._turns(speed))
        required = np.where(force.first.moving, level, self.margin)
        above = force.values(unknowns, turns) / self.problem.force_scale - required
        worst = int(np.argmin(above.min(axis=1)))
        self._distances[speed] = float(above[worst].min())
        return float(turns[worst]), above[worst]

    def add_violated(self, solution: ProgramSolution) -> bool:
        """Add inequalities where the contact force of a solution is too low.

        Inequalities whose force is far above the required force are removed from time to time.
        Returns True if any inequality was added.
        """
        level = self.margin if self.limit else solution.level
        if (
            level < self._lowest_level - MIN_LEVEL_FALL
        ):  # otherwise the same rows could be removed and added endlessly
            self._lowest_level = level
            self._remove_rows(solution)
        return self.add_rows_below(solution.unknowns, level) > 0

    @property
    def blocks(self) -> list[RowBlock]:
        """Blocks of a convex program that require a contact force at many speeds.

        A block contains inequalities of one limit. They are those for cam speeds up to the present
        highest speed.
        """
        scale = self.problem.force_scale
        chosen = [row for row in self._rows if row[0] <= self.fastest]
        if not self.limit:  # this keeps the program bounded without other inequalities
            top = Affine.number(MAX_LEVEL * scale, self.problem.space.unknowns).dense()
            chosen.append((self.fastest, top, np.full(1, -1.0)))
        if not chosen:
            return []
        joined = Affine.stacked([rows for _, rows, _ in chosen])
        weight = np.concatenate([weight for _, _, weight in chosen])
        constant = joined.constant / scale - np.where(weight < 0.0, 0.0, self.margin)
        affine = Affine(constant, sparse.csr_array(joined.matrix / scale))
        necessary = self.margin == 0.0
        return [RowBlock(self.name, affine, weight, "nonneg", necessary=necessary)]

    def _remove_rows(self, solution: ProgramSolution) -> None:
        """Remove the inequalities whose contact force is far above the required force.

        The force is that of the law of ``solution``.
        """
        remaining = []
        for speed, rows, weight in self._rows:
            force = rows(solution.unknowns) / self.problem.force_scale
            near = force < np.where(weight < 0.0, solution.level, self.margin) + REMOVE_ABOVE
            near |= speed > KEEP_ABOVE * self.fastest
            if near.any():
                remaining.append((speed, rows.rows(near), weight[near]))
        self._rows = remaining


# Limits and goals on the residual vibration, which remains after each event, over a range of
# speeds.

#: Only every n-th speed of the range has an inequality in the first program.
FIRST_STRIDE = 8
#: Relative excess of the vibration amplitude over its limit above which an inequality is added.
#: Sufficient inequalities tighten the limit by the same fraction.
CUT_RTOL = 1e-4
#: Largest number of elements of a table of vibration phases (speeds times Gauss points). It limits
#: the memory.
MAX_TABLE = 2_000_000


@lru_cache(maxsize=4)
def _amplitudes(problem: DesignProblem, low: float, high: float) -> tuple[FloatArray, list[Affine]]:
    """Return cam speeds (rad/s) from ``low`` to ``high``, and the vibration at them.

    The vibration after each event (motion between two dwells) is a complex amplitude in m. It is
    given as one function of the unknowns per event, with one value per speed.
    """
    events = problem.space.events
    cells = Cells(problem.space, problem.mode, low)
    speeds = speeds_of(problem.mode, max(event.span for event in events), low, high)
    return speeds, [final_amplitude(cells, e, speeds) for e in range(len(events))]


def final_amplitude(cells: Cells, event: int, speeds: FloatArray) -> Affine:
    """Return the complex vibration amplitude (m) at the end of an event.

    An event is the motion between two dwells, with the number ``event`` from 0. The result is a
    linear function of the unknowns, with one value per speed of ``speeds`` (rad/s). Vibration from
    before the event is not included. It is integrated with Gauss points, exact to rounding.
    """
    mode, (slope, curvature, columns) = cells.mode, cells.driving[event]
    points, weights = cells.gauss
    width = cells.width(event)
    angles = (width * (np.arange(cells.count)[:, None] + points)).ravel()
    share = np.tile(weights, cells.count) * width / (mode.rate - mode.rate.conjugate())
    constant = np.zeros(speeds.size, complex)
    matrix = np.zeros((speeds.size, cells.space.unknowns), complex)
    step = max(1, MAX_TABLE // angles.size)
    for first in range(0, speeds.size, step):
        part = slice(first, first + step)
        rate = mode.rate / speeds[part, None]
        fading = np.exp(rate * (cells.space.events[event].span - angles)) * share
        drive = slope.mapped(fading * mode.drive[0])
        drive += curvature.mapped(fading * (mode.drive[1] * speeds[part, None]))
        constant[part], matrix[part, columns] = drive.constant, drive.matrix
    return Affine(constant, matrix)


@dataclass(eq=False)
class ResidualRows:
    """Inequalities that limit the residual vibration after every event of a law.

    An event is the motion between two dwells. The inequalities are |2a| ≤ limit for the complex
    amplitude a, at some speeds of a range. For a goal, minus the level t (the variable that a
    program maximises) replaces the limit. If ``sufficient``, the limit is tightened by a margin.
    """

    problem: DesignProblem
    target: ScaledLimit
    sufficient: bool
    blocks: list[RowBlock] = field(default_factory=list)

    def __post_init__(self) -> None:
        term = self.target.term
        self.cells = Cells(self.problem.space, self.problem.mode, term.low)
        self.speeds, self.left = _amplitudes(self.problem, term.low, term.high)
        for affine in self.left:
            self._add(affine.rows(slice(None, None, FIRST_STRIDE)))

    def add_violated(self, solution: ProgramSolution) -> bool:
        """Add inequalities at speeds at which the vibration of a solution is too large.

        These are the peaks of the amplitude over the speed. Returns True if any inequality was
        added.
        """
        allowed = self.target.value
        if allowed is None:
            allowed = -solution.level * self.target.scale
        elif self.sufficient:
            allowed *= 1.0 - CUT_RTOL
        add_violated = False
        for event, affine in enumerate(self.left):
            amplitudes = 2.0 * np.abs(affine(solution.unknowns))
            peak_speeds = peaks(self.speeds, amplitudes, allowed * (1.0 - PEAK_SEARCH_RTOL))
            at_peaks = final_amplitude(self.cells, event, peak_speeds)
            worse = 2.0 * np.abs(at_peaks(solution.unknowns)) > allowed * (1.0 + CUT_RTOL)
            if worse.any():
                self._add(at_peaks.rows(worse))
                add_violated = True
        return add_violated

    def _add(self, amplitudes: Affine) -> None:
        count, size = amplitudes.constant.size, self.problem.space.unknowns
        scale = self.target.scale
        constant, matrix = np.zeros((count, 3)), np.zeros((count, 3, size))
        for component, part in ((1, np.real), (2, np.imag)):
            constant[:, component] = 2.0 * part(amplitudes.constant) / scale
            matrix[:, component] = 2.0 * part(amplitudes.matrix) / scale
        weight = np.zeros((count, 3))
        weight[:, 0] = self.target.weight
        if self.target.value is not None:
            factor, spare = (1.0 - CUT_RTOL, SPARE) if self.sufficient else (1.0, 0.0)
            constant[:, 0] = self.target.value / scale * factor - spare
        rows = Affine(constant.ravel(), sparse.csr_array(matrix.reshape(-1, size)))
        self.blocks.append(RowBlock(self.target.name, rows, weight.ravel(), "cone", 3))

"""Laws to start from: the start's own, optima of convex goals, and seeded random laws of the class.

All of them keep the convex limits.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import sparse

from cam_rig.arrays import FloatArray
from cam_rig.studies.design.constraints import Asked, add
from cam_rig.studies.design.local.multistart import Multistart
from cam_rig.studies.design.programs.affine import Affine
from cam_rig.studies.design.programs.program import RowBlock
from cam_rig.studies.design.solve import Cuts, Solver
from cam_rig.studies.design.terms import Term

#: Convex goals whose best laws are started from.
GOALS = ("rms_acceleration", "peak_velocity")
#: A random law is on the way from the first of these to a random corner of the class: at least so
#: far, at most so far as s'' grows by so many times its largest.
LEAST_WAY, BENDS = 0.2, 3.0


def starts(solver: Solver, cuts: list[Cuts], asked: Multistart) -> Iterator[FloatArray]:
    """Unknowns of laws that keep the solver's limits and what is cut, as many as are asked for.

    The same for the same seed.

    Raises
    ------
    InfeasibleError : no law of the class keeps the convex limits
    DesignError : the solver did not end
    """
    yield _near_start(solver, cuts)
    random = np.random.default_rng(asked.seed)
    best = [_best(solver, cuts, goal) for goal in GOALS[: asked.starts - 1]]
    yield from best
    bend = solver.problem.space.derivative(2)
    for _ in range(asked.starts - 1 - len(best)):
        way = _corner(solver, cuts, random) - best[0]
        most = np.abs(bend(best[0])).max() / np.abs(bend.matrix @ way).max()
        yield best[0] + random.uniform(LEAST_WAY, 1.0) * min(1.0, BENDS * most) * way


def _near_start(solver: Solver, cuts: list[Cuts]) -> FloatArray:
    """The law of the class whose lift is nearest to the start's, in mean square."""
    problem = solver.problem
    space, program = problem.space, solver.static(True)
    u = np.linspace(0.0, 1.0, space.parts + 1)
    angles = (space.breaks[:-1, None] + u * space.spans[:, None]).ravel()
    apart = space.points(space.lift).plus(-problem.start(np.minimum(angles, space.breaks[-1])))
    none = Affine(np.zeros(1), sparse.csr_array((1, space.unknowns)))
    cone = Affine.stacked([none, apart * (1.0 / problem.start.lift)])
    weight = np.zeros(cone.constant.size)
    weight[0] = -1.0
    program.blocks.append(RowBlock("start", cone, weight, "cone", weight.size))
    return solver.settled(program, cuts).unknowns


def _best(solver: Solver, cuts: list[Cuts], goal: str) -> FloatArray:
    program = solver.static(True)
    scale = solver.problem.start.lift
    add(program, solver.problem, Asked(Term(goal), "<=", None, scale), True)
    return solver.settled(program, cuts).unknowns


def _corner(solver: Solver, cuts: list[Cuts], random: np.random.Generator) -> FloatArray:
    """The law that is farthest in a random direction of the ordinates."""
    space, program = solver.problem.space, solver.static(True)
    direction = np.zeros((1, space.unknowns))
    free = space.unknowns - space.link.constant.size
    direction[0, :free] = random.normal(size=free) / np.sqrt(free)
    program.at_least("direction", Affine(np.zeros(1), sparse.csr_array(direction)), -1.0)
    return solver.settled(program, cuts).unknowns

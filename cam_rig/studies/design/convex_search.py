"""Search for the best motion law of a class, for a convex goal and convex limits."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

from cam_rig.errors import ConfigError, DesignError
from cam_rig.studies.design.convex_program import InfeasibleError
from cam_rig.studies.design.cutting_planes import BestLaw, OnBetterLaw, Solver
from cam_rig.studies.design.rows import rows_of
from cam_rig.studies.design.space import DesignProblem, ScaledLimit
from cam_rig.studies.design.two_mass_search import TwoMassSearch
from cam_rig.units import FloatArray

#: If a minimised goal falls below this fraction of its value for the start law, the program is
#: solved again with a finer scale of the goal, which gives more correct digits.
SMALL_FRACTION = 0.05


def best_convex(
    problem: DesignProblem, goal: ScaledLimit, limits: list[ScaledLimit], on_better: OnBetterLaw
) -> BestLaw:
    """Return the best law of a convex goal under convex limits, and its bound.

    ``on_better`` is called with the unknowns and the goal's value (SI) of each better law.

    Raises
    ------
    InfeasibleError
        If it is proved that no law of the class satisfies the limits.
    DesignError
        If the search found no law, without a proof that the class has no such law.
    """

    def report(unknowns: FloatArray, value: float) -> None:
        on_better(unknowns, rows_of(goal.term).from_rows(problem, goal.term, value))

    best = _best(Solver(problem, goal, limits, report))
    if goal.sense == "<=" and 0.0 < best.value < SMALL_FRACTION * goal.scale:
        # for more digits of a small goal
        finer_goal = replace(goal, scale=best.value / SMALL_FRACTION)
        with suppress(DesignError):  # if it fails, the first result is used
            again = _best(Solver(problem, finer_goal, limits, report))
            law = min(best, again, key=lambda result: result.value)
            # a solved program has a bound
            assert best.bound is not None and again.bound is not None
            bound = max(best.bound, again.bound)
            best = replace(law, bound=bound, rounds=best.rounds + again.rounds)
    return best


def _best(solver: Solver) -> BestLaw:
    """Return the best law, found by the search that suits the kind of goal.

    The jump speed (lowest speed with loss of contact) of two masses or of one rigid mass needs a
    search over the speed. Any other goal is maximised by a single convex program.
    """
    run, rig = rows_of(solver.goal.term).run, solver.problem.rig
    try:
        if run is None:
            return solver.level()
        if solver.problem.two_masses and not run.rigid:
            return TwoMassSearch(solver, run.duration).best()
        if not run.rigid and run.duration is None:
            raise ConfigError(
                f"goal {solver.goal.term.name} requires follower.roller_share and "
                f"follower.stem_damping, which rig {rig.name!r} does not contain; add them, or use "
                "jump_speed_rigid"
            )
        return solver.rigid()
    except InfeasibleError as error:
        if error.proved:
            raise
        raise DesignError(
            f"no law was found whose ordinates satisfy {error.conflict}, although the class may "
            "have one; use limits looser by 0.1 %, or more pieces"
        ) from None

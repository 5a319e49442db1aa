"""Designs on a front, compared with an evolutionary search of the same class.

A design is a law that a search finds, and a front is the set of best compromises of two goals: jump
speed of one rigid mass, and peak |s″|. Both searches use the same evaluation, for laws of 16 pieces
at the events of poly345. The evolutionary search is NSGA-II (pymoo). Its variables (genes) are
combinations of the free ordinates that change s″ by equal amounts. With the ordinates themselves it
would not leave the start. The range of a gene is that of all designs of cam_rig, extended by half
on both sides. The search starts at and near the start law, and the lift is its constraint. The
program prints the table of docs/design.md and draws both fronts.

Usage: OMP_NUM_THREADS=1 python -m benchmark.design_front [--minutes 10] [--plot docs/front.png]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.problem import ElementwiseProblem
from pymoo.indicators.hv import HV
from pymoo.optimize import minimize
from pymoo.termination.max_time import TimeBasedTermination

import cam_rig
from cam_rig.laws import Law
from cam_rig.laws.law import extremes
from cam_rig.show.figure import write
from cam_rig.studies.design.figures import front_figure
from cam_rig.studies.design.request import DesignRequest, LawClass, parse_goal
from cam_rig.studies.design.result import Front
from cam_rig.studies.design.space import DesignProblem, Space, measured
from cam_rig.studies.design.study import front
from cam_rig.units import FloatArray, to_rpm

#: Number of points of the front of cam_rig.
FRONT_POINTS = 25
#: Number of laws per generation of NSGA-II.
POPULATION = 100
#: Random seed of NSGA-II.
SEED = 1
#: First goal, which is maximised.
GOAL = parse_goal("jump_speed_rigid")
#: Second goal, which is minimised.
OTHER = parse_goal("peak_acceleration")
#: Distances of the first population from the start law, relative to the range of the designs.
AROUND = (1e-3, 1e-2, 0.1, 0.5)
#: Relative lift by which a law of NSGA-II may exceed its range. For cam_rig it is zero.
LIFT = 1e-6


class Laws(ElementwiseProblem):
    """Problem of NSGA-II: negative jump speed (rpm) and peak |s″| (mm/rad²) of a law.

    The lift of the law is a constraint.
    """

    def __init__(
        self, problem: DesignProblem, shapes: np.ndarray, low: np.ndarray, high: np.ndarray
    ) -> None:
        self.problem, self.shapes, self.evaluated = problem, shapes, 0
        super().__init__(n_var=low.size, n_obj=2, n_ieq_constr=1, xl=low, xu=high)

    def _evaluate(self, x: FloatArray, out: dict[str, Any], *_args: Any, **_kwargs: Any) -> None:
        self.evaluated += 1
        problem = self.problem
        law = problem.space.law(problem.space.joined(self.shapes @ x), "peer")
        jump = to_rpm(measured(problem, law, GOAL, ">="))
        peak = measured(problem, law, OTHER, "<=") * 1e3
        low, high = extremes(law, 0)
        left = max(-low.value, high.value - problem.start.lift) / problem.start.lift
        out["F"], out["G"] = [-jump, peak], [left - LIFT]


def ordinates(space: Space, law: Law) -> np.ndarray:
    """Return the ordinates of the closest law of the class, relative to the lift."""
    angles = np.concatenate(
        [np.linspace(e.start, e.start + e.span, 400)[1:-1] for e in space.events]
    )
    rows = space.at(0, angles)
    own = space.law_class.free * len(space.events)
    matrix = rows.matrix.toarray()[:, :own]
    return np.linalg.lstsq(matrix, law(angles, 0) - rows.constant, rcond=None)[0]


def even_shapes(space: Space) -> np.ndarray:
    """Return free ordinates, in columns, whose changes of s″ are orthonormal."""
    own = space.law_class.free * len(space.events)
    angles = np.linspace(0.0, 2.0 * np.pi, 4000, endpoint=False)
    unit = np.eye(own)
    bends = [space.law(space.joined(law), "one")(angles, 2) for law in (0.0 * unit[0], *unit)]
    _, upper = np.linalg.qr(np.stack(bends[1:], axis=1) - bends[0][:, None])
    return np.linalg.inv(upper)


def main() -> None:
    """Compute both fronts, print the table and draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--plot", type=Path)
    arguments = parser.parse_args()
    cam, rig = cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2")
    request = DesignRequest.of(maximise=GOAL.key, law_class=LawClass(16, 3))
    start_time = time.perf_counter()
    ours = front(cam, rig, request, OTHER, FRONT_POINTS)
    took = time.perf_counter() - start_time
    start = ours.designs[0].start
    space = Space(start, request.law_class)
    shapes = even_shapes(space)
    laws_known = [start, *(design.law for design in ours.designs)]
    shapes_of_laws = np.array(
        [np.linalg.solve(shapes, ordinates(space, law)) for law in laws_known]
    )
    first = shapes_of_laws[0]
    low, high = shapes_of_laws.min(axis=0), shapes_of_laws.max(axis=0) + 1e-6
    problem = DesignProblem(cam, start, rig, space)
    laws = Laws(problem, shapes, 1.5 * low - 0.5 * high, 1.5 * high - 0.5 * low)
    spread = np.resize(AROUND, (POPULATION, 1)) * (high - low)
    rng = np.random.default_rng(SEED)
    population = first + rng.normal(size=(POPULATION, first.size)) * spread
    population[0] = first
    result = minimize(
        laws,
        NSGA2(pop_size=POPULATION, sampling=population),
        TimeBasedTermination(60.0 * arguments.minutes),
        seed=SEED,
    )
    report(ours, took, laws, result.F, arguments)


def report(
    ours: Front, took: float, laws: Laws, peer: FloatArray, arguments: argparse.Namespace
) -> None:
    """Print the table of both fronts, and draw the figure."""
    allowed = np.array(ours.allowed) * 1e3
    result = np.array([to_rpm(design.goal.result) for design in ours.designs])
    bounds = (design.goal.bound for design in ours.designs)
    bound = np.array(
        [to_rpm(value) for value in bounds if value is not None]
    )  # all designs for a jump speed have a bound
    designs = np.column_stack([-result, allowed])
    # The reference point of the hypervolume is just beyond the worst values of both fronts.
    worst = np.maximum(designs.max(axis=0), peer.max(axis=0))
    indicator = HV(ref_point=worst + 0.01 * np.abs(worst))
    indices = np.searchsorted(allowed, peer[:, 1])  # first design with this limit
    beyond = np.append(bound, np.inf)[indices] < -peer[:, 0]
    volume = indicator(designs), indicator(peer)
    print("| | points | laws evaluated | time | hypervolume |")
    print("|---|---|---|---|---|")
    programs = sum(design.rounds for design in ours.designs)
    print(f"| designs | {result.size} | {programs} programs | {took:.0f} s | 1 |")
    print(
        f"| NSGA-II | {len(peer)} | {laws.evaluated} | {60.0 * arguments.minutes:.0f} s | "
        f"{volume[1] / volume[0]:.3f} |"
    )
    print(
        f"\nPoints of NSGA-II beyond a bound: {int(beyond[indices < bound.size].sum())}; "
        f"jump speed {-peer[:, 0].max():.1f} to {-peer[:, 0].min():.1f} rpm at peak |s″| "
        f"{peer[:, 1].min():.2f} to {peer[:, 1].max():.2f} mm/rad²; "
        f"designs {result.min():.1f} to {result.max():.1f} rpm at {allowed.min():.2f} to "
        f"{allowed.max():.2f} mm/rad²"
    )
    if arguments.plot is not None:
        figure = front_figure(ours)
        figure.axes[0].plot(peer[:, 1], -peer[:, 0], "x", ms=4, color="0.4", label="NSGA-II")
        figure.axes[0].legend(frameon=False)
        write(figure, arguments.plot)


if __name__ == "__main__":
    main()

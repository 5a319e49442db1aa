"""The best law of a class between a cam's dwells, and the bound that proves it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cam_rig.api.arguments import checked
from cam_rig.api.notebook import shown
from cam_rig.extras import libraries_named
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.studies.design.design import design as solve
from cam_rig.studies.design.law_class import LawClass
from cam_rig.studies.design.local.multistart import STARTS, Multistart
from cam_rig.studies.design.request import KEEP, DesignRequest
from cam_rig.studies.design.results.law_design import LawDesign

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame


@dataclass(frozen=True, eq=False, repr=False)
class DesignedLaw(LawDesign):
    """A designed law: ``law``, ``cam``, the ``text`` of its file, and ``measures``, goal first."""

    def __repr__(self) -> str:
        """The goal, from start to result, and its bound."""
        goal = self.goal
        factor, unit = goal.term.quantity.shown, goal.term.quantity.unit
        bound = "local" if goal.bound is None else f"bound {goal.bound / factor:.4g}"
        start, result = goal.start / factor, goal.result / factor
        return f"DesignedLaw({self.request.words}: {start:.4g} → {result:.4g} {unit}, {bound})"

    def to_pandas(self) -> DataFrame:
        """A row for the goal and for each limit, SI (levels in dB).

        Raises
        ------
        MissingLibraryError : pandas is not installed
        """
        with libraries_named():
            from pandas import DataFrame
        keys = ("start", "result", "bound", "limit", "active")
        rows = [
            {"quantity": measure.term.key} | {key: getattr(measure, key) for key in keys}
            for measure in self.measures
        ]
        return DataFrame(rows)

    def plot(self) -> Figure:
        """Start and result: derivatives, contact force, contour.

        Raises
        ------
        MissingLibraryError : matplotlib is not installed
        """
        with libraries_named():
            from cam_rig.plots.laws.designed import figure
        return shown(figure(self))


@checked
def design(
    cam: CamConfig,
    rig: RigConfig,
    *,
    minimise: str | None = None,
    maximise: str | None = None,
    limits: Sequence[str] = (),
    pieces: int = 16,
    joints: int = 3,
    degree: int | None = None,
    starts: int = STARTS,
    seed: int = 1,
    keep: Sequence[str] = KEEP[0],
) -> DesignedLaw:
    """The law that is best by a goal, of B-splines in each event of a cam.

    Dwells, events and lift stay. The bound holds for the whole class: it comes from a convex
    program's multipliers. What is not convex is searched for from several starts, without a bound:
    ``multistart`` says how many of them came to the same.

    Parameters
    ----------
    minimise, maximise : one of them: a quantity as `cam-rig design` takes it
    limits : such as ``"peak_acceleration<=start"`` or ``"lift@90deg>=30mm"``
    pieces, joints, degree : of the splines; joints k means Cᵏ, a degree is by default k + 2
    keep : what stays: all of it, ``("dwells", "lift")`` or ``("lift",)``; then spans are searched
    starts, seed : of a local search; the same seed gives the same law

    Raises
    ------
    ConfigError : an unknown quantity or unit, a goal or limit that is not convex that way
    DesignError : no law of the class keeps the limits
    MissingLibraryError : clarabel or highspy is not installed

    Examples
    --------
    >>> import cam_rig
    >>> cam, rig = cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2")
    >>> found = cam_rig.design(cam, rig, minimise="peak_acceleration", joints=1)
    >>> print(f"{found.goal.start:.4f} {found.goal.result:.4f} m/rad^2")
    0.0686 0.0476 m/rad^2
    """
    request = DesignRequest.of(
        minimise=minimise,
        maximise=maximise,
        limits=limits,
        law_class=LawClass(pieces, joints, degree),
        multistart=Multistart(starts, seed),
        keep=keep,
    )
    return DesignedLaw(**vars(solve(cam, rig, request)))

"""A designed law as a cam file: B-splines between the dwells of its start."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.schema import CamConfig
from cam_rig.studies.cam_fit.cam_file import quantity, to_yaml, valid_cam
from cam_rig.studies.design.constraints import Asked
from cam_rig.studies.design.local.multistart import Multistart
from cam_rig.studies.design.problem import DesignProblem
from cam_rig.studies.design.terms import Term

#: A law's lift is its file's where they differ by no more than this part.
SAME = 1e-12


@dataclass(frozen=True)
class DesignedCam:
    """A cam and the text of its file."""

    cam: CamConfig
    text: str


def designed_cam(
    problem: DesignProblem,
    unknowns: FloatArray,
    name: str,
    verb: str,
    goal: Term,
    limits: list[Asked],
    search: Multistart | None = None,
) -> DesignedCam:
    """The cam of some unknowns, with the follower of the start's; ``search`` of what is local.

    Raises
    ------
    ConfigError : the name is not one
    """
    source = f"designed to {verb} {goal.key} on rig {problem.rig.name}"
    data: dict[str, Any] = {
        "name": name,
        "title": f"{problem.cam.title}, designed",
        "lift": _lift(problem),
        **_follower(problem),
        "segments": _segments(problem, unknowns, source),
    }
    header = [
        f"# {_found(search)} by this goal: {verb} {goal.key}.",
        f"# Start: {problem.cam.name}; rig: {problem.rig.name}; {problem.space.law_class.words}.",
        *(f"# Limit: {limit.name}." for limit in limits),
        f"# Made by cam-rig design; {_kept(problem)}.",
    ]
    return DesignedCam(valid_cam(data), "\n".join(header) + "\n" + to_yaml(data))


def _kept(problem: DesignProblem) -> str:
    kept = [what for what in ("dwells", "events") if what not in problem.free]
    return f"{' and '.join(kept)} are the start's" if kept else "the lift is the start's"


def _found(search: Multistart | None) -> str:
    if search is None:
        return "The law of its class that is best"
    return f"The best law found, seed {search.seed}, {search.words}, without a bound,"


def _lift(problem: DesignProblem) -> dict[str, Any]:
    """The start's, with where it comes from; a law may have another than its file's."""
    own, name = problem.cam.lift, problem.cam.name
    if abs(own.si - problem.start.lift) > SAME * problem.start.lift:
        return quantity("assumed", problem.start.lift * 1e3, "mm", f"that of the law of {name}")
    return quantity(own.origin, own.numbers[0], own.unit, f"as {name}: {own.source}", own.residual)


def _follower(problem: DesignProblem) -> dict[str, Any]:
    data = problem.cam.model_dump(exclude_none=True)
    kept = {"follower": _plain(data["follower"])}
    return kept | ({"contact": _plain(data["contact"])} if "contact" in data else {})


def _plain(data: dict[str, Any]) -> dict[str, Any]:
    """Without empty words."""
    return {
        key: {k: v for k, v in value.items() if v != ""} if isinstance(value, dict) else value
        for key, value in data.items()
    }


def _segments(problem: DesignProblem, unknowns: FloatArray, source: str) -> list[dict[str, Any]]:
    space, found, at = problem.space, [], 0.0
    own = {what: _origin(problem, what) for what in ("dwells", "events")}
    for index, event in enumerate(space.events):
        found += _dwell(at, event.start, own["dwells"])
        at = event.start + event.span
        ordinates = space.coefficients(index)(unknowns) / problem.start.lift
        law_class = space.law_class
        knots = np.rint(law_class.knots[1:-1] * law_class.pieces).astype(int).tolist()
        found.append(
            {
                "law": "b_spline",
                "span": _span(event.span, own["events"]),
                "degree": law_class.power,
                "knots": quantity("assumed", knots, "1", f"{law_class.pieces} equal pieces"),
                "ordinates": quantity("identified", ordinates.tolist(), "1", source),
            }
        )
    found += _dwell(at, 2.0 * math.pi, own["dwells"])
    return found


def _origin(problem: DesignProblem, what: str) -> tuple[str, str]:
    """Whether spans of events or dwells are the cam's or found, and the words for it."""
    if what in problem.free:
        return "identified", "found with the law"
    return "assumed", f"that of {problem.cam.name}"


def _dwell(start: float, end: float, origin: tuple[str, str]) -> list[dict[str, Any]]:
    if end - start <= 0.0:
        return []
    return [{"law": "dwell", "span": _span(end - start, origin)}]


def _span(span: float, origin: tuple[str, str]) -> dict[str, Any]:
    kind, source = origin
    return quantity(kind, round(math.degrees(span), 10), "deg", source)

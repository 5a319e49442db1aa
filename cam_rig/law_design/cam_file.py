"""A designed law as a cam file: B-splines between the dwells of its start."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from cam_rig.law_design.constraints import Asked, DesignProblem
from cam_rig.law_design.request import Multistart
from cam_rig.law_design.space import LawEvent, Space
from cam_rig.law_design.terms import Term
from cam_rig.laws import Law
from cam_rig.schema import CamConfig
from cam_rig.schema.load import quantity, to_yaml, valid_cam
from cam_rig.units import FloatArray

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
    """The cam of some unknowns, with the follower of the start's; ``search`` of what is local."""
    source = f"designed to {verb} {goal.key} on rig {problem.rig.name}"
    title = f"{problem.cam.title}, designed"
    data = class_cam_data(problem.cam, problem.space, unknowns, name, title, source, problem.free)
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


def class_cam_data(
    cam: CamConfig,
    space: Space,
    unknowns: FloatArray,
    name: str,
    title: str,
    source: str,
    free: tuple[str, ...] = (),
) -> dict[str, Any]:
    """The content of the file of a law of a class, with the follower of the cam it starts from.

    Parameters
    ----------
    cam : of which ``space`` has the law, dwells and events
    unknowns : of the space
    source : where the ordinates come from
    free : what of dwells and events the space has elsewhere than the cam
    """
    own = space.law_class
    knots = np.rint(own.knots[1:-1] * own.pieces).astype(int).tolist()
    splines = [
        {
            "degree": own.power,
            "knots": quantity("assumed", knots, "1", f"{own.pieces} equal pieces"),
            "ordinates": quantity(
                "identified",
                (space.coefficients(index)(unknowns) / space.start.lift).tolist(),
                "1",
                source,
            ),
        }
        for index in range(len(space.events))
    ]
    return spline_cam_data(cam, space.start, space.events, splines, name, title, free)


def spline_cam_data(
    cam: CamConfig,
    start: Law,
    events: list[LawEvent],
    splines: list[dict[str, Any]],
    name: str,
    title: str,
    free: tuple[str, ...] = (),
) -> dict[str, Any]:
    """The content of the file of a B-spline in each event, with dwells between them.

    Parameters
    ----------
    cam, start : whose follower and lift it has, and the law of that
    splines : of each event degree, knots and ordinates in lifts of ``start``, as a file has them
    free : what of dwells and events is elsewhere than in the cam
    """
    return {
        "name": name,
        "title": title,
        "lift": _lift(cam, start),
        **_follower(cam),
        "segments": _segments(cam, events, splines, free),
    }


def _lift(cam: CamConfig, start: Law) -> dict[str, Any]:
    """The start's, with where it comes from; a law may have another than its file's."""
    own, name = cam.lift, cam.name
    if abs(own.si - start.lift) > SAME * start.lift:
        return quantity("assumed", start.lift * 1e3, "mm", f"that of the law of {name}")
    return quantity(own.origin, own.numbers[0], own.unit, f"as {name}: {own.source}", own.residual)


def _follower(cam: CamConfig) -> dict[str, Any]:
    data = cam.model_dump(exclude_none=True)
    kept = {"follower": without_empty(data["follower"])}
    return kept | ({"contact": without_empty(data["contact"])} if "contact" in data else {})


def without_empty(data: dict[str, Any]) -> dict[str, Any]:
    """A part of a file without empty words."""
    return {
        key: {k: v for k, v in value.items() if v != ""} if isinstance(value, dict) else value
        for key, value in data.items()
    }


def _segments(
    cam: CamConfig, events: list[LawEvent], splines: list[dict[str, Any]], free: tuple[str, ...]
) -> list[dict[str, Any]]:
    found, at = [], 0.0
    dwells, spans = (_origin(cam, what in free) for what in ("dwells", "events"))
    for event, spline in zip(events, splines, strict=True):
        found += _dwell(at, event.start, dwells)
        at = event.start + event.span
        found.append({"law": "b_spline", "span": _span(event.span, spans), **spline})
    found += _dwell(at, 2.0 * math.pi, dwells)
    return found


def _origin(cam: CamConfig, found: bool) -> tuple[str, str]:
    """Whether spans of events or dwells are the cam's or found, and the words for it."""
    return ("identified", "found with the law") if found else ("assumed", f"that of {cam.name}")


def _dwell(start: float, end: float, origin: tuple[str, str]) -> list[dict[str, Any]]:
    if end - start <= 0.0:
        return []
    return [{"law": "dwell", "span": _span(end - start, origin)}]


def _span(span: float, origin: tuple[str, str]) -> dict[str, Any]:
    kind, source = origin
    return quantity(kind, round(math.degrees(span), 10), "deg", source)

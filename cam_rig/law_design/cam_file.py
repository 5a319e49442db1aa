"""A designed law as a cam file: B-splines between the dwells of its start."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cam_rig.law_design.request import DesignRequest, Multistart
from cam_rig.law_design.space import Asked, DesignProblem, LawEvent
from cam_rig.laws import Law
from cam_rig.schema import CamConfig
from cam_rig.schema.load import file_data, quantity, to_yaml, valid_cam
from cam_rig.units import TURN, FloatArray

#: A law's lift is its file's where they differ by no more than this part.
SAME = 1e-12


def designed_cam(
    problem: DesignProblem,
    unknowns: FloatArray,
    name: str,
    request: DesignRequest,
    limits: list[Asked],
    search: Multistart | None = None,
) -> tuple[CamConfig, str]:
    """The cam of some unknowns, and its file; ``search`` is of what is local."""
    cam, space = problem.cam, problem.space
    own, goal = space.law_class, f"{request.verb} {request.goal.key}"
    knots = np.rint(own.knots[1:-1] * own.pieces).astype(int).tolist()
    source = f"designed to {goal} on rig {problem.rig.name}"
    splines = []
    for index in range(len(space.events)):
        ordinates = (space.coefficients(index)(unknowns) / space.start.lift).tolist()
        spline = {
            "degree": own.power,
            "knots": quantity("assumed", knots, "1", f"{own.pieces} equal pieces"),
            "ordinates": quantity("identified", ordinates, "1", source),
        }
        splines.append(spline)
    found = "The law of its class that is best"
    if search is not None:
        found = f"The best law found, seed {search.seed}, {search.words}, without a bound,"
    kept = " and ".join(what for what in ("dwells", "events") if what not in problem.free)
    header = [
        f"# {found} by this goal: {goal}.",
        f"# Start: {cam.name}; rig: {problem.rig.name}; {own.words}.",
        *(f"# Limit: {limit.name}." for limit in limits),
        f"# Made by cam-rig design; {kept + ' are' if kept else 'the lift is'} the start's.",
    ]
    title = f"{cam.title}, designed"
    data = spline_cam_data(cam, space.start, space.events, splines, name, title, problem.free)
    return valid_cam(data), "\n".join(header) + "\n" + to_yaml(data)


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

    ``cam`` and its law ``start`` give follower and lift; ``splines`` of each event degree, knots
    and ordinates in lifts, as a file has them; ``free`` is what of dwells and events is elsewhere.
    """
    data = file_data(cam)
    parts = {key: data[key] for key in ("follower", "contact") if key in data}
    own = cam.lift
    lift = quantity(
        own.origin, own.numbers[0], own.unit, f"as {cam.name}: {own.source}", own.residual
    )
    if abs(own.si - start.lift) > SAME * start.lift:  # a law may have another than its file's
        lift = quantity("assumed", start.lift * 1e3, "mm", f"that of the law of {cam.name}")
    head = {"name": name, "title": title, "lift": lift}
    return head | parts | {"segments": _segments(cam, events, splines, free)}


def _segments(
    cam: CamConfig, events: list[LawEvent], splines: list[dict[str, Any]], free: tuple[str, ...]
) -> list[dict[str, Any]]:
    def span(angle: float, what: str) -> dict[str, Any]:
        found = ("identified", "found with the law"), ("assumed", f"that of {cam.name}")
        kind, source = found[what not in free]
        return quantity(kind, round(math.degrees(angle), 10), "deg", source)

    def dwell(start: float, end: float) -> list[dict[str, Any]]:
        return [{"law": "dwell", "span": span(end - start, "dwells")}] if end > start else []

    found, at = [], 0.0
    for event, spline in zip(events, splines, strict=True):
        found += dwell(at, event.start)
        at = event.start + event.span
        found.append({"law": "b_spline", "span": span(event.span, "events"), **spline})
    return found + dwell(at, TURN)

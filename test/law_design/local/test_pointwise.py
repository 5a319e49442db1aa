"""Rows near a law: its exact values there, its slopes, and what was tried from there."""

from __future__ import annotations

import numpy as np
import pytest

from cam_rig.law_design.constraints import DesignProblem
from cam_rig.law_design.measure import measured
from cam_rig.law_design.pointwise_search import PointwiseTerm, greatest, pointwise
from cam_rig.law_design.request import LawClass
from cam_rig.law_design.space import Space
from cam_rig.law_design.terms import parse_term
from cam_rig.laws import build_law
from cam_rig.schema import load_cam, load_rig
from cam_rig.schema.load import config_root
from cam_rig.units import FloatArray

RIG = load_rig(config_root() / "rigs" / "paper_table2.yaml")
QUANTITIES = ("shaft_torque@300rpm", "shaft_torque@50-600rpm", "pressure_angle")
CAMS = ("poly345", "oscillating_roller", "oscillating_flat", "conjugate", "eccentric_roller")


def term_of(cam_name: str, text: str) -> PointwiseTerm:
    cam = load_cam(config_root() / "cams" / f"{cam_name}.yaml")
    start = build_law(cam)
    problem = DesignProblem(cam, start, RIG, Space(start, LawClass(5, 2)))
    return PointwiseTerm(problem, text, pointwise(problem, parse_term(text)), None)


def some_law(term: PointwiseTerm, seed: int) -> FloatArray:
    """Unknowns of a law that rises where the start does, with ordinates a little off."""
    space, random = term.problem.space, np.random.default_rng(seed)
    found = []
    for event in space.events:
        ends = np.array([event.first[0], event.last[0]]) / space.start.lift
        way = np.linspace(0.0, 1.0, space.law_class.free)
        found.append(ends[0] + (ends[1] - ends[0]) * way + 0.01 * random.normal(size=way.size))
    return space.joined(np.concatenate(found))


@pytest.mark.variants(8)
@pytest.mark.parametrize("name", CAMS)
@pytest.mark.parametrize("text", [*QUANTITIES, "radius_of_curvature"])
def test_rows_are_exact_at_a_law_and_have_its_slopes(name: str, text: str) -> None:
    """The greatest row is the greatest value, of a law that was tried too.

    What its correction changes at the first law goes with the square of the way between them.
    """
    term = term_of(name, text)
    space = term.problem.space
    here = some_law(term, 1)
    rows = term.rows(here, [])
    worst = greatest(space.law(here, "here"), term.branches)
    assert rows(here).max() == pytest.approx(worst, rel=1e-9)
    errors = []
    for size in (1e-3, 1e-4):
        there = here + size * (some_law(term, 2) - here)
        corrected = term.rows(here, [there])
        beside = greatest(space.law(there, "there"), term.branches)
        assert corrected(there).max() == pytest.approx(beside, rel=1e-7)
        errors.append(abs(corrected(here).max() - worst))  # what linear rows leave out
    assert errors[1] <= 0.02 * errors[0] + 1e-9 * term.scale


@pytest.mark.parametrize("name", CAMS)
@pytest.mark.parametrize("text", QUANTITIES)
def test_the_greatest_branch_is_what_is_measured(name: str, text: str) -> None:
    """By the search over every piece of the branches, and by the profile's own."""
    term = term_of(name, text)
    law = term.problem.space.law(some_law(term, 3), "some")
    expected = measured(term.problem, law, parse_term(text), "<=")
    assert term.worst(law) == pytest.approx(expected, rel=1e-6)

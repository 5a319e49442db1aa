"""A front of two quantities: each point the best for its value, none beyond another's bound."""

from __future__ import annotations

import itertools

import pytest

from cam_rig.errors import ConfigError
from cam_rig.schema import load_cam, load_rig
from cam_rig.schema.load import config_root
from cam_rig.studies.design.law_class import LawClass
from cam_rig.studies.design.request import DesignRequest
from cam_rig.studies.design.results.front import front, front_table
from cam_rig.studies.design.terms import parse_term

CAM = load_cam(config_root() / "cams" / "poly345.yaml")
RIG = load_rig(config_root() / "rigs" / "paper_table2.yaml")
REQUEST = DesignRequest.of(minimise="peak_jerk", law_class=LawClass(6, 2))


def test_a_front_is_monotone_and_certified() -> None:
    """Less peak acceleration costs jerk; what a point allows, its law keeps."""
    found = front(CAM, RIG, REQUEST, parse_term("peak_acceleration"), 6)
    jerks = [design.goal.result for design in found.designs]
    assert all(a >= b * (1.0 - 1e-7) for a, b in itertools.pairwise(jerks))
    assert jerks[0] > 1.05 * jerks[-1]
    for allowed, design in zip(found.allowed, found.designs, strict=True):
        assert design.certified
        assert design.measures[1].result <= allowed * (1.0 + 1e-6)
    assert len(front_table(found).rows) == 6


@pytest.mark.parametrize(
    ("other", "points", "words"),
    [
        ("peak_jerk", 5, "is the goal"),
        ("peak_acceleration", 2, "allowed: 3 to 200"),
    ],
)
def test_a_front_that_is_none_is_refused(other: str, points: int, words: str) -> None:
    """The goal itself, or too few points: one line."""
    with pytest.raises(ConfigError, match=words):
        front(CAM, RIG, REQUEST, parse_term(other), points)

"""A front of two quantities: each point the best for its value, none beyond another's bound."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from cam_rig.errors import ConfigError
from cam_rig.law_design.figures import front_figure
from cam_rig.law_design.pareto_front import front, front_table
from cam_rig.law_design.request import DesignRequest, LawClass, Multistart
from cam_rig.law_design.terms import parse_second, parse_term
from cam_rig.schema import load_cam, load_rig
from cam_rig.schema.load import config_root

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


def test_a_front_over_the_span_of_an_event_is_certified_point_by_point() -> None:
    """Least peak acceleration of C1 laws for each span β is 4h/β²; dwells have what it leaves."""
    request = DesignRequest.of(minimise="peak_acceleration", law_class=LawClass(4, 1))
    found = front(CAM, RIG, request, parse_second("event_angle@1"), 4)
    assert found.allowed[0] == pytest.approx(0.5 * np.radians(117.5))
    assert found.allowed[-1] == pytest.approx(np.radians(180.0), rel=2e-3)  # no dwell is left
    for span, design in zip(found.allowed, found.designs, strict=True):
        assert [event.span for event in design.events] == pytest.approx([span, span], rel=1e-4)
        assert design.certified
        assert design.goal.result == pytest.approx(4.0 * 0.05 / span**2, rel=1e-3)


def test_a_front_over_spans_begins_where_the_first_law_is() -> None:
    """68.64 mm/rad² allow no rise shorter than √(4h/68.64 mm): the front is not below that."""
    limits = ["peak_acceleration<=start"]
    request = DesignRequest.of(minimise="peak_jerk", limits=limits, law_class=LawClass(6, 2))
    found = front(CAM, RIG, request, parse_second("event_angle@2"), 3)
    shortest = np.sqrt(4.0 * 0.05 / found.designs[0].measures[1].limit)  # type: ignore[operator]
    assert shortest < found.allowed[0] < np.radians(117.5)
    for design in found.designs:
        assert design.measures[1].result <= design.measures[1].limit * (1.0 + 1e-6)  # type: ignore[operator]
    assert found.designs[0].goal.result > found.designs[-1].goal.result


def test_a_front_over_spans_has_no_other_spans() -> None:
    """A request in which the events' spans are searched has none to go over."""
    request = DesignRequest.of(minimise="peak_jerk", keep=["dwells", "lift"])
    with pytest.raises(ConfigError, match="allowed: without --keep"):
        front(CAM, RIG, request, parse_second("event_angle@1"), 4)


@pytest.mark.long
def test_a_front_of_what_is_not_convex_has_no_bounds() -> None:
    """Torque against peak acceleration: falling, and called local."""
    request = DesignRequest.of(
        minimise="shaft_torque@300rpm", law_class=LawClass(6, 2), multistart=Multistart(2)
    )
    found = front(CAM, RIG, request, parse_second("peak_acceleration"), 3)
    table = front_table(found)
    assert [row[2:] for row in table.rows] == [("local",)] * 3  # no column of bounds
    torques = [design.goal.result for design in found.designs]
    assert all(a >= b * (1.0 - 1e-3) for a, b in itertools.pairwise(torques))
    assert front_figure(found).axes[0].get_legend_handles_labels()[1] == ["designed"]

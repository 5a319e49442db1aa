"""Event angles as unknowns: known optima, what stays and what may move, the written file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cam_rig.errors import ConfigError, DesignError
from cam_rig.law_design.design import search_design as design
from cam_rig.law_design.request import DesignRequest, LawClass, Multistart
from cam_rig.law_design.space import dwells, events
from cam_rig.law_design.tables import LawDesign
from cam_rig.laws import build_law
from cam_rig.laws.law import peak
from cam_rig.schema import CamConfig, load_cam, load_rig
from cam_rig.schema.load import config_root

RIG = load_rig(config_root() / "rigs" / "paper_table2.yaml")
HEIGHTS, LIFT = np.array([0.4, 0.6, 1.0]), 0.05


def two_rises() -> CamConfig:
    """Rises of 0.4 and 0.6 of the lift and a fall, 80° each, with dwells of 40° between them."""
    data = load_cam(config_root() / "cams" / "poly345.yaml").model_dump(exclude_none=True)
    segments: list[dict[str, Any]] = [{"law": "dwell", "span": {"given": 20.0, "unit": "deg"}}]
    for to, behind in ((0.4, 40.0), (1.0, 40.0), (0.0, 20.0)):
        segments.append({"law": "poly345", "to": to, "span": {"given": 80.0, "unit": "deg"}})
        segments.append({"law": "dwell", "span": {"given": behind, "unit": "deg"}})
    return CamConfig.model_validate(data | {"segments": segments})


def designed(start: CamConfig, keep: list[str], joints: int = 1, **words: Any) -> LawDesign:
    law_class = LawClass(4, joints)
    request = DesignRequest.of(
        law_class=law_class, keep=keep, multistart=Multistart(words.pop("starts", 2)), **words
    )
    return design(start, RIG, request)


@pytest.mark.long
def test_spans_go_with_the_root_of_what_each_event_rises(tmp_path: Path) -> None:
    """Least peak acceleration 4h/β² of three events that share 240°: β as √h.

    The dwells keep their lengths, in the written file too.
    """
    found = designed(two_rises(), ["dwells", "lift"], minimise="peak_acceleration")
    spans = np.radians(240.0) * np.sqrt(HEIGHTS) / np.sqrt(HEIGHTS).sum()
    optimum = 4.0 * LIFT * HEIGHTS[0] / spans[0] ** 2
    (tmp_path / "cam.yaml").write_text(found.text, encoding="utf-8")
    law = build_law(load_cam(tmp_path / "cam.yaml"))
    assert abs(peak(law, 2).value) == pytest.approx(optimum, rel=2e-3)
    assert found.goal.result == pytest.approx(optimum, rel=2e-3)
    assert [b - a for a, b in dwells(law)] == pytest.approx(np.radians([20.0, 40.0, 40.0, 20.0]))
    assert [event.span for event in events(law, 1)] == pytest.approx(spans, rel=5e-3)
    assert found.goal.bound is None
    assert found.spans_bound is not None
    assert found.spans_bound <= found.goal.result <= found.spans_bound * 1.002


@pytest.mark.long
def test_a_limit_on_a_span_holds_and_dwells_give_way() -> None:
    """Events that keep their middles: the fall as wide as its limit allows, 4h/β²."""
    widest = 109.5
    limits = [f"event_angle@{number}<={widest}deg" for number in (1, 2, 3)]
    found = designed(two_rises(), ["lift"], minimise="peak_acceleration", limits=limits)
    assert found.goal.result == pytest.approx(4.0 * LIFT / np.radians(widest) ** 2, rel=2e-3)
    assert found.measures[3].active
    for measure, event in zip(found.measures[1:], found.events, strict=True):
        assert measure.start == pytest.approx(np.radians(80.0))
        assert measure.result == pytest.approx(event.span)
        assert measure.result <= np.radians(widest) * (1.0 + 1e-6)
    middles = [event.start + 0.5 * event.span for event in found.events]
    assert middles == pytest.approx(np.radians([60.0, 180.0, 300.0]), abs=1e-6)


@pytest.mark.long
def test_limits_of_the_start_are_those_of_its_own_events() -> None:
    """Peak velocity at no more than the start's peak acceleration: lower than with its events."""
    limits = ["peak_acceleration<=start"]
    words: dict[str, Any] = {"joints": 2, "minimise": "peak_velocity", "limits": limits}
    fixed = designed(two_rises(), ["events", "dwells", "lift"], **words)
    moved = designed(two_rises(), ["dwells", "lift"], starts=2, **words)
    assert fixed.certified
    assert moved.goal.result < fixed.goal.result
    assert moved.goal.start == fixed.goal.start
    allowed = abs(peak(build_law(two_rises()), 2).value)
    assert abs(peak(moved.law, 2).value) <= allowed * (1.0 + 1e-6)


@pytest.mark.long
def test_the_same_seed_gives_the_same_file() -> None:
    """Byte for byte; the file says that its events were found."""
    words: dict[str, Any] = {"minimise": "peak_acceleration", "starts": 2}
    first, again = (designed(two_rises(), ["dwells", "lift"], **words) for _ in range(2))
    assert first.text == again.text
    assert "dwells are the start's" in first.text
    assert "found with the law" in first.text


@pytest.mark.parametrize(
    ("name", "keep", "limits", "error", "message"),
    [
        ("poly345", ["dwells"], [], ConfigError, "allowed: events,dwells,lift or dwells,lift or"),
        ("bezier15", ["dwells", "lift"], [], ConfigError, "has one event"),
        (
            "poly345",
            ["events", "dwells", "lift"],
            ["event_angle@1<=90deg"],
            ConfigError,
            "events stay",
        ),
        ("poly345", ["lift"], ["event_angle@3<=90deg"], ConfigError, "has 2 events"),
        ("poly345", ["lift"], ["event_angle<=90deg"], ConfigError, "such as event_angle@1"),
        ("poly345", ["lift"], ["event_angle@1.5<=90deg"], ConfigError, "such as event_angle@1"),
        (
            "poly345",
            ["dwells", "lift"],
            ["event_angle@1<=90deg", "event_angle@2<=90deg"],
            ConfigError,
            "no spans of events keep them",
        ),
        (
            "poly345",
            ["dwells", "lift"],
            ["peak_acceleration<=20mm/rad^2"],
            DesignError,
            "no spans of events that were tried have a law; of the last: no law of the class keeps",
        ),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(
    name: str, keep: list[str], limits: list[str], error: type[Exception], message: str
) -> None:
    """It says what is allowed."""
    start = load_cam(config_root() / "cams" / f"{name}.yaml")
    with pytest.raises(error, match=message) as caught:
        designed(start, keep, minimise="peak_velocity", limits=limits, starts=2)
    assert "\n" not in str(caught.value)

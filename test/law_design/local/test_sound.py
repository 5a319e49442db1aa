"""The level where contact may be lost: that of a run, and a search that makes it lower."""

from __future__ import annotations

import numpy as np
import pytest

import cam_rig
from cam_rig.acoustics import RadiationParameters
from cam_rig.acoustics.pressure import steady_power
from cam_rig.law_design.constraints import DesignProblem
from cam_rig.law_design.design import search_design as design
from cam_rig.law_design.pointwise_search import level_with_jumps
from cam_rig.law_design.request import DesignRequest, LawClass, Multistart
from cam_rig.law_design.space import Space
from cam_rig.law_design.terms import parse_term
from cam_rig.laws import build_law
from cam_rig.schema import load_cam, load_rig
from cam_rig.schema.load import config_root
from cam_rig.units import RPM

RIG = load_rig(config_root() / "rigs" / "paper_table2.yaml")
CAM = load_cam(config_root() / "cams" / "poly345.yaml")


def problem() -> DesignProblem:
    law = build_law(CAM)
    return DesignProblem(CAM, law, RIG, Space(law, LawClass(4, 3)))


def test_below_the_jump_speed_it_is_the_exact_level_of_the_steady_force() -> None:
    """At 250 rpm, where nothing is lost, within the 0.003 dB of its sample rate."""
    own, speed = problem(), 250.0 * RPM
    power = steady_power(own.start, own.rigid, RadiationParameters.from_rig(RIG), speed)
    level = level_with_jumps(own, own.start, parse_term("sound_level_with_jumps@250rpm"))
    assert level == pytest.approx(20.0 * np.log10(np.sqrt(power) / 20e-6), abs=3e-3)


@pytest.mark.parametrize("rpm", [480.0, 540.0])
def test_above_it_is_what_the_microphone_of_a_run_measures(rpm: float) -> None:
    """With lift-offs and landings in each turn, four times the sample rate."""
    own = problem()
    motion = cam_rig.simulate(
        own.start, RIG, model="one_mass", rpm=rpm, turns=4, sample_rate=48_000
    )
    assert motion.events
    level = level_with_jumps(own, own.start, parse_term(f"sound_level_with_jumps@{rpm:g}rpm"))
    assert level == pytest.approx(cam_rig.sound_level(motion).level_db, abs=0.02)


@pytest.mark.long
def test_a_search_is_quieter_than_the_best_law_that_no_landing_counts_for() -> None:
    """At 500 rpm, beyond every jump speed: than the start, and than the convex level's optimum."""
    goal, limits = "sound_level_with_jumps@500rpm", ["peak_acceleration<=start"]
    words = {"limits": limits, "law_class": LawClass(8, 3), "multistart": Multistart(2)}
    found, convex = (
        design(CAM, RIG, DesignRequest.of(minimise=one, **words))  # type: ignore[arg-type]
        for one in (goal, "sound_level_rigid@500rpm")
    )
    own = level_with_jumps(problem(), found.law, parse_term(goal))
    assert found.goal.result == own
    assert own < found.goal.start - 0.1
    assert own < level_with_jumps(problem(), convex.law, parse_term(goal)) - 0.1
    limit = found.measures[1]
    assert limit.result <= limit.limit * (1.0 + 1e-6)  # type: ignore[operator]
    assert found.goal.bound is None

"""Designs that are not convex: known optima from every start, limits kept by the written file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.kinetostatic import shaft_torque
from cam_rig.errors import ConfigError, DesignError
from cam_rig.law_design.design import search_design as design
from cam_rig.law_design.request import DesignRequest, LawClass, Multistart
from cam_rig.law_design.space import Space
from cam_rig.law_design.tables import LawDesign
from cam_rig.laws import Law, build_law
from cam_rig.profile.disc import contours
from cam_rig.schema import CamConfig, RigConfig, load_cam, load_rig
from cam_rig.schema.load import config_root
from cam_rig.units import RPM, TURN

RIG = load_rig(config_root() / "rigs" / "paper_table2.yaml")
ANGLES = np.linspace(0.0, TURN, 7201)


def cam(name: str = "poly345") -> CamConfig:
    return load_cam(config_root() / "cams" / f"{name}.yaml")


def rig_with(**numbers: tuple[float, str]) -> RigConfig:
    """The rig with other numbers of its follower."""
    data = RIG.model_dump(exclude_none=True)
    for key, (value, unit) in numbers.items():
        data["follower"][key] = {"given": value, "unit": unit}
    return RigConfig.model_validate(data)


def designed(
    start: CamConfig, rig: RigConfig, law_class: LawClass, starts: int = 4, **words: Any
) -> LawDesign:
    request = DesignRequest.of(law_class=law_class, multistart=Multistart(starts), **words)
    return design(start, rig, request)


def written(found: LawDesign, folder: Path) -> CamConfig:
    """The cam as its file has it."""
    file = folder / f"{found.cam.name}.yaml"
    file.write_text(found.text, encoding="utf-8")
    return load_cam(file)


def peak_torque(law: Law, rig: RigConfig, rpm: float) -> float:
    """From the contact force of the kinetostatic model at many angles, as a run publishes it."""
    follower = FollowerParameters.from_rig(rig)
    return max(abs(shaft_torque(law, follower, float(a), rpm * RPM)) for a in ANGLES)


def least_radius(start: CamConfig, law: Law) -> float:
    """Of the convex parts, from circles through three neighbours of the contour's points."""
    found = []
    for contour in contours(start.follower, law, 7200):
        points = contour.points[0] + 1j * contour.points[1]
        before, after = points - np.roll(points, 1), np.roll(points, -1) - points
        turned = np.angle(after / before)
        way = 0.5 * (np.abs(before) + np.abs(after))
        sense = np.sign(turned.sum())
        convex = sense * turned > 0.0
        found.append(float((way[convex] / np.abs(turned[convex])).min()))
    return min(found)


def test_torque_against_a_constant_force_is_that_of_the_least_peak_slope() -> None:
    """Where only the preload counts T = F₀ s′: the convex design of s′ bounds it.

    All starts come to it.
    """
    rig = rig_with(
        spring_stiffness=(1e-6, "N/m"), mass=(1e-6, "kg"), damping=(0.0, "N*s/m"), preload=(50, "N")
    )
    law_class = LawClass(8, 2)
    limits = ["peak_acceleration<=start"]
    slope = designed(cam(), rig, law_class, minimise="peak_velocity", limits=limits)
    torque = designed(cam(), rig, law_class, 8, minimise="shaft_torque@10rpm", limits=limits)
    assert slope.certified
    assert torque.goal.result == pytest.approx(50.0 * slope.goal.result, rel=5e-4)
    assert torque.goal.bound is None
    assert not torque.certified
    assert torque.multistart == Multistart(8, near=8)


def test_one_free_ordinate_is_as_good_as_a_scan(tmp_path: Path) -> None:
    """A class of one ordinate each for rise and fall: the best of 801 values of both is not better.

    The torque of every law of the scan is the kinetostatic model's.
    """
    law_class = LawClass(1, 3, 8)
    found = designed(cam(), RIG, law_class, minimise="shaft_torque@250rpm")
    space, follower = Space(build_law(cam()), law_class), FollowerParameters.from_rig(RIG)
    rise = np.linspace(0.0, np.pi, 1201)
    halves: list[list[float]] = [[], []]
    for ordinate in np.linspace(0.0, 1.0, 801):
        law = space.law(space.joined(np.full(2, ordinate)), "scan")
        for half, angles in zip(halves, (rise, rise + np.pi), strict=True):
            s, slope, bend = law.motion_at(angles)
            speed = 250.0 * RPM
            force = follower.spring_stiffness * s + follower.damping * speed * slope
            force += follower.mass * speed**2 * bend + follower.preload
            half.append(np.abs(force * slope).max())
    best = max(min(half) for half in halves)
    law = build_law(written(found, tmp_path))
    assert peak_torque(law, RIG, 250.0) == pytest.approx(found.goal.result, rel=1e-5)
    assert found.goal.result <= best * (1.0 + 2e-5)  # where a descent ends
    assert found.goal.result >= best * (1.0 - 2e-3)  # the scan's own grid


@pytest.mark.variants(2)
@pytest.mark.parametrize(
    ("name", "goal", "limits"),
    [
        ("poly345", "shaft_torque@300rpm", ["peak_acceleration<=start", "pressure_angle<=25deg"]),
        ("poly345", "peak_jerk", ["radius_of_curvature>=45mm", "shaft_torque@250rpm<=5.5Nm"]),
        (
            "oscillating_roller",
            "pressure_angle",
            ["radius_of_curvature>=start", "peak_acceleration<=start"],
        ),
        ("conjugate", "pressure_angle", ["peak_acceleration<=start"]),
        ("inclined_flat", "peak_jerk", ["radius_of_curvature>=start"]),
        ("bezier15", "shaft_torque@300rpm", ["peak_acceleration<=start"]),
    ],
)
def test_the_written_cam_keeps_its_limits(
    name: str, goal: str, limits: list[str], tmp_path: Path
) -> None:
    """Torque by the kinetostatic model, radius by circles through the contour's points."""
    found = designed(cam(name), RIG, LawClass(8, 3), 3, minimise=goal, limits=limits)
    made = written(found, tmp_path)
    law = build_law(made)
    assert found.goal.result < found.goal.start
    for measure in found.measures:
        if measure.term.name == "shaft_torque":
            rpm = measure.term.low / RPM
            assert peak_torque(law, RIG, rpm) == pytest.approx(measure.result, rel=1e-4)
        if measure.term.name == "radius_of_curvature":
            assert measure.limit is not None
            assert least_radius(made, law) >= measure.limit * (1.0 - 2e-3)
        if measure.limit is not None:
            over = measure.result - measure.limit
            assert (over if measure.sense == "<=" else -over) <= 1e-6 * abs(measure.limit)


@pytest.mark.variants(2)
@pytest.mark.parametrize("seed", range(4))
def test_random_cams_and_rigs(seed: int, tmp_path: Path) -> None:
    """Any lift, base, follower, rig and speed: better than the start's fit, with its limits."""
    random = np.random.default_rng(seed)
    lift = float(10.0 ** random.uniform(-3.5, -0.5))
    data = cam().model_dump(by_alias=True, exclude_none=True)
    data["lift"] = {"given": lift, "unit": "m"}
    data["follower"]["base_radius"] = {"given": float(random.uniform(1.5, 4.0)) * lift, "unit": "m"}
    roller = float(random.uniform(0.1, 0.5)) * lift
    data["follower"]["roller_radius"] = {"given": roller, "unit": "m"}
    start = CamConfig.model_validate(data)
    rig = rig_with(
        spring_stiffness=(float(10.0 ** random.uniform(2, 5)), "N/m"),
        mass=(float(10.0 ** random.uniform(-1, 1)), "kg"),
        preload=(float(random.uniform(5.0, 200.0)), "N"),
    )
    rpm = float(random.uniform(20.0, 600.0))
    limits = ["peak_acceleration<=start", "radius_of_curvature>=start"]
    found = designed(
        start, rig, LawClass(6, 2), 3, minimise=f"shaft_torque@{rpm!r}rpm", limits=limits
    )
    assert found.goal.result < found.goal.start
    law = build_law(written(found, tmp_path))
    force = FollowerParameters.from_rig(rig)
    s, slope, bend = law.motion_at(ANGLES)
    speed = rpm * RPM
    total = force.spring_stiffness * s + force.damping * speed * slope + force.preload
    total += force.mass * speed**2 * bend
    assert np.abs(total * slope).max() == pytest.approx(found.goal.result, rel=1e-4)
    assert found.goal.result >= np.abs(total * slope).max() * (1.0 - 1e-9)
    for measure in found.measures[1:]:
        assert measure.limit is not None
        over = measure.result - measure.limit
        assert (over if measure.sense == "<=" else -over) <= 1e-6 * abs(measure.limit)


def test_the_greatest_torque_of_a_range_is_no_less_than_at_any_speed_of_it() -> None:
    """60 to 500 rpm: at speeds between the ends none is greater, and one is as great."""
    found = designed(
        cam(), RIG, LawClass(6, 3), 2, minimise="shaft_torque@60-500rpm",
        limits=["peak_acceleration<=start"],
    )  # fmt: skip
    follower = FollowerParameters.from_rig(RIG)
    s, slope, bend = found.law.motion_at(ANGLES)
    peaks = []
    for speed in np.linspace(60.0, 500.0, 45) * RPM:
        force = follower.spring_stiffness * s + follower.damping * speed * slope
        force += follower.mass * speed**2 * bend + follower.preload
        peaks.append(np.abs(force * slope).max())
    assert max(peaks) == pytest.approx(found.goal.result, rel=1e-5)


def test_the_same_seed_gives_the_same_file() -> None:
    """Byte for byte; and its file says the seed, and that there is no bound."""
    words = {"minimise": "shaft_torque@300rpm", "limits": ["peak_acceleration<=start"]}
    first, again = (designed(cam(), RIG, LawClass(6, 3), 5, **words) for _ in range(2))
    assert first.text == again.text
    assert "seed 1, local (5 starts, " in first.text.splitlines()[0]
    assert "without a bound" in first.text.splitlines()[0]


def test_a_convex_goal_under_a_limit_that_does_not_bind_is_the_convex_best() -> None:
    """Peak jerk with a torque limit far off: what the convex program finds, and not certified."""
    law_class = LawClass(6, 2)
    convex = designed(cam(), RIG, law_class, minimise="peak_jerk")
    found = designed(
        cam(), RIG, law_class, minimise="peak_jerk", limits=["shaft_torque@100rpm<=100Nm"]
    )
    assert found.goal.result == pytest.approx(convex.goal.result, rel=1e-4)
    assert found.goal.bound is None


@pytest.mark.long
def test_the_jump_speed_of_a_rigid_mass_under_a_limit_on_the_radius() -> None:
    """The limit costs speed, so its result is below the bound without it, and above the start."""
    law_class, limits = LawClass(8, 3), ["peak_acceleration<=start"]
    free = designed(cam(), RIG, law_class, maximise="jump_speed_rigid", limits=limits)
    limits.append("radius_of_curvature>=start")
    found = designed(cam(), RIG, law_class, 2, maximise="jump_speed_rigid", limits=limits)
    assert found.goal.start < found.goal.result <= free.goal.bound  # type: ignore[operator]


@pytest.mark.parametrize(
    ("name", "words", "error", "message"),
    [
        ("flat", {"minimise": "pressure_angle"}, ConfigError, "pressure angle no law changes"),
        (
            "poly345",
            {"minimise": "peak_jerk", "limits": ["radius_of_curvature>=80mm"]},
            DesignError,
            "a dwell of 'poly345' breaks it",
        ),
        (
            "poly345",
            {"minimise": "peak_jerk", "limits": ["shaft_torque@300rpm<=1Nm"]},
            DesignError,
            "no law was found that keeps .* from 2 starts",
        ),
        (
            "poly345",
            {"maximise": "jump_speed", "limits": ["shaft_torque@300rpm<=6Nm"]},
            ConfigError,
            "allowed: it as a limit, such as jump_speed>=450rpm",
        ),
        ("poly345", {"maximise": "shaft_torque@300rpm"}, ConfigError, "allowed: minimise"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(
    name: str, words: dict[str, Any], error: type[Exception], message: str
) -> None:
    """It names the limit and what is allowed."""
    with pytest.raises(error, match=message) as caught:
        designed(cam(name), RIG, LawClass(6, 3), 2, **words)
    assert "\n" not in str(caught.value)

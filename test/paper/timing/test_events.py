"""The angles at which heights are passed, in closed form or not at all; and cam-rig timing."""

import json
import math
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from cam_rig import load_cam
from cam_rig.laws import Law, build_law
from cam_rig.paper.timing.events import LEVELS, events

from ...cli.conftest import call as run


def test_simple_harmonic(make_cam):
    """(1 − cos πu)/2 passes p at u = arccos(1 − 2p)/π, and the fall is its mirror image."""
    cam = make_cam(
        {"law": "simple_harmonic", "to": 1, "span": 180},
        {"law": "simple_harmonic", "to": 0, "span": 180},
    )
    found = events(build_law(cam), cam.lift.si)
    up = np.arccos(1.0 - 2.0 * np.array(LEVELS))
    assert [event.angle for event in found] == pytest.approx([*up, *(2 * np.pi - up[::-1])])
    assert [event.rising for event in found] == [True] * 3 + [False] * 3
    half = found[1]
    assert half.slope == pytest.approx(0.5 * cam.lift.si, rel=1e-12)


def test_cycloidal():
    """u − sin(2πu)/2π = p has one root."""
    span, start = np.radians(117.5), np.radians(31.25)
    found = events(build_law(load_cam("cycloidal")), 0.05)
    for event in found[:3]:
        u = brentq(
            lambda u, p=event.level: u - np.sin(2.0 * np.pi * u) / (2.0 * np.pi) - p,
            *(0.0, 1.0),
            xtol=1e-15,
        )
        assert event.angle == pytest.approx(start + span * u, abs=1e-12)


@pytest.mark.parametrize("name", ["half_rises", "bezier_segments", "poly345", "trigonometric"])
def test_a_joint_on_the_height_counts_once(name):
    """Half-rises meet at half the lift, in the middle of rise and fall."""
    found = events(build_law(load_cam(name)), 0.05, [0.5])
    assert [event.angle for event in found] == pytest.approx([0.5 * np.pi, 1.5 * np.pi], abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_the_law_is_there(seed):
    """At every event the law has that height, over its lowest place; up and down alternate."""
    random = np.random.default_rng(seed)
    ordinates = np.concatenate([np.zeros(3), random.uniform(-0.5, 1.0, 9), np.zeros(3)])
    law = Law("random", [0.0, 2.0 * np.pi], 0.02 * ordinates[:, None])
    low = law(np.linspace(0.0, 2.0 * np.pi, 100_001)).min()
    level = 0.4 * law.lift
    found = events(law, level, [1.0])
    assert found
    for event in found:
        assert float(law(event.angle)) - low == pytest.approx(level, rel=1e-8)
        assert (event.slope > 0.0) == event.rising
    assert all(a.rising != b.rising for a, b in pairwise(found))


def test_a_height_that_is_not_reached():
    """Nothing passes it."""
    assert events(build_law(load_cam("poly345")), 0.05, [1.01]) == ()


# The command.


call = partial(run, "timing")


def test_one_cam(tmp_path):
    """Its ordinates, and the B-spline beside it."""
    csv = tmp_path / "timing.csv"
    result = call("bezier15", "--plot", tmp_path / "a.png", "--csv", csv, "--json", "-")
    assert result.exit_code == 0, result.stderr
    data = json.loads(result.stdout)
    assert [event["level"] for event in data["events"]] == [0.01, 0.5, 0.99, 0.99, 0.5, 0.01]
    assert len(data["ordinates"]) == 16
    shift = {(row["ordinate"], row["level"], row["rising"]): row for row in data["shifts"]}
    assert len(shift) == 16 * 6
    half = data["ordinates"][4]
    assert half["up_50"] == shift[4, 0.5, True]["shift"]
    assert half["free"] and half["down_50"] is None  # beyond its reach
    assert csv.read_text(encoding="utf-8").startswith("cam,up_1,up_50")
    others = {path.name for path in tmp_path.iterdir()} - {"timing.csv", "a.png"}
    assert others == {f"timing.{key}.csv" for key in ("ordinates", "control", "events", "shifts")}
    for words in ("what each ordinate moves", "Control of the events"):
        assert words in " ".join(result.stderr.split())


def test_several_cams():
    """Events alone, of those of Table 2."""
    result = call("--json", "-")
    found = json.loads(result.stdout)
    angles = {row["cam"]: row["up_50"] for row in found["cams"]}
    assert angles["poly345"] == pytest.approx(0.5 * math.pi)
    assert "what each ordinate moves" not in result.stderr
    assert "one cam alone is shown" in result.stderr

"""The map of bounces in the viewer: the exact states once a turn, turn after turn."""

import numpy as np
import pytest

from cam_rig.bounce.motion import bouncing
from cam_rig.dynamics.turn_map import ON_THE_CAM, StroboscopicMap
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import cam_states
from cam_rig.units import NS, RPM, TURN
from cam_rig.viewer.bounce_chart import GAPS, LANDINGS, bounce_axes, rebounds
from cam_rig.viewer.quantities import scene_ranges
from cam_rig.viewer.recording import LiveView, save_recording

from .conftest import Picture, make_bag

POSITIONS = "Points2D:positions"
SCENE = """
name: small
title: A follower that rebounds
cams: [tm21]
rig: tm21_bouncing
model: one_mass
sample_rate: {{assumed: 4, unit: kHz, source: "small"}}
program:
  speeds: {{assumed: {speeds}, unit: rpm, source: "turned up"}}
  turns: {{assumed: {turns}, unit: turns, source: "small"}}
  settle_turns: {{assumed: 1, unit: turns, source: "small"}}
  ticks_per_turn: {ticks}
"""
#: m: how far the follower moves in a sample's time, of which a landing beside angle 0 costs a part.
BESIDE_A_LANDING = 2.5e-4
#: Turns at a speed: so few that the last digit has not grown where it is irregular.
TURNS = 6


@pytest.fixture(scope="module", params=[1, 4], ids=["a tick a turn", "four"])
def bouncing_bag(request, tmp_path_factory, config_dir):
    """A knob turned up from where it rests on the cam to where it is irregular."""
    speeds = sorted(np.random.default_rng(7).uniform(380.0, 560.0, 3).round(2).tolist())
    scene = SCENE.format(speeds=speeds, turns=TURNS, ticks=request.param)
    return make_bag(tmp_path_factory.mktemp("bounces"), config_dir, scene=scene)


@pytest.fixture(scope="module")
def replayed(bouncing_bag, tmp_path_factory):
    path = tmp_path_factory.mktemp("replayed") / "small.rrd"
    save_recording(bouncing_bag.path, path)
    return Picture(path)


def exact(loaded):
    """Speed (rpm) and gap (mm) at the end of each turn, each speed from where the last ended."""
    (law,), state = loaded.laws.values(), ON_THE_CAM
    for speed in loaded.scene.program.speeds.si_list:
        run = StroboscopicMap(law, bouncing(loaded.rig, None), speed).run(TURNS, state)
        state = tuple(run.states[-1].tolist())
        yield from ((speed / RPM, 1e3 * gap) for gap in run.states[:, 0])


def back(axes, points):
    """Rows of x and y that points were placed from."""
    x, y = np.array(points).reshape(-1, 2).T
    across, up = x / axes.width, 1.0 - (y - axes.top) / axes.height
    return np.stack(
        [
            low + part * (high - low)
            for part, (low, high) in zip((across, up), (axes.x, axes.y), strict=True)
        ]
    )


def axes_of(bag):
    return bounce_axes(bag.loaded, scene_ranges(bag.loaded).whole)


def test_points_are_the_states_of_the_exact_map(bouncing_bag, replayed):
    """A row a turn, at the turn's end and speed; the run's last turn has no sample after it."""
    rows = replayed.column(f"{GAPS}/tm21", POSITIONS)
    assert all(len(points) == 1 for points in rows)
    rpm, gap = np.array([*exact(bouncing_bag.loaded)])[:-1].T
    shown = back(axes_of(bouncing_bag)[0], rows)
    np.testing.assert_allclose(shown[0], rpm, atol=1e-4)
    off = np.abs(shown[1] - gap)
    assert np.median(off) < 1e-6
    assert off.max() < 1e3 * BESIDE_A_LANDING
    assert np.ptp(gap) > 1.0


def test_a_turn_is_shown_once_it_is_over(bouncing_bag, replayed):
    """Its row has the time of the tick in which the cam passes angle 0: the map grows."""
    time = replayed.time(f"{GAPS}/tm21")
    scene = bouncing_bag.loaded.scene
    ticks = scene.program.ticks_per_turn
    ends = np.array([state.time_ns / NS for state in cam_states(scene)][ticks:-1:ticks])
    late, tick = time - ends, TURN / scene.program.speeds.si_list[0] / ticks
    assert np.all(np.diff(time) > 0.0)
    assert late.min() > 0.0 and late.max() <= tick


def test_landings_are_those_of_the_samples(bouncing_bag, replayed):
    """Each sample with an impulse, at its cam angle within the turn."""
    points = [p for row in replayed.column(f"{LANDINGS}/tm21", POSITIONS) for p in row]
    _, degrees = back(axes_of(bouncing_bag)[1], points)
    landed = bouncing_bag.samples[5] > 0.0
    wanted = np.degrees(bouncing_bag.angle[landed] % TURN)
    np.testing.assert_allclose(degrees, wanted, atol=1e-3)
    assert landed.sum() > 3 * TURNS


def test_a_live_view_gets_the_same_points(bouncing_bag, replayed, tmp_path):
    """As they come, tick by tick, in one row for each turn."""
    view, states = (
        LiveView(bouncing_bag.loaded, str(tmp_path)),
        cam_states(bouncing_bag.loaded.scene),
    )
    for cam, points in bouncing_bag.profiles.items():
        view.feed.profile(cam, points)
    view.feed.state(next(states))
    for state, rows in zip(states, bouncing_bag.rows, strict=True):
        view.feed.state(state)
        view.feed.block(rows)
        for _ in view.draw():
            view.flush()
    view.close()
    (part,) = tmp_path.glob("*.rrd")
    live = Picture(part)
    for entity in (f"{GAPS}/tm21", f"{LANDINGS}/tm21"):
        assert live.column(entity, POSITIONS) == replayed.column(entity, POSITIONS)
        np.testing.assert_array_equal(live.time(entity), replayed.time(entity))


def test_only_a_follower_that_rebounds_has_one(picture):
    """Of the shipped scenes one; a recording without it has nothing of it."""
    scenes = (config_root() / "scenes").glob("*.yaml")
    assert [path.stem for path in scenes if rebounds(open_scene(path))] == ["bounce"]
    assert not [entity for entity in picture.entities if entity.startswith(f"/{GAPS}")]

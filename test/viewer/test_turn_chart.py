"""Chart of one turn: it shows the samples, on axes that contain the whole scene."""

import numpy as np
import pytest

from cam_rig.dynamics import Samples
from cam_rig.dynamics.turn_map import ON_THE_CAM, StroboscopicMap
from cam_rig.schema.load import config_root
from cam_rig.show.chart import step_marks
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import cam_states
from cam_rig.simulation.simulate import simulate_ticks
from cam_rig.studies.bounce.motion import bouncing
from cam_rig.units import NS, RPM, TURN
from cam_rig.viewer.bounce_chart import GAPS, LANDINGS, bounce_axes, can_rebound
from cam_rig.viewer.quantities import GAP_LINE as GAP
from cam_rig.viewer.quantities import LANDING, LIFT_OFF, gap_of, plot_rows, scene_ranges
from cam_rig.viewer.recording import save_recording
from cam_rig.viewer.turn_chart import HEAD, MAX_OVERLAID, ROW, WIDTH, TurnAxes, curve

from ..conftest import scene_data
from .conftest import Picture, make_bag

STRIPS, POSITIONS = "LineStrips2D:strips", "Points2D:positions"


def back(bag, cam, key, strip):
    """Return cam angle (°) and value of the points of a curve in the turn chart.

    `key` is the quantity of the chart row, and `strip` has the drawn points.
    """
    ranges = scene_ranges(bag.loaded).of(cam)
    low, high, _ = ranges[key]
    top = TurnAxes(plot_rows("one_mass"), ranges).tops[key]
    x, y = np.array(strip).reshape(-1, 2).T
    return x / WIDTH * 360.0, high - (y - top) / ROW * (high - low)


def rows_of(bag, step, turn):
    """Return the samples of a turn of the small bag, and their cam angles (rad).

    `step` is the index of cam and speed. The angles are not reduced to a turn.
    """
    at = slice(4 * step + 2 * turn, 4 * step + 2 * turn + 2)
    return Samples(np.concatenate(bag.rows[at], axis=1)), np.concatenate(bag.angles[at])


@pytest.mark.parametrize("scene", ["quick", "torsion"])
def test_the_axes_contain_the_whole_scene(scene):
    """Each sample of a scene is within the axes of the turn chart of its cam.

    Each axis has at least two numbers.
    """
    loaded = open_scene(config_root() / "scenes" / f"{scene}.yaml")
    ranges = scene_ranges(loaded)
    for tick in simulate_ticks(loaded):
        for row in plot_rows(loaded.scene.model)[:4]:
            low, high, _ = ranges.of(tick.cam)[row.key]
            values = getattr(tick, row.key) * row.line.factor
            assert low - 1e-9 <= values.min() and values.max() <= high + 1e-9
            assert ranges.all_cams[row.key][0] <= low
    for cam in loaded.cams:
        for axis in ranges.of(cam).values():
            assert len(step_marks(*axis)) >= 2


def test_a_curve_shows_the_samples_of_the_turn(bag, picture):
    """The curves of the turn chart are the samples of the turn, with their peaks.

    They extend over 0 to 360°.
    """
    for step, cam in enumerate(("poly345", "poly345", "bezier15", "bezier15")):
        rows, angle = rows_of(bag, step, 0)
        degrees = np.degrees(angle) % 360.0
        for row in plot_rows("one_mass"):
            first = [strips for strips in picture.column(f"turn/{row.key}/follower/0", STRIPS)]
            drawn = [strips for strips in first if strips][step]
            x, y = back(bag, cam, row.key, drawn[0])
            values = gap_of(bag.loaded.laws[cam], angle, rows) if row.key == "gap" else None
            known = (getattr(rows, row.key) if values is None else values) * row.line.factor
            assert np.all(np.diff(x) > 0.0)
            at = np.abs(degrees[:, None] - x).argmin(axis=0)
            np.testing.assert_allclose(x, degrees[at], atol=1e-3)
            near = 2e-5 * np.ptp(scene_ranges(bag.loaded).of(cam)[row.key][:2])
            np.testing.assert_allclose(y, known[at], atol=near)
            assert y.max() == pytest.approx(known.max(), abs=near)


def test_the_law_is_drawn_over_the_lift(bag, picture):
    """In the turn chart the law is drawn over the lift as a second, thinner line."""
    for strips in picture.column("turn/lift/follower/0", STRIPS):
        if strips:
            degrees, lift = back(bag, "poly345", "lift", strips[1])
            law = bag.loaded.laws["poly345"](np.radians(degrees)) * 1e3
            np.testing.assert_allclose(lift, law, atol=2e-3)
            break
    (widths,) = picture.column("turn/lift/follower/0", "LineStrips2D:radii")
    assert -widths[1] < -widths[0]


def test_equal_turns_are_sent_once(bag, picture):
    """A turn whose samples equal the previous turn is not sent to the viewer again.

    In contact from rest the second turn equals the first.
    """
    sent = [strips for strips in picture.column("turn/force/follower/0", STRIPS) if strips]
    assert len(sent) == 4
    for step in range(4):
        first, second = (rows_of(bag, step, turn)[0].force for turn in (0, 1))
        count = min(first.size, second.size)
        is_equal = np.abs(first[:count] - second[:count]).max() < 1e-3 * first.max()
        assert is_equal or step in (1, 3)
    others = {f"/turn/force/follower/{i}" for i in range(1, MAX_OVERLAID)}
    sent = [e[1:] for e in others & picture.entities if picture.column(e[1:], "rig_time")]
    times = [t for entity in sent for t in picture.time(entity)]
    slow = (bag.rows[0][0, 0], bag.rows[4][0, 0]), (bag.rows[8][0, 0], bag.rows[12][0, 0])
    assert not [t for t in times for a, b in slow if a < t < b]


def test_landings_and_lift_offs_are_marked_and_flights_shaded(bag, picture):
    """In the turn chart landings and lift-offs are marked at their cam angles.

    Strokes cover each flight, within half a degree.
    """
    rows, angle = rows_of(bag, 1, 0)
    degrees, off = np.degrees(angle) % 360.0, rows.force == 0.0
    landed, left = degrees[rows.impulse > 0.0], degrees[off & ~np.roll(off, 1)]
    for mark, there in ((LANDING, landed), (LIFT_OFF, left)):
        points = [p for p in picture.column(f"turn/lift/{mark.name}", POSITIONS) if p]
        x, _ = back(bag, "poly345", "lift", points[0])
        np.testing.assert_allclose(x, there, atol=1e-3)
    strokes = [s for s in picture.column("turn/flights", STRIPS) if s]
    x = np.array(strokes[0])[:, 0, 0] / WIDTH * 360.0
    apart = np.abs(degrees[off][:, None] - x)
    assert apart.min(axis=1).max() < 0.501  # every flight sample is covered
    assert apart.min(axis=0).max() < 0.501 + 360.0 * 700.0 / 60.0 / 4000.0


def test_the_gap_is_lift_minus_law_in_flight(bag, picture):
    """The gap in the recording is lift minus law in µm in flight, and 0 in contact."""
    gap = np.where(bag.samples[4] == 0.0, bag.gap, 0.0) * 1e6
    np.testing.assert_allclose(picture.numbers(GAP.entity, "Scalars:scalars"), gap, atol=1e-3)
    assert gap.max() > 1e3


def test_the_cursor_is_at_the_cams_angle(bag, picture):
    """In each frame the cursor of the turn chart is at the cam angle."""
    place = picture.numbers("turn/cursor", STRIPS)[:, 0, 0]
    sample = bag.sample_of(picture, "turn/cursor")
    np.testing.assert_allclose(place / WIDTH, bag.angle[sample] / (2.0 * np.pi) % 1.0, atol=1e-6)


def test_values_beyond_their_axis_are_drawn_at_its_edge():
    """Values beyond an axis of the turn chart are drawn at its edge.

    Otherwise they would be drawn in the next row. They occur if an operator drives faster than the
    scene.
    """
    (lift, *_) = plot_rows("one_mass")
    axes = TurnAxes([lift], {"lift": (0.0, 10.0, 5.0)})
    angle = np.linspace(0.0, 2.0 * np.pi, 100, endpoint=False)
    points = curve(axes, "lift", angle, 20.0 * np.sin(angle))
    assert points[:, 1].min() == HEAD and points[:, 1].max() == HEAD + ROW


# -- chart of bounces: the exact states, one per turn


#: Allowed error (m) of the gap at angle 0 if a landing is next to it: the travel of the follower in
#: one sample period.
LANDING_ERROR = 2.5e-4
#: Number of turns at each speed, so few that rounding errors of irregular motion stay small.
TURNS = 6


@pytest.fixture(scope="module", params=[1, 4], ids=["a tick a turn", "four"])
def bouncing_bag(request, tmp_path_factory, config_dir):
    """Bag with three speeds from contact to irregular bouncing.

    The fixture runs each test with one and with four ticks (cam states) per turn.
    """
    speeds = sorted(np.random.default_rng(7).uniform(380.0, 560.0, 3).round(2).tolist())
    rig, program = "tm21_bouncing", {"turns": TURNS, "ticks_per_turn": request.param}
    scene = scene_data(cams=["tm21"], rig=rig, speeds=speeds, sample_rate=4000, **program)
    return make_bag(tmp_path_factory.mktemp("bounces"), config_dir, scene=scene)


@pytest.fixture(scope="module")
def replayed(bouncing_bag, tmp_path_factory):
    """Viewer recording of the bag with bounces."""
    path = tmp_path_factory.mktemp("replayed") / "small.rrd"
    save_recording(bouncing_bag.path, path)
    return Picture(path)


def exact(loaded):
    """Yield speed (rpm) and gap (mm) at the end of each turn, from the exact motion.

    Each speed starts from the last state of the previous one.
    """
    (law,), state = loaded.laws.values(), ON_THE_CAM
    for speed in loaded.scene.schedule.speeds.si_list:
        run = StroboscopicMap(law, bouncing(loaded.rig, None), speed).run(TURNS, state)
        state = tuple(run.states[-1].tolist())
        yield from ((speed / RPM, 1e3 * gap) for gap in run.states[:, 0])


def placed_from(axes, points):
    """Return the x and y values that the points of a chart represent."""
    x, y = np.array(points).reshape(-1, 2).T
    across, up = x / axes.width, 1.0 - (y - axes.top) / axes.height
    placed = ((across, *axes.x), (up, *axes.y))
    return np.stack([low + part * (high - low) for part, low, high in placed])


def axes_of(bag):
    return bounce_axes(bag.loaded, scene_ranges(bag.loaded).all_cams)


def test_points_are_the_states_of_the_exact_map(bouncing_bag, replayed):
    """In the bounce chart each turn has a point at its speed and its gap at angle 0.

    The gap is that of the exact motion, to a median error of 1e-6 mm. The last turn has no point,
    because no sample follows it.
    """
    rows = replayed.column(f"{GAPS}/tm21", POSITIONS)
    assert all(len(points) == 1 for points in rows)
    rpm, gap = np.array([*exact(bouncing_bag.loaded)])[:-1].T
    shown = placed_from(axes_of(bouncing_bag)[0], rows)
    np.testing.assert_allclose(shown[0], rpm, atol=1e-4)
    off = np.abs(shown[1] - gap)
    assert np.median(off) < 1e-6 and off.max() < 1e3 * LANDING_ERROR
    assert np.ptp(gap) > 1.0


def test_a_turn_is_shown_once_it_is_over(bouncing_bag, replayed):
    """The point of a turn appears within one tick after the cam passes angle 0.

    A tick is the interval between two cam states.
    """
    time = replayed.time(f"{GAPS}/tm21")
    scene = bouncing_bag.loaded.scene
    ticks = scene.schedule.ticks_per_turn
    ends = np.array([state.time_ns / NS for state in cam_states(scene)][ticks:-1:ticks])
    late, tick = time - ends, TURN / scene.schedule.speeds.si_list[0] / ticks
    assert np.all(np.diff(time) > 0.0)
    assert late.min() > 0.0 and late.max() <= tick


def test_landings_are_those_of_the_samples(bouncing_bag, replayed):
    """Each sample with a landing impulse has a point at its cam angle within the turn."""
    points = [p for row in replayed.column(f"{LANDINGS}/tm21", POSITIONS) for p in row]
    _, degrees = placed_from(axes_of(bouncing_bag)[1], points)
    landed = bouncing_bag.samples[5] > 0.0
    wanted = np.degrees(bouncing_bag.angle[landed] % TURN)
    np.testing.assert_allclose(degrees, wanted, atol=1e-3)
    assert landed.sum() > 3 * TURNS


def test_only_a_follower_that_rebounds_has_the_chart(picture):
    """Of the shipped scenes only `bounce` has the chart of bounces.

    Its follower rebounds from the cam.
    """
    scenes = (config_root() / "scenes").glob("*.yaml")
    assert [path.stem for path in scenes if can_rebound(open_scene(path))] == ["bounce"]
    assert not [entity for entity in picture.entities if entity.startswith(f"/{GAPS}")]

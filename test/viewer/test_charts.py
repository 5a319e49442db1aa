"""Charts of the viewer: axes, levels, bands, overlaid turns, texts."""

from dataclasses import replace
from itertools import islice, pairwise

import numpy as np
import pytest

from cam_rig.acoustics import RadiationParameters, rms_pressure
from cam_rig.dynamics import MODELS
from cam_rig.dynamics.torsional.motion import solve, steady_state
from cam_rig.schema.load import config_root
from cam_rig.show.chart import TOP_MARGIN, round_range, step_marks, tens_range
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import cam_states
from cam_rig.simulation.simulate import MeasuredTick, step_levels
from cam_rig.units import NS, TURN
from cam_rig.viewer import Layout, ViewOptions, level_chart, quantities, timeline
from cam_rig.viewer.level_chart import BAND_LEVELS, at_speed, band_axes, level_axes
from cam_rig.viewer.quantities import scene_ranges
from cam_rig.viewer.run_view import about
from cam_rig.viewer.scene2d import force_scale
from cam_rig.viewer.timeline import CAM_DEGREES, TURN_DEGREES, time_columns
from cam_rig.viewer.turn_chart import HEAD, WIDTH

STRIPS, POSITIONS = "LineStrips2D:strips", "Points2D:positions"

# -- axes with round numbers, and points on them


def some_ends():
    """Return 300 random pairs of axis ends.

    Their size is 1e-3 to 1e6, and the second end is larger by 1 to 100 % of it.
    """
    random = np.random.default_rng(18)
    size = 10.0 ** random.uniform(-3.0, 6.0, 300)
    low = random.uniform(-1.0, 1.0, 300) * size
    return [*zip(low.tolist(), (low + size * random.uniform(0.01, 1.0, 300)).tolist(), strict=True)]


def test_an_axis_contains_its_values_with_a_small_margin():
    """An axis contains its values and extends beyond them by less than one step.

    Steps are 1, 2 or 5 times a power of ten. An axis has 2 to 4 numbers, including 0 if it contains
    0.
    """
    for low, high in some_ends():
        left, right, step = round_range(low, high)
        mantissa = step / 10.0 ** np.floor(np.log10(step) + 1e-9)
        assert round(mantissa, 9) in (1.0, 2.0, 5.0)
        assert left <= low + 1e-9 * step and high <= right + 1e-9 * step
        assert low - left < step * (1.0 + 1e-9) and right - high < step * (1.0 + 1e-9)
        assert (high - low) / step <= 5.0 + 1e-9
        marks = step_marks(left, right, step)
        values = np.array([*marks])
        assert 2 <= values.size <= 4
        assert left - 1e-9 * step <= values.min()
        assert values.max() <= right + 1e-9 * step
        apart = np.diff(values) / step
        np.testing.assert_allclose(apart, np.rint(apart), atol=1e-6)
        if left <= 0.0 <= right:
            assert np.abs(values).min() < 1e-9 * step
        for value, words in marks.items():
            assert float(words.replace("−", "-")) == pytest.approx(value, rel=1e-5)
        # Axes over time have three or more multiples of a power of ten.
        left, right = tens_range(low, high)
        assert left <= low and high <= right
        step = 10.0 ** np.floor(np.log10(high - low) + 1e-9)
        numbers = np.arange(np.ceil(left / step - 1e-9), right / step)
        assert numbers.size >= 3
        assert (right - left) / step <= 10.0 * (1.0 + TOP_MARGIN) + 1.0
        assert high - low >= 0.33 * (right - left)
    # The gap is 0 if the follower never leaves its cam.
    assert round_range(0.0, 0.0)[:2] == (0.0, 1.0)


def test_a_gap_much_smaller_than_the_greatest_has_an_additional_axis():
    """A cam whose largest gap is much smaller than that of others gets another axis.

    The gap between cam and follower fills 15 to 50 % of this additional axis. Gaps that one axis
    resolves have no additional axis.
    """
    for least in (1.5e-6, 16.5e-6, 3e-4):
        (low, high, _) = quantities.close_gap([least, 0.04, 0.0])[quantities.CLOSE_GAP]
        assert low == 0.0 and 0.15 <= least * 1e6 / high <= 0.5
    for gaps in ([], [0.0], [1e-9, 0.04], [0.02, 0.04], [1e-4]):
        assert quantities.close_gap(gaps) == {}
    axes = scene_ranges(open_scene(config_root() / "scenes" / "tm21_sweep.yaml")).all_cams
    assert axes[quantities.CLOSE_GAP][1] <= quantities.MAX_SHARE * 4.0 * axes["gap"][1]


def test_minimum_and_maximum_of_every_bucket_are_kept_in_order():
    """A reduced curve keeps minimum and maximum of each bucket of samples, in order.

    A bucket is a number of successive samples. The last one may be shorter. Buckets of one sample
    keep all samples.
    """
    for count, bucket in ((1, 5), (5, 5), (52, 5), (100, 7), (9, 100)):
        values = np.random.default_rng(1).normal(size=count)
        indices = quantities.extremes(values, bucket)
        assert np.all(np.diff(indices) > 0)
        assert indices.size <= 2 * -(-count // bucket)
        for start in range(0, count, bucket):
            part = values[start : start + bucket]
            of_part = values[indices[(indices >= start) & (indices < start + bucket)]]
            assert of_part.min() == part.min() and of_part.max() == part.max()
    np.testing.assert_array_equal(quantities.extremes(np.array([3.0, 1.0, 2.0]), 1), [0, 1, 2])


def test_a_row_at_the_end_of_a_turn_is_at_0_degrees_of_the_next():
    """A sample at the end of a turn is shown at 0° of the next turn.

    Simulated times are whole ns, so the angle may be slightly less than a turn.
    """
    turns = np.arange(1, 700)
    for rpm in (60.0, 200.0, 400.0, 3000.0, 10_000.0):
        speed = rpm * np.pi / 30.0
        time = np.floor(turns * 2.0 * np.pi / speed * 1e9) * 1e-9
        columns = {
            str(column.timeline): column.as_arrow_array().cast("int64").to_numpy()
            for column in time_columns(time, time * speed)
        }
        np.testing.assert_array_equal(columns[timeline.TURN], turns)
        np.testing.assert_array_equal(columns[TURN_DEGREES], np.zeros(turns.size))
        np.testing.assert_array_equal(columns[CAM_DEGREES], 360 * turns)


@pytest.mark.parametrize("free", [True, False])
def test_twist_tick_by_tick_is_that_of_the_model(config_dir, free):
    """The displayed twist of the shaft at the end of each tick is that of the model.

    A tick is the interval between two cam states. The relative tolerance is 1e-9. With a free
    flywheel the whole turn agrees with the steady state.
    """
    loaded = open_scene(config_dir / "scenes" / "flywheel.yaml")
    if not free:
        shaft = loaded.rig.shaft
        held = shaft.model_copy(update={"flywheel_inertia": None})
        loaded = replace(loaded, rig=loaded.rig.model_copy(update={"shaft": held}))
    states = list(islice(cam_states(loaded.scene), 3))
    twist, law, speed = quantities.ShaftTwist(loaded), loaded.laws[states[0].cam], states[0].speed
    parameters, state = MODELS["torsional"].parameters(loaded.rig), None
    for start, end in pairwise(states):
        times = np.linspace(start.time_ns, end.time_ns, 101) / NS
        shown = twist.tick(start.cam, start.until(end), times)
        state, _ = MODELS["torsional"].advance(law, parameters, state, start.until(end), 1000)
        peak = np.abs(shown).max()
        assert shown[-1] == pytest.approx(state.inner[0], rel=1e-9, abs=1e-10 * peak)
        if free:
            driven, first = steady_state(law, parameters, speed)
            turn = solve(law, driven, first, 0.0, TURN / speed)
            expected = turn.at(np.linspace(0.0, turn.stop_time, 101))[0]
            np.testing.assert_allclose(shown, expected, rtol=0, atol=1e-8 * peak)


# -- third-octave bars: Parseval, transfer function, pulse of a landing

RATE = 12_000.0


@pytest.fixture(scope="module")
def radiation(rig):
    """Radiation constants of the shipped rig."""
    return RadiationParameters.from_rig(rig)


def test_a_tone_has_power_in_its_band_only(radiation):
    """A force of 1 N at 1 kHz has sound power only in the third-octave band of 1 kHz.

    Its pressure amplitude is gain · ω_c times the ratio of the low-pass at 1 kHz.
    """
    time = np.arange(12_000) / RATE
    power = level_chart.band_power(radiation, np.cos(2e3 * np.pi * time), np.zeros_like(time), RATE)
    numbers = level_chart.band_numbers(RATE)
    ratio = 1e3 / np.hypot(1e3, radiation.corner_frequency)
    expected = 0.5 * (radiation.gain * radiation.corner_rate * ratio) ** 2
    np.testing.assert_allclose(power[numbers == 30.0], expected, rtol=1e-9)
    assert power[numbers != 30.0].max() < 1e-20 * expected


def test_the_bands_sum_to_the_power_at_the_microphone(radiation):
    """The sound powers of the third-octave bands add up to that at the microphone.

    The background is excluded. A constant force gives 0 dB in each band. A landing has its energy
    divided by the turn's duration as power.
    """
    turn = 2000
    phase = 2.0 * np.pi * np.arange(turn) / turn
    force = 100.0 + 60.0 * np.cos(phase) + 20.0 * np.sin(5.0 * phase)
    state = None
    for _ in range(40):
        state, pressure = rms_pressure(radiation, state, force, np.zeros(turn), RATE, 30.0)
    contact = pressure**2 - radiation.background_power(30.0)
    power = level_chart.band_power(radiation, force, np.zeros(turn), RATE)
    np.testing.assert_allclose(power.sum(), contact, rtol=1e-4)
    levels = level_chart.third_octaves(radiation, np.full(501, 80.0), np.zeros(501), RATE)
    np.testing.assert_allclose(levels, 0.0, atol=1e-12)
    assert levels.size == level_chart.band_numbers(RATE).size
    rate, turn, impulse = 96_000.0, 19_200, np.zeros(19_200)
    impulse[77] = 0.01
    power = level_chart.band_power(radiation, np.zeros(turn), impulse, rate).sum()
    energy = float(radiation.landing_energy(np.array([0.01]))[0])
    np.testing.assert_allclose(power * turn / rate, energy, rtol=0.03)  # up to 20 kHz


def test_each_bar_has_the_position_of_its_band_and_the_height_of_its_level(bag, drawings, picture):
    """Each third-octave bar is at its band, with the height of its level.

    In a run the bars appear at the end of each turn.
    """
    shown, rate = drawings(ViewOptions(Layout.COMPARE, 700.0)), bag.loaded.scene.sample_rate.si
    axes, numbers = band_axes(rate), level_chart.band_numbers(rate)
    for i, cam in enumerate(bag.loaded.cams):
        ((skyline,),) = shown.column(f"compare/{cam}/bands/bars", STRIPS)
        rows = np.concatenate(bag.rows[8 * i + 6 : 8 * i + 8], axis=1)
        levels = level_chart.third_octaves(bag.loaded.radiation, rows[4], rows[5], rate)
        bars = np.array(skyline).reshape(-1, 4, 2)
        for of_bar, heights in (([1, 2], levels), ([0, 3], np.full(levels.size, BAND_LEVELS[0]))):
            middle = np.mean(bars[:, of_bar], axis=1)
            np.testing.assert_allclose(middle, axes.place(numbers, heights), atol=1e-4)
    for other in (4_000.0, 12_000.0, 96_000.0):
        assert (band_axes(other).y, band_axes(other).x[0]) == (BAND_LEVELS, 4.5)
    times = np.array([end for end, _ in bag.levels]) * 1e-9
    whole = [i for i in range(16) if i % 4]  # two ticks per turn, four per step
    np.testing.assert_allclose(picture.time("bands/bars"), times[whole], atol=1e-9)


# -- levels over speed


def test_each_cam_is_labelled_next_to_its_last_point(bag, picture):
    """The titles of the cams are right of the level chart and do not overlap.

    Each is at the height of the cam's last point. Titles that are moved apart keep their order.
    """
    names = picture.column("noise/names", "Points2D:labels")[-1]
    assert names == [*level_chart.displayed_titles(bag.loaded).values()]
    positions = picture.column("noise/names", POSITIONS)[-1]
    axes, (x, y) = level_axes(bag.loaded), np.array(positions).T
    assert np.all(x > axes.width)
    assert np.all(x < axes.width * (1.0 + level_chart.names_width(bag.loaded)))
    assert np.diff(np.sort(y)).min() >= level_chart.TITLE_DISTANCE - 1e-4
    random = np.random.default_rng(18)
    for _ in range(50):
        positions = random.uniform(0.0, 30.0, random.integers(1, 7))
        shifted = level_chart.spread_apart(positions, 5.0)
        np.testing.assert_array_equal(np.argsort(shifted), np.argsort(positions))
        assert np.all(shifted >= positions) and np.all(np.diff(np.sort(shifted)) >= 5.0 - 1e-12)


def test_measured_points_are_the_levels_of_the_steps(bag, picture):
    """The last points of the level chart are the levels of each cam at each speed.

    A level is the energy mean over the ticks (intervals between cam states) in which the motion has
    settled.
    """
    states, rate = list(cam_states(bag.loaded.scene)), int(bag.loaded.scene.sample_rate.si)
    ticks = [
        MeasuredTick.between(start, end, pressure, rate)
        for start, end, pressure in zip(states[:-1], states[1:], bag.pressures, strict=True)
    ]
    axes = level_axes(bag.loaded)
    for cam, steps in step_levels(ticks, 1.0).items():
        shown = picture.column(f"noise/measured/{cam}", POSITIONS)
        rpm = np.array(list(steps)) * 30.0 / np.pi
        np.testing.assert_allclose(shown[-1], axes.place(rpm, np.array([*steps.values()])), 1e-5)
        assert len(shown[-1]) == 2
        (final,) = picture.column(f"noise/final/{cam}", POSITIONS)
        np.testing.assert_allclose(final, shown[-1])
    corners = axes.place(np.array([300.0, 700.0]), np.array(axes.y))
    np.testing.assert_allclose(corners, [[0.0, axes.height], [axes.width, 0.0]])


# -- cams side by side, and texts


@pytest.mark.parametrize("rpm", [300.0, 700.0])
def test_the_last_turns_of_all_cams_are_overlaid(bag, drawings, rpm):
    """A chart of one speed overlays the lift of the last turn of each cam.

    Each point is a sample at its angle in degrees, and the peak is included.
    """
    shown = drawings(ViewOptions(Layout.COMPARE, rpm))
    low, high, _ = scene_ranges(bag.loaded).all_cams["lift"]
    for i, cam in enumerate(bag.loaded.cams):
        (strips,) = shown.column(f"{at_speed(rpm, 'lift')}/lift/{cam}", STRIPS)
        x, y = np.array(strips[0]).T
        degrees, lift = x / WIDTH * 360.0, high - (y - HEAD) / level_chart.ROW * (high - low)
        step = 4 * (2 * i + int(rpm > 500.0))
        rows = np.concatenate(bag.rows[step + 2 : step + 4], axis=1)
        angle = np.degrees(np.concatenate(bag.angles[step + 2 : step + 4])) % 360.0
        assert np.all(np.diff(degrees) > 0.0)
        at = np.abs(angle[:, None] - degrees).argmin(axis=0)
        np.testing.assert_allclose(degrees, angle[at], atol=1e-3)
        np.testing.assert_allclose(lift, rows[1, at] * 1e3, atol=1e-3)
        assert lift.max() == pytest.approx(rows[1].max() * 1e3, abs=1e-3)


@pytest.mark.parametrize("layout", [Layout.COMPARE, Layout.REPORT])
def test_cams_side_by_side_at_one_speed(bag, drawings, layout):
    """In a comparison at one speed each cam has a moving picture and bars.

    The bars are third-octave levels. The scale bar of 100 N has the same length for all cams.
    """
    shown, lengths = drawings(ViewOptions(layout, 300.0)), []
    assert "/plots/lift/follower" not in shown.entities
    assert 100.0 < force_scale(bag.loaded, 10.0 * np.pi) < 1000.0
    for cam in bag.loaded.cams:
        rig = f"compare/{cam}/scene/rig"
        assert shown.column(f"{rig}/label", "Points2D:labels") == [["300 rpm"]]
        assert shown.column(f"{rig}/bar/words", "Points2D:labels") == [["100 N"]]
        assert len(shown.column(f"{rig}/cam", "Transform3D:quaternion")) == 72
        assert len(shown.column(f"compare/{cam}/bands/bars", STRIPS)) == 1
        ((foot, top),) = shown.column(f"{rig}/bar", STRIPS)[0]
        (zoom,) = shown.column(rig, "Transform3D:mat3x3")[0]
        lengths.append((top[1] - foot[1]) * zoom[0])
    assert lengths[0] == pytest.approx(lengths[1], rel=1e-5)


def test_results_are_those_of_the_turns(bag, picture):
    """The table of results has the peaks and lift-offs of the last turn at each speed.

    Cams and speeds are in the order of the scene.
    """
    words = picture.column("results", "TextDocument:text")[-1][0]
    lines = [[cell.strip() for cell in line.split("|")[1:]] for line in words.splitlines()[4:]]
    assert [line[0] for line in lines] == ["Polynomial 3-4-5", "", "Bézier degree 15", ""]
    assert [line[1] for line in lines] == ["300", "700"] * 2
    last = np.concatenate(bag.rows[6:8], axis=1)
    slow, fast = lines[:2]
    assert float(fast[3]) == pytest.approx(last[4].max(), rel=1e-3)
    assert float(fast[4]) == 0.0
    assert int(fast[5]) == 1
    law, angle = bag.loaded.laws["poly345"], np.concatenate(bag.angles[6:8])
    gap = (last[1] - law(angle))[last[4] == 0.0].max() * 1e6
    assert float(fast[6]) == pytest.approx(gap, rel=1e-3) and (slow[5], slow[6]) == ("0", "0")


@pytest.mark.parametrize("layout", list(Layout))
def test_a_finished_run_has_its_results_at_every_time(bag, picture, drawings, layout):
    """The results of a finished run are displayed at every time of every timeline.

    They are the table and the levels of all speeds.
    """
    shown = picture if layout is Layout.RUN else drawings(ViewOptions(layout, 300.0))
    (words,) = shown.column("results", "TextDocument:text")
    assert len([line for line in words[0].splitlines() if line.startswith("|")]) == 2 + 4
    for cam in bag.loaded.cams:
        assert len(shown.column(f"noise/final/{cam}", POSITIONS)[0]) == 2
        assert shown.column(f"noise/final/{cam}", TURN_DEGREES) == []
    assert shown.column("results", TURN_DEGREES) == []


def test_numbers_are_listed_by_origin(bag):
    """The text about a run lists its numbers as given, assumed or identified.

    These are the origins of the numbers, which are listed with units. The text states if curves are
    reduced.
    """
    words = about(bag.loaded, 1)
    assert words.startswith("# Two cams, two speeds\n")
    assert "## Polynomial 3-4-5" in words
    assert "**given:** lift 0.05 m" in words
    assert "**assumed:** base_radius 65 mm; roller_radius 10 mm" in words
    assert "**identified:** segments[1].span 117.5 deg" in words
    assert "mass 1.3 kg" in words
    assert "Of every" not in words
    thinned = "Of every 26 samples the curves show the minimum and the maximum."
    assert thinned in about(bag.loaded, 26)

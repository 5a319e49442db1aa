"""Tests of `cam-rig compare` for bags of the rig and of a test bench.

The command compares a measured run with the simulation of a scene.
"""

import csv
import re
from functools import partial
from itertools import product

import numpy as np
import pytest

import cam_rig
from cam_rig.show.chart import SPEED
from cam_rig.studies.compare.chart import real_run_entity, save_real_run
from cam_rig.studies.compare.study import RunComparison

from ...cli.conftest import GOLDEN, data_of, done
from ...cli.conftest import call as run
from ...foreign_bags import joint, number, wrench, write_bag, write_rigs
from ...viewer.conftest import Picture
from .bench import compared, measured

LINE = "angle=/encoder.position[0] lift=/lvdt.position[0]:mm force=/cell.wrench.force.z level=/mic"


call = partial(run, "compare")


@pytest.fixture
def bench(tmp_path, make_loaded_scene):
    """Bag of a simulated bench, and its scene.

    The bench has an encoder, two sensors and a microphone. The clock of the sensors is 200 ppm
    slow.
    """
    loaded = make_loaded_scene(cams=["tm21"], speeds=[250, 400], turns=12, transient_turns=2)
    run = measured(loaded, slow=200e-6)
    topics = {
        "/encoder": (joint, run.angle.time, run.angle.value),
        "/lvdt": (joint, run.lift.time, 1e3 * run.lift.value),
        "/cell": (wrench, run.force.time, run.force.value),
        "/mic": (number, run.level.time, run.level.value),
    }
    return write_bag(tmp_path / "bench", topics), loaded


@pytest.fixture(scope="module")
def golden():
    """Comparison of the golden bag, the reference recording, with its scene `quick`."""
    return cam_rig.compare(GOLDEN, "quick")


def test_a_bag_of_the_rig_agrees_with_its_scene(golden):
    """The golden bag agrees with the simulation of its scene to rounding.

    This applies to lift, force, lift-offs and sound level of each cam at each speed.
    """
    found = golden.data()
    assert repr(golden).startswith("RunComparison(departures: 8 rows")
    rows = [(row["cam"], row["rpm"]) for row in found["departures"]]
    assert rows == [*product(("tm21", "bezier15"), (200.0, 300.0, 350.0, 400.0))]
    for row in found["departures"]:
        assert row["lift_within_noise"] and row["force_within_noise"]
        assert abs(row["force_largest"]) < 1e-9 and row["lift_noise"] == 0.0
    for row in found["events"]:
        assert row["lift_offs_measured"] == row["lift_offs_model"]
        assert row["level_measured"] == pytest.approx(row["level_model"], abs=1e-9)
    assert [row["agreeing"] for row in found["largest"][:2]] == [8, 8]
    assert golden.summary() == ["lift and force agree at 8 of 8 speeds"]


def test_a_figure_has_at_most_three_speeds_per_cam(golden):
    """The figure of a comparison shows at most three speeds per cam.

    A difference within rounding is labelled "equal to rounding". Its axis spans ±1 µm or ±1 N, so
    that rounding is not magnified.
    """
    panels = golden.plot().axes
    titles = [axes.get_title() for axes in panels if axes.get_title()]
    expected = [f"TM21 concave cam\n{rpm} rpm" for rpm in (200, 350, 400)]
    assert titles == [*expected, "Bézier degree 15\n200 rpm", "Bézier degree 15\n400 rpm"]
    differences = [axes for axes in panels if axes.get_ylabel().startswith("difference")]
    assert {axes.get_ylim() for axes in differences} == {(-1.0, 1.0)}
    assert {axes.get_title(loc="left") for axes in differences} <= {"equal to rounding", ""}


def test_the_scene_needs_only_the_chosen_cam(make_loaded_scene):
    """With --cam the scene only has to contain this cam of the bag.

    Without it, a scene that lacks a cam of the bag is refused.
    """
    settings = {"model": "one_mass", "transient_turns": 1, "sample_rate": 1000}
    scene = make_loaded_scene(cams=["bezier15"], **settings).scene_file
    refused = call(GOLDEN, scene)
    assert refused.exit_code == 2 and "must have the cam 'tm21' of the bag" in refused.stderr
    rows = data_of("compare", GOLDEN, scene, "--cam", "bezier15")["departures"]
    assert [row["cam"] for row in rows] == ["bezier15"] * 4
    assert all(row["force_within_noise"] for row in rows)


@pytest.mark.long
def test_a_bench_s_bag_is_compared_by_its_topics(bench, tmp_path):
    """A bench's bag is read by the topics of --topics and agrees within the noise.

    The command reports the angle offset (3.1°) and the clock drift (200 ppm) of the bench, and
    writes CSV, figure and recording.
    """
    bag, loaded = bench
    plot, recording = tmp_path / "a.svg", tmp_path / "a.rrd"
    files = "--plot", plot, "--save", recording, "--csv", tmp_path / "a.csv"
    result = done("compare", bag, loaded.scene_file, "--topics", LINE, *files)
    said = " ".join(result.stderr.split())
    assert re.search(r"cam angle offset 3\.1\d+ ° from the lift", said)
    assert re.search(r"sensor clock drift (19|20)\d(\.\d)? ppm from the lift", said)
    assert "lift and force agree at 2 of 2 speeds" in said
    assert "level: /mic, 24 readings, the time is that of the bag." in said
    rows, events = (
        list(csv.DictReader((tmp_path / name).read_text(encoding="utf-8").splitlines()))
        for name in ("a.csv", "a.events.csv")
    )
    assert [float(row["rpm"]) for row in rows] == pytest.approx([250.0, 400.0], rel=1e-4)
    assert all(row["lift_within_noise"] == row["force_within_noise"] == "True" for row in rows)
    lost = [float(row["lift_offs_model"]) for row in events]
    assert lost == pytest.approx([0.0, 1.0], abs=0.01)
    assert plot.read_text(encoding="utf-8").count("rpm") >= 1
    assert recording.stat().st_size > 10_000


def test_the_recording_has_run_and_model(bench, tmp_path):
    """The Rerun recording of a comparison has measured and model curves per speed.

    The third curve is the difference, measured minus model.
    """
    _, loaded = bench
    _, rows = compared(measured(loaded), loaded)
    save_real_run(RunComparison(tmp_path, loaded, tuple(rows), ()), tmp_path / "a.rrd")
    picture = Picture(tmp_path / "a.rrd")
    for quantity in ("lift", "force"):
        curves = {}
        for chart in ("measured", "model", "difference"):
            entity = f"{real_run_entity('tm21', quantity, chart)}/curve"
            assert picture.numbers(entity, SPEED).tolist() == [250.0, 400.0]
            strips = picture.column(entity, "LineStrips2D:strips")
            curves[chart] = np.array([np.array(list(strip))[0][:300] for strip in strips])
        np.testing.assert_array_equal(curves["measured"][..., 0], curves["model"][..., 0])
        both, apart = curves["measured"][..., 1] - curves["model"][..., 1], curves["difference"]
        apart = apart[..., 1] - np.median(apart[..., 1])
        scale = np.sum(both * apart) / np.sum(apart**2)
        np.testing.assert_allclose(both, scale * apart, atol=0.05 * np.abs(both).max())


def test_one_of_two_rigs_is_compared_by_namespace(tmp_path):
    """--namespace selects one of two rigs in a bag. Without it the error names both."""
    bag = write_rigs(tmp_path / "two", GOLDEN, "", "/rig2")
    result = call(bag, "quick")
    assert result.exit_code == 1
    assert "several rigs, /, /rig2; choose one with --namespace /rig2" in result.stderr
    data = data_of("compare", bag, "quick", "--namespace", "/rig2", "--cam", "tm21")
    assert len(data["departures"]) == 4


def test_readings_and_skipped_messages_are_counted_for_each_quantity(bench):
    """The results of a comparison count readings and skipped messages per quantity.

    They are in the JSON and in the notes.
    """
    bag, loaded = bench
    found = data_of("compare", bag, loaded.scene_file, "--topics", LINE)
    counts = {row["quantity"]: row for row in found["readings"]}
    assert list(counts) == ["angle", "lift", "force", "level"]
    for name, row in counts.items():
        assert row["skipped"] == row["messages"] - row["readings"] == 0
        note = f"{name}: {row['source']}, {row['readings']} readings, the time is that of"
        assert any(line.startswith(note) for line in found["run"]["notes"])

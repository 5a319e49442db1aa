"""Command `cam-rig view`, charts of laws and orders, and Rerun's import of a bag."""

import json
import os
import re
import shlex
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
import typer
from mcap.reader import make_reader
from typer.testing import CliRunner

import cam_rig
from cam_rig.bag.files import bag_file
from cam_rig.bag.reader import messages
from cam_rig.errors import CamRigError
from cam_rig.laws.catalogue import ORDERS, rise_curves
from cam_rig.messages import topics
from cam_rig.schema.load import config_root
from cam_rig.show.chart import SPEED
from cam_rig.show.looks import short
from cam_rig.simulation.scene import open_scene
from cam_rig.studies.laws import chart as law_chart
from cam_rig.studies.laws.chart import save_laws
from cam_rig.studies.orders.chart import entity, orders_tabs, save_orders
from cam_rig.studies.orders.spectrum import RANGE, loudest, waterfall
from cam_rig.units import RPM
from cam_rig.viewer import Layout, ViewOptions
from cam_rig.viewer import process as viewer
from cam_rig.viewer.command import view
from cam_rig.viewer.level_chart import at_speed
from cam_rig.viewer.process import COMMAND, SILENT
from cam_rig.viewer.recording import save_recording
from cam_rig.viewer.run_recorder import RunRecorder

from ..conftest import GOLDEN, scene_data
from .conftest import Picture

app = typer.Typer()
app.command()(view)


@pytest.fixture
def no_display(monkeypatch):
    """Environment of a Linux machine without a display."""
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)


def test_the_viewer_opens_the_file_on_loopback_and_reports_no_usage(monkeypatch, tmp_path):
    """Rerun's viewer is started with the file, on the loopback address, with CI set.

    CI disables its usage reports. If it fails, the error has its exit code and a remedy.
    """
    said = tmp_path / "said"
    monkeypatch.delenv("CI", raising=False)
    words = (
        f"import os, sys; open({str(said)!r}, 'w').write(f'{{sys.argv}} {{os.environ[\"CI\"]}}')"
    )
    monkeypatch.setattr(viewer, "COMMAND", words)
    viewer.show(tmp_path / "a.rrd")
    assert said.read_text().endswith(
        f"'--bind', '127.0.0.1', '--hide-welcome-screen', '--new', '{tmp_path / 'a.rrd'}'] 1"
    )
    monkeypatch.setattr(viewer, "COMMAND", "import sys; sys.exit(3)")
    with pytest.raises(CamRigError, match=r"ended with code 3.*--save"):
        viewer.show(tmp_path / "a.rrd")


@pytest.mark.usefixtures("no_display")
def test_a_missing_display_is_reported(bag):
    """Without a display the command ends with code 1 and suggests --save."""
    result = CliRunner().invoke(app, [str(bag.path)])
    assert result.exit_code == 1 and "no display to open the viewer on" in result.stderr
    assert "--save FILE.rrd" in result.stderr


@pytest.mark.usefixtures("no_display")
def test_saving_needs_no_display_and_prints_path_and_size(bag, tmp_path):
    """`--save` works without a display, creates the folder, and prints path and size.

    An existing file is replaced only with --force.
    """
    path = tmp_path / "out" / "a.rrd"
    command = [str(bag.path), "--save", str(path)]
    first, second = (CliRunner().invoke(app, command) for _ in range(2))
    assert first.exit_code == 0
    assert re.fullmatch(rf"{re.escape(str(path))}: \d+\.\d MB", first.stderr.strip())
    assert second.exit_code == 1 and "exists already" in second.stderr
    assert CliRunner().invoke(app, [*command, "--force"]).exit_code == 0


def test_invalid_options_are_refused(bag, tmp_path):
    """Conflicting options, or a speed that is not in the run, are refused.

    The error contains the options, or the speeds of the run. No file is written.
    """
    save = ["--save", "{tmp}/a.rrd"]
    for options, code, words in (
        ([*save, "--web"], 2, "--save cannot be combined with --web"),
        (["--force"], 2, "--force requires --save"),
        (["--save", "{tmp}"], 1, "is a folder; name a file in it, such as"),
        *(
            (
                [*save, "--layout", "compare", "--rpm", rpm],
                2,
                f"rpm must be a speed of the run, 300, 700, got {rpm}",
            )
            for rpm in ("500", "nan", "inf", "-300")
        ),
    ):
        command = [str(bag.path), *(option.format(tmp=tmp_path) for option in options)]
        result = CliRunner().invoke(app, command)
        assert result.exit_code == code and words in result.stderr
        assert list(tmp_path.iterdir()) == []


def test_cams_are_compared_at_speeds_of_the_operator(bag, tmp_path):
    """Cams can be compared at the speeds that a bag has, even if its scene has others.

    An operator may have set other speeds during the run.
    """
    path = tmp_path / "scenes" / "other.yaml"
    path.parent.mkdir()
    for part in ("cams", "rigs"):
        (tmp_path / part).symlink_to(bag.loaded.scene_file.parent.parent / part)
    path.write_text(json.dumps(scene_data(speeds=[500])), encoding="utf-8")
    other = open_scene(path)
    for rpm in (300.0, 700.0):
        saved = tmp_path / f"{rpm:g}.rrd"
        save_recording(bag.path, saved, ViewOptions(Layout.COMPARE, rpm), loaded=other)
        assert f"/{at_speed(rpm, 'lift')}/lift/poly345" in Picture(saved).entities
    path = tmp_path / "none.rrd"
    with pytest.raises(CamRigError, match="rpm must be a speed of the run, 300, 700, got 500"):
        save_recording(bag.path, path, ViewOptions(Layout.COMPARE, 500.0), loaded=other)


def test_an_interrupted_file_is_deleted(bag, tmp_path, monkeypatch):
    """An interrupt while a recording is written deletes the partial file."""

    def interrupted(*_):
        assert [path.name for path in tmp_path.iterdir()] == ["a.rrd.drawn.part"]
        raise KeyboardInterrupt

    monkeypatch.setattr(RunRecorder, "tick", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save_recording(bag.path, tmp_path / "a.rrd")
    assert list(tmp_path.iterdir()) == []


# -- recordings of laws and of orders


STRIPS = "LineStrips2D:strips"
SPEEDS = (300.0, 350.0, 400.0)
UNITS = ("h", "h/β", "h/β²", "h/β³")


def test_each_curve_is_the_law(tmp_path):
    """Each curve in a chart of laws has the values of its law or derivative, to scale.

    The scale is common to all curves of a chart.
    """
    curves = [rise_curves(name) for name in ("poly345", "cycloidal", "simple_harmonic")]
    save_laws(curves, "u", UNITS, tmp_path / "a.rrd")
    picture = Picture(tmp_path / "a.rrd")
    for order in ORDERS:
        drawn, values = [], []
        for curve in curves:
            (strips,) = picture.column(f"{law_chart.entity(order)}/{curve.name}", STRIPS)
            drawn.append(np.array([list(point) for point in strips[0]])[:, 1])
            values.append(curve.motion[order])
        scale, start = np.polyfit(np.concatenate(values), np.concatenate(drawn), 1)
        assert scale < 0.0  # the y axis of the picture is down
        fitted = scale * np.concatenate(values) + start
        np.testing.assert_allclose(np.concatenate(drawn), fitted, atol=1e-4)
    with pytest.raises(CamRigError, match=r"must end in .rrd, got '.png'"):
        save_laws(curves, "u", UNITS, tmp_path / "a.png")


@pytest.fixture(scope="module")
def found():
    """Order spectra of the 3-4-5 cam at three speeds.

    An order is a frequency as a multiple of the cam's.
    """
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    rig = cam_rig.load_rig("paper_table2")
    return waterfall({"poly345": law}, "elastic_stem", rig, [rpm * RPM for rpm in SPEEDS], 40)


def test_bars_are_the_levels_of_the_speed(found, tmp_path):
    """The bars in a chart of orders are the levels at each speed, to scale.

    An order is a frequency as a multiple of the cam's. In the chart over speed, strokes mark the
    orders within 60 dB of the loudest.
    """
    path = tmp_path / "a.rrd"
    save_orders(found, path)
    picture, (study,) = Picture(path), found
    view = entity(study, "level", "lines")
    assert picture.numbers(f"{view}/orders", SPEED).tolist() == list(SPEEDS)
    low = 10.0 * np.ceil(loudest(found, "level") / 10.0) - RANGE
    for spectrum, bars in zip(study.spectra, picture.column(f"{view}/orders", STRIPS), strict=True):
        ends = np.array([np.array(list(bar)) for bar in bars])
        heights = ends[:, 0, 1] - ends[:, 1, 1]
        levels = np.clip(spectrum.level[1:], low, None) - low
        np.testing.assert_allclose(heights / heights.max(), levels / levels.max(), atol=1e-5)
    (strokes,) = picture.column(f"{entity(study, 'level', 'rays')}/orders", STRIPS)
    shown = study.values("level") > loudest(found, "level") - RANGE
    assert len(strokes) == int(shown.sum()) < 0.6 * shown.size
    with pytest.raises(CamRigError, match=r"must end in .rrd, got '.png'"):
        save_orders(found, tmp_path / "a.png")


def test_tabs_and_charts_have_titles(found):
    """A tab of a recording of orders has the shortened title of its cam.

    Without a title it has the name of the cam as text.
    """
    long = "A cam whose title has about forty letters"
    for titles, name in (({}, "Polynomial 3-4-5"), ({"poly345": long}, short(long))):
        (tab,) = orders_tabs(found, titles)
        assert tab.name == name
        charts = [view for row in tab.contents for view in row.contents]
        assert len(charts) == 4 and not any("poly" in str(view.name) for view in charts)


# -- Rerun's import of the MCAP file of a bag


#: Pattern of the packages of message types that every ROS 2 installation has.
OF_ROS = r"(diagnostic|geometry|rosgraph|sensor|std|tf2|trajectory|visualization)_msgs/"


def convert(path, *options):
    """Convert the golden bag with Rerun's importer, and return the recording."""
    command = [sys.executable, "-c", COMMAND, "mcap", "convert", str(bag_file(GOLDEN)), *options]
    subprocess.run([*command, "-o", str(path)], check=True, env=os.environ | SILENT, timeout=60)
    return Picture(path)


@pytest.fixture(scope="module")
def imported(tmp_path_factory):
    """Golden bag (reference recording), converted by Rerun with default options."""
    return convert(tmp_path_factory.mktemp("imported") / "golden.rrd")


def test_the_documented_options_give_named_curves_over_rig_time(tmp_path):
    """With the documented options Rerun names the curves of a bag after the joints.

    The times are durations from 0, as in the simulation.
    """
    documented = (config_root().parent / "docs" / "viewing.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"rerun mcap convert (.*?) -o", documented, re.DOTALL)
    options = shlex.split(line.replace("\\\n", " "))[1:]
    shown = convert(tmp_path / "named.rrd", *options)
    plotted = {e for e in shown.entities if shown.column(e[1:], "Scalars:scalars")}
    assert {f"/joint_states/{field}" for field in ("position", "velocity", "effort")} <= plotted
    assert all(e.rpartition("/")[2] in ("position", "velocity", "effort") for e in plotted)
    names = shown.column("joint_states/position", "SeriesLines:names")
    assert names[-1] == ["cam", "follower"]
    times = shown.column("joint_states/position", "message_log_time")
    assert min(times).total_seconds() >= 0.0 and max(times).total_seconds() < 10.0


def test_joint_states_and_pressure_are_plotted_without_options(imported):
    """Rerun's import of the golden bag plots joint states and pressure.

    They have the values of the bag.
    """
    every = ("position", "velocity", "effort")
    for topic, fields in (
        (topics.CAM_STATE, every),
        (topics.FOLLOWER_STATE, ("position", "effort")),
        (topics.JOINT_STATES, every),
    ):
        recorded = [message for _, _, message in messages(GOLDEN, (topic,))]
        for field in fields:
            shown = imported.numbers(f"{topic.name[1:]}/{field}", "Scalars:scalars")
            wanted = np.squeeze([getattr(message, field) for message in recorded])
            np.testing.assert_array_equal(shown, wanted)
    shown = imported.numbers(topics.PRESSURE.name[1:], "Measurements:values")
    recorded = [message.fluid_pressure for _, _, message in messages(GOLDEN, (topics.PRESSURE,))]
    np.testing.assert_array_equal(shown, recorded)


def test_the_rig_moves_without_options(imported):
    """Rerun's import shows each body of the last URDF and moves it by the transforms."""
    *_, (_, _, last) = messages(GOLDEN, (topics.ROBOT_DESCRIPTION,))
    links = [
        e for e in ElementTree.fromstring(last.data).iter("link") if e.find("visual") is not None
    ]
    bodies = {f"/cam_rig/visual_geometries/{e.get('name')}/visual_0" for e in links}
    assert bodies and bodies <= imported.entities
    moved = np.ravel(imported.column("tf", "Transform3D:child_frame")).tolist()
    instants = sum(1 for _ in messages(GOLDEN, (topics.JOINT_STATES,)))
    assert moved.count("cam") == moved.count("follower") == instants
    still = set(np.ravel(imported.column("tf_static", "Transform3D:child_frame")))
    assert {"guide", "motor", "microphone", "tm21", "bezier15"} <= still


def test_the_file_contains_the_schemas_of_all_messages():
    """The golden bag contains the definition of each message type, for viewers.

    Foxglove and PlotJuggler read the definitions. All messages are of standard ROS types.
    """
    with bag_file(GOLDEN).open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]
        assert (channel.message_encoding, schema.encoding) == ("cdr", "ros2msg")
        assert schema.data
        assert re.match(OF_ROS, schema.name)

"""The bag as it is, without our own drawing: what Rerun's MCAP import makes of it."""

import os
import re
import shlex
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from mcap.reader import make_reader

from cam_rig.bag.files import bag_file
from cam_rig.bag.reader import messages
from cam_rig.messages import topics
from cam_rig.schema.load import config_root
from cam_rig.viewer.process import COMMAND, SILENT

from .conftest import Picture

#: Packages of interfaces that every ROS 2 installation has: none is our own.
OF_ROS = (
    "diagnostic_msgs",
    "geometry_msgs",
    "rosgraph_msgs",
    "sensor_msgs",
    "std_msgs",
    "tf2_msgs",
    "trajectory_msgs",
    "visualization_msgs",
)
GOLDEN = config_root().parent / "bags" / "golden"


def convert(path, *options):
    """The golden bag as Rerun's own converter makes it."""
    command = [sys.executable, "-c", COMMAND, "mcap", "convert", str(bag_file(GOLDEN)), *options]
    subprocess.run([*command, "-o", str(path)], check=True, env=os.environ | SILENT, timeout=60)
    return Picture(path)


@pytest.fixture(scope="module")
def imported(tmp_path_factory):
    return convert(tmp_path_factory.mktemp("imported") / "golden.rrd")


def test_the_options_of_the_documents_leave_named_curves_over_rig_time(tmp_path):
    """No `samples[i]`; θ, lift and force by their joints; durations from 0 instead of dates."""
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
    assert min(times).total_seconds() >= 0.0
    assert max(times).total_seconds() < 10.0


def test_joint_states_and_pressure_plot_by_themselves(imported):
    """Each field as in the bag; r.m.s. sound pressure, one value a tick."""
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


def test_the_rig_turns_by_itself(imported):
    """Each body of the last URDF in its link's frame, moved by the bag's transforms."""
    *_, (_, _, last) = messages(GOLDEN, (topics.ROBOT_DESCRIPTION,))
    links = [
        e for e in ElementTree.fromstring(last.data).iter("link") if e.find("visual") is not None
    ]
    bodies = {f"/cam_rig/visual_geometries/{e.get('name')}/visual_0" for e in links}
    assert bodies
    assert bodies <= imported.entities
    moved = np.ravel(imported.column("tf", "Transform3D:child_frame")).tolist()
    instants = sum(1 for _ in messages(GOLDEN, (topics.JOINT_STATES,)))
    assert moved.count("cam") == moved.count("follower") == instants
    still = set(np.ravel(imported.column("tf_static", "Transform3D:child_frame")))
    assert {"guide", "motor", "microphone", "tm21", "bezier15"} <= still


def test_every_message_explains_itself():
    """Schemas are in the file, in the encoding that Foxglove and PlotJuggler read."""
    with bag_file(GOLDEN).open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]
        assert (channel.message_encoding, schema.encoding) == ("cdr", "ros2msg")
        assert schema.data
        assert schema.name.split("/")[0] in OF_ROS

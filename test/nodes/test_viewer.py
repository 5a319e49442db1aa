"""Tests of the live view of a run: its values equal those of the view of the bag."""

import numpy as np
import pytest
from rerun.chunk import RrdReader

from cam_rig.bag.completeness import require_complete
from cam_rig.runner.graph import Graph
from cam_rig.schema import load_scene
from cam_rig.schema.load import config_root
from cam_rig.viewer.page import newest_recording
from cam_rig.viewer.process import find_free_port, stream_address
from cam_rig.viewer.recording import save_recording

from .conftest import patient, run_to_end, wait_until

pytestmark = [pytest.mark.ros, pytest.mark.filterwarnings("ignore:RRD file has no footer")]
QUICK = config_root() / "scenes" / "quick.yaml"
CURVES = ("lift/follower", "lift/law", "velocity/follower", "force/contact", "level", "speed")


def curves(path):
    """Return rig times and values of every curve in a recording file of the viewer.

    A curve is an array of shape (n, 2), in order of rig time. Each start of a viewer adds a
    recording to the file, and the values of all recordings are joined.
    """
    result, reader = {name: [] for name in CURVES}, RrdReader(path)
    streams = [reader.stream(store=recording) for recording in reader.recordings()]
    for chunk in (chunk for stream in streams for chunk in stream.to_chunks()):
        name = chunk.entity_path.removeprefix("/plots/")
        batch = chunk.to_record_batch()
        if name in result and "Scalars:scalars" in batch.schema.names:
            times = batch.column("rig_time").cast("int64").to_pylist()
            values = batch.column("Scalars:scalars").to_pylist()
            result[name] += zip(times, [value[0] for value in values], strict=True)
    return {name: np.array(sorted(rows)) for name, rows in result.items()}


def complete_curves(file, recorded):
    """Return the curves in a file if they reach the end of the recorded curves.

    Otherwise None is returned.
    """
    try:
        live = curves(file)
    except RuntimeError:  # the file ends in the middle of a chunk that is being written
        return None
    ends = (live[name].size and live[name][-1][0] >= recorded[name][-1][0] for name in CURVES)
    return live if all(ends) else None


def test_live_curves_equal_those_of_the_bag(domain, tmp_path):
    """The live viewer shows the values that the view of the run's bag shows.

    No tick (interval between two cam states) is missing. Live curves have at least half of the
    samples, including the smallest and the largest value.
    """
    bag, folder = tmp_path / "bag", tmp_path / "page"
    folder.mkdir()
    run_to_end(QUICK, bag, screen=str(folder))
    require_complete(bag, load_scene(QUICK))
    save_recording(bag, tmp_path / "bag.rrd")
    recorded = curves(tmp_path / "bag.rrd")
    assert all(recorded[name].size for name in CURVES)
    live = wait_until(lambda: complete_curves(newest_recording(folder), recorded))
    for name in CURVES:
        times, values = live[name].T
        is_live = np.isin(recorded[name][:, 0], times)
        np.testing.assert_array_equal(live[name], recorded[name][is_live], err_msg=name)
        assert np.diff(times).max() <= 2.0 * np.diff(recorded[name][:, 0]).max(), name
        all_values = recorded[name][:, 1]
        assert (values.min(), values.max()) == (all_values.min(), all_values.max())


@pytest.mark.long
@pytest.mark.parametrize(
    ("address", "pacing"),
    [("/no/such/folder", "free"), (stream_address(find_free_port()), "1x")],
    ids=["invalid address", "killed repeatedly"],
)
def test_a_run_continues_without_a_failed_viewer(forked, domain, tmp_path, address, pacing):
    """If the viewer fails, the run continues and its bag is complete."""
    bag, logged = tmp_path / "bag", []
    with Graph(patient(QUICK, bag, address, pacing=pacing), log=logged.append) as graph:
        for report in graph.progress():
            if pacing == "1x" and report["tick"] >= 2:
                graph.processes["viewer"].process.kill()
    require_complete(bag, load_scene(QUICK))
    assert any("node viewer" in line for line in logged)

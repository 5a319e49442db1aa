"""A run seen while it runs: the same curves as of its bag."""

import numpy as np
import pytest
from rerun.chunk import RrdReader

from cam_rig.bag.completeness import require_complete
from cam_rig.runner.graph import Graph
from cam_rig.schema import load_scene
from cam_rig.schema.load import config_root
from cam_rig.viewer.page import newest_recording
from cam_rig.viewer.process import free_port, stream_address
from cam_rig.viewer.recording import save_recording

from .conftest import patient, run_to_end, wait_until

pytestmark = [pytest.mark.ros, pytest.mark.filterwarnings("ignore:RRD file has no footer")]
QUICK = config_root() / "scenes" / "quick.yaml"
CURVES = ("lift/follower", "lift/law", "velocity/follower", "force/contact", "level", "speed")


def curves(path):
    """Every curve's values in order of rig time, of all recordings: each viewer begins its own."""
    found, reader = {name: [] for name in CURVES}, RrdReader(path)
    streams = [reader.stream(store=recording) for recording in reader.recordings()]
    for chunk in (chunk for stream in streams for chunk in stream.to_chunks()):
        name = chunk.entity_path.removeprefix("/plots/")
        batch = chunk.to_record_batch()
        if name in found and "Scalars:scalars" in batch.schema.names:
            times = batch.column("rig_time").cast("int64").to_pylist()
            values = batch.column("Scalars:scalars").to_pylist()
            found[name] += zip(times, [value[0] for value in values], strict=True)
    return {name: np.array(sorted(rows)) for name, rows in found.items()}


def arrived(file, recorded):
    """The curves, once the server has written them to the end of the recorded ones; else none."""
    try:
        seen = curves(file)
    except RuntimeError:  # it ends in the middle of what is being written
        return None
    ends = (seen[name].size and seen[name][-1][0] >= recorded[name][-1][0] for name in CURVES)
    return seen if all(ends) else None


def test_the_live_picture_is_the_bags(domain, tmp_path):
    """All six nodes run, no tick is missing in bag or picture, and the numbers are the same. Of
    every two samples of this scene a live curve has the least and the greatest."""
    bag, folder = tmp_path / "bag", tmp_path / "page"
    folder.mkdir()
    run_to_end(QUICK, bag, screen=str(folder))
    require_complete(bag, load_scene(QUICK))
    save_recording(bag, tmp_path / "bag.rrd")
    recorded = curves(tmp_path / "bag.rrd")
    assert all(recorded[name].size for name in CURVES)
    seen = wait_until(lambda: arrived(newest_recording(folder), recorded))
    for name in CURVES:
        times, values = seen[name].T
        there = np.isin(recorded[name][:, 0], times)
        np.testing.assert_array_equal(seen[name], recorded[name][there], err_msg=name)
        assert np.diff(times).max() <= 2.0 * np.diff(recorded[name][:, 0]).max(), name
        whole = recorded[name][:, 1]
        assert (values.min(), values.max()) == (whole.min(), whole.max())


@pytest.mark.long
@pytest.mark.parametrize(
    ("address", "pacing"),
    [("/no/such/folder", "free"), (stream_address(free_port()), "1x")],
    ids=["nobody listens", "killed whenever it is there"],
)
def test_a_run_goes_on_without_a_viewer_that_cannot_stay(forked, domain, tmp_path, address, pacing):
    """The drive stops waiting for it, and the bag is whole."""
    bag, logged = tmp_path / "bag", []
    with Graph(patient(QUICK, bag, address, pacing=pacing), log=logged.append) as graph:
        for report in graph.progress():
            if pacing == "1x" and report["tick"] >= 2:
                graph.processes["viewer"].process.kill()
    require_complete(bag, load_scene(QUICK))
    assert any("node viewer" in line for line in logged)

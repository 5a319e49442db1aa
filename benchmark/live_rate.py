"""Speed of a run with ROS nodes relative to real time, with and without a viewer.

    python -m benchmark.live_rate

The time is from the first tick that the drive reports to the last message in the closed bag,
without the start of the nodes. With a viewer the whole run is sent to a Rerun server, which stores
it. No page is open.
"""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from cam_rig.runner.graph import Graph
from cam_rig.runner.node_process import live_nodes
from cam_rig.runner.resources import reserve_domain
from cam_rig.show.tables import DataTable, Header, tabulate, to_markdown
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import cam_states
from cam_rig.units import NS
from cam_rig.viewer.rerun_page import serve

SCENES = ("tm21_sweep", "tm21_sweep_48khz")


@dataclass(frozen=True)
class LiveRate:
    """Speed of a run: sample rate (Hz), viewer, and rig time relative to wall time."""

    scene: str
    rate: float
    viewer: bool
    speed_up: float


def live_rate(scene: str, viewer: bool, folder: Path) -> LiveRate:
    """Run a shipped scene with ROS nodes, and measure its speed."""
    path = Path(__file__).parents[1] / "config" / "scenes" / f"{scene}.yaml"
    loaded = open_scene(path)
    stamps = [state.time_ns / NS for state in cam_states(loaded.scene)]
    with ExitStack() as stack:
        screen = str(stack.enter_context(serve()).folder) if viewer else None
        stack.enter_context(reserve_domain(""))
        nodes = live_nodes(path, folder / f"{scene}_{viewer}", screen, pacing="free")
        with Graph(nodes) as graph:
            first = None
            for report in graph.progress():
                first = first or (time.perf_counter(), stamps[int(report["tick"])])
        graph.require_closed()
        assert first is not None
        wall = time.perf_counter() - first[0]
    rate = float(loaded.scene.sample_rate.si)
    return LiveRate(scene, rate, viewer, (stamps[-1] - first[1]) / wall)


def live_table() -> DataTable:
    """Return a table with each scene, without and with a viewer."""
    with TemporaryDirectory() as folder:
        runs = [
            live_rate(name, viewer, Path(folder)) for name in SCENES for viewer in (False, True)
        ]
    return tabulate(
        "Live runs",
        runs,
        (
            (Header("scene"), lambda run: run.scene),
            (Header("samples", "kHz", ".0f"), lambda run: run.rate / 1e3),
            (Header("viewer"), lambda run: "yes" if run.viewer else "no"),
            (Header("x real time", "", ".0f"), lambda run: run.speed_up),
        ),
    )


if __name__ == "__main__":
    print(to_markdown(live_table()))

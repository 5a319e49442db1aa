"""Memory of each node over a long run.

It prints a table. Run it from the root of the repository: .venv/bin/python -m benchmark.soak
[ticks] [scene] [pacing] The exit code is 1 if the memory of a node increases by more than
`MAX_GROWTH` MB after the first tenth of the ticks. The bag of 100 000 ticks of the scene `quick`
needs 1 GB of the temporary folder.
"""

from __future__ import annotations

import math
import shutil
import sys
import tempfile
import time
from pathlib import Path

import yaml

from cam_rig.runner.graph import Graph
from cam_rig.runner.node_process import live_nodes
from cam_rig.runner.resources import reserve_domain
from cam_rig.schema import load_scene
from cam_rig.schema.load import config_root
from cam_rig.simulation.schedule import tick_count

#: Wall time (s) between two rows.
EVERY = 15.0
#: Largest growth (MB) of a node after the first tenth. The recorder stores an index of its bag.
MAX_GROWTH = 20.0


def prolonged(folder: Path, scene: str, ticks: int) -> Path:
    """Copy the configuration with more turns per speed, and return the scene's path."""
    shutil.copytree(config_root(), folder / "config")
    path = folder / "config" / "scenes" / f"{scene}.yaml"
    planned = tick_count(load_scene(path))
    raw = yaml.safe_load(path.read_text(encoding="utf-8"))
    turns = raw["schedule"]["turns"]
    turns["assumed"] = math.ceil(turns["assumed"] * ticks / planned)
    path.write_text(yaml.safe_dump(raw), encoding="utf-8")
    return path


def own_memory(pid: int) -> float:
    """Return the memory (MB) of a process that is not backed by files."""
    lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    return int(next(line for line in lines if line.startswith("RssAnon")).split()[1]) / 1024.0


def main(ticks: str = "100000", scene: str = "quick", pacing: str = "free") -> int:
    """Run the prolonged scene, and measure its nodes at intervals."""
    with tempfile.TemporaryDirectory() as folder, reserve_domain():
        path = prolonged(Path(folder), scene, int(ticks))
        total = tick_count(load_scene(path))
        early: dict[str, float] = {}
        used: dict[str, float] = {}
        start_time, last_print = time.monotonic(), -EVERY
        with Graph(live_nodes(path, Path(folder) / "bag", pacing=pacing), log=print) as graph:
            print("wall s", "tick", *graph.processes, sep="\t")
            for report in graph.progress():
                if int(report["tick"]) == total:
                    break  # nodes have ended, or are about to end
                if (wall := time.monotonic() - start_time) - last_print > EVERY:
                    last_print = wall
                    used = {name: own_memory(p.process.pid) for name, p in graph.processes.items()}
                    if int(report["tick"]) <= total / 10 or not early:
                        early = used
                    row = (f"{mb:.1f}" for mb in used.values())
                    print(f"{wall:.0f}", report["tick"], *row, sep="\t", flush=True)
            for _ in graph.progress():
                pass
        graph.require_closed()
        grown = {name: used[name] - early[name] for name in used}
        print(
            f"{total} ticks in {time.monotonic() - start_time:.0f} s; "
            "grown since the first tenth, MB:"
        )
        print(*(f"{name} {mb:+.1f}" for name, mb in grown.items()), sep=", ")
        return int(max(grown.values()) > MAX_GROWTH)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

"""Memory of each node over a long run: prints a table, a row every so often.

Run it from the project's root: .venv/bin/python benchmark/soak.py [rig hours] [pacing] [scene]
The bag of an hour at 48 kHz takes 8 GB of the temporary folder while it runs.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
from pathlib import Path

import yaml

from cam_rig.cli.domain import own_domain
from cam_rig.cli.graph import Graph, live
from cam_rig.experiment.program import cam_states
from cam_rig.schema import load_scene
from cam_rig.schema.load import config_root

#: Wall time (s) between two rows.
EVERY = 15.0


def prolonged(folder: Path, scene: str, hours: float) -> Path:
    """A copy of the configuration whose scene holds each speed for longer."""
    shutil.copytree(config_root(), folder / "config")
    path = folder / "config" / "scenes" / f"{scene}.yaml"
    *_, last = cam_states(load_scene(path))
    raw = yaml.safe_load(path.read_text(encoding="utf-8"))
    turns = raw["program"]["turns"]
    turns["assumed"] = round(turns["assumed"] * hours * 3600e9 / last.time_ns)
    path.write_text(yaml.safe_dump(raw), encoding="utf-8")
    return path


def own_memory(pid: int) -> float:
    """Memory (MB) of a process that no file backs."""
    lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    return int(next(line for line in lines if line.startswith("RssAnon")).split()[1]) / 1024.0


def main(hours: str = "1", pacing: str = "20x", scene: str = "tm21_sweep_48khz") -> None:
    """Run the prolonged scene and look at its nodes now and then."""
    with tempfile.TemporaryDirectory() as folder, own_domain():
        path = prolonged(Path(folder), scene, float(hours))
        begun, shown = time.monotonic(), -EVERY
        with Graph(live(path, Path(folder) / "bag", pacing=pacing), say=print) as graph:
            print("wall s", "tick", *graph.processes, sep="\t")
            for report in graph.progress():
                if (wall := time.monotonic() - begun) - shown > EVERY:
                    shown = wall
                    used = (own_memory(p.process.pid) for p in graph.processes.values())
                    print(f"{wall:.0f}", report["tick"], *(f"{mb:.1f}" for mb in used), sep="\t")
        print(f"{float(hours):g} h of rig time in {time.monotonic() - begun:.0f} s")


if __name__ == "__main__":
    main(*sys.argv[1:])

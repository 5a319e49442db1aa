"""The page on real runs does what it shows, with a bench's bag as it describes one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from cam_rig.schema.load import config_root
from cam_rig.simulation.loaded_scene import open_scene

from ..foreign_bags import joint, number, wrench, write_bag
from ..studies.real_run.bench import measured
from .pages import DOCS
from .tutorials import follow


def test_every_command_of_the_page_runs(tmp_path, monkeypatch):
    """Beside the golden bag and one of a bench of ten turns a speed; every number is printed."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    Path("bags").mkdir()
    Path("bags/golden").symlink_to(config_root().parent / "bags" / "golden")
    loaded = open_scene(config_root() / "scenes" / "quick.yaml")
    program = loaded.scene.program
    longer = program.turns.model_copy(update={program.turns.origin: 10})
    scene = loaded.scene.model_copy(
        update={"cams": ["tm21"], "program": program.model_copy(update={"turns": longer})}
    )
    run = measured(replace(loaded, scene=scene))
    topics = {
        "/encoder": (joint, run.angle.time, run.angle.value),
        "/lvdt": (joint, run.lift.time, 1e3 * run.lift.value),
        "/cell": (wrench, run.force.time, run.force.value),
        "/mic": (number, run.level.time, run.level.value),
    }
    write_bag(Path("bags/bench"), topics)
    assert follow(DOCS / "real_run.md") == 3

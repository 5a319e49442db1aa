"""The page on real runs does what it shows, with a bench's bag as it describes one."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from cam_rig.schema.load import config_root

from .pages import DOCS
from .tutorials import follow


@pytest.mark.long
@pytest.mark.slow
def test_every_command_of_the_page_runs(tmp_path, monkeypatch):
    """Beside the golden bag and that of the example's bench; every number is printed."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    Path("bags").mkdir()
    Path("bags/golden").symlink_to(config_root().parent / "bags" / "golden")
    runpy.run_path(str(DOCS.parent / "examples" / "simulated_bench.py"), run_name="__main__")
    assert follow(DOCS / "real_run.md", within=1e-3) == 3

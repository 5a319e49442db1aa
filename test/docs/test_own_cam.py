"""From the GL 110's table to a running scene: docs/own_cam.md does what it shows."""

from __future__ import annotations

import pytest

from cam_rig.schema.load import config_root

from .pages import DOCS, blocks
from .tutorials import follow


@pytest.mark.slow
def test_every_command_of_the_page_runs(tmp_path, monkeypatch):
    """In an empty folder, one after the other; every number shown is in what is printed."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    assert follow(DOCS / "own_cam.md") >= 7


def test_the_table_is_the_shipped_one():
    """The page's readings are those of config/cams, without their comment."""
    shown = next(
        content for _, words, content in blocks(DOCS / "own_cam.md") if "gl110.csv" in words
    )
    shipped = (config_root() / "cams" / "gunt_gl110_convex.csv").read_text(encoding="utf-8")
    lines = [line for line in shipped.splitlines() if not line.startswith("#")]
    assert shown.splitlines() == lines

"""Campaigns: docs/campaign.md does what it shows."""

from __future__ import annotations

import pytest

from .pages import DOCS
from .tutorials import follow


@pytest.mark.long
@pytest.mark.slow
def test_every_command_of_the_page_runs(tmp_path, monkeypatch):
    """In an empty folder, one after the other; every number shown is in what is printed."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    assert follow(DOCS / "campaign.md") >= 3

"""Designing a law: docs/design.md does what it shows."""

from __future__ import annotations

import pytest

from .pages import DOCS
from .tutorials import follow


@pytest.mark.long
@pytest.mark.slow
def test_every_command_of_the_page_runs(tmp_path, monkeypatch):
    """In an empty folder, one after the other; every number shown is in what is printed.

    To 0.1 %, as far as the page's searches are certified: where they end depends on the processor.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    assert follow(DOCS / "design.md", within=1e-3) >= 6

"""The Python of the documents runs as it stands."""

from __future__ import annotations

import pytest

from .pages import DOCS, ROOT, blocks


@pytest.mark.parametrize(
    "page", [ROOT / "README.md", DOCS / "python.md", DOCS / "bounce.md"], ids=lambda p: p.name
)
def test_blocks_run_one_after_the_other(page, monkeypatch):
    """From the folder of the source, where ``bags/golden`` is; a page asserts what it shows."""
    monkeypatch.chdir(ROOT)
    code = [content for language, _, content in blocks(page) if language == "python"]
    assert code
    names = {}
    for block in code:
        exec(compile(block, page.name, "exec"), names)

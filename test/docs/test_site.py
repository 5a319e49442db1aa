"""The documents as a site: whole, and without any other machine."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest

from .pages import DOCS, ROOT


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built as ``make docs`` does; a warning is an error."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "-d", str(folder)]
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False, timeout=500
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.mark.long
def test_every_page_is_in_the_menu(site):
    """README is the first page; each document and each room has one."""
    menu = (site / "index.html").read_text(encoding="utf-8")
    for page in DOCS.rglob("*.md"):
        assert f'href="{page.relative_to(DOCS).with_suffix(".html")}"' in menu, page.name
    assert (site / "api" / "cam_rig.html").is_file()
    assert (site / "search" / "search_index.js").is_file()


@pytest.mark.long
def test_nothing_comes_from_another_machine(site):
    """No script, style, font, picture or frame with an address of its own."""
    sources = r"<(?:script|img|iframe|source)[^>]*\ssrc=[\"']?(?:https?:)?//"
    sheets = r"<link[^>]*rel=[\"']?(?:stylesheet|preconnect|preload)[^>]*(?:https?:)?//"
    loaded = re.compile(f"{sources}|{sheets}")
    for page in site.rglob("*.html"):
        found = loaded.search(page.read_text(encoding="utf-8"))
        assert found is None, f"{page.name}: {found[0]}"
    for style in site.rglob("*.css"):
        assert not re.search(r"(?:url\(|@import )[\"']?https?:", style.read_text(encoding="utf-8"))

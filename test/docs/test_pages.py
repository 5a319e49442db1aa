"""What the documents name is there: pages, pictures, files of the tree."""

from __future__ import annotations

import re

import pytest

from .pages import DOCS, PAGES, ROOT, text

#: Folders of the tree whose files the documents name.
TREE = r"(?:cam_rig|config|test|tools|benchmark|examples|launch|docs|bags)/[\w./*-]*\w/?"
#: Names that stand for any, and files that a run makes.
ANY = re.compile(r"NAME|mine|^bags/(?!golden|README)")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_pictures_exist(page):
    """Every relative link of a page leads to a file."""
    links = re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`\n]*`", "", text(page)))
    for link in links:
        if not link.startswith(("http:", "https:", "#")):
            assert (page.parent / link.partition("#")[0]).is_file(), f"{page.name}: {link}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_of_the_tree_exist(page):
    """Every path of this repository that a page gives in code."""
    named = set(re.findall(rf"`({TREE})`", text(page)))
    missing = [p for p in named if not ANY.search(p) and not list(ROOT.glob(p.rstrip("/")))]
    assert not missing


def test_short_names_in_the_lists_exist():
    """A file named without its folder stands beside the one named before it in its item."""
    for cell in re.findall(r"^(?:-|\d+\.) (.*)", text(DOCS / "architecture.md"), re.M):
        folder = None
        for name in re.findall(r"`([\w./*]+)`", cell):
            if name.startswith("cam_rig/"):
                path = ROOT / name
                folder = path if path.is_dir() else path.parent
            elif folder is not None and name.endswith(".py"):
                assert list(folder.glob(name)), f"{name} in {folder}"


def test_every_picture_is_shown():
    """No picture in docs/ that no page shows."""
    words = "".join(text(page) for page in PAGES)
    for picture in (p for kind in ("png", "svg", "webp") for p in DOCS.rglob(f"*.{kind}")):
        assert picture.name in words


def test_the_readme_is_short():
    """Two screens of 40 lines."""
    assert len(text(ROOT / "README.md").splitlines()) <= 80


def test_list_of_rooms_is_whole():
    """The list of rooms has every folder of the package, and no other."""
    page = text(DOCS / "architecture.md")
    named = set(re.findall(r"^- `cam_rig/(\w+)`:", page, re.M))
    folders = {p.parent.name for p in (ROOT / "cam_rig").glob("*/__init__.py")}
    assert named == folders

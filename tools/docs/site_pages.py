"""Hooks of mkdocs: README as the first page, an API page per room, equations."""

from __future__ import annotations

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

import cam_rig
from tools.docs.equations import convert_equations

ROOT = Path(__file__).parents[2]
#: Rooms whose public names are documented, in the order of the menu. The public interface comes
#: first.
ROOMS = (
    "laws",
    "profile",
    "dynamics",
    "acoustics",
    "simulation",
    "quantities",
    "studies",
    "bag",
    "messages",
)
#: Names of ``import cam_rig``.
FACE = [f"cam_rig.{name}" for name in cam_rig.__all__ if not name.startswith("_")]


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the API pages at the entry ``api`` of the menu."""
    pages = [{"cam_rig": "api/cam_rig.md"}, *({room: f"api/{room}.md"} for room in ROOMS)]
    for section in config.nav or []:
        for entries in section.values():
            for entry in entries if isinstance(entries, list) else []:
                if entry.get("API") == "api":
                    entry["API"] = pages
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Generate index.md from README.md, and the API pages."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    pages = {"index.md": re.sub(r"\]\(docs/", "](", readme)}
    pages["api/cam_rig.md"] = "# cam_rig\n\n" + "\n".join(f"::: {name}" for name in FACE)
    for room in ROOMS:
        pages[f"api/{room}.md"] = f"# cam_rig.{room}\n\n::: cam_rig.{room}\n"
    for path, text in pages.items():
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown: str, **_: object) -> str:
    """Convert the equations, so that no page of the site loads an external library."""
    return convert_equations(markdown)

"""What mkdocs does besides: README as the first page, an API page for each room, equations."""

from __future__ import annotations

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

import cam_rig
from tools.docs.equations import drawn

ROOT = Path(__file__).parents[2]
#: Rooms whose public names are documented, in the order of the menu; the face comes first.
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
#: The names of ``import cam_rig``.
FACE = [f"cam_rig.{name}" for name in cam_rig.__all__ if not name.startswith("_")]


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the API pages where the menu says ``api``."""
    pages = [{"cam_rig": "api/cam_rig.md"}, *({room: f"api/{room}.md"} for room in ROOMS)]
    for section in config.nav or []:
        for entries in section.values():
            for entry in entries if isinstance(entries, list) else []:
                if entry.get("API") == "api":
                    entry["API"] = pages
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Make index.md of README.md, and the API pages."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    pages = {"index.md": re.sub(r"\]\(docs/", "](", readme)}
    pages["api/cam_rig.md"] = "# cam_rig\n\n" + "\n".join(f"::: {name}" for name in FACE)
    for room in ROOMS:
        pages[f"api/{room}.md"] = f"# cam_rig.{room}\n\n::: cam_rig.{room}\n"
    for path, text in pages.items():
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown: str, **_: object) -> str:
    """Draw the equations: no page of the site asks another machine for a library."""
    return drawn(markdown)

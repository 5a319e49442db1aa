"""A served lab sheet, and requests to it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

import cam_rig
from cam_rig.panel.lab.pages import LabPages
from cam_rig.panel.lab.sheet import LabSheet
from cam_rig.panel.server import serve

from ..asking import ask


def sheet_of(rig: str = "paper_table2", seed: str | None = None, cam: str = "poly345") -> LabSheet:
    return LabSheet("jump", cam_rig.load_cam(cam), cam_rig.load_rig(rig), seed)


class ServedLab:
    """A lab sheet as its page asks it.

    Parameters
    ----------
    pages : that are served at ``address``
    """

    def __init__(self, pages: LabPages, address: str) -> None:
        self.pages, self.address = pages, address
        _, headers, _ = ask(address, f"/?{urlsplit(address).query}")
        self.home = headers["Location"]
        self.cookie = headers["Set-Cookie"].split(";")[0]

    def get(self, path: str) -> tuple[int, str]:
        status, _, body = ask(self.address, path, Cookie=self.cookie)
        return status, body.decode()

    def post(self, path: str, value: Any) -> tuple[int, Any]:
        origin = f"http://{urlsplit(self.address).netloc}"
        status, _, body = ask(
            self.address, path, "POST", json.dumps(value), Cookie=self.cookie, Origin=origin
        )
        return status, json.loads(body)

    def asked(self, index: int, rpm: float) -> dict[str, Any]:
        """What the page sends of a set-up at a speed."""
        return vars(self.pages.notebook.sheet.setups[index]) | {"rpm": rpm}


@pytest.fixture
def hidden(tmp_path: Path) -> Iterator[ServedLab]:
    """A sheet with a seed."""
    pages = LabPages(sheet_of(seed="group-3"), tmp_path / "out")
    with serve(pages, home="/lab") as served:
        yield ServedLab(pages, served.address)


@pytest.fixture
def plain(tmp_path: Path) -> Iterator[ServedLab]:
    """A sheet of the rig's own numbers."""
    pages = LabPages(sheet_of("tm21"), tmp_path / "out")
    with serve(pages, home="/lab") as served:
        yield ServedLab(pages, served.address)

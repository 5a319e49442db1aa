"""Designing on from a saved cam: beside the server, one at a time, and never left behind."""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from websockets.sync.client import ClientConnection, connect

import cam_rig
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.drawn_law import ORDERS, POINTS, table_angles
from cam_rig.panel.board.worker import MODULE

from ..asking import ask

pytestmark = pytest.mark.slow


@pytest.fixture
def headers(address: str) -> dict[str, str]:
    """Those of a page that came with the token."""
    url = urlsplit(address)
    cookie = ask(address, f"/?{url.query}")[1]["Set-Cookie"].split(";")[0]
    return {"Cookie": cookie, "Origin": f"http://{url.netloc}"}


@pytest.fixture
def page(address: str, headers: dict[str, str]) -> Iterator[ClientConnection]:
    """A page's websocket."""
    url = f"ws://{urlsplit(address).netloc}/changes"
    with connect(url, additional_headers=headers, origin=None) as found:
        yield found


def begin(address: str, headers: dict[str, str], name: str) -> tuple[int, dict[str, Any]]:
    """Status and answer of a wish for a design."""
    status, _, body = ask(address, "/design", "POST", json.dumps({"name": name}), **headers)
    return status, json.loads(body)


def told(page: ClientConnection) -> dict[str, Any]:
    """The next word of a design."""
    while True:
        message: dict[str, Any] = json.loads(page.recv(timeout=300))
        if message["type"] == "design":
            return message


def designing() -> list[str]:
    """Processes of a design that this one started."""
    tasks = Path(f"/proc/{os.getpid()}/task").glob("*/children")
    children = [number for task in tasks for number in task.read_text().split()]
    lines = {n: Path(f"/proc/{n}/cmdline").read_bytes() for n in children}
    return [number for number, line in lines.items() if MODULE.encode() in line]


@pytest.mark.long
def test_a_design_is_told_as_it_grows_and_written(
    board: Board, address: str, headers: dict[str, str], page: ClientConnection
) -> None:
    """It jumps later than its start, its file is the law that the page is given, and stays."""
    board.save("start", board.ordinates.tolist())
    assert begin(address, headers, "start")[0] == 202
    message, best = told(page), []
    while "so_far_rpm" in message:
        best.append(message["so_far_rpm"])
        message = told(page)
    assert best
    assert best == sorted(best)
    law = cam_rig.build_law(cam_rig.load_cam(message["path"]))
    jump = cam_rig.jump_speed(law, board.rig).rpm
    assert message["rpm"] == pytest.approx(jump, rel=1e-3)
    assert jump > 1.2 * cam_rig.jump_speed(board.law(), board.rig).rpm
    motion = np.frombuffer(base64.b64decode(message["motion"]), dtype="<f8")
    wanted = np.stack([law(table_angles(), order) for order in range(ORDERS)])
    found = motion.reshape(ORDERS, POINTS)
    largest = np.abs(wanted).max(axis=1, keepdims=True)
    assert (np.abs(found - wanted) / largest).max() <= 1e-9
    status, words = begin(address, headers, "start")
    assert status == 409
    assert "start_designed.yaml: exists already" in words["words"]


def test_one_design_at_a_time_and_it_can_be_stopped(
    board: Board, address: str, headers: dict[str, str], page: ClientConnection
) -> None:
    """A second one is refused with the remedy; stopped, no process and no file is left."""
    board.save("start", board.ordinates.tolist())
    board.save("other", board.ordinates.tolist())
    assert begin(address, headers, "start")[0] == 202
    status, words = begin(address, headers, "other")
    assert status == 409
    assert "so stop it" in words["words"]
    assert ask(address, "/design/stop", "POST", "", **headers)[0] == 200
    message = told(page)
    while not message.get("stopped"):
        message = told(page)
    assert designing() == []
    assert sorted(path.name for path in board.out.iterdir()) == ["other.yaml", "start.yaml"]
    assert begin(address, headers, "other")[0] == 202


def test_a_start_that_was_not_saved_is_refused(
    address: str, headers: dict[str, str], page: ClientConnection
) -> None:
    """Nor is a name that is a path."""
    status, words = begin(address, headers, "nothing")
    assert status == 409
    assert "nothing.yaml" in words["words"]
    for name in ("../poly345", "", "A"):
        status, words = begin(address, headers, name)
        assert status == 409
        assert words["words"].startswith("name: allowed")


def test_a_cam_that_cannot_be_designed_says_why(
    board: Board, address: str, headers: dict[str, str], page: ClientConnection
) -> None:
    """In the words of `cam-rig design`."""
    board.out.mkdir(parents=True)
    text = Path(cam_rig.__file__).parents[1] / "config/cams/constant_breadth.yaml"
    (board.out / "frame.yaml").write_text(text.read_text(encoding="utf-8"), encoding="utf-8")
    assert begin(address, headers, "frame")[0] == 202
    assert "its follower is constant_breadth" in told(page)["words"]

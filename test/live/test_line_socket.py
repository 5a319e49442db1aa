"""Lines between a page's server and a node: whole, in order, bounded, and never waited for."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from cam_rig.errors import ConfigError, RunError
from cam_rig.live import line_socket
from cam_rig.live.line_socket import LineSocket, line_of, read_line


@pytest.fixture
def ends(tmp_path: Path) -> Iterator[tuple[LineSocket, socket.socket]]:
    """A node's end and the server's."""
    path = tmp_path / "socket"
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        listener.listen()
        node = LineSocket(path)
        server, _ = listener.accept()
        yield node, server
        node.close()
        server.close()


def test_a_line_that_comes_in_parts_is_one(ends: tuple[LineSocket, socket.socket]) -> None:
    """Nothing is given before its line is whole; two lines at once are two."""
    node, server = ends
    line = line_of({"call": "start"})
    server.sendall(line[:5])
    assert node.receive() == []
    server.sendall(line[5:] + line)
    assert node.receive() == [{"call": "start"}] * 2


def test_what_is_sent_arrives_whole(ends: tuple[LineSocket, socket.socket]) -> None:
    """A message larger than what the system buffers waits, and follows when there is room."""
    node, server = ends
    message = {"samples": "x" * 1_000_000}
    node.send(message)
    data = b""
    while not data.endswith(b"\n"):
        data += server.recv(1 << 16)
        node.flush()
    assert json.loads(data) == message


def test_a_server_that_takes_nothing_is_given_up(
    ends: tuple[LineSocket, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What waits to be sent is bounded."""
    monkeypatch.setattr(line_socket, "MAX_UNSENT", 1000)
    with pytest.raises(RunError, match="has not taken"):
        for _ in range(100):
            ends[0].send({"samples": "x" * 100_000})


def test_an_end_is_named(ends: tuple[LineSocket, socket.socket]) -> None:
    """A closed socket is no empty one."""
    node, server = ends
    server.close()
    with pytest.raises(RunError, match="has ended"):
        node.receive()


@pytest.mark.parametrize("line", [b"[1]", b"{", b"", b"\xff", b"[" * 100_000])
def test_what_is_no_object_is_refused(line: bytes) -> None:
    """In one line, with its beginning."""
    with pytest.raises(RunError, match="is not a JSON object"):
        read_line(line)


def test_nobody_listens(tmp_path: Path) -> None:
    """A node that is started by itself says who starts it."""
    with pytest.raises(ConfigError, match=r"allowed: the socket of cam-rig panel"):
        LineSocket(tmp_path / "nothing")

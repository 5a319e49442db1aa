"""Lines between a page's server and a node: whole, in order, bounded; and a machine's loopback."""

import json
import socket
import sys
from pathlib import Path

import pytest

from cam_rig.errors import ConfigError, RunError
from cam_rig.live import sockets
from cam_rig.live.sockets import LineSocket, line_of, read_line, require_loopback

from ..processes import ended


@pytest.fixture
def ends(tmp_path):
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


def test_a_line_that_comes_in_parts_is_one(ends):
    node, server = ends
    line = line_of({"call": "start"})
    server.sendall(line[:5])
    assert node.receive() == []
    server.sendall(line[5:] + line)
    assert node.receive() == [{"call": "start"}] * 2


def test_what_is_sent_arrives_whole(ends):
    """A message larger than what the system buffers waits, and follows when there is room."""
    node, server = ends
    message = {"samples": "x" * 1_000_000}
    node.send(message)
    data = b""
    while not data.endswith(b"\n"):
        data += server.recv(1 << 16)
        node.flush()
    assert json.loads(data) == message


def test_a_server_that_takes_nothing_is_given_up(ends, monkeypatch):
    monkeypatch.setattr(sockets, "MAX_UNSENT", 1000)
    with pytest.raises(RunError, match="has not taken"):
        for _ in range(100):
            ends[0].send({"samples": "x" * 100_000})


def test_an_end_is_named(ends):
    """A closed socket is no empty one."""
    node, server = ends
    server.close()
    with pytest.raises(RunError, match="has ended"):
        node.receive()


def test_what_is_no_object_is_refused():
    for line in (b"[1]", b"{", b"", b"\xff", b"[" * 100_000):
        with pytest.raises(RunError, match="is not a JSON object"):
            read_line(line)


def test_nobody_listens(tmp_path):
    """A node that is started by itself says who starts it."""
    with pytest.raises(ConfigError, match=r"allowed: the socket of cam-rig panel"):
        LineSocket(tmp_path / "nothing")


ALONE = ["unshare", "--map-root-user", "--net"]
GOLDEN = Path(__file__).parents[2] / "bags" / "golden"


@pytest.mark.variants(1)
@pytest.mark.parametrize("command", ["run quick --bag bag", "panel", "view {golden} --web"])
def test_without_a_loopback_a_command_says_so(command, tmp_path):
    """In a network namespace where it is down; with the remedy, and nothing is left."""
    require_loopback()  # this machine has one
    if ended(*ALONE, "true").returncode:
        pytest.skip("no network namespace can be made here")
    words = [Path(sys.executable).with_name("cam-rig"), *command.format(golden=GOLDEN).split()]
    done = ended(*ALONE, *words, cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("cam-rig: the loopback interface, 127.0.0.1: is")
    assert done.stderr.rstrip().endswith("so: ip link set lo up")
    assert done.stdout == ""
    assert list(tmp_path.iterdir()) == []

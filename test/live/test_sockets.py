"""Tests of the JSON lines between the panel's server and a node.

Further tests cover the loopback interface.
"""

import json
import socket
import sys
from pathlib import Path

import pytest

from cam_rig.errors import ConfigError, RunError
from cam_rig.live import sockets
from cam_rig.live.sockets import LineSocket, line_of, parse_line, require_loopback

from ..processes import ended


@pytest.fixture
def ends(tmp_path):
    """Both ends of a socket connection: the node's and the panel server's."""
    path = tmp_path / "socket"
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        listener.listen()
        node = LineSocket(path)
        server, _ = listener.accept()
        yield node, server
        node.close()
        server.close()


def test_a_line_that_arrives_in_parts_is_one_object(ends):
    """A JSON line that arrives in parts is returned by receive() once it is complete."""
    node, server = ends
    line = line_of({"call": "start"})
    server.sendall(line[:5])
    assert node.receive() == []
    server.sendall(line[5:] + line)
    assert node.receive() == [{"call": "start"}] * 2


def test_a_message_larger_than_the_buffer_arrives_completely(ends):
    """A message larger than the buffer of the socket arrives completely.

    The node keeps the remainder until the server has taken the first bytes.
    """
    node, server = ends
    message = {"samples": "x" * 1_000_000}
    node.send(message)
    data = b""
    while not data.endswith(b"\n"):
        data += server.recv(1 << 16)
        node.flush()
    assert json.loads(data) == message


def test_a_server_that_stops_reading_raises_an_error(ends, monkeypatch):
    """send() raises RunError if the server leaves more than the allowed bytes unread."""
    monkeypatch.setattr(sockets, "MAX_UNSENT", 1000)
    with pytest.raises(RunError, match="has not taken"):
        for _ in range(100):
            ends[0].send({"samples": "x" * 100_000})


def test_a_closed_connection_raises_an_error(ends):
    """receive() raises RunError after the panel's server has closed the connection."""
    node, server = ends
    server.close()
    with pytest.raises(RunError, match="has ended"):
        node.receive()


def test_a_line_that_is_not_an_object_is_rejected():
    """A line that is not a JSON object raises RunError."""
    for line in (b"[1]", b"{", b"", b"\xff", b"[" * 100_000):
        with pytest.raises(RunError, match="must send JSON objects"):
            parse_line(line)


def test_a_missing_socket_is_rejected(tmp_path):
    """A bench node that is started without the panel's server raises an error.

    It suggests the command cam-rig panel.
    """
    with pytest.raises(ConfigError, match="must be that of cam-rig panel"):
        LineSocket(tmp_path / "nothing")


#: Command that runs another in a network namespace, in which the loopback interface is down.
ISOLATED = ["unshare", "--map-root-user", "--net"]
GOLDEN = Path(__file__).parents[2] / "bags" / "golden"


@pytest.mark.variants(1)
@pytest.mark.parametrize("command", ["run quick --bag bag", "panel", "view {golden} --web"])
def test_a_command_without_a_loopback_interface_fails_with_the_remedy(command, tmp_path):
    """Without a loopback interface a command ends with the remedy and leaves no files."""
    require_loopback()  # this machine has one
    if ended(*ISOLATED, "true").returncode:
        pytest.skip("a network namespace cannot be created here")
    arguments = [Path(sys.executable).with_name("cam-rig"), *command.format(golden=GOLDEN).split()]
    done = ended(*ISOLATED, *arguments, cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("cam-rig: the loopback interface 127.0.0.1 is")
    assert done.stderr.rstrip().endswith("start it with: ip link set lo up")
    assert done.stdout == ""
    assert list(tmp_path.iterdir()) == []

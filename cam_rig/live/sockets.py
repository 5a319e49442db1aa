"""Sockets of one machine: its loopback, and JSON lines between a page's server and a node."""

from __future__ import annotations

import json
import socket
from pathlib import Path
from typing import Any

from cam_rig.errors import ConfigError, RunError

LOOPBACK = "127.0.0.1"


def require_loopback() -> None:
    """Refuse a machine without it: nodes, and the servers of pages, speak over it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        try:
            asked.bind((LOOPBACK, 0))
            asked.connect(asked.getsockname())
        except OSError as error:
            raise RunError(
                f"the loopback interface, {LOOPBACK}: is down or missing ({error.strerror}); "
                "needed by the nodes and the pages, so: ip link set lo up"
            ) from None


#: Bytes of a line, at most: a second of sound at the highest sample rate fits.
MAX_LINE = 1 << 24
#: Bytes that may wait to be sent; a server that takes nothing for so long has stopped.
MAX_UNSENT = 1 << 25
_CHUNK = 1 << 16


class LineSocket:
    """The node's end of the socket at ``path``; it never waits."""

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        try:
            self._socket.connect(str(path))
        except OSError as error:
            self._socket.close()
            raise ConfigError(
                f"socket: is {str(path)!r} ({error.strerror or error}); allowed: the socket of "
                "cam-rig panel, which starts this node"
            ) from None
        self._socket.setblocking(False)
        self._received, self._unsent = bytearray(), bytearray()

    def receive(self) -> list[dict[str, Any]]:
        """The objects that have come."""
        try:
            while chunk := self._socket.recv(_CHUNK):
                self._received += chunk
                if len(self._received) > MAX_LINE:
                    raise RunError(f"the page's server: a line of more than {MAX_LINE} bytes")
            raise RunError("the page's server has ended")
        except BlockingIOError:
            pass
        except ConnectionError:
            raise RunError("the page's server has ended") from None
        *lines, rest = bytes(self._received).split(b"\n")
        self._received = bytearray(rest)
        return [read_line(line) for line in lines]

    def put(self, message: dict[str, Any]) -> None:
        """Send an object with the next `flush`, which wakes the receiver once for all that wait."""
        self._unsent += line_of(message)

    def send(self, message: dict[str, Any]) -> None:
        """Send an object, now or with the next `flush`."""
        self.put(message)
        self.flush()

    def flush(self) -> None:
        """Send what waits, as far as it is taken."""
        try:
            while self._unsent:
                del self._unsent[: self._socket.send(self._unsent[:_CHUNK])]
        except BlockingIOError:
            pass
        except ConnectionError:
            raise RunError("the page's server has ended") from None
        if len(self._unsent) > MAX_UNSENT:
            raise RunError(f"the page's server has not taken {len(self._unsent)} bytes")

    def close(self) -> None:
        """Close it."""
        self._socket.close()


def line_of(message: dict[str, Any]) -> bytes:
    """An object as a line."""
    return json.dumps(message).encode() + b"\n"


def read_line(line: bytes) -> dict[str, Any]:
    """The object of a line."""
    try:
        found = json.loads(line)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise RunError(f"the page's server: {line[:40]!r} is not a JSON object")
    return found

"""Loopback socket, with JSON lines between a page's server and a node."""

from __future__ import annotations

import json
import socket
from pathlib import Path
from typing import Any

from cam_rig.errors import ConfigError, RunError

#: Address of the loopback interface.
LOOPBACK = "127.0.0.1"


def require_loopback() -> None:
    """Raise RunError if the loopback interface is not available."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((LOOPBACK, 0))
            probe.connect(probe.getsockname())
        except OSError as error:
            raise RunError(
                f"the loopback interface {LOOPBACK} is down or missing ({error.strerror}); nodes "
                "and pages need it, start it with: ip link set lo up"
            ) from None


#: Maximum length of a line in bytes, sufficient for one second of samples at the highest rate.
MAX_LINE = 1 << 24
#: Maximum number of bytes in the queue for sending. If it is longer, the server no longer reads.
MAX_UNSENT = 1 << 25
#: Number of bytes that are read from or written to a socket in one call.
_CHUNK = 1 << 16


class LineSocket:
    """Non-blocking socket of a node, connected to the page's server at `path`."""

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        try:
            self._socket.connect(str(path))
        except OSError as error:
            self._socket.close()
            raise ConfigError(
                f"socket must be that of cam-rig panel, which starts this node, got {str(path)!r} "
                f"({error.strerror or error})"
            ) from None
        self._socket.setblocking(False)
        self._received, self._unsent = bytearray(), bytearray()

    def receive(self) -> list[dict[str, Any]]:
        """Return the objects received since the last call.

        Raises
        ------
        RunError
            If the server has closed the connection, or a line is invalid or longer than `MAX_LINE`.
        """
        try:
            while chunk := self._socket.recv(_CHUNK):
                self._received += chunk
                if len(self._received) > MAX_LINE:
                    raise RunError(f"the page's server sent more than {MAX_LINE} bytes in a line")
            raise RunError("the page's server has ended")
        except BlockingIOError:
            pass
        except ConnectionError:
            raise RunError("the page's server has ended") from None
        *lines, remainder = bytes(self._received).split(b"\n")
        self._received = bytearray(remainder)
        return [parse_line(line) for line in lines]

    def queue(self, message: dict[str, Any]) -> None:
        """Queue a JSON object for the next `flush`, which sends all of them together."""
        self._unsent += line_of(message)

    def send(self, message: dict[str, Any]) -> None:
        """Send a JSON object now, or with the next `flush` if the server is not ready."""
        self.queue(message)
        self.flush()

    def flush(self) -> None:
        """Send queued objects as far as the server takes them.

        Raises
        ------
        RunError
            If the server has closed the connection, or more than `MAX_UNSENT` bytes wait.
        """
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
        """Close the socket."""
        self._socket.close()


def line_of(message: dict[str, Any]) -> bytes:
    """Return an object as a line of JSON."""
    return json.dumps(message).encode() + b"\n"


def parse_line(line: bytes) -> dict[str, Any]:
    """Return the object of a line of JSON.

    Any other content raises RunError.
    """
    try:
        value = json.loads(line)
    except (ValueError, RecursionError):
        value = None
    if not isinstance(value, dict):
        raise RunError(f"the page's server must send JSON objects, got {line[:40]!r}")
    return value

"""The interface over which nodes and pages speak on one machine."""

from __future__ import annotations

import socket

from cam_rig.errors import RunError

LOOPBACK = "127.0.0.1"


def require_loopback() -> None:
    """To be called before nodes are started, or pages served: they speak over it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        try:
            asked.bind((LOOPBACK, 0))
            asked.connect(asked.getsockname())
        except OSError as error:
            raise RunError(
                f"the loopback interface, {LOOPBACK}: is down or missing ({error.strerror}); "
                "needed by the nodes and the pages, so: ip link set lo up"
            ) from None

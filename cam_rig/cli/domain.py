"""One run a ROS domain: two would hear each other's cams."""

from __future__ import annotations

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cam_rig.errors import ConfigError, RunError

#: By the ports of DDS.
MOST = 232


@contextmanager
def own_domain() -> Iterator[None]:
    """Hold the ROS domain of this environment; the kernel lets go of it with the process.

    Raises
    ------
    ConfigError : it is no domain
    RunError : another run on this machine holds it
    """
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not (domain.isascii() and domain.isdigit() and int(domain) <= MOST):
        raise ConfigError(f"ROS_DOMAIN_ID: is {domain!r}; allowed: 0 to {MOST}")
    path = Path(tempfile.gettempdir()) / f"cam_rig-{os.getuid()}-domain-{domain}.lock"
    with path.open("a") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RunError(
                f"another run is at work in ROS domain {domain}; allowed: one a domain, so set "
                "ROS_DOMAIN_ID to another number"
            ) from None
        yield

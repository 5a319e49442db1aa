"""One run a ROS domain: two would hear each other's cams."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager

from cam_rig.bag.temporary import no_room, temporary_place
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
    OutputError : there is nowhere to note that it is held
    """
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not (domain.isascii() and domain.isdigit() and int(domain) <= MOST):
        raise ConfigError(f"ROS_DOMAIN_ID: is {domain!r}; allowed: 0 to {MOST}")
    place = temporary_place()
    try:
        lock = (place / f"cam_rig-{os.getuid()}-domain-{domain}.lock").open("a")
    except OSError as error:
        raise no_room(place, error) from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RunError(
                f"another run is at work in ROS domain {domain}; allowed: one a domain, so set "
                "ROS_DOMAIN_ID to another number"
            ) from None
        yield

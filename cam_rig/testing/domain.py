"""A ROS domain for one test: of its own, on this machine alone."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count

from cam_rig.runner.node_process import PROFILES, environment

#: Domains that tests take: below the ports that Linux hands out by itself, beside a user's own.
DOMAINS = range(40, 101)
_TURNS = count(os.getpid())
#: What keeps a node's sockets on this machine.
_LOCAL = (PROFILES, "ROS_AUTOMATIC_DISCOVERY_RANGE", "SKIP_DEFAULT_XML_FILE")


@contextmanager
def hold_domain() -> Iterator[int]:
    """A ROS domain that no other test on this machine uses; waits where all are taken.

    It is held by a port of the domain's own block that no participant uses: whoever shares the
    network shares the lock, and the kernel lets go of it with the process.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as lock:
        while True:
            domain = DOMAINS[next(_TURNS) % len(DOMAINS)]
            with suppress(OSError):
                lock.bind(("127.0.0.1", 7400 + 250 * domain + 9))
                break
            time.sleep(0.02)
        yield domain


@contextmanager
def in_domain(domain: int) -> Iterator[None]:
    """Set the environment so that what starts meanwhile is in a domain, on this machine alone."""
    local = environment()
    wanted = {"ROS_DOMAIN_ID": str(domain)} | {name: local[name] for name in _LOCAL}
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def isolated_domain() -> Iterator[int]:
    """Hold a domain, and be in it."""
    with hold_domain() as domain, in_domain(domain):
        yield domain

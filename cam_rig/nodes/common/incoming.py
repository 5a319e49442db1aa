"""What a node takes: every message bounded and guarded, and at the end the rest of them."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import wraps
from typing import Any, Protocol

from cam_rig.errors import CamRigError, RefusedError
from cam_rig.messages.topics import Topic

#: What a message of the right type with impossible content may raise where it is read.
UNREADABLE = (ValueError, TypeError, LookupError, ArithmeticError, AttributeError, RuntimeError)
#: Wall time (s) for messages still in transit at the end; after 10 s the runner kills the node.
MAX_DRAIN_S = 3.0


class Taking(Protocol):
    """A node that takes messages."""

    def refuse(self, error: CamRigError) -> None:
        """Go on without a message."""

    def fail(self, error: CamRigError) -> None:
        """End."""


def guarded(node: Taking, name: str, callback: Callable[..., Any]) -> Callable[..., Any]:
    """A callback for what comes under a name: what is impossible is refused, other errors end."""

    @wraps(callback)
    def safe(*message: Any) -> Any:
        try:
            return callback(*message)
        except RefusedError as error:
            node.refuse(error)
        except CamRigError as error:
            node.fail(error)
        except UNREADABLE as error:
            node.refuse(RefusedError(f"{name}: cannot be read ({error})"))

    return safe


def require_length(topic: Topic, cdr: bytes) -> None:
    """Refuse a serialized message, before it is read, that is longer than any of its topic.

    Raises
    ------
    RefusedError : with its length and the limit
    """
    if len(cdr) > topic.most_bytes:
        raise RefusedError(f"{topic.name}: {len(cdr)} bytes; allowed: {topic.most_bytes}")


def take_rest(
    spin_once: Callable[..., None],
    taken: Callable[[], int],
    now: Callable[[], float] = time.monotonic,
) -> None:
    """Spin until nothing more is taken for a while, at most `MAX_DRAIN_S`."""
    quiet, deadline = 0, now() + MAX_DRAIN_S
    while quiet < 5 and now() < deadline:
        before = taken()
        spin_once(timeout_sec=0.02)
        quiet = quiet + 1 if taken() == before else 0

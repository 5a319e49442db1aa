"""The /diagnostics of the rig's nodes, each message once, in the order of rig time."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from cam_rig.bag.recording.pending import MAX_WAITING, make_room
from cam_rig.errors import RefusedError
from cam_rig.messages import topics

#: What is said on wall time.
OF_WALL_TIME = (topics.PACE, topics.SHOWN_MOTION)


class Diagnostic(NamedTuple):
    """Rig time (ns), the node it is of, and the serialized message."""

    stamp: int
    node: str
    cdr: bytes


class PendingDiagnostics:
    """Messages that wait until rig time, by the cam's states, has come to their stamps.

    So a stamp of the wall clock, which other programs use on the same topic, never gets into a bag.
    """

    def __init__(self) -> None:
        self._waiting: dict[Diagnostic, None] = {}
        self._written: deque[Diagnostic] = deque(maxlen=4 * MAX_WAITING)

    def take(self, stamp: int, node: str, cdr: bytes) -> None:
        """Keep a message that was not received before.

        Raises
        ------
        RefusedError : it is of no node of the rig, or there are too many of no known time
        """
        if node in OF_WALL_TIME or node.endswith(topics.HEARTBEAT):
            return
        if node not in topics.DIAGNOSED_NODES:
            raise RefusedError(
                f"{topics.DIAGNOSTICS.name}: of {node[:80]!r}; recorded: "
                f"{', '.join(topics.DIAGNOSED_NODES)}"
            )
        found = Diagnostic(stamp, node, cdr)
        if found in self._written or found in self._waiting:
            return
        self._waiting[found] = None
        if make_room(self._waiting):
            raise RefusedError(
                f"{topics.DIAGNOSTICS.name}: more than {MAX_WAITING} of no known time"
            )

    def due(self, until: int) -> Iterator[tuple[int, bytes]]:
        """Log time (ns) and message of all up to a rig time."""
        for found in sorted(one for one in self._waiting if one.stamp <= until):
            del self._waiting[found]
            self._written.append(found)
            # A few ns late, by node: the order among others of its time is not left to scheduling
            yield found.stamp + 1 + topics.DIAGNOSED_NODES.index(found.node), found.cdr

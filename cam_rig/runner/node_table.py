"""The one table of the node graph, which the runner and the launch file start.

Subscribers stand before publishers: they start in this order, and end in the opposite one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: Starts of a node that was killed, at most, before it is given up.
MAX_RESPAWNS = 20
#: Wall time (s) without an answer after which the drive of a run gives up.
PATIENCE_S = 120.0
#: What a node does when the run is over: end, stay for another one, or wait for a signal to stop.
END, STAY, WAIT = "end", "stay", "wait"


@dataclass(frozen=True)
class NodeEntry:
    """One node of a run, by its executable.

    A run ends with an ``essential`` node that has ended. Without another one it goes on: that node
    is started again up to ``max_respawns`` times, whatever ended it, and then left out.
    """

    name: str
    essential: bool = True
    max_respawns: int = MAX_RESPAWNS


RECORDER, VIEWER, DRIVE = "recorder", "viewer", "cam_drive"
NODES = (
    NodeEntry(RECORDER),
    NodeEntry(VIEWER, essential=False, max_respawns=3),
    NodeEntry("microphone"),
    NodeEntry("follower"),
    NodeEntry("law_server"),
    NodeEntry(DRIVE),
)
#: The node in place of drive and law server where a bag is replayed.
PLAYER = NodeEntry("player")
#: The node that passes the commands of a page in a browser on to the others.
PANEL = NodeEntry("panel", essential=False)
ENTRIES = {entry.name: entry for entry in (*NODES, PLAYER, PANEL)}
#: The nodes that make what others consume, in a run and in a replay.
SOURCES = ("law_server", DRIVE, PLAYER.name)
#: The nodes that the drive may wait for, beside the law server, and those it can go on without.
CONSUMERS = tuple(entry.name for entry in NODES if entry.name not in SOURCES)
OPTIONAL = frozenset(entry.name for entry in NODES if not entry.essential)


def in_chain(names: Sequence[str]) -> list[str]:
    """Some nodes in the order in which each waits for those before it."""
    order = [entry.name for entry in NODES]
    return sorted(names, key=order.index, reverse=True)


def held_by(names: Sequence[str]) -> str:
    """Which of some nodes that do not answer holds the others, in words."""
    first, *rest = in_chain(names)
    return f"{first}, and behind it {', '.join(rest)}" if rest else first

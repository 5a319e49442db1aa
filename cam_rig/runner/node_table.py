"""Table of the node graph, used by the runner and by the launch file.

Subscribers come before publishers: nodes start in this order and end in the opposite one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: Patience (s, wall clock) of the drive of a run: time without an answer before it gives up.
PATIENCE_S = 120.0
#: Values of the parameter at_end: what a node does when the run is over.
END, STAY, WAIT = "end", "stay", "wait"


@dataclass(frozen=True)
class NodeEntry:
    """One node of a run, by its executable.

    The run ends if an ``essential`` node ends. It continues without an optional node.
    """

    name: str
    essential: bool = True


RECORDER, VIEWER, DRIVE = "recorder", "viewer", "cam_drive"
NODES = (
    NodeEntry(RECORDER),
    NodeEntry(VIEWER, essential=False),
    NodeEntry("microphone"),
    NodeEntry("follower"),
    NodeEntry("law_server"),
    NodeEntry(DRIVE),
)
#: The node that replaces drive and law server in the replay of a bag.
PLAYER = NodeEntry("player")
#: The node that connects the panel in a browser with the other nodes.
PANEL = NodeEntry("panel")
ENTRIES = {entry.name: entry for entry in (*NODES, PLAYER, PANEL)}
#: Nodes whose messages other nodes consume, in a run and in a replay.
SOURCES = ("law_server", DRIVE, PLAYER.name)
#: Nodes for which the drive may wait in addition to the law server. The run can continue without
#: the optional nodes.
CONSUMERS = tuple(entry.name for entry in NODES if entry.name not in SOURCES)
OPTIONAL = frozenset(entry.name for entry in NODES if not entry.essential)


def in_chain(names: Sequence[str]) -> list[str]:
    """Return nodes in the order in which each waits for the nodes before it."""
    order = [entry.name for entry in NODES]
    return sorted(names, key=order.index, reverse=True)


def held_by(names: Sequence[str]) -> str:
    """Return which of several nodes without an answer blocks the others, as text."""
    first, *rest = in_chain(names)
    return f"{first}, and behind it {', '.join(rest)}" if rest else first

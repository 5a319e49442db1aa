"""Table of the node graph, used by the runner and by the launch file.

Subscribers come before publishers. Nodes start in this order and end in reverse order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: Longest time (s, wall clock) for which the drive waits for a node before it ends the run.
PROGRESS_TIMEOUT_S = 120.0
#: Value of the parameter on_finish: the node ends with the run.
END = "end"
#: Value of the parameter on_finish: the node stays for another run of the rig.
STAY = "stay"
#: Value of the parameter on_finish: the node waits until the runner ends it.
WAIT = "wait"


@dataclass(frozen=True)
class NodeEntry:
    """Node of a run: name of its executable, and True if the run cannot continue without it."""

    name: str
    essential: bool = True


RECORDER = "recorder"
VIEWER = "viewer"
DRIVE = "cam_drive"
#: Nodes of a run, in the order of their start.
NODES = (
    NodeEntry(RECORDER),
    NodeEntry(VIEWER, essential=False),
    NodeEntry("microphone"),
    NodeEntry("follower"),
    NodeEntry("law_server"),
    NodeEntry(DRIVE),
)
#: Node that replaces drive and law server in the replay of a bag.
PLAYER = NodeEntry("player")
#: Node that connects the panel in a browser with the other nodes.
PANEL = NodeEntry("panel")
#: All nodes by name.
ENTRIES = {entry.name: entry for entry in (*NODES, PLAYER, PANEL)}
#: Names of the nodes that publish the laws and states of the cam, in a run or in a replay.
SOURCES = ("law_server", DRIVE, PLAYER.name)
#: Names of the nodes for which the drive may wait in addition to the law server. The run can
#: continue without the optional nodes.
CONSUMERS = tuple(entry.name for entry in NODES if entry.name not in SOURCES)
#: Names of the nodes without which a run can continue.
OPTIONAL = frozenset(entry.name for entry in NODES if not entry.essential)


def order_by_chain(names: Sequence[str]) -> list[str]:
    """Sort nodes by the order of processing: each waits for the nodes before it."""
    order = [entry.name for entry in NODES]
    return sorted(names, key=order.index, reverse=True)


def blocking_text(names: Sequence[str]) -> str:
    """Return a text on nodes that do not answer.

    It names first the node for which the others wait.
    """
    first, *others = order_by_chain(names)
    return f"{first}, which blocks {', '.join(others)}" if others else first

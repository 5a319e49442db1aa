"""The nodes of a run and of a replay, in the order of the table, with their parameters."""

from __future__ import annotations

from pathlib import Path

from cam_rig.bag.recording.split import Split
from cam_rig.runner.node_process import Arguments
from cam_rig.runner.node_table import (
    CONSUMERS,
    DRIVE,
    NODES,
    PANEL,
    PATIENCE_S,
    PLAYER,
    RECORDER,
    VIEWER,
    WAIT,
)


def live(
    scene: Path,
    bag: Path,
    screen: str | None = None,
    split: Split | None = None,
    **drive: str | bool | float,
) -> dict[str, Arguments]:
    """The nodes of a run in the order of the table, with their parameters.

    ``screen`` is where a viewer draws the run to; None starts no viewer. ``split`` has the limits
    of each file of the bag.
    """
    names = [entry.name for entry in NODES if screen is not None or entry.name != VIEWER]
    consumers = [name for name in names if name in CONSUMERS]
    given: dict[str, Arguments] = {
        RECORDER: {"bag": str(bag), **(split or Split()).parameters},
        VIEWER: {"address": screen or ""},
        # a node that has ended is noticed here at once, so a busy machine may answer late
        DRIVE: {"consumers": consumers, "patience": PATIENCE_S, **drive},
    }
    # the runner ends its nodes itself, when it need not start one again for another
    common = {"scene": str(scene), "at_end": WAIT}
    return {name: {**common, **given.get(name, {})} for name in names}


def replayed(scene: Path, bag: Path, recorded: Path) -> dict[str, Arguments]:
    """The consumers of a run, and the player in place of the drive and the law server."""
    nodes = {name: given for name, given in live(scene, bag).items() if name in CONSUMERS}
    player: Arguments = {"bag": str(recorded), "patience": PATIENCE_S, "at_end": WAIT}
    return nodes | {PLAYER.name: player}


def steered(
    scene: Path, bag: Path, socket: Path, screen: str | None, **drive: str | bool | float
) -> dict[str, Arguments]:
    """The nodes of a run that a page steers, through the panel's node at ``socket``."""
    nodes = live(scene, bag, screen, None, **drive)
    panel: Arguments = {"scene": str(scene), "at_end": WAIT, "socket": str(socket)}
    return {PANEL.name: panel} | nodes

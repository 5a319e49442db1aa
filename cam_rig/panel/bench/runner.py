"""The bench's node graph: begun for a set-up, watched, and ended for the next one."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from queue import Empty, Queue
from typing import Any

from cam_rig.errors import CamRigError
from cam_rig.extras import require
from cam_rig.panel.bench.setup import Setup
from cam_rig.runner.domain_lock import domain_number, own_domain
from cam_rig.runner.graph import Graph
from cam_rig.runner.node_table import DRIVE, OPTIONAL, PANEL
from cam_rig.runner.nodes_of_run import steered
from cam_rig.schema import RigConfig
from cam_rig.viewer.server.page_time import PageTime
from cam_rig.viewer.server.web import serve

#: Wall time (s) that nodes wait for one that was killed, until somebody starts it again.
PATIENCE_S = 3600.0
#: Wall time (s) between two looks at whether the pages are still served.
LOOK_S = 0.5

#: Parameters by node.
NodeValues = dict[str, dict[str, Any]]
Told = Callable[[dict[str, Any]], None]


class BenchRunner:
    """Runs set-up after set-up; `run` belongs to the main thread, all else to any.

    Parameters
    ----------
    rig : as its file has it
    folder : the bench's own, for scenes; its ``cams`` can be mounted
    out : where kept bags go
    screen : show the rig in Rerun
    """

    def __init__(self, rig: RigConfig, folder: Path, out: Path, screen: bool = True) -> None:
        self.rig, self.folder, self.out = rig, folder, out
        self.cams = folder / "cams"
        self.cams.mkdir(parents=True, exist_ok=True)
        #: Called with what happens to the graph.
        self.tell: Told = lambda _message: None
        #: Address of the page that shows the rig in Rerun; empty where there is none.
        self.screen = ""
        self.has_screen = self._wants_screen = screen
        self._stream: str | None = None
        self._page: PageTime | None = None
        self._setups: Queue[tuple[Setup, NodeValues]] = Queue()
        self._permitted: set[str] = set()
        self._waiting: dict[str, str] = {}
        self._keep = False

    @property
    def socket(self) -> Path:
        """Where the panel's node finds the page's server."""
        return self.folder / "panel.socket"

    def set_up(self, setup: Setup, values: NodeValues, keep: bool = False) -> None:
        """End the present run, and begin another with parameters of its nodes; ``keep`` its bag."""
        self._keep = self._keep or keep
        self._setups.put((setup, values))

    def start_again(self, node: str) -> None:
        """Start a node that was killed."""
        self._permitted.add(node)

    def run(self, served: Callable[[], bool]) -> None:
        """Run what is set up, as long as the pages are ``served``; a signal ends it before."""
        setup = None
        with ExitStack() as stack:
            while served():
                if setup is None:
                    setup = self._next(LOOK_S)
                    continue
                if self._wants_screen:
                    self._open_screen(stack)
                setup = self._run(*setup)

    def _open_screen(self, stack: ExitStack) -> None:
        """Begin to serve Rerun's viewer, once; without it the bench runs all the same."""
        self._wants_screen = False
        try:
            require("rerun")
            pages = stack.enter_context(serve())
        except CamRigError as error:
            self._log(f"no picture of the rig: {error}")
        else:
            self.screen, self._stream, self._page = pages.address, str(pages.folder), pages.page
        self.tell({"screen": self.screen})

    def driven(self, rig_time: float) -> None:
        """The drive has come to a rig time (s) now, by which the picture's delay is known."""
        if self._page is not None:
            self._page.driven(rig_time)

    def _next(self, timeout: float = 0.0) -> tuple[Setup, NodeValues] | None:
        """The newest set-up that waits."""
        found = None
        with suppress(Empty):
            found = self._setups.get(timeout > 0.0, timeout or None)
            while True:
                found = self._setups.get_nowait()
        return found

    def _run(self, setup: Setup, values: NodeValues) -> tuple[Setup, NodeValues] | None:
        """One run; what is set up next, None where nothing is."""
        self._waiting.clear()
        self._permitted.clear()
        following: tuple[Setup, NodeValues] | None = None
        try:
            scene = setup.write(self.folder, self.rig)
            with self._bag(lambda: following is not None) as bag, own_domain():
                nodes = steered(scene, bag, self.socket, self._stream)
                nodes[DRIVE] |= {"autostart": False, "patience": PATIENCE_S, "pacing": "real_time"}
                for node, chosen in values.items():
                    nodes[node] |= chosen
                self.tell({"graph": "starting", "domain": _domain()})
                with Graph(nodes, respawn=True, log=self._log, permit=self._permit) as graph:
                    while not graph.finished and following is None:
                        graph.look()
                        following = self._next()
                self.tell({"graph": "ended"})
        except CamRigError as error:
            self.tell({"graph": "failed", "words": str(error)})
        return following

    def _permit(self, node: str, words: str) -> bool:
        """Whether a node is to be started again: those that are not essential, at once."""
        if node in OPTIONAL or node == PANEL.name or node in self._permitted:
            self._permitted.discard(node)
            if self._waiting.pop(node, None) is not None:
                self.tell({"ended": dict(self._waiting)})
            return True
        if node not in self._waiting:
            self._waiting[node] = words
            self.tell({"ended": dict(self._waiting)})
        return False

    def _log(self, line: str) -> None:
        self.tell({"log": line})

    @contextmanager
    def _bag(self, replaced: Callable[[], bool]) -> Iterator[Path]:
        """Where a run records to.

        Removed where a person has ended the run, by a signal or another set-up, and does not keep
        it; what else ends a run leaves its bag.
        """
        self._keep = False
        bag = self.out / time.strftime("bench_%Y-%m-%d_%H-%M-%S")
        while bag.exists():
            bag = bag.with_name(f"{bag.name}_again")
        ended_by_hand = False
        try:
            yield bag
            ended_by_hand = replaced()
        except KeyboardInterrupt:
            ended_by_hand = True
            raise
        finally:
            if ended_by_hand and not self._keep:
                shutil.rmtree(bag, ignore_errors=True)
            elif bag.is_dir():
                self.tell({"kept": str(bag)})


def _domain() -> int:
    return domain_number(os.environ.get("ROS_DOMAIN_ID", ""))

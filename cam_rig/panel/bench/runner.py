"""The bench's node graph: begun for a set-up, watched, and ended for the next one."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import Empty, Queue
from typing import Any

from cam_rig import dynamics
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.any_follower import follower_of
from cam_rig.errors import CamRigError, ConfigError, RefusedError
from cam_rig.extras import require
from cam_rig.runner.graph import Graph
from cam_rig.runner.node_process import steered
from cam_rig.runner.node_table import DRIVE
from cam_rig.runner.resources import domain_number, own_domain
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.load import NAME, config_root, load_cam, to_yaml
from cam_rig.viewer.page import PageTime
from cam_rig.viewer.rerun_page import serve

# How the rig is set up: cam, model and the follower's numbers, as a scene that nodes can run.

#: Models that a bench runs, and what a rig must have for each.
TWO_MASS = "two_mass"
MODELS = ("one_mass", TWO_MASS, "kinetostatic", "elastic_stem", "torsional")
#: A scene's last speed (rpm): what the viewer's axes have room for.
DRAWN_RPM = 600.0
SPEEDS_ARE = "the knob's first, and what the axes have room for"
#: The speed (rpm) that the knob begins at.
START_RPM = 200.0
#: Ticks of a turn: a command acts at the next one, 17 ms later at 300 rpm.
TICKS_PER_TURN = 12
#: Samples a second (Hz): what the page's sound and the recorded force are made of.
SAMPLE_RATE = 4000
#: Speeds (rpm) that are taken: a tick has two samples at the highest.
MIN_RPM, MAX_RPM = 1.0, 60.0 * SAMPLE_RATE / (2 * TICKS_PER_TURN)
#: Turns after which a bench ends by itself: 5 h at 300 rpm.
MAX_TURNS = 100_000
#: What is added to the rig's own mass (kg), at most.
MAX_ADDED_MASS = 100.0


@dataclass(frozen=True)
class Setup:
    """What is chosen while the machine stands: the cam that is mounted first, and one of `MODELS`.

    The mass (kg) is added to the follower's own; spring in N/m, preload in N; the first speed.
    """

    cam: str
    model: str
    added_mass: float
    spring_stiffness: float
    preload: float
    rpm: float = START_RPM

    @classmethod
    def of(cls, rig: RigConfig, cam: str) -> Setup:
        """The rig as its file has it: two masses where it says how its mass is split, else one."""
        own, two = rig.follower, isinstance(follower_of(rig), TwoMassParameters)
        model = TWO_MASS if two else MODELS[0]
        return cls(cam, model, 0.0, own.spring_stiffness.si, own.preload.si)

    def changed(self, given: dict[str, Any], rig: RigConfig) -> Setup:
        """The set-up with what a page has chosen."""
        known = asdict(self)
        wrong = [key for key in given if key not in known]
        kinds = {key: str if isinstance(value, str) else float for key, value in known.items()}
        try:
            values: dict[str, Any] = {k: kinds[k](given.get(k, v)) for k, v in known.items()}
            found = Setup(**values)
        except (TypeError, ValueError, OverflowError):
            wrong = [key for key in given if key in known]
        if wrong:
            raise RefusedError(f"set-up: {', '.join(wrong)[:80]}: allowed: {', '.join(known)}")
        if found.model not in allowed_models(rig):
            allowed = ", ".join(allowed_models(rig))
            raise RefusedError(f"model: is {found.model[:40]!r}; allowed on this rig: {allowed}")
        if not MIN_RPM <= found.rpm <= MAX_RPM:
            raise RefusedError(f"rpm: is {found.rpm:g}; allowed: {MIN_RPM:g} to {MAX_RPM:g}")
        if not 0.0 <= found.added_mass <= MAX_ADDED_MASS:
            raise RefusedError(
                f"added mass: is {found.added_mass:g} kg; allowed: 0 to {MAX_ADDED_MASS:g}"
            )
        found.rig(rig)
        return found

    def rig(self, base: RigConfig) -> RigConfig:
        """The rig with the chosen numbers; those that are the file's own keep their origin."""
        own = {
            "mass": base.follower.mass.si + self.added_mass,
            "spring_stiffness": self.spring_stiffness,
            "preload": self.preload,
        }
        other = {k: v for k, v in own.items() if v != getattr(base.follower, k).si}
        try:
            return base.with_follower(**other) if other else base
        except ConfigError as error:
            raise RefusedError(str(error)) from None

    def write(self, folder: Path, base: RigConfig) -> Path:
        """Write scene and rig into a folder, beside its ``cams``; gives the scene's path."""
        speeds = [self.rpm] if self.rpm >= DRAWN_RPM else [self.rpm, DRAWN_RPM]
        rig = self.rig(base).model_dump(exclude_none=True, mode="json") | {"name": "bench"}
        scene = self.scene(base, speeds, MAX_TURNS)
        for kind, data in (("scenes", scene), ("rigs", rig)):
            (folder / kind).mkdir(parents=True, exist_ok=True)
            (folder / kind / "bench.yaml").write_text(to_yaml(data), encoding="utf-8")
        return folder / "scenes" / "bench.yaml"

    def scene(self, base: RigConfig, speeds: list[float], turns: int) -> dict[str, Any]:
        """As a scene file has it, of speeds in rpm."""
        return {
            "name": "bench",
            "title": f"The bench, {base.title}",
            "cams": [self.cam],
            "rig": "bench",
            "model": self.model,
            "sample_rate": {"assumed": SAMPLE_RATE, "unit": "Hz", "source": "the bench's"},
            "program": {
                "speeds": {"assumed": speeds, "unit": "rpm", "source": SPEEDS_ARE},
                "turns": {"assumed": turns, "unit": "turns", "source": "until it is ended"},
                "settle_turns": {"assumed": 1, "unit": "turns", "source": "the bench's"},
                "ticks_per_turn": TICKS_PER_TURN,
            },
        }


def allowed_models(rig: RigConfig) -> tuple[str, ...]:
    """The models that a rig has the numbers for."""

    def known(model: str) -> bool:
        try:
            dynamics.MODELS[model].parameters(rig)
        except ConfigError:
            return False
        return True

    return tuple(model for model in MODELS if known(model))


def cam_names(own: Path) -> list[str]:
    """The cams that can be mounted, own and shipped, but those whose follower is held on them."""
    folders = (config_root() / "cams", own)  # the bench's own come first, as they are looked up
    found = {path.stem: path for folder in folders for path in folder.glob("*.yaml")}
    named = ((name, path) for name, path in found.items() if NAME.fullmatch(name))
    return sorted(name for name, path in named if load_cam(path).follower.sprung)


def add_cam(cam: CamConfig, cams: Path) -> None:
    """Put a cam among those that can be mounted."""
    text = to_yaml(cam.model_dump(exclude_none=True, mode="json"))
    cams.mkdir(parents=True, exist_ok=True)
    (cams / f"{cam.name}.yaml").write_text(text, encoding="utf-8")


#: Wall time (s) between two looks at whether the pages are still served.
LOOK_S = 0.5
#: Parameters by node.
NodeValues = dict[str, dict[str, Any]]
Told = Callable[[dict[str, Any]], object]


class BenchRunner:
    """Runs set-ups in ``folder`` and keeps bags in ``out``; the main thread alone may `run` it."""

    def __init__(self, rig: RigConfig, folder: Path, out: Path, screen: bool = True) -> None:
        self.rig, self.folder, self.out = rig, folder, out
        self.cams = folder / "cams"
        self.cams.mkdir(parents=True, exist_ok=True)
        #: Called with what happens to the graph.
        self.tell: Told = lambda _message: None
        #: Address of the page that shows the rig in Rerun; empty where there is none.
        self.screen = ""
        self.has_screen, self._wants_screen = screen, False
        self._stream: str | None = None
        self._page: PageTime | None = None
        self._setups: Queue[tuple[Setup, NodeValues]] = Queue()
        self._keep = False

    @property
    def socket(self) -> Path:
        """Where the panel's node finds the page's server."""
        return self.folder / "panel.socket"

    def set_up(self, setup: Setup, values: NodeValues, keep: bool = False) -> None:
        """End the present run, and begin another with parameters of its nodes; ``keep`` its bag."""
        self._keep = self._keep or keep
        self._setups.put((setup, values))

    def show(self) -> None:
        """Have the next run shown in Rerun too, and those after it."""
        if not self.has_screen:
            raise RefusedError("rerun: this panel has none; allowed: without --no-rerun")
        self._wants_screen = not self.screen

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
        found = None
        with suppress(Empty):
            found = self._setups.get(timeout > 0.0, timeout or None)
            while True:
                found = self._setups.get_nowait()
        return found

    def _run(self, setup: Setup, values: NodeValues) -> tuple[Setup, NodeValues] | None:
        following: tuple[Setup, NodeValues] | None = None
        try:
            scene = setup.write(self.folder, self.rig)
            with self._bag(lambda: following is not None) as bag, own_domain():
                nodes = steered(scene, bag, self.socket, self._stream)
                nodes[DRIVE] |= {"autostart": False, "pacing": "real_time"}
                for node, chosen in values.items():
                    nodes[node] |= chosen
                domain = domain_number()
                self.tell({"graph": "starting", "domain": domain})
                with Graph(nodes, log=self._log) as graph:
                    while not graph.finished and following is None:
                        graph.poll()
                        following = self._next()
                self.tell({"graph": "ended"})
        except CamRigError as error:
            self.tell({"graph": "failed", "words": str(error)})
        return following

    def _log(self, line: str) -> None:
        self.tell({"log": line})

    @contextmanager
    def _bag(self, replaced: Callable[[], bool]) -> Iterator[Path]:
        """Where a run records to; removed where a person has ended the run and does not keep it."""
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

"""Node graph of the bench: started for a set-up, monitored, ended for the next."""

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
from cam_rig.runner.node_process import panel_nodes
from cam_rig.runner.node_table import DRIVE
from cam_rig.runner.resources import domain_number, reserve_domain
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.load import NAME, config_root, load_cam, to_yaml
from cam_rig.viewer.page import PageTime
from cam_rig.viewer.rerun_page import serve

# The set-up of the rig: cam, model and follower numbers, written as a scene for the nodes.

#: Name of the model with two elastic masses, which needs a rig with a split mass.
TWO_MASS = "two_mass"
#: Names of the models that a bench can run if the rig has their parameters.
MODELS = ("one_mass", TWO_MASS, "kinetostatic", "elastic_stem", "torsional")
#: Highest speed of the scene that the bench runs, rpm, unless the speed knob starts at a higher
#: speed. It sets the range of the viewer's axes.
AXIS_RPM = 600.0
#: Text that the scene of the bench contains as the source of its speeds.
SPEEDS_SOURCE = "the knob's first, and what the axes have room for"
#: Initial speed of the speed knob, rpm.
START_RPM = 200.0
#: Number of ticks per turn. A command takes effect at the next tick, at most 17 ms later at 300
#: rpm.
TICKS_PER_TURN = 12
#: Sample rate of the recorded force and of the page's sound, Hz.
SAMPLE_RATE = 4000
#: Lowest accepted cam speed, rpm.
MIN_RPM = 1.0
#: Highest accepted cam speed, rpm. A tick then has two samples.
MAX_RPM = 60.0 * SAMPLE_RATE / (2 * TICKS_PER_TURN)
#: Number of turns after which a bench ends: 5.6 h at 300 rpm.
MAX_TURNS = 100_000
#: Largest mass that can be added to that of the rig, kg.
MAX_ADDED_MASS = 100.0


@dataclass(frozen=True)
class Setup:
    """Set-up of the bench: choices that are made while the cam is stopped.

    `cam` is the cam that is mounted first and `model` one of `MODELS`. `added_mass` (kg) is added
    to the mass of the rig's follower. `spring_stiffness` is in N/m, `preload` in N, and `rpm` is
    the first speed.
    """

    cam: str
    model: str
    added_mass: float
    spring_stiffness: float
    preload: float
    rpm: float = START_RPM

    @classmethod
    def of(cls, rig: RigConfig, cam: str) -> Setup:
        """Return the set-up with the numbers of a rig file.

        The model is two masses if the rig splits its mass, else one mass.
        """
        follower = rig.follower
        model = TWO_MASS if isinstance(follower_of(rig), TwoMassParameters) else MODELS[0]
        return cls(cam, model, 0.0, follower.spring_stiffness.si, follower.preload.si)

    def with_changes(self, changes: dict[str, Any], rig: RigConfig) -> Setup:
        """Return the set-up with the changes that a page has sent.

        Raises RefusedError if a name is unknown or a value is not allowed.
        """
        current = asdict(self)
        wrong = [key for key in changes if key not in current]
        kinds = {key: str if isinstance(value, str) else float for key, value in current.items()}
        try:
            values: dict[str, Any] = {k: kinds[k](changes.get(k, v)) for k, v in current.items()}
            setup = Setup(**values)
        except (TypeError, ValueError, OverflowError):
            wrong = [key for key in changes if key in current]
        if wrong:
            raise RefusedError(f"set-up: {', '.join(wrong)[:80]}: allowed: {', '.join(current)}")
        if setup.model not in available_models(rig):
            allowed = ", ".join(available_models(rig))
            raise RefusedError(f"model: is {setup.model[:40]!r}; allowed on this rig: {allowed}")
        if not MIN_RPM <= setup.rpm <= MAX_RPM:
            raise RefusedError(f"rpm: is {setup.rpm:g}; allowed: {MIN_RPM:g} to {MAX_RPM:g}")
        if not 0.0 <= setup.added_mass <= MAX_ADDED_MASS:
            raise RefusedError(
                f"added mass: is {setup.added_mass:g} kg; allowed: 0 to {MAX_ADDED_MASS:g}"
            )
        setup.rig(rig)  # raises if a number is not allowed
        return setup

    def rig(self, base: RigConfig) -> RigConfig:
        """Return the rig with the numbers of the set-up.

        Unchanged numbers keep their origin.
        """
        numbers = {
            "mass": base.follower.mass.si + self.added_mass,
            "spring_stiffness": self.spring_stiffness,
            "preload": self.preload,
        }
        changed = {k: v for k, v in numbers.items() if v != getattr(base.follower, k).si}
        try:
            return base.with_follower(**changed) if changed else base
        except ConfigError as error:
            raise RefusedError(str(error)) from None

    def write(self, folder: Path, base: RigConfig) -> Path:
        """Write the scene and rig files of the set-up, and return the path of the scene.

        `base` is the rig whose numbers the set-up changes. The cam files must be in the subfolder
        ``cams`` of `folder`.
        """
        speeds = [self.rpm] if self.rpm >= AXIS_RPM else [self.rpm, AXIS_RPM]
        rig = self.rig(base).model_dump(exclude_none=True, mode="json") | {"name": "bench"}
        scene = self.scene_data(base, speeds, MAX_TURNS)
        for kind, data in (("scenes", scene), ("rigs", rig)):
            (folder / kind).mkdir(parents=True, exist_ok=True)
            (folder / kind / "bench.yaml").write_text(to_yaml(data), encoding="utf-8")
        return folder / "scenes" / "bench.yaml"

    def scene_data(self, base: RigConfig, speeds: list[float], turns: int) -> dict[str, Any]:
        """Return the data of a scene file for the set-up, with speeds in rpm."""
        return {
            "name": "bench",
            "title": f"The bench, {base.title}",
            "cams": [self.cam],
            "rig": "bench",
            "model": self.model,
            "sample_rate": {"assumed": SAMPLE_RATE, "unit": "Hz", "source": "the bench's"},
            "schedule": {
                "speeds": {"assumed": speeds, "unit": "rpm", "source": SPEEDS_SOURCE},
                "turns": {"assumed": turns, "unit": "turns", "source": "until it is ended"},
                "transient_turns": {"assumed": 1, "unit": "turns", "source": "the bench's"},
                "ticks_per_turn": TICKS_PER_TURN,
            },
        }


def available_models(rig: RigConfig) -> tuple[str, ...]:
    """Return the models for which a rig has the numbers."""

    def has_numbers(model: str) -> bool:
        try:
            dynamics.MODELS[model].parameters(rig)
        except ConfigError:
            return False
        return True

    return tuple(model for model in MODELS if has_numbers(model))


def cam_names(cams: Path) -> list[str]:
    """Return the names of the cams that can be mounted.

    They are the shipped cams and those in the folder `cams`. Cams with a desmodromic follower are
    left out, because no model turns them.
    """
    # A cam of the bench's folder replaces a shipped cam of the same name, as in `Cams`.
    folders = (config_root() / "cams", cams)
    paths = {path.stem: path for folder in folders for path in folder.glob("*.yaml")}
    valid = ((name, path) for name, path in paths.items() if NAME.fullmatch(name))
    return sorted(name for name, path in valid if load_cam(path).follower.sprung)


def add_cam(cam: CamConfig, cams: Path) -> None:
    """Write a cam into the folder of the cams that can be mounted."""
    text = to_yaml(cam.model_dump(exclude_none=True, mode="json"))
    cams.mkdir(parents=True, exist_ok=True)
    (cams / f"{cam.name}.yaml").write_text(text, encoding="utf-8")


#: Polling period (s, wall clock) of the check that the pages are still served.
POLL_S = 0.5
#: Parameter values by node.
NodeValues = dict[str, dict[str, Any]]
#: Function that is called with each event of the node graph.
EventCallback = Callable[[dict[str, Any]], object]


class BenchRunner:
    """Runner of the node graph of the bench, which is restarted for each set-up.

    Its files are in `folder`, and bags that are kept in `out`. `rerun` is False if the viewer may
    not be opened. Only the main thread may call `run`. `set_up` may be called from any thread.
    """

    def __init__(self, rig: RigConfig, folder: Path, out: Path, rerun: bool = True) -> None:
        self.rig, self.folder, self.out = rig, folder, out
        self.cams = folder / "cams"
        self.cams.mkdir(parents=True, exist_ok=True)
        #: Called with each event of the graph, from the thread of `run`.
        self.on_event: EventCallback = lambda _event: None
        #: Address of the page that shows the rig in Rerun, empty without one.
        self.rerun_address = ""
        self.has_rerun, self._wants_rerun = rerun, False
        self._stream: str | None = None
        self._page: PageTime | None = None
        self._setups: Queue[tuple[Setup, NodeValues]] = Queue()
        self._keep = False

    @property
    def socket(self) -> Path:
        """Path of the socket on which the server listens to the panel's node."""
        return self.folder / "panel.socket"

    def set_up(self, setup: Setup, values: NodeValues, keep: bool = False) -> None:
        """End the present run, and start another run with a set-up.

        `values` are the parameter values of its nodes. If `keep` is True, the bag of the present
        run is kept.
        """
        self._keep = self._keep or keep
        self._setups.put((setup, values))

    def request_rerun(self) -> None:
        """Display the next runs in the Rerun viewer, too.

        Raises RefusedError if the viewer is disabled.
        """
        if not self.has_rerun:
            raise RefusedError("rerun: disabled by --no-rerun; start the panel without it")
        self._wants_rerun = not self.rerun_address

    def run(self, served: Callable[[], bool]) -> None:
        """Run the newest set-up while `served` returns True, or until a signal arrives.

        A new set-up replaces the running one.
        """
        setup = None
        with ExitStack() as stack:
            while served():
                if setup is None:
                    setup = self._newest_setup(POLL_S)
                    continue
                if self._wants_rerun:
                    self._open_rerun(stack)
                setup = self._run(*setup)

    def _open_rerun(self, stack: ExitStack) -> None:
        """Start Rerun's viewer once.

        The bench runs without the viewer if it fails.
        """
        self._wants_rerun = False
        try:
            require("rerun")
            pages = stack.enter_context(serve())
        except CamRigError as error:
            self._log(f"cannot show the rig in Rerun: {error}")
        else:
            self.rerun_address, self._page = pages.address, pages.page
            self._stream = str(pages.folder)
        self.on_event({"rerun_address": self.rerun_address})

    def on_drive_time(self, rig_time: float) -> None:
        """Report the present rig time (s) of the drive.

        The delay of the picture in the Rerun viewer is measured from it.
        """
        if self._page is not None:
            self._page.record_drive(rig_time)

    def _newest_setup(self, timeout: float = 0.0) -> tuple[Setup, NodeValues] | None:
        """Return the newest set-up in the queue, or None after a timeout (s)."""
        newest = None
        with suppress(Empty):
            newest = self._setups.get(timeout > 0.0, timeout or None)
            while True:
                newest = self._setups.get_nowait()
        return newest

    def _run(self, setup: Setup, values: NodeValues) -> tuple[Setup, NodeValues] | None:
        following: tuple[Setup, NodeValues] | None = None
        try:
            scene = setup.write(self.folder, self.rig)
            with self._bag(lambda: following is not None) as bag, reserve_domain():
                nodes = panel_nodes(scene, bag, self.socket, self._stream)
                nodes[DRIVE] |= {"autostart": False, "pacing": "real_time"}
                for node, chosen in values.items():
                    nodes[node] |= chosen
                domain = domain_number()
                self.on_event({"graph": "starting", "domain": domain})
                with Graph(nodes, log=self._log) as graph:
                    while not graph.finished and following is None:
                        graph.poll()
                        following = self._newest_setup()
                self.on_event({"graph": "ended"})
        except CamRigError as error:
            self.on_event({"graph": "failed", "failure": str(error)})
        return following

    def _log(self, line: str) -> None:
        self.on_event({"log": line})

    @contextmanager
    def _bag(self, replaced: Callable[[], bool]) -> Iterator[Path]:
        """Yield the path of the bag to which a run records.

        The bag is deleted if a person ended the run and did not keep it.
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
                self.on_event({"kept_bag": str(bag)})

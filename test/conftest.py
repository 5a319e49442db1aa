"""Fixtures of all tests: the shipped cams and rig, and small cams and scenes."""

from __future__ import annotations

import dataclasses
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from ruamel.yaml import YAML
from xdist.scheduler import LoadFileScheduling

from cam_rig.acoustics import RadiationParameters
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.laws import Law, build_law
from cam_rig.runner.fork_server import ForkedProcess, ForkServer
from cam_rig.runner.node_process import environment
from cam_rig.schema import CamConfig, RigConfig, SceneConfig, load_cam, load_rig
from cam_rig.schema.motions import SCCA_PARAMETERS
from cam_rig.simulation.scene import LoadedScene, open_scene
from cam_rig.testing import running_rig

from .references import many_digits

__all__ = ["many_digits"]
CONFIG = Path(__file__).parents[1] / "config"
#: Recorded run that the repository ships.
GOLDEN = CONFIG.parent / "bags" / "golden"
CAM_NAMES = sorted(path.stem for path in (CONFIG / "cams").glob("*.yaml"))
#: Cams with velocity jumps. No follower can stay on them, so few models accept them.
VELOCITY_JUMPS = {"worked_example_constant_velocity"}
#: Wall time (s) after which a test of a kind is stopped, on a busy machine. Others: pyproject.toml.
TIMEOUTS = {"slow": 600, "ros": 300, "long": 3600}
#: Largest number of workers. More only use memory.
MAX_WORKERS = 8


def pytest_xdist_auto_num_workers() -> int:
    """Return one worker more than cores, because many tests wait for a run."""
    usable = getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))
    return min(len(usable(0)) + 1, MAX_WORKERS)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--references``: stored, computed or written references of many digits."""
    choices = ("stored", "compute", "write")
    parser.addoption("--references", choices=choices, default="stored", help="of many digits")


def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> LoadFileScheduling:
    """Give each file's tests to one worker, so that its fixtures are created once."""
    return LoadFileScheduling(config, log)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Start with the longest tests, and set their timeouts."""
    for item in _further_variants(items):
        item.add_marker(pytest.mark.long)
    for item in items:
        if item.get_closest_marker("timeout") is None:
            allowed = [s for name, s in TIMEOUTS.items() if item.get_closest_marker(name)]
            for longest in sorted(allowed)[-1:]:
                item.add_marker(pytest.mark.timeout(longest))
    if config.getoption("references") == "write":
        items[:] = [item for item in items if "many_digits" in getattr(item, "fixturenames", ())]
    items.sort(key=lambda item: (item.get_closest_marker("ros") is None, _is_quick(item)))


def _further_variants(items: list[pytest.Item]) -> Iterator[pytest.Item]:
    """Return the cases of tests marked ``variants(n)``, except n evenly spread cases."""
    cases: dict[tuple[str, str], list[pytest.Item]] = {}
    for item in items:
        if isinstance(item, pytest.Function) and item.get_closest_marker("variants"):
            cases.setdefault((item.path.as_posix(), item.originalname), []).append(item)
    for found in cases.values():
        mark = found[0].get_closest_marker("variants")
        assert mark is not None
        kept = {round(place) for place in np.linspace(0, len(found) - 1, mark.args[0])}
        yield from (item for place, item in enumerate(found) if place not in kept)


def _is_quick(item: pytest.Item) -> bool:
    return not any(map(item.get_closest_marker, ("slow", "long")))


# Examples of Hypothesis: the same in every ordinary run, more and random ones in a long run.
settings.register_profile(
    "ordinary",
    max_examples=40,
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
settings.register_profile(
    "long", settings.get_profile("ordinary"), max_examples=400, derandomize=False, print_blob=True
)
settings.load_profile("ordinary")


@pytest.fixture
def hangup_enabled() -> Iterator[None]:
    """SIGHUP ends commands, even if the tests were started by nohup."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """Browser without a window. The test is skipped if none is installed."""
    from tools.docs.browser import open_browser, why_no_browser

    if why := why_no_browser():
        pytest.skip(f"no browser: {why}")
    with open_browser() as browser:
        yield browser


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Figures are drawn without a screen, and all are closed at the end."""
    import matplotlib as mpl

    monkeypatch.setitem(mpl.rcParams, "backend", "agg")
    yield
    mpl.pyplot.close("all")


@pytest.fixture(scope="session")
def config_dir() -> Path:
    """The shipped ``config`` folder."""
    return CONFIG


@pytest.fixture(scope="session")
def cams() -> dict[str, CamConfig]:
    """Every shipped cam file by name."""
    return {name: load_cam(CONFIG / "cams" / f"{name}.yaml") for name in CAM_NAMES}


@pytest.fixture(scope="session")
def laws(cams: dict[str, CamConfig]) -> dict[str, Law]:
    """Law of every shipped cam by name."""
    return {name: build_law(cam) for name, cam in cams.items()}


@pytest.fixture(scope="session")
def followable_laws(laws: dict[str, Law]) -> dict[str, Law]:
    """Laws that a follower can follow, by name."""
    return {name: law for name, law in laws.items() if name not in VELOCITY_JUMPS}


@pytest.fixture(scope="session", params=[name for name in CAM_NAMES if name not in VELOCITY_JUMPS])
def law(request: pytest.FixtureRequest, laws: dict[str, Law]) -> Law:
    """Each shipped law that a follower can follow, one after the other."""
    return laws[request.param]


@pytest.fixture(scope="session")
def rig() -> RigConfig:
    """The shipped rig file."""
    return load_rig(CONFIG / "rigs" / "tm21.yaml")


@pytest.fixture(scope="session")
def paper_rig() -> RigConfig:
    """Rig identified from the jump speeds of Table 2: two masses, and a shaft."""
    return load_rig(CONFIG / "rigs" / "paper_table2.yaml")


@pytest.fixture(scope="session")
def two_mass(paper_rig: RigConfig) -> TwoMassParameters:
    """Two-mass follower of the paper's jump speeds."""
    return TwoMassParameters.from_rig(paper_rig)


@pytest.fixture(scope="session")
def follower(rig: RigConfig) -> FollowerParameters:
    """Follower of the shipped rig."""
    return FollowerParameters.from_rig(rig)


@pytest.fixture
def radiation(rig: RigConfig) -> RadiationParameters:
    """Shipped constants with a round corner, so that no test needs a fitted number."""
    return dataclasses.replace(RadiationParameters.from_rig(rig), gain=1e-4, corner_frequency=20.0)


def assumed(value: Any, unit: str) -> dict[str, Any]:
    """Return an assumed number in the form of a file."""
    return {"assumed": value, "unit": unit}


def dwell(span: float) -> dict[str, Any]:
    """Return a segment for `make_cam`, with its span in degrees."""
    return {"law": "dwell", "span": span}


def rise(span: float, to: float, law: str = "poly345") -> dict[str, Any]:
    """Return a rise for `make_cam`, to a level relative to the lift."""
    return {"law": law, "span": span, "to": to}


@pytest.fixture(scope="session")
def make_cam() -> Callable[..., CamConfig]:
    """Make a cam of segments, with spans in degrees."""

    def make(
        *segments: dict[str, Any],
        lift: float = 0.05,
        name: str = "made",
        roller_radius: float | None = None,
    ) -> CamConfig:
        ratios = ("ordinates", "knots", "value", "mean", "cosine", "sine", *SCCA_PARAMETERS)
        lengths = ("flank_radius", "nose_radius", "tolerance")
        units = dict.fromkeys(("span", "nose_span", "at"), "deg")
        units |= dict.fromkeys(ratios, "1") | dict.fromkeys(lengths, "m")
        follower: dict[str, Any] = {"type": "point", "base_radius": assumed(0.04, "m")}
        if roller_radius is not None:
            follower |= {"type": "roller", "roller_radius": assumed(roller_radius, "m")}
        return CamConfig.model_validate(
            {
                "name": name,
                "title": "made for a test",
                "lift": assumed(lift, "m"),
                "follower": follower,
                "segments": [
                    {k: assumed(v, units[k]) if k in units else v for k, v in segment.items()}
                    for segment in segments
                ],
            }
        )

    return make


def scene_data(**changes: Any) -> dict[str, Any]:
    """Data of a scene file: two cams, three speeds, three turns each."""
    schedule = {
        "speeds": assumed(changes.pop("speeds", [200, 300, 400]), "rpm"),
        "turns": assumed(changes.pop("turns", 3), "turns"),
        "transient_turns": assumed(changes.pop("transient_turns", 1), "turns"),
        "ticks_per_turn": changes.pop("ticks_per_turn", 1),
    }
    if "ramp" in changes:
        schedule["ramp"] = assumed(changes.pop("ramp"), "s")
    return {
        "name": "small",
        "title": "a small scene",
        "cams": ["poly345", "bezier15"],
        "rig": "tm21",
        "model": "one_mass",
        "sample_rate": assumed(changes.pop("sample_rate", 8000), "Hz"),
        "schedule": schedule,
        **changes,
    }


@pytest.fixture(scope="session")
def make_scene() -> Callable[..., SceneConfig]:
    """Make a scene, with changes."""
    return lambda **changes: SceneConfig.model_validate(scene_data(**changes))


@pytest.fixture
def make_loaded_scene(tmp_path: Path) -> Callable[..., LoadedScene]:
    """Write a scene file, with changes, and open it with all it names."""

    def make(**changes: Any) -> LoadedScene:
        path = tmp_path / "scenes" / "small.yaml"
        path.parent.mkdir(exist_ok=True)
        with path.open("w", encoding="utf-8") as file:
            YAML(typ="safe").dump(scene_data(**changes), file)
        return open_scene(path)

    return make


@pytest.fixture(scope="session")
def fork_server() -> Iterator[ForkServer]:
    """Server that forks the nodes of all tests that do not test their start."""
    with ForkServer().begin() as made:
        yield made


@pytest.fixture
def forked(fork_server: ForkServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fork the nodes that are started in this process from the server of all tests."""

    def started(command: list[str], network: bool, pipe: int | None, _: object) -> ForkedProcess:
        node = fork_server.start(command, environment(network), pipe)
        assert node is not None
        return node

    monkeypatch.setattr("cam_rig.runner.node_process._launch", started)
    monkeypatch.setattr(ForkServer, "begin", lambda own: own)  # use the same server


@pytest.fixture(scope="session", autouse=True)
def isolated_domain() -> Iterator[None]:
    """Commands run in a ROS domain in which no other rig is active.

    Otherwise a tested command would fail while a rig runs on this machine.
    """
    with running_rig.hold_domain() as domain, pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(domain))
        yield


@pytest.fixture
def ros_domain(request: pytest.FixtureRequest) -> Iterator[int]:
    """ROS domain for one test, on this machine only.

    Nodes of a graph in this process are forked, unless the test is marked ``starts``.
    """
    if request.node.get_closest_marker("starts") is None:
        request.getfixturevalue("forked")
    with running_rig.isolated_domain() as domain:
        yield domain

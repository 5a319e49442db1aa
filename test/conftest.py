"""Fixtures of all tests: the shipped cams and rig, and small cams and scenes.

The hooks of pytest set the order of the tests, their timeouts and the number of workers.
"""

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
#: Reference recording (bag) in the repository.
GOLDEN = CONFIG.parent / "bags" / "golden"
CAM_NAMES = sorted(path.stem for path in (CONFIG / "cams").glob("*.yaml"))
#: Cams whose law has velocity jumps. A follower cannot stay in contact there, so few models accept
#: them.
VELOCITY_JUMPS = {"worked_example_constant_velocity"}
#: Timeouts (s) of marked tests, long enough for a busy machine. For others see pyproject.toml.
TIMEOUTS = {"slow": 600, "ros": 300, "long": 3600}
#: Largest number of worker processes. More would only need memory.
MAX_WORKERS = 8


def pytest_xdist_auto_num_workers() -> int:
    """Return the number of workers: cores + 1, because many tests wait for a run."""
    usable = getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))
    return min(len(usable(0)) + 1, MAX_WORKERS)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--references``: use stored, compute again or write reference values."""
    choices = ("stored", "compute", "write")
    parser.addoption("--references", choices=choices, default="stored", help="of many digits")


def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> LoadFileScheduling:
    """Assign the tests of a file to one worker, so that its fixtures are created once."""
    return LoadFileScheduling(config, log)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Set timeouts, and run the longest tests first.

    With ``--references`` other than stored, only tests with reference values run.
    """
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
    """Yield all cases of tests marked ``variants(n)`` except n evenly spread cases.

    The yielded cases run only in a long run.
    """
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


# Hypothesis uses the same examples in every ordinary run, and more and random examples in a long
# run.
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
    """Default action of SIGHUP during a test.

    The signal thus ends commands even under nohup.
    """
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """Browser without a window. Without an installed browser the test is skipped."""
    from tools.docs.browser import open_browser, why_no_browser

    if why := why_no_browser():
        pytest.skip(f"no browser: {why}")
    with open_browser() as browser:
        yield browser


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Matplotlib without a screen. The figures are closed at the end of the test."""
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
    """All shipped cam files, by name."""
    return {name: load_cam(CONFIG / "cams" / f"{name}.yaml") for name in CAM_NAMES}


@pytest.fixture(scope="session")
def laws(cams: dict[str, CamConfig]) -> dict[str, Law]:
    """Laws of all shipped cams, by name."""
    return {name: build_law(cam) for name, cam in cams.items()}


@pytest.fixture(scope="session")
def followable_laws(laws: dict[str, Law]) -> dict[str, Law]:
    """Laws without velocity jumps, which a follower can follow, by name."""
    return {name: law for name, law in laws.items() if name not in VELOCITY_JUMPS}


@pytest.fixture(scope="session", params=[name for name in CAM_NAMES if name not in VELOCITY_JUMPS])
def law(request: pytest.FixtureRequest, laws: dict[str, Law]) -> Law:
    """Each shipped law that a follower can follow; the test runs once per law."""
    return laws[request.param]


@pytest.fixture(scope="session")
def rig() -> RigConfig:
    """The shipped rig TM21."""
    return load_rig(CONFIG / "rigs" / "tm21.yaml")


@pytest.fixture(scope="session")
def paper_rig() -> RigConfig:
    """Rig with two masses and a shaft, identified from the jump speeds of the paper.

    They are in Table 2 of the paper on Bézier cams (see docs/glossary.md).
    """
    return load_rig(CONFIG / "rigs" / "paper_table2.yaml")


@pytest.fixture(scope="session")
def two_mass(paper_rig: RigConfig) -> TwoMassParameters:
    """Parameters of the two-mass follower identified from Table 2 of the paper."""
    return TwoMassParameters.from_rig(paper_rig)


@pytest.fixture(scope="session")
def follower(rig: RigConfig) -> FollowerParameters:
    """Lumped parameters of the follower of the shipped rig TM21."""
    return FollowerParameters.from_rig(rig)


@pytest.fixture
def radiation(rig: RigConfig) -> RadiationParameters:
    """Radiation constants with round numbers instead of the fitted numbers."""
    return dataclasses.replace(RadiationParameters.from_rig(rig), gain=1e-4, corner_frequency=20.0)


def assumed(value: Any, unit: str) -> dict[str, Any]:
    """Return an entry of a cam or rig file with the origin "assumed".

    It has a value and its unit.
    """
    return {"assumed": value, "unit": unit}


def dwell(span: float) -> dict[str, Any]:
    """Return the data of a dwell segment for `make_cam`. `span` is in degrees."""
    return {"law": "dwell", "span": span}


def rise(span: float, to: float, law: str = "poly345") -> dict[str, Any]:
    """Return the data of a rise or fall for `make_cam`. `span` is in degrees.

    `to` is the level at its end, as a fraction of the lift.
    """
    return {"law": law, "span": span, "to": to}


@pytest.fixture(scope="session")
def make_cam() -> Callable[..., CamConfig]:
    """Function that returns a cam made of the given segments, with spans in degrees.

    The follower is a point, or a roller if `roller_radius` (m) is given. The lift is 0.05 m by
    default.
    """

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
    """Return the data of a scene file: two cams at three speeds, three turns each.

    `changes` replaces entries of the data.
    """
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
    """Function that returns the scene of `scene_data` with changed entries."""
    return lambda **changes: SceneConfig.model_validate(scene_data(**changes))


@pytest.fixture
def make_loaded_scene(tmp_path: Path) -> Callable[..., LoadedScene]:
    """Function that writes the scene of `scene_data` to a file and loads it.

    Its arguments replace entries of the data.
    """

    def make(**changes: Any) -> LoadedScene:
        path = tmp_path / "scenes" / "small.yaml"
        path.parent.mkdir(exist_ok=True)
        with path.open("w", encoding="utf-8") as file:
            YAML(typ="safe").dump(scene_data(**changes), file)
        return open_scene(path)

    return make


@pytest.fixture(scope="session")
def fork_server() -> Iterator[ForkServer]:
    """Server process that forks the nodes of all tests.

    Tests of the start of nodes do not use it.
    """
    with ForkServer().begin() as made:
        yield made


@pytest.fixture
def forked(fork_server: ForkServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nodes that this process starts are forked by the server of all tests.

    This is faster than a new interpreter for each node.
    """

    def started(command: list[str], network: bool, pipe: int | None, _: object) -> ForkedProcess:
        node = fork_server.start(command, environment(network), pipe)
        assert node is not None
        return node

    monkeypatch.setattr("cam_rig.runner.node_process._launch", started)
    monkeypatch.setattr(ForkServer, "begin", lambda own: own)  # all rigs use the same server


@pytest.fixture(scope="session", autouse=True)
def isolated_domain() -> Iterator[None]:
    """ROS domain of all tests, in which no other rig is active.

    Otherwise a tested command would fail while a rig runs on this machine.
    """
    with running_rig.hold_domain() as domain, pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(domain))
        yield


@pytest.fixture
def ros_domain(request: pytest.FixtureRequest) -> Iterator[int]:
    """ROS domain of a test, limited to this machine.

    Nodes that this process starts are forked, unless the test is marked ``starts``.
    """
    if request.node.get_closest_marker("starts") is None:
        request.getfixturevalue("forked")
    with running_rig.isolated_domain() as domain:
        yield domain

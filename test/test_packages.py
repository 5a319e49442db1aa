"""Who installs the rig finds every library it imports: with pip, with rosdep, by the README."""

import ast
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree

import pytest

import cam_rig
from cam_rig.extras import EXTRAS, OPTIONAL

ROOT = Path(__file__).parents[1]
#: rosdep keys of the libraries whose key is not python3-<name>.
KEYS = {
    "lz4": "mcap-ros2-support",
    "mcap": "mcap-ros2-support",
    "pyyaml": "python3-yaml",
    "rosbags": "python3-rosbags-pip",
    "zstandard": "mcap-ros2-support",
}
#: Libraries whose import has another name than the package.
IMPORTED_AS = {"PIL": "pillow", "rerun": "rerun-sdk", "sksundae": "scikit-sundae", "yaml": "pyyaml"}
#: What only the makers of reference numbers import.
MAKERS = {"mpmath"}
#: What only a test of somebody else's imports, through `cam_rig.testing`.
TESTS = {"pytest"}
IMPORTED_AS |= {"mkdocs": "mkdocs-material", "griffe": "mkdocstrings"}
IMPORTED_AS |= {"pydantic_core": "pydantic", "rerun_cli": "rerun-sdk", "SALib": "salib"}
#: Extras that `all` leaves out: what measures against others, and what a cluster needs.
APART = {"bench", "dask"}
#: What `make setup` installs beside `all`.
INSTALLED = ("CORE", "BENCH", "DASK", "ROS_WHEELS", "TEST")
#: The ten lines of the README, without the bag; a library outside the core cannot be imported.
TEN_LINES = """
import sys

class Barred:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {barred}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Barred())
import cam_rig
cam = cam_rig.load_cam("poly345")
law = cam_rig.build_law(cam)
rig = cam_rig.load_rig("paper_table2")
motion = cam_rig.simulate(law, rig, model="two_mass", rpm=450, turns=3, sample_rate=48_000)
motion.time, motion.lift, motion.force, motion.events
cam_rig.sound_level(motion), cam_rig.contour(cam).radius, cam_rig.run_scene("quick").noise
print(round(cam_rig.jump_speed(law, rig).rpm, 2))
"""


def lists_of_setup():
    """The lists of names in setup.py, without versions."""
    tree = ast.parse((ROOT / "setup.py").read_text())
    found = {}
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.List):
            plain = [e for e in node.value.elts if not isinstance(e, ast.Starred)]
            names = {re.split(r"[>=\[]", str(ast.literal_eval(e)))[0] for e in plain}
            parts = (found[e.value.id] for e in node.value.elts if isinstance(e, ast.Starred))
            found[node.targets[0].id] = names.union(*parts)
    return found


def declared():
    """The rosdep keys of package.xml, and what its comments say has none."""
    text = (ROOT / "package.xml").read_text()
    keys = {e.text for e in ElementTree.fromstring(text).iter("exec_depend")}
    without = re.findall(r"No rosdep keys? exists? for [^:]*: pip install ([^>]*?)\. -->", text)
    return keys, [set(words.split()) for words in without]


def imported(folder="cam_rig"):
    """Top-level names that a folder imports, without Python's own and the project's."""
    names = set()
    for path in (ROOT / folder).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                names.add(node.module.split(".")[0])
    return names - set(sys.stdlib_module_names) - {"benchmark", "cam_rig", "tools"}


def test_what_is_imported_is_declared():
    """By setup.py or, for ROS's own packages, by package.xml."""
    lists, (keys, _) = lists_of_setup(), declared()
    known = lists["CORE"] | lists["ALL"] | lists["BENCH"] | lists["DASK"] | keys
    found = imported() | imported("benchmark")
    missing = {n for n in found if IMPORTED_AS.get(n, n) not in known}
    assert missing - {"builtin_interfaces", *OPTIONAL} == MAKERS | TESTS <= lists["TEST"]
    assert set(OPTIONAL) <= lists["TEST"]


def test_what_the_tools_import_is_declared():
    """By setup.py: what draws and builds the documents is no part of the package."""
    lists = lists_of_setup()
    known = lists["CORE"] | lists["ALL"] | lists["TEST"] | lists["DOCS"]
    assert {IMPORTED_AS.get(n, n) for n in imported("tools")} <= known


def test_rosdep_and_pip_install_the_same():
    """Every library of setup.py has a rosdep key in package.xml, or is named as one that has none;
    no key is left of one that is needed no more.
    """
    lists, (keys, (without, *_)) = lists_of_setup(), declared()
    runtime = lists["CORE"] | lists["ALL"] | lists["DASK"]
    by_key = {KEYS.get(name, f"python3-{name}") for name in runtime - without}
    assert by_key <= keys
    assert {key for key in keys if key.startswith("python3-")} <= by_key
    assert without <= runtime


def test_each_library_is_of_the_extra_that_its_error_names():
    """What `cam_rig.extras` says is what setup.py does; the core is nowhere in it."""
    lists = lists_of_setup()
    by_extra = {}
    for module, extra in EXTRAS.items():
        by_extra.setdefault(extra, set()).add(IMPORTED_AS.get(module, module))
    assert by_extra.pop("ros-wheels") == {"rclpy"}
    for extra, libraries in by_extra.items():
        assert libraries <= lists[extra.upper()] <= set().union(*by_extra.values()), extra
    assert lists["ALL"] == set().union(*(lists[e.upper()] for e in by_extra if e not in APART))
    assert not lists["CORE"] & (lists["ALL"] | lists["BENCH"] | lists["DASK"])


def test_the_lock_has_all_extras():
    """`make setup` installs all."""
    lists, makefile = lists_of_setup(), (ROOT / "Makefile").read_text()
    lock = set(re.findall(r"^([a-z0-9-]+)==", (ROOT / "requirements.lock").read_text(), re.M))
    wanted = lists["ALL"].union(*(lists[name] for name in INSTALLED))
    assert {name.replace(".", "-") for name in wanted} <= {name.replace(".", "-") for name in lock}
    extras = re.search(r"pip compile setup.py (.*) --output", makefile)[1].split(" --extra ")
    assert {extra.removeprefix("--extra ") for extra in extras} >= {"all", "ros-wheels", "test"}


def test_the_core_alone_runs_the_ten_lines():
    """numpy, scipy, pydantic and a YAML reader are enough for all that needs no file of a run."""
    barred = {*EXTRAS, *OPTIONAL}
    code = TEN_LINES.format(barred=barred)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=100
    )
    assert done.stderr == ""
    assert done.stdout == "413.44\n"


@pytest.mark.variants(4)
@pytest.mark.parametrize(
    ("barred", "command", "remedy"),
    [
        ("typer", ["--help"], "typer is not installed: pip install 'cam_rig[cli]'"),
        (
            "rerun",
            ["view", "bags/golden", "--save", "out/none.rrd"],
            "rerun is not installed: pip install 'cam_rig[view]'",
        ),
        ("mcap", ["analyze", "bags/golden"], "mcap is not installed: pip install 'cam_rig[bags]'"),
        (
            "matplotlib",
            ["simulate", "quick", "--plot", "out/none.png"],
            "matplotlib is not installed: pip install 'cam_rig[plots]'",
        ),
        (
            "pyarrow",
            ["export", "quick", "--to", "out/none.parquet"],
            "pyarrow is not installed: pip install 'cam_rig[parquet]'",
        ),
        ("shapely", ["profile", "flat"], "shapely is not installed: pip install 'cam_rig[cad]'"),
        (
            "rclpy",
            ["replay", "bags/golden"],
            "rclpy is not installed: pip install 'cam_rig[ros-wheels]', or source a ROS 2 "
            "installation",
        ),
    ],
)
def test_a_command_names_the_extra_that_it_lacks(barred, command, remedy):
    """In one line, with the code of a failure."""
    code = (
        f"import sys; sys.modules[{barred!r}] = None; sys.argv = ['cam-rig', *{command!r}]\n"
        "from cam_rig.cli import start; start()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
        timeout=100,
    )
    assert done.returncode == 1
    assert done.stderr.strip() == f"cam-rig: {remedy}"
    assert done.stdout == ""


def test_the_version_stands_once():
    """In package.xml; setup.py reads it there, and the package asks what is installed."""
    (stands,) = ElementTree.parse(ROOT / "package.xml").iter("version")
    assert cam_rig.__version__ == version("cam_rig") == stands.text
    for place in ("setup.py", "cam_rig/__init__.py", "pyproject.toml"):
        assert stands.text not in (ROOT / place).read_text(encoding="utf-8")

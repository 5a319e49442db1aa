"""Tests of the packaging: libraries, extras, version, Docker image, code layout.

The libraries are declared for pip and rosdep. The image follows the page on installation.
"""

import ast
import json
import os
import re
import sys
from collections import Counter
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

import cam_rig
from cam_rig.extras import EXTRAS, OPTIONAL

from .processes import ended

ROOT = Path(__file__).parents[1]
#: Keys of rosdep for the libraries whose key is not python3-<name>.
KEYS = {
    "markupsafe": "python3-jinja2",
    "lz4": "mcap-ros2-support",
    "mcap": "mcap-ros2-support",
    "pyyaml": "python3-yaml",
    "rosbags": "python3-rosbags-pip",
    "zstandard": "mcap-ros2-support",
}
#: Libraries whose module has another name than the package.
IMPORTED_AS = {"PIL": "pillow", "rerun": "rerun-sdk", "sksundae": "scikit-sundae", "yaml": "pyyaml"}
#: Libraries that are imported only by the scripts that compute reference values.
MAKERS = {"mpmath"}
#: Libraries that only the tests of other packages need, which use `cam_rig.testing`.
TESTS = {"pytest"}
IMPORTED_AS |= {"mkdocs": "mkdocs-material", "griffe": "mkdocstrings"}
IMPORTED_AS |= {"pydantic_core": "pydantic", "rerun_cli": "rerun-sdk", "SALib": "salib"}
#: Extras of setup.py that are not part of `all`: comparison with other solvers, and a Dask cluster.
APART = {"bench", "dask"}
#: Lists of setup.py that `make setup` installs in addition to `all`.
INSTALLED = ("CORE", "BENCH", "DASK", "ROS_WHEELS", "TEST")
#: Example of the README without its bag, run while libraries outside the core cannot be imported.
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
    """Return the lists of libraries in setup.py by name, without versions."""
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
    """Return the rosdep keys of package.xml, and the libraries without a key.

    The latter are in comments of package.xml.
    """
    text = (ROOT / "package.xml").read_text()
    keys = {e.text for e in ElementTree.fromstring(text).iter("exec_depend")}
    without = re.findall(r"rosdep keys [^:]*: pip install\s([^>]*?)\. -->", text)
    return keys, [set(words.split()) for words in without]


def imported(folder="cam_rig"):
    """Return the top-level modules that the code in a folder imports.

    The standard library of Python and the modules of the project are left out.
    """
    lines = re.compile(r"^ *(?:from (\w+)[\w.]* )?import (\w+)", re.M)
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / folder).rglob("*.py")]
    names = {module or name for text in texts for module, name in lines.findall(text)}
    return names - set(sys.stdlib_module_names) - {"benchmark", "cam_rig", "tools"}


def test_what_is_imported_is_declared():
    """Each library that cam_rig, its benchmark or its tools import is declared.

    It is in a list of setup.py or has a rosdep key. Exceptions are optional libraries, and
    libraries that only tests and reference values need.
    """
    lists, (keys, _) = lists_of_setup(), declared()
    known = lists["CORE"] | lists["ALL"] | lists["BENCH"] | lists["DASK"] | keys
    found = imported() | imported("benchmark")
    missing = {n for n in found if IMPORTED_AS.get(n, n) not in known}
    # Siconos is a Debian package for Debian's Python, and is not on PyPI.
    assert missing - {"builtin_interfaces", "siconos", *OPTIONAL} == MAKERS | TESTS <= lists["TEST"]
    assert set(OPTIONAL) <= lists["TEST"]
    of_tools = lists["CORE"] | lists["ALL"] | lists["TEST"] | lists["DOCS"]
    assert {IMPORTED_AS.get(n, n) for n in imported("tools")} <= of_tools


def test_rosdep_and_pip_install_the_same():
    """Each library of setup.py has a rosdep key, or is listed as a library without.

    package.xml has no key of any other library.
    """
    lists, (keys, (no_key, not_tried, *_)) = lists_of_setup(), declared()
    without = no_key | not_tried
    runtime = lists["CORE"] | lists["ALL"] | lists["DASK"]
    by_key = {KEYS.get(name, f"python3-{name}") for name in runtime - without}
    assert by_key <= keys
    assert {key for key in keys if key.startswith("python3-")} <= by_key
    assert without <= runtime


def names_in(file):
    """Return the names in a file of test/rosdep, a stored list of ros/rosdistro."""
    lines = (ROOT / "test" / "rosdep" / file).read_text(encoding="utf-8").splitlines()
    return {line for line in lines if not line.startswith("#")}


@pytest.mark.parametrize("distribution", ["lyrical", "kilted", "jazzy"])
def test_rosdep_resolves_every_key(distribution):
    """Each dependency in package.xml is a system key of rosdep or a released package.

    `rosdep install` would stop at any other key.
    """
    # std_srvs is released with common_interfaces, but is missing in the stored copy.
    existing = names_in(f"{distribution}_packages.txt") | names_in("system_keys.txt") | {"std_srvs"}
    package = ElementTree.parse(ROOT / "package.xml")
    keys = {element.text for element in package.iter() if element.tag.endswith("_depend")}
    assert len(keys) > 30 and keys - existing == set()


def test_libraries_that_are_said_to_have_no_key_have_none():
    """Each library that package.xml lists as without a rosdep key has no key."""
    text = (ROOT / "package.xml").read_text(encoding="utf-8")
    lists = re.findall(r"No rosdep keys exist for [^:]*: pip install\s([^>]*?)\. -->", text)
    names = {name for words in lists for name in words.split()}
    assert names
    assert {f"python3-{name}" for name in names} & names_in("system_keys.txt") == set()


def test_each_library_is_of_the_extra_that_its_error_names():
    """The extra in the error of a missing library contains that library.

    `all` contains the libraries of all extras except bench and dask. No extra repeats a library of
    the core.
    """
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
    """requirements.lock contains each library that `make setup` installs.

    It is compiled with the extras all, ros-wheels and test.
    """
    lists, makefile = lists_of_setup(), (ROOT / "Makefile").read_text()
    lock = set(re.findall(r"^([a-z0-9-]+)==", (ROOT / "requirements.lock").read_text(), re.M))
    wanted = lists["ALL"].union(*(lists[name] for name in INSTALLED))
    assert {name.replace(".", "-") for name in wanted} <= {name.replace(".", "-") for name in lock}
    extras = re.search(r"pip compile setup.py (.*) --output", makefile)[1].split(" --extra ")
    assert {extra.removeprefix("--extra ") for extra in extras} >= {"all", "ros-wheels", "test"}


def run(code):
    """Run Python code in the root of the repository, and return the ended process."""
    return ended(sys.executable, "-c", code, cwd=ROOT)


def test_the_core_alone_runs_the_ten_lines():
    """The example of the README prints its number if only the core is installed."""
    done = run(TEN_LINES.format(barred={*EXTRAS, *OPTIONAL}))
    assert (done.stderr, done.stdout) == ("", "413.44\n")


#: Cases: missing library, a command that needs it, and the end of its error line.
LACKING = {
    "typer": ("--help", "cam_rig[cli]'"),
    "rerun": ("view bags/golden --save out/none.rrd", "cam_rig[view]'"),
    "mcap": ("analyze bags/golden", "cam_rig[bags]'"),
    "matplotlib": ("simulate quick --plot out/none.png", "cam_rig[plots]'"),
    "pyarrow": ("export quick --to out/none.parquet", "cam_rig[parquet]'"),
    "shapely": ("profile flat", "cam_rig[cad]'"),
    "rclpy": ("replay bags/golden", "cam_rig[ros-wheels]', or source a ROS 2 installation"),
}


@pytest.mark.variants(3)
@pytest.mark.parametrize("barred", LACKING)
def test_a_command_names_the_extra_that_it_lacks(barred):
    """A command without its library ends with code 1 and an error of one line.

    The error contains the pip command for the extra of the library.
    """
    command, remedy = LACKING[barred]
    code = (
        f"import sys; sys.modules[{barred!r}] = None; sys.argv = ['cam-rig', *{command.split()}]\n"
        "from cam_rig.cli import start; start()"
    )
    done, line = run(code), f"cam-rig: {barred} is not installed: pip install '{remedy}\n"
    assert (done.returncode, done.stdout, done.stderr) == (1, "", line)


def test_the_version_stands_once():
    """The version is defined in package.xml, and no other source file contains it."""
    (stands,) = ElementTree.parse(ROOT / "package.xml").iter("version")
    assert cam_rig.__version__ == version("cam_rig") == stands.text
    for place in ("setup.py", "cam_rig/__init__.py", "pyproject.toml"):
        assert stands.text not in (ROOT / place).read_text(encoding="utf-8")


def test_the_changelog_starts_with_the_version():
    """CHANGELOG.rst has an entry of the current version, in the format of REP 132.

    The format is version and date, underlined, then a list.
    """
    (declared_version,) = ElementTree.parse(ROOT / "package.xml").iter("version")
    text = (ROOT / "CHANGELOG.rst").read_text(encoding="utf-8")
    heading = rf"^{re.escape(declared_version.text)} \(\d{{4}}-\d\d-\d\d\)\n-+\n\* "
    assert re.search(heading, text, re.M)


DOCKER = ROOT / "docker"
PAGE = (ROOT / "docs" / "installation.md").read_text(encoding="utf-8")
#: Libraries of setup.py that Ubuntu 24.04 has in a version that is new enough.
FROM_UBUNTU = {
    *("ezdxf", "jinja2", "markupsafe", "matplotlib", "numpy", "pyyaml", "rich", "scipy"),
    "shapely",
}
#: Debian packages that an installation step needs besides the ROS image and the rosdep keys.
APT = {"python3-venv"}


def pinned(path):
    """Return the pinned version of each library in a requirements file, by name."""
    return dict(re.findall(r"^([\w.-]+)==(\S+)", path.read_text(encoding="utf-8"), re.M))


def instructions():
    """Return the instructions of the Dockerfile as pairs of keyword and arguments."""
    text = (DOCKER / "Dockerfile").read_text(encoding="utf-8")
    text = re.sub(r"^#.*\n", "", text, flags=re.M).replace("\\\n", " ")
    return [line.split(maxsplit=1) for line in text.splitlines() if line]


def steps():
    """Return the separate shell commands of all RUN instructions of the Dockerfile."""
    runs = [words for kind, words in instructions() if kind == "RUN"]
    return [re.sub(r"\s+", " ", step).strip() for run in runs for step in run.split("&&")]


def copied():
    """Return the target of each file that the Dockerfile copies, by source."""
    found = {}
    for kind, words in instructions():
        if kind == "COPY":
            *sources, target = [word for word in words.split() if not word.startswith("--")]
            found |= dict.fromkeys(sources, target)
    return found


def test_pip_installs_what_ubuntu_has_not_in_the_versions_of_the_lock():
    """pip installs each library that Ubuntu lacks, in the version of the lock file.

    The page on installation lists the same versions. numba, pyarrow, rerun-sdk and salib are
    optional and not installed. Ubuntu's Python has setuptools.
    """
    lists, asked = lists_of_setup(), pinned(ROOT / "requirements-ros.txt")
    lock, said = pinned(ROOT / "requirements.lock"), re.findall(r"([\w-]+)==([\w.]+)", PAGE)
    assert asked.items() <= lock.items() >= set(said)
    assert set(asked) <= set(dict(said))
    left_out = {"numba", "pyarrow", "rerun-sdk", "salib", "setuptools"}
    assert set(asked) | FROM_UBUNTU == (lists["CORE"] | lists["ALL"]) - left_out
    assert not set(asked) & FROM_UBUNTU


def test_all_that_the_image_copies_is_there():
    """The Dockerfile copies only existing files, and all files that the build needs."""
    sources = copied()
    assert all((ROOT / source).exists() for source in sources)
    setup = (ROOT / "setup.py").read_text(encoding="utf-8")
    needed = {"cam_rig", "package.xml", "resource", "setup.py", "setup.cfg"}
    needed |= set(re.findall(r'\*share\("(\w+)"\)', setup))
    assert needed <= set(sources)
    for name in needed:
        target = sources[name]
        assert target in {"src/cam_rig/", f"src/cam_rig/{name}"}
        assert (ROOT / name).is_file() == target.endswith("/")


def test_the_image_takes_the_steps_of_the_page():
    """The installation commands of the image are on the page on installation."""
    done = [step.replace("apt-get", "apt") for step in steps()]
    for step in ("rosdep install", "python3 -m venv", "venv/bin/python -m"):
        taken = [one for one in done if one.startswith(step)]
        assert taken
        for command in taken:
            plain = command.replace(" --no-cache-dir", "").replace(" --symlink-install", "")
            assert plain in PAGE.replace(" --symlink-install", ""), command


def test_the_image_installs_nothing_unknown():
    """The image installs only Debian packages and requirements that the page lists.

    Each key that rosdep skips is a dependency in package.xml.
    """
    apt = [step for step in steps() if step.startswith("apt-get install")]
    names = {word for step in apt for word in step.split()[2:] if not word.startswith("-")}
    assert names == APT
    assert all(f" {name}" in PAGE for name in names)
    pip = [step for step in steps() if " pip install" in step]
    assert pip and all(re.search(r"-r src/cam_rig/requirements-ros\.txt$", step) for step in pip)
    package = ElementTree.parse(ROOT / "package.xml")
    keys = {e.text for kind in ("exec_depend", "test_depend") for e in package.iter(kind)}
    skipped = set(re.findall(r'--skip-keys "([^"]*)"', PAGE)[0].split())
    skipped |= set(re.findall(r"--skip-keys ([\w.-]+)", PAGE))
    assert skipped and skipped <= keys


def test_the_image_starts_a_launch_file_that_there_is():
    """The image is based on ROS 2 Lyrical and starts an existing launch file.

    Its entry point is an executable and valid shell script.
    """
    found = dict(instructions())
    assert found["FROM"] == "ros:${DISTRO}-ros-base"
    assert found["ARG"] == "DISTRO=lyrical"
    assert all(name in PAGE for name in ("Lyrical", "Kilted", "Jazzy"))
    assert json.loads(found["ENTRYPOINT"]) == [copied()["docker/entrypoint.sh"]]
    _, _, package, launch, *_ = json.loads(found["CMD"])
    assert package == "cam_rig" and (ROOT / "launch" / launch).is_file()
    entry = DOCKER / "entrypoint.sh"
    assert os.access(entry, os.X_OK)
    assert ended("bash", "-n", entry).returncode == 0


def test_compose_builds_that_image():
    """compose.yaml builds the image of the Dockerfile from the root of the repository.

    The volume contains the folder of the recorded bag, and shared memory has 256 MB.
    """
    compose = yaml.safe_load((DOCKER / "compose.yaml").read_text(encoding="utf-8"))
    (rig,) = compose["services"].values()
    context = (DOCKER / rig["build"]["context"]).resolve()
    assert context == ROOT
    assert (context / rig["build"]["dockerfile"]) == DOCKER / "Dockerfile"
    assert set(rig["build"]["args"]) == {"DISTRO"}
    assert rig["shm_size"] == "256m"
    (volume,) = rig["volumes"]
    bag = Path(json.loads(dict(instructions())["CMD"])[-1].split("=")[1])
    assert Path(volume.split(":")[1]) in bag.parents


# -- layout of the package: unique class names, short files and functions, small folders


PACKAGE = {path: path.read_text(encoding="utf-8") for path in (ROOT / "cam_rig").rglob("*.py")}
MAX_FILE, MAX_FUNCTION = 420, 60
#: Attributes of a statement that contain nested statements.
PARTS = ("body", "orelse", "handlers", "finalbody", "cases")


def defined(node):
    """Yield all classes and functions in a module, including nested definitions."""
    for child in (one for part in PARTS for one in getattr(node, part, ())):
        if isinstance(child, ast.ClassDef | ast.FunctionDef):
            yield child
        yield from defined(child)


@pytest.fixture(scope="module")
def nodes():
    """All classes and functions of cam_rig, with the paths of their files."""
    return [(path, node) for path, text in PACKAGE.items() for node in defined(ast.parse(text))]


def test_a_class_name_is_defined_once(nodes):
    """No two classes of cam_rig have the same name."""
    names = Counter(node.name for _, node in nodes if isinstance(node, ast.ClassDef))
    assert {name: count for name, count in names.items() if count > 1} == {}


def lines_without_docstrings(node, first, last):
    """Return the number of lines of a node of the syntax tree without its docstrings."""
    documented = [
        inner.body[0].end_lineno - inner.body[0].lineno + 1
        for inner in ast.walk(node)
        if isinstance(inner, ast.Module | ast.ClassDef | ast.FunctionDef)
        and ast.get_docstring(inner)
    ]
    return last - first + 1 - sum(documented)


def test_no_file_is_too_long_to_read():
    """Each file of cam_rig has at most 420 lines, not counting docstrings."""
    lines = {
        str(path): lines_without_docstrings(ast.parse(text), 1, len(text.splitlines()))
        for path, text in PACKAGE.items()
    }
    assert {path: count for path, count in lines.items() if count > MAX_FILE} == {}


def test_no_function_is_longer_than_a_screen(nodes):
    """Each function of cam_rig has at most 60 lines, not counting its docstring."""
    lines = {
        f"{path}:{node.name}": lines_without_docstrings(node, node.lineno, node.end_lineno)
        for path, node in nodes
        if isinstance(node, ast.FunctionDef)
    }
    assert {name: count for name, count in lines.items() if count > MAX_FUNCTION} == {}


def test_folders_have_at_most_20_entries():
    """Each folder below cam_rig has at most 20 modules and folders."""
    entries = (ROOT / "cam_rig").rglob("*")
    folders = [path for path in entries if path.is_dir() and path.name != "__pycache__"]
    counts = {
        str(folder): len([p for p in folder.iterdir() if p.suffix == ".py" or p in folders])
        for folder in folders
    }
    assert {folder: count for folder, count in counts.items() if count > 20} == {}

"""Tests of the recipes in the section Extending of docs/architecture.md.

Each test makes the edits of a recipe in a copy of cam_rig, and only in the files that the recipe
lists. The feature that the recipe promises must then work.
"""

import json
import os
import re
import shutil
import sys
from pathlib import Path

import pytest

from ..processes import ended

ROOT = Path(__file__).parents[2]
SLICE = ROOT / "examples" / "least_preload"


class Copy:
    """Copy of cam_rig that a recipe edits. `touched` has the edited files."""

    def __init__(self, folder):
        self.folder, self.touched = folder, set()
        skip = shutil.ignore_patterns("__pycache__", "static")
        for name in ("cam_rig", "config"):
            shutil.copytree(ROOT / name, folder / name, ignore=skip)

    def insert(self, file, before, text):
        """Insert text into a file, before the line of the first occurrence of `before`."""
        path = self.folder / file
        found = path.read_text(encoding="utf-8")
        at = found.rindex("\n", 0, found.index(before)) + 1
        path.write_text(found[:at] + text + found[at:], encoding="utf-8")
        self.touched.add(file)

    def add_slice(self):
        """Add the folder of the example study, and its line in the list of commands."""
        for file in SLICE.glob("*.py"):
            self.add(file, f"cam_rig/studies/least_preload/{file.name}")
        line = '    "least-preload": "cam_rig.studies.least_preload.command",\n'
        self.insert("cam_rig/cli/main.py", '    "vibration": "', line)

    def add(self, source, target):
        """Copy a new file into the copy of cam_rig."""
        path = self.folder / target
        path.parent.mkdir(exist_ok=True)
        shutil.copyfile(source, path)

    def python(self, *arguments):
        """Return the output of a Python process that imports this copy of cam_rig."""
        env = os.environ | {"PYTHONPATH": str(self.folder)}
        done = ended(sys.executable, *arguments, cwd=self.folder, env=env)
        assert done.returncode == 0, done.stderr[-2000:]
        return done.stdout


@pytest.fixture
def copy(tmp_path):
    """Copy of cam_rig in a temporary folder, which a test can change."""
    return Copy(tmp_path)


def recipe(heading):
    """Return the package files that the recipe under a heading of the page lists."""
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    part = text.split(f"### {heading}\n")[1].split("\n### ")[0]
    return set(re.findall(r"`(cam_rig/[^`]*\.py)`", part))


def test_an_experiment_is_a_folder_and_a_line(copy):
    """The recipe for a study adds a folder and a line, which make a new command.

    The command has a table, JSON, a plot and a help text.
    """
    copy.add_slice()
    run = ("-m", "cam_rig.cli.main", "least-preload", "poly345", "bezier15", "--rpm", "480")
    found = json.loads(copy.python(*run, "--json", "-", "--plot", "a.png"))
    least = [row["least"] for row in found["preloads"]]
    assert least == pytest.approx(json.loads(copy.python("-c", FORCE)), rel=1e-6)
    assert (copy.folder / "a.png").stat().st_size > 10_000
    assert "least-preload" in copy.python("-m", "cam_rig.cli.main", "--help")
    assert copy.touched <= recipe("A study")


#: Code that prints the smallest force without the preload, at 100 001 angles.
FORCE = """
import json, numpy as np
from cam_rig import build_law, load_cam, load_rig
p, angle, w = load_rig("paper_table2").follower, np.linspace(0, 2 * np.pi, 100_001), 16 * np.pi
def least(law):
    s, v, a = (law(angle, order) for order in range(3))
    return -(p.mass.si * a * w**2 + p.damping.si * v * w + p.spring_stiffness.si * s).min()
print(json.dumps([least(build_law(load_cam(name))) for name in ("poly345", "bezier15")]))
"""


@pytest.mark.long
def test_an_experiment_is_a_function_of_the_package(copy):
    """The recipe for `import cam_rig` adds a study as a function with three lines.

    The function has the options of the command.
    """
    copy.add_slice()
    face = "cam_rig/__init__.py"
    module = "cam_rig.studies.least_preload.study"
    copy.insert(face, "    from cam_rig.studies.noise", f"    from {module} import least_preload\n")
    copy.insert(face, '    "list_laws": "', f'    "least_preload": "{module}",\n')
    copy.insert(face, '    "load_cam", ', '    "least_preload",\n')
    shutil.copytree(ROOT / "test" / "face", copy.folder / "test" / "face")
    shutil.copy(ROOT / "test" / "processes.py", copy.folder / "test")
    options = ("--import-mode=importlib", "--rootdir=.", "-p", "no:cacheprovider")
    found = copy.python("-m", "pytest", "-v", *options, "test/face", "-k", "command")
    assert "[least-preload] PASSED" in found
    assert copy.touched <= recipe("A study")


@pytest.mark.long
def test_the_report_shows_an_experiment(copy):
    """The recipe for the report adds a study as a section, with a function and a line.

    The section has a figure and a table.
    """
    copy.add_slice()
    copy.add(SLICE / "section.jinja", "cam_rig/report/templates/scene/least_preload.jinja")
    sections = "cam_rig/report/scene.py"
    copy.insert(sections, "def _jump(scene", SECTION)
    copy.insert(
        sections,
        '    Section("numbers",',
        '    Section("scene/least_preload", "Least preload", _least_preload),\n',
    )
    page = copy.python("-c", PAGE)
    assert "## 1 Least preload" in page
    assert "At 480 rpm 1 of 2 cases need more preload" in page and "| poly345 |" in page
    assert copy.touched <= recipe("A study")


SECTION = """def _least_preload(scene: SceneStudies) -> Content:
    from cam_rig.studies.least_preload.study import NULL_PROGRESS, least_preloads

    found = least_preloads(scene.cam_set, [300.0, 480.0], NULL_PROGRESS)
    return Content(found.to_display(), {"preload": found.plot}, {"preloads": found})


"""
PAGE = """
from types import SimpleNamespace
from cam_rig.report.document import Made, render
from cam_rig.report.scene import SECTIONS
from cam_rig.simulation.inputs import resolve_cams
section = next(one for one in SECTIONS if one.key == "least_preload")
content = section.find(SimpleNamespace(cam_set=resolve_cams(["poly345"], None)))
assert content.drawn["preload"][0].startswith("data:image/svg")
print(render("md", "A page", Made("a command"), {section: content}))
"""


@pytest.mark.long
def test_a_goal_of_a_design_is_a_record_and_a_line(copy):
    """The recipe for a design goal adds a quantity with a record and a line.

    A design is a search for a law. The quantity can be its goal, and can have a limit. It is the
    mean of s″² here.
    """
    copy.insert("cam_rig/quantities/catalogue.py", '    _at_speed("shaft_torque"', GOAL)
    copy.insert(
        "cam_rig/studies/design/rows.py",
        '    "shaft_torque": QuantityRows(',
        '    "mean_acceleration": QuantityRows(squares=_rms_acceleration),\n',
    )
    run = ("-m", "cam_rig.cli.main", "design", "poly345", "--pieces", "4", "--minimise")
    new = json.loads(copy.python(*run, "mean_acceleration", "--json", "-"))
    old = json.loads(copy.python(*run, "rms_acceleration", "--json", "-"))
    numbers = [one["measures"][0] for one in (new, old)]
    for key in ("result", "bound"):
        assert numbers[0][key] == pytest.approx(numbers[1][key], rel=1e-9)
    assert copy.touched <= recipe("A goal or a limit of a design, a measure of a campaign")


GOAL = """    LawQuantity(
        "mean_acceleration", "root of the mean of s″²", "mm/rad^2", _DERIVATIVES[1][3],
        values.rms_acceleration, senses=_UPPER,
    ),
"""


@pytest.mark.long
def test_a_column_is_a_line(copy):
    """The recipe for a column adds it to the results of the jump speeds by a line.

    The results are table and JSON.
    """
    file = "cam_rig/studies/jump/comparison.py"
    text = (copy.folder / file).read_text(encoding="utf-8")
    line = next(x for x in text.splitlines() if x.strip().startswith('Column("rpm", "rpm", ".2f"'))
    copy.insert(
        file, line, '            Column("per_s", "1/s", of=lambda row: row.found.rpm / 60),\n'
    )
    run = ("-m", "cam_rig.cli.main", "jump", "poly345", "--json", "-")
    (row,) = json.loads(copy.python(*run))["jump"]
    assert row["per_s"] == pytest.approx(row["rpm"] / 60)


@pytest.mark.long
def test_a_law_known_by_name_is_a_name_and_a_rise(copy):
    """The recipe for a law adds a rise by a name and its Bernstein ordinates.

    Cam files can then use the name.
    """
    file = copy.folder / "cam_rig/schema/segments.py"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace('["poly345", ', '["poly3", "poly345", '), encoding="utf-8")
    copy.touched.add("cam_rig/schema/segments.py")
    copy.insert(
        "cam_rig/laws/segments.py",
        '    "poly345": NamedRise(',
        '    "poly3": NamedRise("3u² − 2u³", np.array([0.0, 0.0, 1.0, 1.0])),\n',
    )
    cam = (copy.folder / "config/cams/poly345.yaml").read_text(encoding="utf-8")
    (copy.folder / "poly3.yaml").write_text(cam.replace("poly345", "poly3"), encoding="utf-8")
    found = json.loads(copy.python("-m", "cam_rig.cli.main", "law", "poly3.yaml", "--json", "-"))
    assert found["curves"][-1]["cam"] == "poly3"
    laws = json.loads(copy.python("-m", "cam_rig.cli.main", "laws", "--json", "-"))
    (rise,) = [one for one in laws["laws"] if one["law"] == "poly3"]
    assert rise["peak_velocity"] == pytest.approx(1.5)
    assert copy.touched <= recipe("A motion law known by name")


@pytest.mark.long
@pytest.mark.ros
def test_a_parameter_of_a_node_is_a_record(copy, ros_domain, monkeypatch):
    """The recipe for a parameter adds it to a node's settings and help by a record."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    copy.insert("cam_rig/nodes/parameters.py", 'Spec("frequency_weighting"', OFFSET)
    arguments = ["--ros-args", "-p", "scene:=quick", "-p", "offset:=3"]
    assert copy.python("-c", NODE, *arguments).splitlines()[-1] == "3.0"
    help_text = copy.python("-m", "cam_rig.nodes.__main__", "microphone", "--help")
    assert "correction of the level, dB" in help_text
    assert copy.touched <= recipe("A parameter of a node")


OFFSET = """            Spec("offset", 0.0, "correction of the level, dB", -20.0, 20.0),
"""
NODE = """
import sys
import rclpy
from cam_rig.nodes.microphone import Microphone
rclpy.init(args=sys.argv)
node = Microphone()
print(node.settings["offset"])
node.destroy_node()
rclpy.shutdown()
"""

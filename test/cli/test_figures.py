"""Figures of all commands: no text is cut, overlaps or is too small.

The cams have long titles, and tiny, large and negative numbers.
"""

import json
import re
import shutil
from textwrap import dedent

import pytest

from cam_rig.schema.load import config_root
from tools.docs.commands import verbs

from ..conftest import scene_data
from .conftest import GOLDEN, done, shipped

TITLE = "A cam whose title is of many more letters than forty: {}"
#: Custom cams: name, shipped file, and a replacement in its text or None.
CAMS = {
    "tiny_3": ("cycloidal", ("given: 0.05, unit: m", "given: 0.02, unit: mm")),
    "bezier_14": ("bezier15", None),
    "arcs_2": ("tm21", None),
    "flat_7": ("flat", None),
    "arm_7": ("oscillating_roller", None),
    "pair_7": ("oscillating_conjugate", None),
    "below_0": ("gunt_gl110", None),
}
#: Commands that draw, with their arguments. The path of the picture is appended.
CASES = [
    "simulate {five} --plot",
    "orders {five} --plot",
    "orders {bezier_14} --rpm 3000 --plot",
    "bounce --restitution 0.7 --rpm 380:460:8 --turns 20 --continuation --plot",
    "bounce --restitution 0.7 --rpm 450 --parameter mass --values 1:2:.2 --turns 20 --plot",
    "bounce {bezier_14} --rig paper_table2 --rpm 300,400 --turns 20 --jobs 1 --plot",
    "bounce --restitution 0.7 --rpm 420 --basins --jobs 1 --plot",
    "jump {five} --plot",
    "jump {tiny_3} --plot",
    "vibration {slow} --plot",
    "contact {five} --plot",
    "law {tiny_3} --out",
    "law {below_0} --out",
    "law worked_example_constant_velocity --out",
    "law b_spline --out",
    "law measured --out",
    "law {tiny_3} {below_0} {bezier_14} {arm_7} {flat_7} --out",
    "laws --plot",
    "design {tiny_3} --minimise peak_jerk --pieces 4 --joints C2 --plot",
    "design {arm_7} --minimise residual_vibration@200-300rpm --pieces 4 --plot",
    "profile {arm_7} --plot",
    "profile {pair_7} --plot",
    "profile {below_0} --plot",
    "compare {golden} {quick} --plot",
    "electronic poly4567 --points 64 --interpolation linear,spline --plot",
    "analyze {golden} --plot",
    "campaign {draws} --jobs 1 --out {draws}.rows --plot",
    "campaign {planes} --jobs 1 --out {planes}.rows --plot",
]
#: Campaigns with many inputs, failing points, points without a jump, and an unattainable limit.
CAMPAIGNS = {
    "draws": """
        vary:
          rig.follower.mass: {normal: 80, unit: "%"}
          rig.follower.preload: {uniform: 100, unit: "%"}
          rig.follower.stem_stiffness: {uniform: 0, unit: "%"}
          rig.radiation.background_corner_frequency: {uniform: 1, unit: "%"}
          cam.follower.base_radius: {uniform: 2, unit: "%"}
          profile.eccentricity.amplitude: {range: [0, 1], unit: mm}
          profile.waviness.amplitude: {range: [0, 1], unit: um}
          profile.waviness.wavelength: {range: [20, 200], unit: deg}
        plan: {kind: latin_hypercube, points: 24}
        measures: [jump_speed, least_contact_force@12000rpm, residual_vibration_steady@200-210rpm]
        limits: [jump_speed>=99999rpm, least_contact_force@12000rpm>=-1e-9N]
        """,
    "planes": """
        vary:
          rig.follower.mass: {values: [-1, 0.5, 5], unit: kg}
          rig.follower.preload: {values: [0.001, 1000], unit: N}
          rig.follower.spring_stiffness: {range: [1, 90000], unit: N/m, count: 4}
          cam.follower.roller_radius: {values: [0.009, 0.0101], unit: m}
        plan: {kind: grid}
        measures: [jump_speed_rigid, peak_torque@450rpm]
        limits: [jump_speed_rigid>=300rpm]
        """,
}
#: Commands whose figures take minutes or need a bench, and the test files that draw them.
ELSEWHERE = {
    "noise": "test_studies.py",
    "fit rig": "../studies/fit_rig/test_command.py",
    "fit cam": "../studies/fit_cam/test_command.py",
    "mark": "../panel/test_lab.py",
}


def retitled(text, name, title):
    """Return the text of a file with another name and title."""
    text = re.sub(r"^name: .*$", f"name: {name}", text, count=1, flags=re.M)
    return re.sub(r"^title: .*$", f"title: '{title}'", text, count=1, flags=re.M)


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """Dict from name to file: cams, scenes and campaigns with long titles, and a bag."""
    root = tmp_path_factory.mktemp("own")
    files = {"golden": GOLDEN}

    def write(folder, name, text):
        (root / folder).mkdir(exist_ok=True)
        files[name] = root / folder / f"{name}.yaml"
        files[name].write_text(text, encoding="utf-8")

    for name, (source, change) in CAMS.items():
        text = retitled(shipped("cams", source), name, TITLE.format(name))
        write("cams", name, text.replace(*change) if change else text)
        assert change is None or change[1] in text.replace(*change)
    for name in ("tm21", "bezier15"):
        write("cams", name, retitled(shipped("cams", name), name, TITLE.format(name)))
    for path in config_root().glob("cams/*.csv"):
        shutil.copy(path, root / "cams")
    quick = shipped("scenes", "quick")
    title = "A scene whose title has many more letters than forty, over a whole figure of 170 mm"
    write("scenes", "quick", retitled(quick, "quick", title))
    five = {"title": title, "cams": ["tiny_3", "bezier_14", "arcs_2", "flat_7", "arm_7"]}
    for name, speeds in (("five", [3, 450, 12000]), ("slow", [3, 200])):
        write("scenes", name, json.dumps(scene_data(name=name, speeds=speeds, **five)))
    for name, text in CAMPAIGNS.items():
        head = f"name: {name}\ntitle: '{title}'\nbase: {{cam: poly345, rig: paper_table2}}\n"
        write("campaigns", name, head + dedent(text))
    return files


@pytest.mark.variants(2)
@pytest.mark.parametrize("case", CASES)
def test_no_figure_is_faulty(case, own, tmp_path):
    """The figure of each command has no cut, overlapping or too small text.

    Titles are long, and numbers tiny, large and negative. The PDF has TrueType fonts.
    """
    picture = tmp_path / "a.pdf"
    done(*case.format_map(own).split(), picture)
    data = picture.read_bytes()
    assert b"/Type3" not in data and b"/FontFile2" in data


@pytest.mark.long
@pytest.mark.slow
def test_no_figure_of_a_page_is_faulty(own, tmp_path):
    """The report of a scene with the same cams has no faulty figure."""
    done("report", own["slow"], "--out", tmp_path / "a.html")


def test_every_command_with_a_plot_is_tested():
    """Each command with --plot is in `CASES` or in a test file of `ELSEWHERE`."""
    drawn = {case.split()[0] for case in CASES}
    options = {
        name: [option for param in verb.params for option in param.opts]
        for name, verb in verbs().items()
    }
    commands = {name for name, names in options.items() if "--plot" in names}
    assert commands <= drawn | set(ELSEWHERE)
    for name, file in ELSEWHERE.items():
        assert name in commands
        text = (config_root().parent / "test" / "cli" / file).read_text(encoding="utf-8")
        assert "--plot" in text

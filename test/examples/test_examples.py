"""Tests that every example runs unchanged.

An example writes pictures or controls the rig.
"""

import ast
import json
import re
import runpy
import sys
from functools import partial
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

EXAMPLES = Path(__file__).parents[2] / "examples"
#: Examples that are ROS nodes and need a running rig.
NODES = {"stop_at_lift_off.py"}
SCRIPTS = sorted({path.name for path in EXAMPLES.glob("*.py")} - NODES)
#: Expected results by script: a part of the output, and the files that it writes into out/.
LEFT = {
    "fit_cam.py": ("farthest from the truth", {"fit_cam.png", "lifts.csv"}),
    "jump_speed.py": ("rpm", {"jump_speed.png"}),
    "own_law.py": ("checks that fail: none", {"own_cam.png", "own_law.png"}),
    "own_rig.py": ("follower.preload: is -5 N; allowed: ", {"bench.yaml", "own_rig.png"}),
    "read_bag.py": ("complete: True", {"read_bag.png"}),
    "simulated_bench.py": ("out/bench: /encoder, /lvdt, /cell", {"bench"}),
    "sweep.py": ("contact is lost from", {"sweep.png"}),
    "vibration.py": ("the follower on its stem", {"vibration.png"}),
    "sound.py": ("dB at 400 rpm (calibrated on poly345)", {"sound.png"}),
}


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """Run each example in a temporary working folder without a screen."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(mpl.rcParams, "backend", "agg")


def test_all_are_known():
    """Each example is tested here and listed in examples/README.md."""
    assert set(LEFT) == set(SCRIPTS)
    listed = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    assert all((EXAMPLES / name).is_file() for name in NODES)
    for path in (*EXAMPLES.glob("*.py"), *EXAMPLES.glob("*.ipynb")):
        assert f"({path.name})" in listed


@pytest.mark.variants(4)
@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_runs(name, tmp_path, capsys):
    """An example script prints its result and writes its pictures."""
    words, pictures = LEFT[name]
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    assert words in capsys.readouterr().out
    assert {path.name for path in (tmp_path / "out").iterdir()} == pictures


@pytest.mark.ros
@pytest.mark.usefixtures("forked")
def test_a_node_stops_the_drive_at_lift_off(start_rig):
    """The example node stops the drive at the first speed with a loss of contact.

    It does not import cam_rig.
    """
    path = EXAMPLES / "stop_at_lift_off.py"
    assert "cam_rig" not in path.read_text(encoding="utf-8")
    rig = start_rig("jump_two_mass", pacing="0.5x", autostart=False)  # runs on for seconds
    node = rig.start_program(sys.executable, str(path))
    listeners = partial(rig.node.get_subscriptions_info_by_topic, "/diagnostics")
    rig.wait_for(lambda: "stop_at_lift_off" in {one.node_name for one in listeners()})
    rig.call("/cam_drive/start")
    rig.wait_for(lambda: node.code is not None, "the end of the node")
    assert "contact lost at 420 rpm" in node.output
    states = int(re.search(r"stopped after (\d+) states", node.output)[1])
    run = rig.read_bag()
    assert not run.complete and len(run.ticks) == states - 1
    assert run.ticks[-1].start.cam == "poly345"


def run_notebook(name):
    """Run the cells of a notebook in one namespace, and return their last expressions.

    The value of a cell that ends with a statement is None.
    """
    notebook = json.loads((EXAMPLES / name).read_text(encoding="utf-8"))
    assert notebook["nbformat"] == 4
    names, values = {}, []
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            tree = ast.parse("".join(cell["source"]))
            last = (
                tree.body.pop()
                if isinstance(tree.body[-1], ast.Expr)
                else ast.parse("None").body[0]
            )
            exec(compile(tree, "cell", "exec"), names)
            values.append(eval(compile(ast.Expression(last.value), "cell", "eval"), names))
    return values


def test_the_notebook_runs(capsys):
    """The notebook of one cam runs and gives its numbers and three figures."""
    values = run_notebook("one_cam.ipynb")
    assert sum(isinstance(value, Figure) for value in values) == 3
    assert values[0] == ("Polynomial 3-4-5", pytest.approx(0.05))
    assert [kind for kind, _ in values[4]] == ["lift-off", "landing"] * 2
    assert "dB at 250 rpm (calibrated on poly345)" in capsys.readouterr().out


#: Expected results by lesson: number of pictures of its notebook, and pairs of a cell's index and
#: the values that the lesson prints as answers.
LESSONS = {
    "1_motion_laws": (1, [(2, [2.074, 8.135, 120.0]), (5, [[1.44, 67.75], [1.59, 95.45]])]),
    "4_vibration": (2, [(0, (156.9, 0.0034))]),
    "5_torsion": (1, [(1, (6.63, -5.52, 0.15)), (3, (0.1392, 79.6, 15.9)), (4, (6.75, 3.11))]),
    "7_gauge_readings": (1, [(1, (8.0, 108.0))]),
    "8_design": (1, [(2, (4.342, 5.833)), (3, 4.342)]),
}


@pytest.mark.parametrize("lesson", LESSONS)
def test_the_notebook_of_a_lesson_runs(lesson):
    """The notebook of a lesson runs and gives the values of the lesson's answers."""
    pictures, shown = LESSONS[lesson]
    values = run_notebook(f"course_{lesson}.ipynb")
    assert sum(isinstance(value, Figure) for value in values) == pictures
    for cell, value in shown:
        np.testing.assert_allclose(values[cell], value, rtol=1e-3)


def test_a_missing_library_is_reported_in_one_line(monkeypatch):
    """A missing library ends a notebook at its first cell, with one line of advice."""
    monkeypatch.setitem(sys.modules, "cam_rig", None)
    for lesson in LESSONS:
        with pytest.raises(SystemExit, match=r"^cam_rig is not installed: `make setup`.*venv$"):
            run_notebook(f"course_{lesson}.ipynb")

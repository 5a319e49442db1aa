"""A type checker of somebody who uses the package sees what its functions take and return."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import cam_rig

#: What a user writes, and what a checker of types must make of it.
SCRIPT = """
import numpy as np

import cam_rig

law = cam_rig.build_law(cam_rig.load_cam("poly345"))
rig = cam_rig.Rig("bench", mass=1.3, spring="3.2 N/mm", preload=30.0).replace(preload="4 N")
cam = cam_rig.Cam(lift="12 mm", segments=[{"law": "dwell"}], follower={"type": "flat"})
reveal_type(law)  # Law
reveal_type(law(np.zeros(3)))  # ndarray
reveal_type(law.derivative())  # Law
reveal_type(law.plot())  # Figure
reveal_type(rig)  # RigConfig
reveal_type(rig.frequency_response(1.0))  # ndarray
reveal_type(cam)  # CamConfig
reveal_type(cam_rig.load_rig("tm21"))  # RigConfig
reveal_type(cam_rig.simulate(law, rig, rpm=450).force)  # ndarray
reveal_type(cam_rig.jump_speed(law, rig).rpm)  # float
reveal_type(cam_rig.jump_speed(law, rig, preload=np.ones(3)))  # JumpSpeeds
reveal_type(cam_rig.sweep([cam, "poly345"], rig, rpm=[300, 400]).by_speed[0].force_peak)  # float
reveal_type(cam_rig.vibration("poly345", rig, 300))  # VibrationResult
reveal_type(cam_rig.orders(cam, rpm=np.arange(3.0)).summary())  # list[str]
reveal_type(cam_rig.design(cam, rig, minimise="a").law)  # Law
reveal_type(cam_rig.design(cam, rig, minimise="a", pareto="b"))  # Front
reveal_type(cam_rig.fit_rig("a.csv", "poly345").identified)  # tuple
reveal_type(cam_rig.compare("bag", "quick").conclusions)  # tuple
"""
WRONG = """
cam_rig.simulate(law, rig, rpm="450")
cam_rig.sweep(cam, rig, rpm=None)
cam_rig.Rig(mass=None, spring=[1.0])
cam_rig.simulat
"""


@pytest.mark.long
@pytest.mark.slow
def test_mypy_sees_every_type_and_every_mistake(tmp_path):
    """Strict, in a folder of his own, as `make setup` installs it; nothing it is shown is Any."""
    file = tmp_path / "own.py"
    file.write_text(SCRIPT + WRONG, encoding="utf-8")
    cache = ("--cache-dir", str(tmp_path / "cache"), "--config-file", "/dev/null")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", *cache, str(file)],
        capture_output=True,
        text=True,
        timeout=600,
        cwd=tmp_path,
        check=False,
    )
    kinds = re.findall(r'own\.py:(\d+): note: Revealed type is "(.*)"', done.stdout)
    lines = (SCRIPT + WRONG).split("\n")
    assert len(kinds) == SCRIPT.count("reveal_type"), done.stdout
    for number, kind in kinds:
        wanted = lines[int(number) - 1].rpartition("# ")[2]
        assert wanted in kind
        assert not kind.startswith("Any")
    wrong = [int(number) for number in re.findall(r"own\.py:(\d+): error", done.stdout)]
    first = SCRIPT.count("\n") + 2
    assert sorted(set(wrong)) == [*range(first, first + 4)], done.stdout


def test_the_package_says_that_it_is_typed():
    """No name of the face is without its type: each stands among the checker's imports."""
    root = Path(cam_rig.__file__).parent
    assert (root / "py.typed").is_file()
    text = (root / "__init__.py").read_text(encoding="utf-8")
    told = set(re.findall(r"(?:import|as|,) (\w+)", text[: text.index("_HOMES")]))
    assert set(cam_rig.__all__) - {"__version__"} <= told
    assert "Any" not in text

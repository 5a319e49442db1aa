"""``import cam_rig``: what it offers, that it is light, and that every printed example is true."""

import doctest
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import cam_rig

#: Modules whose docstrings have examples of public names.
WITH_EXAMPLES = (
    "cam_rig",
    "cam_rig.api.contour",
    "cam_rig.api.files",
    "cam_rig.api.jump",
    "cam_rig.api.motion",
    "cam_rig.api.scene_run",
    "cam_rig.api.sound",
    "cam_rig.dynamics.samples",
    "cam_rig.extras",
    "cam_rig.laws.cam",
    "cam_rig.laws.law",
    "cam_rig.schema.rig",
)


@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_examples_in_docstrings_are_true(module, monkeypatch):
    """Each runs as it is printed, and gives what is printed."""
    monkeypatch.chdir(Path(__file__).parents[2])
    found = doctest.testmod(import_module(module))
    assert found.attempted > 0
    assert found.failed == 0


def test_every_public_function_has_an_example():
    """A name without one cannot be tried from its help."""
    functions = [getattr(cam_rig, name) for name in cam_rig.__all__ if name[0].islower()]
    assert len(functions) == 10
    assert [f.__name__ for f in functions if ">>> " not in f.__doc__] == []


def test_importing_it_imports_no_library():
    """NumPy and all else come with the first name that needs them."""
    code = "import sys, cam_rig; print(sorted({'numpy', 'scipy', 'pydantic'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_name_that_is_not_there_is_an_attribute_error():
    """The same as of any module; and those that are there are listed."""
    with pytest.raises(AttributeError, match="module 'cam_rig' has no attribute 'simulat'"):
        cam_rig.simulat
    assert set(cam_rig.__all__) <= set(dir(cam_rig))

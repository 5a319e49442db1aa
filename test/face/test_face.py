"""``import cam_rig``: what it offers, that it is light, and that every printed example is true."""

import doctest
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import pytest
from matplotlib.figure import Figure

import cam_rig
from cam_rig.show.result import notebook

#: Modules whose docstrings have examples of public names.
WITH_EXAMPLES = (
    "cam_rig",
    "cam_rig.campaigns.run",
    "cam_rig.profile.contour",
    "cam_rig.simulation.scene",
    "cam_rig.dynamics.jump.any_follower",
    "cam_rig.campaigns.largest_waviness",
    "cam_rig.simulation.motion",
    "cam_rig.measured.real_run.run",
    "cam_rig.simulation.scene_run",
    "cam_rig.simulation.sound",
    "cam_rig.dynamics.interval",
    "cam_rig.extras",
    "cam_rig.laws.cam",
    "cam_rig.laws.law",
    "cam_rig.schema.rig",
    "cam_rig.simulation.by_speed",
)


@pytest.mark.variants(9)
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
    assert len(functions) == 14
    assert [f.__name__ for f in functions if ">>> " not in f.__doc__] == []


def test_importing_it_imports_no_library():
    """NumPy and all else come with the first name that needs them."""
    code = "import sys, cam_rig; print(sorted({'numpy', 'scipy', 'pydantic'} & set(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=100
    )
    assert done.stdout.strip() == "[]"


def test_a_name_that_is_not_there_is_an_attribute_error():
    """The same as of any module; and those that are there are listed."""
    with pytest.raises(AttributeError, match="module 'cam_rig' has no attribute 'simulat'"):
        cam_rig.simulat
    assert set(cam_rig.__all__) <= set(dir(cam_rig))


class Shell:
    """IPython as far as pictures are concerned: a printer for each type, by what it makes."""

    def __init__(self, known=()):
        self.printers = {"image/png": Printers(), "image/svg+xml": Printers(known)}
        self.display_formatter = SimpleNamespace(formatters=self.printers)


class Printers:
    """One of its formatters."""

    def __init__(self, known=()):
        self.type_printers = dict.fromkeys(known)

    def for_type(self, kind, function):
        self.type_printers[kind] = function


@pytest.mark.parametrize("known", [(), (Figure,)])
def test_a_notebook_shows_pictures(monkeypatch, known):
    """As PNG, unless the notebook has its own way already."""
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    motion = cam_rig.simulate(law, cam_rig.load_rig("tm21"), rpm=60, turns=1, sample_rate=1000)
    figure, shell = motion.plot(), Shell(known)
    with monkeypatch.context() as patched:
        patched.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
        assert notebook(figure) is figure
    printers = shell.printers["image/png"].type_printers
    assert set(printers) == (set() if known else {Figure})
    assert all(printer(figure).startswith(b"\x89PNG") for printer in printers.values())

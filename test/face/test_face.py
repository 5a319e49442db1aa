"""``import cam_rig``: what it offers, that it is light, and that it gives what commands give."""

import doctest
import inspect
import re
import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

import cam_rig
from cam_rig.arguments import in_python
from cam_rig.cli.main import COMMANDS, command
from cam_rig.errors import ConfigError
from cam_rig.show.command import OUTPUT_OPTIONS
from cam_rig.show.result import enable_notebook_display

from ..processes import ended

#: Where the public names are: their docstrings have examples.
WITH_EXAMPLES = sorted({"cam_rig"} | {getattr(cam_rig, name).__module__ for name in cam_rig._HOMES})


@pytest.mark.variants(13)
@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_examples_in_docstrings_are_true(module, monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[2])
    assert doctest.testmod(import_module(module)).failed == 0


def test_every_public_function_has_an_example():
    functions = [getattr(cam_rig, name) for name in cam_rig.__all__ if name[0].islower()]
    assert functions
    assert [f.__name__ for f in functions if ">>> " not in f.__doc__] == []


def test_importing_it_imports_no_library():
    code = "import sys, cam_rig; print(sorted({'numpy', 'scipy', 'pydantic'} & set(sys.modules)))"
    assert ended(sys.executable, "-c", code).stdout.strip() == "[]"


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'cam_rig' has no attribute 'simulat'"):
        cam_rig.simulat
    assert set(cam_rig.__all__) <= set(dir(cam_rig))


def formatter(*known):
    """One of IPython's: a printer for each type."""
    printers = dict.fromkeys(known)
    return SimpleNamespace(type_printers=printers, for_type=printers.__setitem__)


@pytest.mark.parametrize("known", [(), (Figure,)])
def test_a_notebook_shows_pictures(monkeypatch, known):
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    motion = cam_rig.simulate(law, cam_rig.load_rig("tm21"), rpm=60, turns=1, sample_rate=1000)
    figure, made = motion.plot(), {"image/png": formatter(), "image/svg+xml": formatter(*known)}
    shell = SimpleNamespace(display_formatter=SimpleNamespace(formatters=made))
    with monkeypatch.context() as patched:
        patched.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
        assert enable_notebook_display(figure) is figure
    printers = made["image/png"].type_printers
    assert set(printers) == (set() if known else {Figure})
    assert all(printer(figure).startswith(b"\x89PNG") for printer in printers.values())


GOLDEN = Path(__file__).parents[2] / "bags" / "golden"


@pytest.fixture(scope="module")
def law():
    return cam_rig.build_law(cam_rig.load_cam("poly345"))


@pytest.fixture(scope="module")
def rig():
    return cam_rig.load_rig("paper_table2")


def test_the_jump_speed_is_drawn_where_the_force_is_zero(law, rig, figures):
    found = cam_rig.jump_speed(law, rig)
    assert found.to_pandas()["rpm"].tolist() == [found.rpm]
    (axes,) = found.plot().axes
    rpm, force = axes.lines[0].get_data()
    assert np.interp(found.rpm, rpm, force) == pytest.approx(0.0, abs=0.2)


def test_a_rig_of_other_numbers_is_another(rig):
    changed = rig.with_follower(roller_share=0.3)
    assert changed.follower.roller_share.si == 0.3 and rig.follower.roller_share.si == 0.4


def test_the_points_of_a_contour_are_as_many_as_asked_for_and_cannot_be_changed():
    shape = cam_rig.contour(cam_rig.load_cam("poly345"), points=90)
    assert shape.x.size == shape.y.size == 90
    assert shape.to_pandas()["x"].tolist() == shape.x.tolist()
    with pytest.raises(ValueError, match="read-only"):
        shape.x[0] = 0.0


def test_a_conjugate_cam_has_two_contours(figures):
    shape = cam_rig.contour(cam_rig.load_cam("conjugate"), points=360)
    assert len(shape.discs) == 2
    assert shape.to_pandas()["disc"].nunique() == 2
    (legend,) = shape.plot(positions=12).legends
    assert "follower every 30°" in [text.get_text() for text in legend.get_texts()]
    with pytest.raises(ConfigError, match="positions: is 2; allowed: 3 to 720"):
        shape.plot(positions=2)


def test_a_bag_and_its_scene_give_one_run(figures):
    recording = cam_rig.read_bag(GOLDEN)
    computed = cam_rig.run_scene(recording.loaded)
    assert recording.complete and computed.complete
    assert recording.counts["/cam/state"] > 0 and computed.counts == {}
    table = recording.to_pandas()
    assert list(table)[:4] == ["cam", "rpm", "turns", "level"]
    assert table["level"].tolist()[:4] == recording.noise.curves["tm21"].level_db.tolist()
    (axes,) = recording.plot().axes
    assert axes.get_xlabel() == "cam speed [rpm]"
    recorded, again = recording.samples("tm21", 350), computed.samples("tm21", 350.0)
    away = np.abs(recorded.rows - again.rows).max(axis=1)
    assert (away <= 1e-11 * np.abs(again.rows).max(axis=1)).all()
    np.testing.assert_allclose(np.diff(recorded.time), 1e-3, rtol=0, atol=1e-12)
    with pytest.raises(ValueError, match="read-only"):
        recorded.force[0] = 1.0
    with pytest.raises(ConfigError, match=r"samples: tm21 at 360 rpm; allowed: tm21 at 200 rpm, "):
        recording.samples("tm21", 360)


def test_progress_is_told_tick_by_tick():
    told = []
    run = cam_rig.run_scene("quick", on_tick=lambda: told.append(1))
    assert len(told) == len(run.ticks) == 16


def test_a_cam_is_loaded_by_its_name_or_path():
    path = Path(__file__).parents[2] / "config" / "cams" / "poly345.yaml"
    assert cam_rig.load_cam(path) == cam_rig.load_cam(str(path)) == cam_rig.load_cam("poly345")


# -- what a command computes, one function of it computes, asked by the same names

#: Commands that compute no result: they start nodes, serve pages, or turn one file into another.
NO_COMPUTATION = {
    *("run", "replay", "panel", "view"),
    *("new", "export", "listen", "recover", "report", "urdf"),
}
#: Names of `import cam_rig` that no command has: what results are made of.
PARTS = {
    *("Cam", "CamRigError", "Law", "Rig", "__version__"),
    *("build_law", "load_cam", "load_rig", "load_scene"),
    *("contour", "jump_speed", "plot_law", "simulate", "sound_level", "sweep"),
}
#: Options that say what is drawn or written, which a result is asked for in Python.
FILES = {
    "bounce": {"basins"},  # a function of its own, `cam_rig.studies.bounce.basins`
    "contact": {"events", "sharpest"},
    "fit sound": {"dry-run"},
    "law": {"out", "save"},
    "compare": {"save"},
    "orders": {"save"},
    "design": {"out"},  # `text` of a design is the file
    "profile": {
        *("out", "positions", "pitch", "cutter", "tolerance", "points", "from", "force"),
        *("unit", "axis", "zero", "mirrored", "layer", "align"),
    },
}
#: Where processes are asked for, a function takes an executor, and how many it has.
WORKPLACE = {"jobs", "dask"}
#: Arguments of a command by their name in Python; one that stands first in both may differ.
IN_PYTHON_ALONE = {"progress", "executor", "workers", "on_tick"}


def verbs():
    """Every command and subcommand, as click knows it."""
    for name in COMMANDS:
        found = command(name)
        parts = getattr(found, "commands", None)
        yield from (
            [(name, found)]
            if parts is None
            else ((f"{name} {word}", one) for word, one in parts.items())
        )


VERBS = dict(verbs())
COMPUTING = sorted(set(VERBS) - NO_COMPUTATION)


def named_in_help(verb):
    """The function that a command's help names."""
    found = re.search(r"In Python: cam_rig\.(\w+)\(", VERBS[verb].help)
    assert found, f"the help of {verb} names no function: In Python: cam_rig.NAME(…)"
    return found[1]


def test_every_command_is_known():
    assert set(VERBS) >= NO_COMPUTATION
    for verb in NO_COMPUTATION:
        assert "In Python" not in VERBS[verb].help


@pytest.mark.parametrize("verb", COMPUTING)
def test_a_command_names_its_function_whose_parameters_are_its_options(verb):
    """So what refuses an option refuses the parameter in Python, by its name.

    What the words of the help show as arguments are parameters of the function, whose docstring
    names the command.
    """
    function = getattr(cam_rig, named_in_help(verb))
    assert f"cam-rig {verb}" in function.__doc__
    parameters = set(inspect.signature(function).parameters)
    shown = re.search(r"In Python: cam_rig\.\w+\((.*?)\)", VERBS[verb].help, re.S)[1]
    assert {word.strip() for word in shown.split(",")} - {"…"} <= parameters
    options, arguments = set(), []
    for one in VERBS[verb].params:
        name = max(one.opts, key=len).removeprefix("--")
        if one.param_type_name == "argument":
            arguments.append(name)
        elif (
            name not in {*OUTPUT_OPTIONS, "help", *WORKPLACE, *FILES.get(verb, ())}
            and not one.hidden
        ):
            refused = in_python(f"--{name}: is wrong", parameters)
            options.add(refused.removesuffix(": is wrong"))
    assert options <= parameters
    first = list(inspect.signature(function).parameters)[: len(arguments)]
    known = {*options, *arguments, *first, *IN_PYTHON_ALONE}
    assert parameters - known == set()
    if any(one.name in WORKPLACE for one in VERBS[verb].params):
        assert "executor" in parameters


def test_every_function_is_of_a_command_or_a_part():
    """And the other way round."""
    assert {named_in_help(verb) for verb in COMPUTING} == set(cam_rig.__all__) - PARTS


# -- a type checker of somebody who uses the package sees what its functions take and return


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
reveal_type(cam_rig.plot_law(law))  # Figure
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
reveal_type(cam_rig.compare("bag", "quick").speeds)  # tuple
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
    options = ["--strict", "--follow-imports=silent", "--config-file", "/dev/null"]
    command = [sys.executable, "-m", "mypy", *options, "--cache-dir", tmp_path / "cache", file]
    done = ended(*command, timeout=600, cwd=tmp_path)
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

"""Tests of ``import cam_rig``: public names, import time, commands and types."""

import doctest
import inspect
import re
import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas
import pytest
from matplotlib.figure import Figure

import cam_rig
from cam_rig.arguments import name_parameters
from cam_rig.cli.main import COMMANDS, command
from cam_rig.errors import ConfigError
from cam_rig.show.command import OUTPUT_OPTIONS
from cam_rig.show.result import enable_notebook_display

from ..processes import ended

#: Modules that define public names. Their docstrings contain examples.
WITH_EXAMPLES = sorted({"cam_rig"} | {getattr(cam_rig, name).__module__ for name in cam_rig._HOMES})


@pytest.mark.variants(13)
@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_examples_in_docstrings_are_correct(module, monkeypatch):
    """The examples in the docstrings of a public module print what they show."""
    monkeypatch.chdir(Path(__file__).parents[2])
    assert doctest.testmod(import_module(module)).failed == 0


def test_every_public_function_has_an_example():
    """The docstring of each public function contains an example."""
    functions = [getattr(cam_rig, name) for name in cam_rig.__all__ if name[0].islower()]
    assert functions
    assert [f.__name__ for f in functions if ">>> " not in f.__doc__] == []


def test_import_does_not_import_libraries():
    """`import cam_rig` imports neither NumPy nor SciPy nor pydantic."""
    code = "import sys, cam_rig; print(sorted({'numpy', 'scipy', 'pydantic'} & set(sys.modules)))"
    assert ended(sys.executable, "-c", code).stdout.strip() == "[]"


def test_unknown_name_is_an_attribute_error():
    """An unknown name raises AttributeError, and `dir` lists every public name."""
    with pytest.raises(AttributeError, match="module 'cam_rig' has no attribute 'simulat'"):
        cam_rig.simulat
    assert set(cam_rig.__all__) <= set(dir(cam_rig))


def formatter(*known):
    """Return a fake formatter of IPython with a printer for each type."""
    printers = dict.fromkeys(known)
    return SimpleNamespace(type_printers=printers, for_type=printers.__setitem__)


@pytest.mark.parametrize("known", [(), (Figure,)])
def test_notebook_displays_figures(monkeypatch, known):
    """In a notebook figures are displayed as PNG, unless a printer is already set."""
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
    """Law of the cam poly345."""
    return cam_rig.build_law(cam_rig.load_cam("poly345"))


@pytest.fixture(scope="module")
def rig():
    """Rig with the parameters of table 2 of the paper."""
    return cam_rig.load_rig("paper_table2")


def test_plotted_force_is_zero_at_the_jump_speed(law, rig, figures):
    """The plotted contact force crosses zero at the jump speed, within 0.2 N.

    The tolerance is that of the interpolation between the points of the plot.
    """
    jump = cam_rig.jump_speed(law, rig)
    assert jump.to_pandas()["rpm"].tolist() == [jump.rpm]
    (axes,) = jump.plot().axes
    rpm, force = axes.lines[0].get_data()
    assert np.interp(jump.rpm, rpm, force) == pytest.approx(0.0, abs=0.2)


def test_with_follower_does_not_change_the_rig(rig):
    """`with_follower` returns a changed rig and does not change the original."""
    changed = rig.with_follower(roller_share=0.3)
    assert changed.follower.roller_share.si == 0.3 and rig.follower.roller_share.si == 0.4


def test_contour_has_the_requested_number_of_read_only_points():
    """`contour` returns the requested number of points in read-only arrays."""
    shape = cam_rig.contour(cam_rig.load_cam("poly345"), points=90)
    assert shape.x.size == shape.y.size == 90
    assert shape.to_pandas()["x"].tolist() == shape.x.tolist()
    with pytest.raises(ValueError, match="read-only"):
        shape.x[0] = 0.0


def test_conjugate_cam_has_two_contours(figures):
    """The contour of a conjugate cam has two discs, also in its table and figure.

    An invalid number of drawn follower positions is refused.
    """
    shape = cam_rig.contour(cam_rig.load_cam("conjugate"), points=360)
    assert len(shape.discs) == 2
    assert shape.to_pandas()["disc"].nunique() == 2
    (legend,) = shape.plot(positions=12).legends
    assert "follower every 30°" in [text.get_text() for text in legend.get_texts()]
    with pytest.raises(ConfigError, match="positions must be between 3 and 720, got 2"):
        shape.plot(positions=2)


def test_bag_and_scene_give_the_same_run(figures):
    """A run read from a bag has the table and samples of the simulated scene."""
    recording = cam_rig.read_bag(GOLDEN)
    computed = cam_rig.run_scene(recording.loaded)
    assert recording.complete and computed.complete
    assert recording.counts["/cam/state"] > 0 and computed.counts == {}
    table = recording.to_pandas()
    assert list(table)[:4] == ["cam", "rpm", "turns", "level"]
    assert table["level"].tolist()[:4] == recording.noise.curves["tm21"].level_db.tolist()
    (axes,) = recording.plot().axes
    assert axes.get_xlabel() == "cam speed [rpm]"
    recorded, simulated = recording.samples("tm21", 350), computed.samples("tm21", 350.0)
    difference = np.abs(recorded.rows - simulated.rows).max(axis=1)
    assert (difference <= 1e-11 * np.abs(simulated.rows).max(axis=1)).all()
    np.testing.assert_allclose(np.diff(recorded.time), 1e-3, rtol=0, atol=1e-12)
    with pytest.raises(ValueError, match="read-only"):
        recorded.force[0] = 1.0
    with pytest.raises(
        ConfigError, match=r"must be of one of tm21 at 200 rpm, .*got tm21 at 360 rpm"
    ):
        recording.samples("tm21", 360)


def test_on_tick_is_called_at_each_tick():
    """`run_scene` calls `on_tick` once per tick, 16 times for the scene quick."""
    calls = []
    run = cam_rig.run_scene("quick", on_tick=lambda: calls.append(1))
    assert len(calls) == len(run.ticks) == 16


def test_cam_is_loaded_by_name_or_path():
    """A cam is loaded equally by its name, by a path and by the text of a path."""
    path = Path(__file__).parents[2] / "config" / "cams" / "poly345.yaml"
    assert cam_rig.load_cam(path) == cam_rig.load_cam(str(path)) == cam_rig.load_cam("poly345")


# -- each command that computes has a function with the same parameter names

#: Commands without a result: they start nodes, serve pages, or convert files.
NO_COMPUTATION = {
    *("run", "replay", "panel", "lab", "mark", "view"),
    *("new", "export", "listen", "recover", "report", "urdf"),
}
#: Public names without a command of the same name, which are parts of a computation.
PARTS = {
    *("Cam", "CamRigError", "Law", "Rig", "__version__"),
    *("build_law", "list_cams", "list_rigs", "load_cam", "load_rig", "load_scene"),
    *("contour", "jump_speed", "plot_law", "read_electronic", "simulate", "sound_level", "sweep"),
}
#: Options for figures and files by command. In Python they are methods of the result.
FILES = {
    "analyze": {"table"},  # display only
    "simulate": {"table"},
    "bounce": {"basins"},  # a separate function, `cam_rig.studies.bounce.basins`
    "contact": {"events", "min-radius"},
    "fit sound": {"dry-run"},
    "law": {"out", "save"},
    "compare": {"save"},
    "orders": {"save"},
    "electronic": {"out", "read", "as"},  # `text`, and the function `read_electronic`
    "design": {"out"},  # the attribute `text` of a design is the file
    "profile": {
        *("out", "positions", "pitch", "cutter", "tolerance", "points", "from", "force"),
        *("unit", "axis", "zero", "mirrored", "layer", "align"),
    },
}
#: Options for parallel processes, in place of the parameters executor and workers.
WORKERS = {"jobs", "dask"}
#: Parameters without an option.
ONLY_IN_PYTHON = {"progress", "executor", "workers", "on_tick"}


def verbs():
    """Yield every command and subcommand as a click object, with its name."""
    for name in COMMANDS:
        verb = command(name)
        parts = getattr(verb, "commands", None)
        yield from (
            [(name, verb)]
            if parts is None
            else ((f"{name} {word}", part) for word, part in parts.items())
        )


VERBS = dict(verbs())
COMPUTING = sorted(set(VERBS) - NO_COMPUTATION)


def named_in_help(verb):
    """Return the name of the function in the help of a command."""
    match = re.search(r"In Python: cam_rig\.(\w+)\(", VERBS[verb].help)
    assert match, f"the help of {verb} names no function: In Python: cam_rig.NAME(…)"
    return match[1]


def test_every_command_is_known():
    """The help of a command without a result refers to no Python function."""
    assert set(VERBS) >= NO_COMPUTATION
    for verb in NO_COMPUTATION:
        assert "In Python" not in VERBS[verb].help


@pytest.mark.parametrize("verb", COMPUTING)
def test_command_names_its_function_whose_parameters_are_its_options(verb):
    """The function in the help of a command has the options as parameters.

    Thus an error message about an option is also correct for the parameter. The docstring of the
    function contains the command.
    """
    function = getattr(cam_rig, named_in_help(verb))
    assert f"cam-rig {verb}" in function.__doc__
    parameters = set(inspect.signature(function).parameters)
    shown = re.search(r"In Python: cam_rig\.\w+\((.*?)\)", VERBS[verb].help, re.S)[1]
    assert {word.strip() for word in shown.split(",")} - {"…"} <= parameters
    options, arguments = set(), []
    for param in VERBS[verb].params:
        name = max(param.opts, key=len).removeprefix("--")
        if param.param_type_name == "argument":
            arguments.append(name)
        elif (
            name not in {*OUTPUT_OPTIONS, "help", *WORKERS, *FILES.get(verb, ())}
            and not param.hidden
        ):
            refused = name_parameters(f"--{name}: is wrong", parameters)
            options.add(refused.removesuffix(": is wrong"))
    assert options <= parameters
    first = list(inspect.signature(function).parameters)[: len(arguments)]
    # the first parameters are the arguments of the command, and can have other names
    expected = {*options, *arguments, *first, *ONLY_IN_PYTHON}
    assert parameters - expected == set()
    if any(param.name in WORKERS for param in VERBS[verb].params):
        assert "executor" in parameters


def test_every_function_belongs_to_a_command_or_is_a_part():
    """Each public function is in the help of a command, or is listed in `PARTS`."""
    assert {named_in_help(verb) for verb in COMPUTING} == set(cam_rig.__all__) - PARTS


# -- figures in a user's figure, floats of a rig, torque, data frames, standard errors


@pytest.mark.parametrize("layout", ["constrained", None])
def test_plot_into_axes(law, rig, layout):
    """`plot(ax=)` draws all panels in place of the axes, and returns the figure of the axes."""
    figure = Figure(figsize=(14.0, 10.0), layout=layout)
    (first, second), (third, fourth) = figure.subplots(2, 2)
    fourth.plot([1.0, 2.0], [1.0, 2.0])
    motion = cam_rig.simulate(law, rig, rpm=300, turns=1, sample_rate=2000)
    assert motion.plot(ax=first) is figure
    assert cam_rig.plot_law(law, ax=second) is figure
    assert cam_rig.contour("poly345").plot(ax=third, positions=12) is figure
    assert [len(part.axes) for part in figure.subfigs] == [2, 4, 3]
    assert len(figure.axes) == 10 and fourth in figure.axes
    figure.draw_without_rendering()
    assert len(motion.plot().axes) == 2  # a new figure again
    with pytest.raises(cam_rig.CamRigError, match="ax must be axes of a grid"):
        motion.plot(ax=figure.add_axes((0.0, 0.0, 0.1, 0.1)))


def test_numbers_of_a_rig_are_floats_in_si():
    """The numbers of the follower are attributes of the rig in SI units, or None."""
    rig = cam_rig.Rig(mass="1300 g", spring="3.2 N/mm", preload=30.0)
    assert (rig.mass, rig.spring_stiffness, rig.damping, rig.preload) == (1.3, 3200.0, 0.0, 30.0)
    assert rig.stem_stiffness is rig.roller_share is rig.stem_damping is rig.restitution is None
    tm21 = cam_rig.load_rig("tm21")
    for key, number in tm21.follower:
        assert getattr(tm21, key) == (None if number is None else number.si)


def test_shipped_names_can_be_loaded():
    """`list_cams` and `list_rigs` return the names that `load_cam` and `load_rig` accept."""
    assert [cam_rig.load_cam(name).name for name in cam_rig.list_cams()] == cam_rig.list_cams()
    assert [cam_rig.load_rig(name).name for name in cam_rig.list_rigs()] == cam_rig.list_rigs()


def test_torque_of_a_motion_and_in_an_export(tmp_path):
    """The torque is F s′: its peak is that of the row by speed, in a motion and in a file."""
    run = cam_rig.read_bag(GOLDEN)
    row = run.by_speed[4]
    run.export(tmp_path / "a.npz", cam=row.cam, rpm=row.rpm)
    with np.load(tmp_path / "a.npz") as columns:
        assert columns["torque_N_m"].max() == pytest.approx(row.peak_torque, rel=1e-9)
    motion = cam_rig.simulate(row.cam, "tm21", rpm=row.rpm, turns=2, sample_rate=1000)
    assert motion.torque.max() == pytest.approx(row.peak_torque, rel=1e-3)
    assert np.array_equal(motion.to_pandas()["torque"], motion.torque)


def test_fit_cam_of_a_data_frame(tmp_path):
    """A data frame gives the same fit as the file with its content."""
    rows = {"angle [deg]": [5.0 * i for i in range(72)], "lift [mm]": [i % 36 for i in range(72)]}
    frame = pandas.DataFrame(rows)
    frame.to_csv(tmp_path / "a.csv", index=False)
    fits = [cam_rig.fit_cam(table, tolerance=1e-3) for table in (frame, tmp_path / "a.csv")]
    assert np.array_equal(fits[0].law.ordinates, fits[1].law.ordinates)


def test_standard_error_of_a_jump_speed():
    """The standard error is the spread of the jump speeds of many rigs, to first order."""
    rig, draws = cam_rig.load_rig("tm21"), np.random.default_rng(1).normal(size=(2, 400))
    draws -= draws.mean(axis=1, keepdims=True)
    draws = np.linalg.solve(np.linalg.cholesky(draws @ draws.T / draws.shape[1]), draws)
    errors = {"mass": 0.01, "preload": 0.5}
    jump = cam_rig.jump_speed("poly345", rig, standard_errors=errors)
    many = cam_rig.jump_speed(
        "poly345", rig, mass=rig.mass + 0.01 * draws[0], preload=rig.preload + 0.5 * draws[1]
    )
    assert jump.standard_error == pytest.approx(many.rpm.std(), rel=0.02)
    assert f"± {jump.standard_error:.2g} rpm" in repr(jump)
    assert cam_rig.jump_speed("poly345", rig).standard_error is None
    assert cam_rig.jump_speed("poly345", rig, standard_errors={"mass": 0.0}).standard_error == 0.0
    for wrong in ({"mas": 1.0}, {"mass": -1.0}, {"stem_damping": 1.0}):
        with pytest.raises(cam_rig.CamRigError, match="standard_errors must be numbers"):
            cam_rig.jump_speed("poly345", rig, standard_errors=wrong)
    with pytest.raises(cam_rig.CamRigError, match="cannot be combined with mass"):
        cam_rig.jump_speed("poly345", rig, mass=2.0, standard_errors=errors)


# -- a type checker of a user's code knows the types of parameters and results


#: Script of a user. Each comment is the type that a type checker must find.
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
reveal_type(cam_rig.sweep([cam, "poly345"], rig, rpm=[300, 400]).by_speed[0].peak_force)  # float
reveal_type(cam_rig.vibration("poly345", rig, 300))  # VibrationResult
reveal_type(cam_rig.order_spectrum(cam, rpm=np.arange(3.0)).summary())  # list[str]
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
def test_mypy_reports_every_type_and_every_mistake(tmp_path):
    """mypy --strict finds the types of a user's script, and each of its mistakes.

    No type is Any.
    """
    file = tmp_path / "own.py"
    file.write_text(SCRIPT + WRONG, encoding="utf-8")
    options = ["--strict", "--follow-imports=silent", "--config-file", "/dev/null"]
    command = [sys.executable, "-m", "mypy", *options, "--cache-dir", tmp_path / "cache", file]
    done = ended(*command, timeout=600, cwd=tmp_path)
    kinds = re.findall(r'own\.py:(\d+): note: Revealed type is "(.*)"', done.stdout)
    lines = (SCRIPT + WRONG).split("\n")
    assert len(kinds) == SCRIPT.count("reveal_type"), done.stdout
    for number, kind in kinds:
        expected = lines[int(number) - 1].rpartition("# ")[2]
        assert expected in kind
        assert not kind.startswith("Any")
    wrong = [int(number) for number in re.findall(r"own\.py:(\d+): error", done.stdout)]
    first = SCRIPT.count("\n") + 2
    assert sorted(set(wrong)) == [*range(first, first + 4)], done.stdout


def test_package_is_typed():
    """The package is marked as typed, and type checkers see each public name."""
    root = Path(cam_rig.__file__).parent
    assert (root / "py.typed").is_file()
    text = (root / "__init__.py").read_text(encoding="utf-8")
    imported = set(re.findall(r"(?:import|as|,) (\w+)", text[: text.index("_HOMES")]))
    assert set(cam_rig.__all__) - {"__version__"} <= imported
    assert "Any" not in text

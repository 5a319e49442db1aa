"""What a command computes, one function of `import cam_rig` computes, asked by the same names."""

import inspect
import re

import pytest

import cam_rig
from cam_rig.arguments import in_python
from cam_rig.cli.main import COMMANDS, command
from cam_rig.show.command import OUTPUTS

#: Commands that compute no result: they start nodes, serve pages, or turn one file into another.
NO_COMPUTATION = {
    *("run", "replay", "panel", "view"),
    *("new", "export", "listen", "recover", "report", "urdf"),
    *("calibrate", "identify"),  # they write what they find into a rig's or a cam's file
}
#: Names of `import cam_rig` that no command has: what results are made of.
PARTS = {
    *("Cam", "CamRigError", "Law", "Rig", "__version__"),
    *("build_law", "load_cam", "load_rig", "load_scene"),
    *("contour", "jump_speed", "simulate", "sound_level", "sweep"),
    "largest_waviness",  # an option of campaign
}
#: Options that say what is drawn or written, which a result is asked for in Python.
FILES = {
    "bounce": {"basins"},  # a function of its own, `cam_rig.bounce.basins`
    "contact": {"events", "sharpest"},
    "law": {"out", "save"},
    "compare": {"save"},
    "orders": {"save"},
    "design": {"out"},  # `text` of a design is the file
    "campaign": {"largest-waviness"},
    "profile": {"out", "positions", "pitch", "cutter", "tolerance", "points", "from", "force"},
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
    return re.search(r"In Python: cam_rig\.(\w+)\(", VERBS[verb].help)[1]


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
        elif name not in {*OUTPUTS, "help", *WORKPLACE, *FILES.get(verb, ())} and not one.hidden:
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

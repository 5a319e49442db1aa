"""Every command that the documents name is one: verb, options, make target, node."""

from __future__ import annotations

import re

import pytest

from cam_rig.cli.main import COMMANDS, command
from tools.docs.commands import PAGE, page

from .pages import PAGES, ROOT, commands, text

VERBS = {name: command(name) for name in COMMANDS}
IDS = [p.name for p in PAGES]


def test_the_page_of_commands_is_that_of_today():
    """It is what --help says; else run ``make docs``."""
    assert text(PAGE) == page()


@pytest.mark.parametrize("document", PAGES, ids=IDS)
def test_cam_rig_commands_parse(document):
    """Each verb exists and takes the options given, with values of their types."""
    for verb, *arguments in commands(document, "cam-rig"):
        if verb.isupper():
            continue
        assert verb in VERBS, f"{document.name}: cam-rig {verb}"
        if arguments and "[OPTIONS]" not in arguments:
            VERBS[verb].make_context(verb, list(arguments))


@pytest.mark.parametrize("document", PAGES, ids=IDS)
def test_make_targets_exist(document):
    """Each target stands in the Makefile."""
    makefile = text(ROOT / "Makefile")
    for target, *_ in commands(document, "make"):
        assert re.search(rf"^{target}:", makefile, re.M), f"{document.name}: make {target}"


@pytest.mark.parametrize("document", PAGES, ids=IDS)
def test_ros_commands_name_what_is_installed(document):
    """ros2 run names a node of setup.py, ros2 launch a file of launch/."""
    for _, name, *_ in (c[:3] for c in commands(document, "ros2 run")):
        assert re.search(rf'"{name}( =|")', text(ROOT / "setup.py"))
    for _, name, *_ in (c[:3] for c in commands(document, "ros2 launch")):
        assert (ROOT / "launch" / name).is_file()


def test_scripts_exist():
    """Every ``python path`` and every module run with -m."""
    for document in PAGES:
        for path in re.findall(r"python ((?:tools|benchmark)/[\w/]+\.py)", text(document)):
            assert (ROOT / path).is_file(), f"{document.name}: {path}"


def test_extras_exist():
    """Every ``cam_rig[extra]`` is one of setup.py."""
    setup = text(ROOT / "setup.py")
    for document in PAGES:
        for extra in re.findall(r"cam_rig\[([\w-]+)\]", text(document)):
            assert f'"{extra}": ' in setup, f"{document.name}: cam_rig[{extra}]"

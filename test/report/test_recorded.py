"""Tests of the comparison of a bag with its scene, and of equations in MathML."""

import re
import shutil
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from cam_rig.errors import BagError
from cam_rig.report.document import environment
from cam_rig.report.equations import mathml
from cam_rig.report.sections import read_recorded
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.simulate import simulate, step_levels


@pytest.fixture
def quick(config_dir):
    """Scene of the golden bag."""
    return open_scene(config_dir / "scenes" / "quick.yaml")


@pytest.fixture
def golden(config_dir):
    """Golden bag, the reference recording of that scene."""
    return config_dir.parent / "bags" / "golden"


def test_recorded_levels_equal_simulated_levels(quick, golden):
    """The levels of the golden bag equal those of a simulation to 1e-9 dB."""
    recorded = read_recorded(golden, quick)
    levels = step_levels(simulate(quick), quick.scene.schedule.transient_turns.si)
    assert recorded.level_db.keys() == levels.keys()
    for cam, steps in levels.items():
        expected = np.array([steps[speed] for speed in sorted(steps)])
        assert recorded.level_db[cam] == pytest.approx(expected, abs=1e-9)


def test_bag_of_another_scene_is_refused(golden, config_dir):
    """A bag of another scene is refused.

    The error contains both scenes and the command that records a bag.
    """
    loaded = open_scene(config_dir / "scenes" / "tm21_sweep.yaml")
    with pytest.raises(BagError, match=r"of the scene 'tm21_sweep', got 'quick'; .*cam-rig run"):
        read_recorded(golden, loaded)


def test_bag_of_a_changed_rig_is_refused(quick, golden):
    """A bag is refused if the preload in the rig file has changed since.

    A changed title of the rig is accepted.
    """
    other = replace(quick, rig=quick.rig.with_follower(preload=99.0))
    with pytest.raises(BagError, match="recorded with another follower than the files have now"):
        read_recorded(golden, other)
    renamed = replace(quick, rig=quick.rig.model_copy(update={"title": "another"}))
    assert read_recorded(golden, renamed).messages > 0


def test_truncated_bag_is_refused(quick, golden, tmp_path):
    """A truncated bag is refused, and the error suggests cam-rig recover."""
    bag = shutil.copytree(golden, tmp_path / "golden")
    (file,) = bag.glob("*.mcap")
    file.write_bytes(file.read_bytes()[:60_000])
    with pytest.raises(BagError, match=r"was not closed; .*cam-rig recover"):
        read_recorded(bag, quick)


# -- equations of a page: conversion of a line of text to MathML


def tree(text):
    """Convert a line to MathML, parse it as XML, and return its first child."""
    return ElementTree.fromstring(mathml(text))[0]


def shape(element):
    """Return an element as nested tuples with the tag first, or its text."""
    return element.text if element.text else (element.tag, *map(shape, element))


def test_products_and_sums():
    """A sum of products becomes variables with dots and primes, numbers and signs."""
    assert shape(tree("m ẍ + 2 c s′ = 0")) == (
        *("mrow", "m", ("mover", "x", "¨"), "+", "2", "c", ("msup", "s", "′"), "=", "0"),
    )


@pytest.mark.parametrize("text, inside", [
    ("k_s", ("msub", "k", "s")),
    ("q^2", ("msup", "q", "2")),
    ("p_rms^2", ("msubsup", "p", "rms", "2")),
    ("a^2_b", ("msubsup", "a", "b", "2")),
    ("e^(i θ)", ("msup", "e", ("mrow", "i", "θ"))),
    ("Σ_n", ("msub", "Σ", "n")),
    ("√(2)", ("msqrt", ("mrow", "2"))),
    ("x^2/q", ("mfrac", ("msup", "x", "2"), "q")),
    ("(a + b)/(2 c)", ("mfrac", ("mrow", "a", "+", "b"), ("mrow", "2", "c"))),
    ("(a)", ("mrow", "(", ("mrow", "a"), ")")),
])  # fmt: skip
def test_parts(text, inside):
    """Subscripts, superscripts, roots and fractions become elements of MathML.

    Brackets that only group their content are omitted.
    """
    assert shape(tree(text)) == ("mrow", inside)


def test_lines_and_signs():
    """Each line becomes an equation, and characters of HTML markup are escaped."""
    assert mathml("a < b\n\nc & d\n").count("<math ") == 2
    assert tree("a < b")[1].text == "<"


#: Templates of the report on the paper.
PAPER = Path(__file__).parents[2] / "examples" / "paper" / "templates"


def test_equations_of_all_templates_are_well_formed():
    """Each equation of a template has closed brackets.

    Its fractions, subscripts and superscripts are complete.
    """
    count = 0
    templates = environment("html", PAPER)
    for name in templates.list_templates():
        source = templates.loader.get_source(templates, name)[0]
        for text in re.findall(
            r"{% call page.equation\(\) %}(.*?){% endcall %}", source, re.DOTALL
        ):
            for line in filter(str.strip, text.splitlines()):
                assert line.count("(") == line.count(")"), line
                assert not any(
                    a.tag in ("mfrac", "msub", "msup") and len(a) != 2 for a in tree(line).iter()
                ), line
                count += 1
    assert count > 20

"""A recording beside the run: the same levels, or a refusal that says what is wrong with it."""

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
    """The scene of the golden bag."""
    return open_scene(config_dir / "scenes" / "quick.yaml")


@pytest.fixture
def golden(config_dir):
    """A recording of it."""
    return config_dir.parent / "bags" / "golden"


def test_recorded_levels_are_the_simulated(quick, golden):
    """Node graph and one process: the same numbers."""
    found = read_recorded(golden, quick)
    levels = step_levels(simulate(quick), quick.scene.program.settle_turns.si)
    assert found.level_db.keys() == levels.keys()
    for cam, steps in levels.items():
        expected = np.array([steps[speed] for speed in sorted(steps)])
        assert found.level_db[cam] == pytest.approx(expected, abs=1e-9)


def test_bag_of_another_scene(golden, config_dir):
    """The scene it is of, the scene it should be of, and what to do."""
    loaded = open_scene(config_dir / "scenes" / "tm21_sweep.yaml")
    with pytest.raises(BagError, match=r"scene 'quick'; allowed: of 'tm21_sweep'.*cam-rig run"):
        read_recorded(golden, loaded)


def test_bag_of_an_older_rig(quick, golden):
    """The same scene on a rig whose preload was changed since; words may change."""
    other = replace(quick, rig=quick.rig.with_follower(preload=99.0))
    with pytest.raises(BagError, match="recorded with another follower than the files have now"):
        read_recorded(golden, other)
    renamed = replace(quick, rig=quick.rig.model_copy(update={"title": "another"}))
    assert read_recorded(golden, renamed).messages > 0


def test_truncated_bag(quick, golden, tmp_path):
    """Half a file is no recording."""
    bag = shutil.copytree(golden, tmp_path / "golden")
    (file,) = bag.glob("*.mcap")
    file.write_bytes(file.read_bytes()[:60_000])
    with pytest.raises(BagError, match=r"was not closed: .*cam-rig recover"):
        read_recorded(bag, quick)


# -- equations of a page: what a line of text becomes in MathML -------------------------------


def tree(text):
    """The only row of a line; not well-formed XML is an error."""
    return ElementTree.fromstring(mathml(text))[0]


def shape(element):
    """An element as nested tuples, its tag first, or its text."""
    return element.text if element.text else (element.tag, *map(shape, element))


def test_products_and_sums():
    """Letters are variables, dots stand over them, primes above, digits are numbers."""
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
    """What is below, above, over; brackets that only hold such a part are not drawn."""
    assert shape(tree(text)) == ("mrow", inside)


def test_lines_and_signs():
    """Each line is an equation; what HTML would take for markup is not."""
    assert mathml("a < b\n\nc & d\n").count("<math ") == 2
    assert tree("a < b")[1].text == "<"


#: Templates of the paper's report.
PAPER = Path(__file__).parents[2] / "examples" / "paper" / "templates"


def test_every_equation_of_the_pages():
    """Is well-formed, with each bracket closed and something on either side of a bar."""
    found = 0
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
                found += 1
    assert found > 20

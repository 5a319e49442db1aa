"""Equations of a page: what a line of text becomes in MathML."""

import re
from xml.etree import ElementTree

import pytest

from cam_rig.report.document import environment
from cam_rig.report.equations import mathml


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


def test_every_equation_of_the_pages():
    """Is well-formed, with each bracket closed and something on either side of a bar."""
    found = 0
    templates = environment("html")
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

"""The TeX of every page becomes MathML, and nothing of it is left."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from tools.docs.equations import CODE, EQUATION, drawn, line

DOCS = Path(__file__).parents[3] / "docs"


def equations(page: Path) -> list[str]:
    """The TeX of a page, without its dollars."""
    parts = CODE.split(page.read_text(encoding="utf-8"))[::2]
    return [one[1] or one[2] for part in parts for one in EQUATION.finditer(part)]


PAGES = [page for page in sorted(DOCS.rglob("*.md")) if equations(page)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
def test_every_equation_of_a_page_is_drawn(page: Path) -> None:
    """Each word of TeX is known, each element of MathML is closed, code stays as it is."""
    text = page.read_text(encoding="utf-8")
    shown = drawn(text)
    assert shown.count("<math") >= len(equations(page)) > 0
    assert CODE.findall(shown) == CODE.findall(text)
    for part in shown.split("<math")[1:]:
        equation = "<math" + part.partition("</math>")[0] + "</math>"
        ElementTree.fromstring(equation)
        assert not set(equation) & set("\\{}$"), equation


def test_the_line_of_an_equation() -> None:
    """Fractions, roots, scripts, dots and primes are those of the report's equations."""
    assert line(r"\frac{a}{b_2} + \frac1b") == "(a)/(b _ 2) + 1/b"
    assert line(r"\sqrt{2 x}\,\ddot x = k_{stem} s''") == "√(2 x) x\u0308 = k _ (stem) s″"
    with pytest.raises(KeyError):
        line(r"\unknown")

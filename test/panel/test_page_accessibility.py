"""Whoever sees, hears or points otherwise can use the pages: axe-core finds nothing against it."""

import itertools

import pytest

from .conftest import BrowserPage, in_browser
from .test_static_types import TOOLS

AXE = TOOLS / "node_modules/axe-core/axe.min.js"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not AXE.exists(), reason="no axe-core: make check-pages"),
]
#: The pages, and what is filled last on each.
FILLED = {"/": "level", "/bench": "graph", "/lab": "contact"}
#: What waits for its turn to be seen is looked at with the rest.
ALL = "document.querySelectorAll('[hidden]').forEach((one) => { one.hidden = false; })"
VIOLATIONS = """() => axe.run().then(({ violations }) => violations.flatMap(({ id, nodes }) =>
  nodes.map(({ html, failureSummary }) => `${id}: ${html.slice(0, 120)} ${failureSummary}`)))"""
CASES = [
    pytest.param(*case, marks=() if case == ("/bench", "es", "dark") else pytest.mark.long)
    for case in itertools.product(FILLED, ("en", "es"), ("light", "dark"))
]


@pytest.mark.parametrize(("path", "language", "scheme"), CASES)
def test_axe_finds_no_violation(chromium, served, path, language, scheme):
    """Names, roles, contrast and order, as the page is once its numbers have come."""
    looks = {"color_scheme": scheme, "viewport": {"width": 1280, "height": 800}}
    with in_browser(chromium, BrowserPage, bypass_csp=True, **looks) as shown:
        chosen = f"sessionStorage.setItem('language', '{language}')"
        shown.page.context.add_init_script(chosen)
        shown.open(served.address, path)
        shown.until(lambda: shown.text(FILLED[path]) not in ("", "–", "None"))
        shown.page.evaluate(ALL)
        shown.page.evaluate(AXE.read_text(encoding="utf-8"))
        assert shown.page.evaluate(VIOLATIONS) == []
        assert shown.page.evaluate("document.documentElement.lang") == language
        shown.page.evaluate("document.querySelector('main').append(new Image())")
        (control,) = shown.page.evaluate(VIOLATIONS)
        assert control.startswith("image-alt: ")

"""The page in a real browser: wide and narrow, light and dark, and on paper."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from tools.docs.browser import open_browser, why_no_browser

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(why_no_browser() is not None, reason=f"no browser: {why_no_browser()}"),
]
#: Relative luminance by WCAG 2: what its contrast ratio is made of.
CONTRAST = """([one, other]) => {
  const light = name => {
    const rgb = getComputedStyle(document.querySelector(name))[name == "body" ? "backgroundColor"
      : "color"].match(/[\\d.]+/g).slice(0, 3).map(x => x / 255)
      .map(x => x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2] + 0.05;
  };
  const [a, b] = [light(one), light(other)];
  return Math.max(a, b) / Math.min(a, b);
}"""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    """A browser without a window."""
    with open_browser() as browser:
        yield browser


@pytest.fixture
def opened(chromium, rendered):
    """The page in a window of a width, in a colour scheme."""
    text = rendered("html")

    def of(width: int, scheme: str = "light") -> Page:
        viewport = {"width": width, "height": 800}
        page = chromium.new_context(viewport=viewport, color_scheme=scheme).new_page()
        page.set_content(text)
        return page

    return of


@pytest.mark.parametrize("width", [400, 1000, 1280])
def test_nothing_is_cut(opened, width):
    """The page does not scroll to the side; captions, notes and sentences end within it."""
    page = opened(width)
    assert page.evaluate("document.documentElement.scrollWidth") == width
    ends = page.eval_on_selector_all(
        "h1, h2, p, dd, caption span", "all => all.map(e => e.getBoundingClientRect().right)"
    )
    assert max(ends) <= width
    if width == 400:  # the wide table scrolls within its own box
        box = "e => e.scrollWidth - e.clientWidth"
        assert page.eval_on_selector("#table-1", box) > 0


def test_contents_at_the_side(opened):
    """Beside the text where there is room; else a line that opens."""
    wide, narrow = opened(1280), opened(400)
    link = wide.locator("nav a").last
    assert link.is_visible()
    assert link.bounding_box()["x"] < wide.locator("main").bounding_box()["x"]
    assert not narrow.locator("nav a").last.is_visible()
    narrow.locator("nav summary").click()
    assert narrow.locator("nav a").last.is_visible()


def test_the_appendix_is_folded(opened):
    """A link to a table of it opens its part."""
    page = opened(1280)
    spare = page.locator("#table-2")
    assert not spare.is_visible()
    page.evaluate("location.hash = 'table-2'")
    spare.wait_for(state="visible")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_can_be_read(opened, scheme):
    """WCAG's contrast of 4.5 for text, names, notes and links on either ground."""
    page = opened(1280, scheme)
    dark = "(prefers-color-scheme: dark)"
    assert page.evaluate(f"matchMedia('{dark}').matches") == (scheme == "dark")
    for name in ("h1", "p", "td", ".made", ".note", "nav a"):
        assert page.evaluate(CONTRAST, [name, "body"]) > 4.5


def test_on_paper(opened):
    """No contents without page numbers; black on white from a dark screen too; whole A4 pages."""
    page = opened(1280, "dark")
    page.emulate_media(media="print")
    assert not page.locator("nav").is_visible()
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert page.locator("#appendix td, #appendix tbody th").last.is_visible()
    assert page.pdf(prefer_css_page_size=True).count(b"/Type /Page\n") >= 1

"""Tests of a report in a browser: wide, narrow, light, dark and printed.

The last tests split tall figures into strips.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cam_rig.report.document import uris
from cam_rig.show.figure import empty, strips, styled, write, write_strip

pytestmark = pytest.mark.slow
#: JavaScript function of the contrast ratio of two elements, from relative luminance (WCAG 2).
CONTRAST = """([first, second]) => {
  const light = name => {
    const rgb = getComputedStyle(document.querySelector(name))[name == "body" ? "backgroundColor"
      : "color"].match(/[\\d.]+/g).slice(0, 3).map(x => x / 255)
      .map(x => x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2] + 0.05;
  };
  const [a, b] = [light(first), light(second)];
  return Math.max(a, b) / Math.min(a, b);
}"""


@pytest.fixture
def opened(chromium, rendered):
    """Function that opens the report at a width (px) in a colour scheme."""
    text = rendered("html")

    def of(width, scheme="light"):
        viewport = {"width": width, "height": 800}
        page = chromium.new_context(viewport=viewport, color_scheme=scheme).new_page()
        page.set_content(text)
        return page

    return of


@pytest.mark.parametrize("width", [400, 1000, 1280])
def test_nothing_is_cut(opened, width):
    """The report does not scroll sideways at widths from 400 to 1280 px.

    Captions and sentences end within the page. A wide table scrolls within its box.
    """
    page = opened(width)
    assert page.evaluate("document.documentElement.scrollWidth") == width
    ends = page.eval_on_selector_all(
        "h1, h2, p, dd, caption span", "all => all.map(e => e.getBoundingClientRect().right)"
    )
    assert max(ends) <= width
    if width == 400:  # the wide table scrolls within its own box
        box = "e => e.scrollWidth - e.clientWidth"
        assert page.eval_on_selector("#table-1", box) > 0


def test_contents_are_at_the_side_or_folded(opened):
    """The contents are left of the text on a wide screen, and folded on a narrow one."""
    wide, narrow = opened(1280), opened(400)
    link = wide.locator("nav a").last
    assert link.is_visible()
    assert link.bounding_box()["x"] < wide.locator("main").bounding_box()["x"]
    assert not narrow.locator("nav a").last.is_visible()
    narrow.locator("nav summary").click()
    assert narrow.locator("nav a").last.is_visible()


def test_appendix_is_folded(opened):
    """The appendix is folded until a link to a table in it is followed."""
    page = opened(1280)
    spare = page.locator("#table-2")
    assert not spare.is_visible()
    page.evaluate("location.hash = 'table-2'")
    spare.wait_for(state="visible")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_contrast_of_text_is_sufficient(opened, scheme):
    """Text has a contrast ratio above 4.5 (WCAG) in the light and the dark scheme."""
    page = opened(1280, scheme)
    dark = "(prefers-color-scheme: dark)"
    assert page.evaluate(f"matchMedia('{dark}').matches") == (scheme == "dark")
    for name in ("h1", "p", "td", ".made", ".note", "nav a"):
        assert page.evaluate(CONTRAST, [name, "body"]) > 4.5


def test_printed_page(opened):
    """The printed report is on white without contents, and has the whole appendix.

    This applies also if the screen is in the dark scheme.
    """
    page = opened(1280, "dark")
    page.emulate_media(media="print")
    assert not page.locator("nav").is_visible()
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert page.locator("#appendix td, #appendix tbody th").last.is_visible()
    assert page.pdf(prefer_css_page_size=True).count(b"/Type /Page\n") >= 1


# -- a tall figure is split into strips between its panels


DPI = 100


@styled
def stacked(rows: int):
    """Draw stacked panels of 1.5 inches, with a title and a legend outside."""
    figure = empty(1.5 * rows + 0.6)
    for i, axes in enumerate(figure.subplots(rows, 1, squeeze=False)[:, 0]):
        axes.plot([0.0, 1.0], [0.0, i + 1.0], label=f"curve {i}")
        axes.set(ylabel="value", xlabel="x")
    figure.suptitle("A title")
    figure.legend(loc="outside lower center", ncols=4)
    return figure


def pixels(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("L"), dtype=int)


@pytest.mark.parametrize("rows", [1, 3, 12])
def test_strips_cover_the_figure(rows: int, tmp_path: Path) -> None:
    """The strips of a tall figure are contiguous, and contain all of its drawing.

    Each cut is through white pixels.
    """
    figure = stacked(rows)
    parts = strips(figure)
    assert parts[0][1] == figure.get_figheight() and parts[-1][0] == 0.0
    assert [low for low, _ in parts[:-1]] == [high for _, high in parts[1:]]
    assert max(high - low for low, high in parts) < (4.0 if rows > 1 else 2.2)
    assert len(parts) == 1 if rows == 1 else len(parts) >= rows // 2
    write(figure, tmp_path / "whole.png", DPI)
    whole, drawn = pixels(tmp_path / "whole.png"), []
    for low, high in parts:
        write_strip(figure, low, high, tmp_path / "a.png", DPI)
        drawn.append(pixels(tmp_path / "a.png"))
        assert drawn[-1].shape[0] == pytest.approx((high - low) * DPI, abs=1.0)
    ink = sum(int((255 - strip).sum()) for strip in drawn)
    assert ink == pytest.approx(int((255 - whole).sum()), rel=0.02)  # edges are rounded
    for low, _ in parts[:-1]:
        assert whole[whole.shape[0] - round(low * DPI)].min() == 255


def test_file_of_a_strip_contains_only_the_strip(tmp_path: Path) -> None:
    """The file of a strip does not contain the rest of the figure.

    All files together are less than 1.5 times as large as the file of the figure.
    """
    figure = stacked(4)
    sizes = []
    for low, high in strips(figure):
        write_strip(figure, low, high, tmp_path / "a.svg", None)
        sizes.append((tmp_path / "a.svg").stat().st_size)
    write(figure, tmp_path / "whole.svg")
    assert sum(sizes) < 1.5 * (tmp_path / "whole.svg").stat().st_size
    assert all(axes.get_visible() for axes in figure.axes)


def test_page_contains_the_strips_as_svg():
    """`uris` returns the strips of a figure as SVG data, equal in each call."""
    first, second = (uris(stacked(3)) for _ in range(2))
    assert first == second and len(first) == 2
    assert all(uri.startswith("data:image/svg+xml;base64,") for uri in first)

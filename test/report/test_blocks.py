"""Sections in templates: text is escaped, words stand left, Markdown is tidy."""

from cam_rig.report.blocks import Grid, Picture, Points, Section, Words
from cam_rig.report.page import TITLE, html, markdown
from cam_rig.report.words import number

SECTION = Section(
    "part",
    "A part & more",
    (
        Words("Less < more."),
        Points(("one", "two")),
        Grid("A table", ("name", "value"), (("a", "1"), ("b", "2")), note="A note."),
        Picture("pic", "A caption"),
    ),
)


def test_html():
    """One page without a script or a link outwards; what a person wrote is text, not markup."""
    page = html([SECTION], {"pic": "data:image/svg+xml;base64,AAAA"})
    assert "Less &lt; more." in page
    assert "A part &amp; more" in page
    assert '<img src="data:image/svg+xml;base64,AAAA" alt="A caption">' in page
    assert '<td class="word">a</td><td>1</td>' in page
    assert "<li>two</li>" in page
    for outward in ("<script", "http://", "https://", "<link"):
        assert outward not in page


def test_markdown():
    """Words, lists and tables; no pictures."""
    text = markdown([SECTION])
    assert text.startswith(f"# {TITLE}\n\nMade by `cam-rig report")
    assert "\n\n## A part & more\n\nLess < more.\n\n- one\n- two\n\n" in text
    assert "| name | value |\n| --- | ---: |\n| a | 1 |\n| b | 2 |\n\nA note.\n" in text
    assert "caption" not in text


def test_numbers():
    """As few characters as needed."""
    assert [number(x) for x in (1.26e6, 3.3e8, 0.05, 4030.0, 9.8599e-5)] == [
        "1.26e6",
        "3.3e8",
        "0.05",
        "4030",
        "9.8599e-5",
    ]

"""The parts of a page: text is escaped, words stand left, Markdown is tidy."""

import pytest

from cam_rig.report.page import environment, percent, to
from cam_rig.tables import Column, DataTable

TABLE = DataTable(
    "A < table",
    (Column("name"), Column("value", "rpm", ".1f")),
    (("a & b", 1.0), ("c", None)),
    ("A note.",),
)
PARTS = """
{% import layout as page %}
{{ page.table(table) }}
{% call page.words() %}
More
words.
{% endcall %}
{% call page.points() %}
one

two
{% endcall %}
{% call page.figure(figures, "pic") %}A caption{% endcall %}
"""


def render(kind, figures):
    """A table, a paragraph, a list and a figure."""
    template = environment(kind).from_string(PARTS)
    return template.render(layout=f"layout.{kind}", table=TABLE, figures=figures)


def test_html():
    """What a person wrote is text, not markup; units under the headings."""
    page = render("html", {"pic": "data:image/svg+xml;base64,AAAA"})
    assert "<caption>A &lt; table</caption>" in page
    assert '<th class="word">name</th><th>value<br>[rpm]</th>' in page
    assert '<td class="word">a &amp; b</td><td>1.0</td>' in page
    assert '<p class="note">A note.</p>' in page
    assert "<li>one</li>\n<li>two</li>" in page
    assert '<img src="data:image/svg+xml;base64,AAAA" alt="A caption">' in page


def test_markdown():
    """Words, lists and tables; no pictures."""
    text = render("md", {})
    assert "**A < table**\n\n| name | value [rpm] |\n| --- | ---: |\n| a & b | 1.0 |\n" in text
    assert "\nMore words.\n" in text
    assert "- one\n- two\n" in text
    assert "caption" not in text


@pytest.mark.parametrize("kind", ["html", "md"])
def test_no_point_is_empty(kind):
    """A part of a list that has nothing to say leaves no bullet."""
    text = "{% import layout as page %}{% call page.points() %}\na\n\n\n\n \n\nb{% endcall %}"
    page = environment(kind).from_string(text).render(layout=f"layout.{kind}")
    assert page.count("- " if kind == "md" else "<li>") == 2


def test_numbers_in_sentences():
    """Shares as percentages, ranges from their ends."""
    assert percent(0.7249) == "72 %"
    assert percent(-0.0053, "+.2f") == "-0.53 %"
    assert to((0.71, 1.66), ".1f") == "0.7 to 1.7"

"""Tests of a report: head, contents, numbering, escaping, alignment."""

import re

import pytest

from cam_rig.report import document
from cam_rig.report.document import Numbering, environment, format_range, percent
from cam_rig.show.tables import DataTable, Header

TABLE = DataTable(
    "A < table",
    (Header("name"), Header("value", "rpm", ".1f")),
    (("a & b", 1.0), ("c", None)),
    ("A note.",),
)
OTHER = DataTable("Another", (Header("name"), Header("here")), (("x", "2 < of 3"),))
PARTS = """
{% call page.words() %}
More
words, see {{ page.see_table(other) }} in {{ page.see_section("end") }}.
{% endcall %}
{{ page.table(table) }}
{% call page.points() %}
one

two
{% endcall %}
{% call page.figure("pic", "the paper's 16") %}A caption.{% endcall %}
{{ page.table(other) }}
"""


def render(kind, parts=PARTS, figures=("pic",)):
    """Render a section with a paragraph, tables, a list and a figure."""
    numbering, text = Numbering(), ""
    variables = {
        "figures": {key: ["data:image/svg+xml;base64,AAAA"] for key in figures},
        "numbering": numbering,
        "numbers": {"start": 1, "end": 2},
    }
    for _ in range(2):
        page = environment(kind).get_template(f"layout.{kind}").make_module(variables)
        text = environment(kind).from_string(parts).render(page=page, table=TABLE, other=OTHER)
        numbering.restart()
    return text


#: Parts of the page. Text of a user is escaped, and units are below the headings. A screen :
#: reader reads headings and table name with each cell. References may precede their target.
HTML = (
    '<span id="caption-1"><b>Table 1.</b> A &lt; table</span></caption>',
    'aria-labelledby="caption-1"',
    '<th scope="col" class="word">name</th><th scope="col">value<br>[rpm]</th>',
    '<tr><th scope="row" class="word">a &amp; b</th><td>1.0</td></tr>',
    '<p class="note">A note.</p>',
    "<li>one</li>\n<li>two</li>",
    "2 &lt; of 3</td>",
    '<a href="#table-2">Table 2</a> in <a href="#end">section 2</a>',
    '<div class="block folds" id="table-2"',
    '<figure id="figure-1">',
    'alt="Figure 1, the paper\'s 16"',
    "<b>Figure 1, the paper's 16.</b> A caption.",
)


def test_html():
    """The HTML has all parts of the section, with separately numbered figures."""
    page = render("html").replace("&#39;", "'")
    assert [part for part in HTML if part not in page] == []


def test_figure_without_data_is_omitted():
    """A figure without data has no element on the page."""
    assert "<figure" not in render("html", figures=())


def test_reference_to_a_missing_table_is_an_error():
    """A reference to a table that is not in the report raises KeyError."""
    with pytest.raises(KeyError, match="table"):
        render("html", "{{ page.see_table(table) }}")


def test_markdown():
    """The Markdown has text, lists and numbered tables, but no figures."""
    text = render("md", figures=())
    assert "**Table 1. A < table**\n\n| name | value [rpm] |\n| --- | ---: |\n| a & b" in text
    assert "\nMore words, see Table 2 in section 2.\n" in text
    assert "- one\n- two\n" in text
    assert "A caption" not in text


@pytest.mark.parametrize("kind", ["html", "md"])
def test_empty_list_items_are_omitted(kind):
    """Empty lines of a list give no items."""
    text = "{% call page.points() %}\na\n\n\n\n \n\nb{% endcall %}"
    assert render(kind, text).count("- " if kind == "md" else "<li>") == 2


def test_head_and_contents(rendered):
    """The head of a report has date, command, versions and random seeds.

    Sections are numbered and listed.
    """
    page, text = rendered("html"), rendered("md")
    assert "<dt>Date</dt><dd>2023-11-14</dd>" in page
    assert "<code>cam-rig report a.yaml --out &#39;a b.html&#39;</code>" in page
    assert "7 (draws)" in page
    assert re.search(r"cam_rig \d\S*, Python 3\.\d+\.\d+, numpy \d\S*, scipy \d", page)
    assert '<li><a href="#summary">The start, in short</a></li>' in page
    assert "<h2>2 The end</h2>" in page
    assert "- [1 The start, in short](#1-the-start-in-short)" in text
    assert "\n## 2 The end\n" in text
    assert ", 2023-11-14;" in text


def test_tables_not_displayed_in_a_section_are_in_the_appendix(rendered):
    """Tables that a section does not display are in the appendix, with a link to them.

    The tables of the main part are numbered before those of the appendix.
    """
    page, text = rendered("html"), rendered("md")
    main, appendix = page.split('<div id="appendix">')
    assert "A table to check" not in main
    assert '<a href="#more-summary">' in main
    assert '<details id="more-summary">' in appendix
    assert "<b>Table 2.</b> A table to check" in appendix
    assert "### 1 The start, in short, continued\n\n**Table 2. A table to check**" in text


def test_equations_and_indices():
    """Equations are MathML in HTML and text in Markdown.

    Indices in sentences are subscripts, and names with an underscore are not.
    """
    parts = (
        "{% call page.equation() %}\nF = k_s s\n{% endcall %}"
        "{% call page.words() %}With k_s of paper_table2.{% endcall %}"
    )
    page = render("html", parts)
    assert "<msub><mi>k</mi><mi>s</mi></msub>" in page
    assert "<p>With k<sub>s</sub> of paper_table2.</p>" in page
    assert "    F = k_s s\n\n" in render("md", parts)


def test_numbers_in_sentences():
    """Percentages and ranges are typeset with minus signs and raised powers.

    Titles of sections are converted to anchors of links.
    """
    assert percent(0.7249) == "72 %"
    assert percent(-0.0053, "+.2f") == "−0.53 %"
    assert format_range((0.71, 1.66), ".1f") == "0.7 to 1.7"
    assert format_range((-2e-7, 3.3e8), ".2g") == "−2·10⁻⁷ to 3.3·10⁸"
    assert document.anchor("12 Given, assumed, identified") == "12-given-assumed-identified"

"""Fixture of a report with two sections, whose templates need only tables."""

import pytest

from cam_rig.report.document import Content, Made, Section, render
from cam_rig.show.tables import DataTable, Header

#: Table that is too wide for a narrow screen, with a caption of several lines there.
WIDE = DataTable(
    "A table of many columns, with a caption that a narrow screen cannot show in one line",
    tuple(Header(f"a long heading {i}", "mm/rad²", ".3f") for i in range(9)),
    tuple(tuple(float(i * j) for i in range(9)) for j in range(30)),
    ("A note that is about as long as the caption, and must not be cut at the side either.",),
)
#: Table that no template displays, which is thus in the appendix.
SPARE = DataTable("A table to check", (Header("name"),), (("spare",),))


#: Templates of the sections: a sentence, and all tables.
TEMPLATES = {
    "summary": "{% call page.words() %}What came out.{% endcall %}",
    "reading": "{{ page.all(tables) }}",
}


@pytest.fixture
def rendered(tmp_path):
    """Function that renders the report as HTML or Markdown.

    The report has a sentence, a wide and long table, and a table in the appendix.
    """
    for name, text in TEMPLATES.items():
        (tmp_path / f"{name}.jinja").write_text(text, encoding="utf-8")
    made = Made("cam-rig report a.yaml --out 'a b.html'", "2023-11-14", "7 (draws)")
    contents = {
        Section("summary", "The start, in short", Content): Content([SPARE]),
        Section("reading", "The end", Content): Content([WIDE]),
    }
    return lambda kind: render(kind, "A page", made, contents, folder=tmp_path)

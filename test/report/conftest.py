"""A page of two sections, whose sentences take nothing but tables."""

import pytest

from cam_rig.report.document import Content, Made, Section, render
from cam_rig.show.tables import DataTable, Header

#: More columns than a narrow screen has room for, under a caption of more than one line there.
WIDE = DataTable(
    "A table of many columns, with a caption that a narrow screen cannot show in one line",
    tuple(Header(f"a long heading {i}", "mm/rad²", ".3f") for i in range(9)),
    tuple(tuple(float(i * j) for i in range(9)) for j in range(30)),
    ("A note that is about as long as the caption, and is not to be cut at the side either.",),
)
#: What no sentence shows.
SPARE = DataTable("A table to check", (Header("name"),), (("spare",),))


#: Sections of the page: sentences alone, and tables.
TEMPLATES = {
    "summary": "{% call page.words() %}What came out.{% endcall %}",
    "reading": "{{ page.all(tables) }}",
}


@pytest.fixture
def rendered(tmp_path):
    """A kind of page: sentences, a table that is wide and long, and one for the appendix."""
    for name, text in TEMPLATES.items():
        (tmp_path / f"{name}.jinja").write_text(text, encoding="utf-8")
    made = Made("cam-rig report a.yaml --out 'a b.html'", "2023-11-14", "7 (draws)")
    contents = {
        Section("summary", "The start, in short", Content): Content([SPARE]),
        Section("reading", "The end", Content): Content([WIDE]),
    }
    return lambda kind: render(kind, "A page", made, contents, folder=tmp_path)

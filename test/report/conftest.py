"""A page of two sections, whose sentences take nothing but answers and tables."""

import pytest

from cam_rig.report.document import Answer, Content, Made, Section, render
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


@pytest.fixture
def rendered():
    """A kind of page: answers, a table that is wide and long, and one for the appendix."""
    answer = Answer("How fast?", "**9 rpm**, and not **10**", "agrees", "about **9 rpm**")
    made = Made("cam-rig report a.yaml --out 'a b.html'", "2023-11-14", "7 (draws)")
    contents = {
        Section("summary", "The start, in short", Content): Content(
            [SPARE], values={"answers": [answer]}
        ),
        Section("reading", "The end", Content): Content([WIDE]),
    }
    return lambda kind: render(kind, "A page", made, contents)

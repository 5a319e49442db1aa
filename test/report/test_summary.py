"""The summary: numbers in bold, and no column or number that nothing stands behind."""

from cam_rig.report.document import Answer, bold, span, summary_table
from cam_rig.show.tables import to_markdown


def test_numbers_are_bold():
    """With their unit; a range has it once."""
    assert bold(0.3692, ".2f", "%") == "**0.37 %**"
    assert bold(4) == "**4**"
    assert span((390.0, 570.0), ".6g", "rpm") == "**390** to **570 rpm**"


def test_no_paper_no_column():
    """On a page of one's own cams there is nothing to compare with."""
    own, paper = Answer("q", "h", "v"), Answer("q", "h", "v", "p")
    assert [c.heading for c in summary_table([own]).columns] == ["question", "here", "verdict"]
    assert "| q | p | h | v |" in to_markdown(summary_table([paper]), "Table 1. ")

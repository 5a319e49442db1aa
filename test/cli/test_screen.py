"""What a run is shown on, and how long."""

import pytest

from cam_rig.errors import CamRigError
from cam_rig.show.command import LINE_EVERY_S
from cam_rig.viewer.command import delay_report
from cam_rig.viewer.page import PageTime


def test_a_log_says_how_far_the_page_is_behind(capsys):
    """A line now and then where there is no terminal; the longest at the end, whatever it is."""
    wall = [0.0]
    page = PageTime(lambda: wall[0])
    with pytest.raises(CamRigError), delay_report(page, lambda: wall[0]) as delayed:
        assert delayed(1.0, "tm21") == "tm21"
        wall[0] = 1.5
        page.take("ns=900000000")
        assert delayed(2.0, "tm21") == "tm21, viewer 1.5 s behind"
        wall[0] = LINE_EVERY_S
        page.take("ns=2000000000")
        assert "viewer" in delayed(3.0, "tm21 [at] 200 rpm")
        raise CamRigError("it was interrupted")
    seen = capsys.readouterr().err.splitlines()
    assert seen[0].startswith("tm21 [at] 200 rpm, viewer ")
    assert float(seen[-1].removeprefix("viewer at most ").removesuffix(" s behind")) >= 1.5
    assert len(seen) == 2


def test_without_a_page_nothing_is_said_of_one(capsys):
    """Neither while it runs nor at the end."""
    with delay_report(None) as delayed:
        assert delayed(1.0, "tm21") == "tm21"
    assert capsys.readouterr().err == ""

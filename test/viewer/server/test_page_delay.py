"""The delay of a page, asked from another process than the one that serves it."""

from __future__ import annotations

import time

import pytest

from cam_rig.viewer.server import page_delay
from cam_rig.viewer.server.page_delay import PageDelay
from cam_rig.viewer.server.process import free_port
from cam_rig.viewer.server.web import serve


def test_the_delay_is_what_the_server_knows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing while no page has shown anything, then its delay; nothing when the server is gone."""
    monkeypatch.setattr(page_delay, "REPORT_EVERY_S", 0.01)
    with serve() as pages:
        delay = PageDelay(pages.address)
        pages.page.driven(1.0)
        assert delay.behind() is None
        pages.page.take("ns=500000000")
        while (late := delay.behind()) is None:
            time.sleep(0.01)
        assert 0.0 <= late <= (pages.page.behind() or 0.0) + 1e-3
    while delay.behind() is not None:
        time.sleep(0.01)
    delay.close()


def test_nobody_at_the_address_is_no_delay() -> None:
    """The run goes on as without a page."""
    delay = PageDelay(f"http://127.0.0.1:{free_port()}/")
    assert delay.behind() is None
    delay.close()

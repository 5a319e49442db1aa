"""How far a page is behind, for another process than the one that serves it."""

from __future__ import annotations

from http.client import HTTPException
from threading import Event, Thread
from urllib.request import urlopen

from cam_rig.viewer.server.scripts import BEHIND_PATH, REPORT_EVERY_S

#: Wall time (s) that an answer may take.
TIMEOUT_S = 2.0


class PageDelay:
    """Asks a page's server as often as the page reports; nobody waits for the answer.

    Parameters
    ----------
    address : the page's, ``http://127.0.0.1:8000/`` for one
    """

    def __init__(self, address: str) -> None:
        self._asked, self._ended = f"{address.rstrip('/')}{BEHIND_PATH}", Event()
        self._seconds: float | None = None
        Thread(target=self._ask, daemon=True).start()

    def behind(self) -> float | None:
        """Wall time (s) by the last answer; None while it is not known."""
        return self._seconds

    def close(self) -> None:
        """Ask no more."""
        self._ended.set()

    def _ask(self) -> None:
        while not self._ended.wait(REPORT_EVERY_S):
            self._seconds = self._answer()

    def _answer(self) -> float | None:
        try:
            with urlopen(self._asked, timeout=TIMEOUT_S) as answer:
                return float(answer.read())
        except (OSError, HTTPException, ValueError):  # no server, or no page that shows anything
            return None

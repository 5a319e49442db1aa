"""Where a run is seen while it runs: in a window, in a browser, or nowhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Event
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.markup import escape

from cam_rig.cli.common.console import console
from cam_rig.errors import ConfigError

if TYPE_CHECKING:
    from cam_rig.viewer.server.page_time import PageTime


#: Wall time (s) from line to line on a page's delay, where there is no terminal for a bar.
LINE_EVERY_S = 10.0


@dataclass(frozen=True)
class Screen:
    """``address`` is where the picture is sent, None for nowhere; ``stay`` waits for its end.

    ``page`` is what a browser shows of it.
    """

    address: str | None = None
    stay: Callable[[], None] = lambda: None
    page: PageTime | None = None


class DelayReport:
    """How far a page is behind the drive, in words; the longest delay is printed at the end.

    Parameters
    ----------
    page : what a browser shows; None where there is none
    clock : wall time, s
    """

    def __init__(self, page: PageTime | None, clock: Callable[[], float] = time.monotonic) -> None:
        self._page, self._clock, self._printed = page, clock, clock()

    def driven(self, rig_time: float, words: str) -> str:
        """The words on what the drive does at a rig time (s), the delay after them."""
        if self._page is None:
            return words
        self._page.driven(rig_time)
        late = self._page.behind()
        words += "" if late is None else f", viewer {late:.1f} s behind"
        now = self._clock()
        if not console.is_terminal and late is not None and now - self._printed >= LINE_EVERY_S:
            self._printed = now
            console.print(escape(words))
        return words

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._page is not None and self._page.longest is not None:
            console.print(f"viewer at most {self._page.longest:.1f} s behind")


@contextmanager
def open_screen(view: bool, web: bool, wait_for_it: bool = False) -> Iterator[Screen]:
    """Open what was asked for; a browser wins over a window, and its page may be waited for.

    Raises
    ------
    ConfigError : nothing was asked for that could be waited for
    CamRigError : no window can be opened here, or the viewer does not start
    """
    if wait_for_it and not (view or web):
        raise ConfigError("--wait: waits for a viewer, and there is none; add --web or --view")
    if web:
        from cam_rig.viewer.server.web import serve

        with serve() as pages:
            print(pages.address, flush=True)
            console.print("open this address in a browser, now or after the run")
            if wait_for_it:
                pages.page.wait()
            yield Screen(str(pages.folder), stay_until_interrupted, pages.page)
    elif view:
        from cam_rig.viewer.server.process import require_display, wait, window

        require_display()
        with window() as (process, address):
            yield Screen(address, lambda: wait(process))
    else:
        yield Screen()


def stay_until_interrupted() -> None:
    """Serve until Ctrl-C, which is how it is meant to end."""
    console.print("Ctrl-C ends the viewer")
    Event().wait()

"""Where a run is seen while it runs: in a window, in a browser, or nowhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from subprocess import Popen
from typing import TYPE_CHECKING

from cam_rig.cli.common.console import console
from cam_rig.errors import CamRigError, ConfigError

if TYPE_CHECKING:
    from cam_rig.viewer.server.page_time import PageTime


@dataclass(frozen=True)
class Screen:
    """``address`` is where the picture is sent, None for nowhere; ``stay`` waits for its end.

    ``page`` is what a browser shows of it.
    """

    address: str | None = None
    stay: Callable[[], None] = lambda: None
    page: PageTime | None = None


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
                pages.page.wait(lambda: pages.viewer.poll() is None)
            yield Screen(pages.stream, lambda: stay_until_interrupted(pages.viewer), pages.page)
    elif view:
        from cam_rig.viewer.server.process import require_display, wait, window

        require_display()
        with window() as (process, address):
            yield Screen(address, lambda: wait(process))
    else:
        yield Screen()


def stay_until_interrupted(viewer: Popen[bytes]) -> None:
    """Serve until Ctrl-C, which is how it is meant to end.

    Raises
    ------
    CamRigError : the viewer that serves ended before, or while the run was on
    """
    console.print("Ctrl-C ends the viewer")
    with suppress(KeyboardInterrupt):
        raise CamRigError(
            f"the viewer's server ended with code {viewer.wait()}; show the bag again with: "
            "cam-rig view BAG --web"
        )

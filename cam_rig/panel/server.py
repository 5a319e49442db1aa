"""Serving the panel: its pages behind one guard, on this machine alone."""

from __future__ import annotations

import asyncio
import errno
import logging
import socket
import threading
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import (
    AbstractAsyncContextManager,
    AsyncExitStack,
    asynccontextmanager,
    contextmanager,
)
from pathlib import Path
from typing import Protocol

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles

from cam_rig.errors import ConfigError
from cam_rig.live.loopback import require_loopback
from cam_rig.panel.guard import Guard
from cam_rig.panel.messages import MAX_MESSAGE
from cam_rig.viewer.server.access import Access
from cam_rig.viewer.server.process import HOST

STATIC = Path(__file__).parent / "static"
#: Wall time (s) that the server has to end, once asked.
END_S = 3.0


class PanelPages(Protocol):
    """Some pages of the panel: what they answer, and what runs as long as they are served."""

    @property
    def routes(self) -> Sequence[BaseRoute]:
        """What is asked of them."""

    def alive(self) -> AbstractAsyncContextManager[None]:
        """Entered in the server's loop before the first request, left after the last."""


def languages() -> list[str]:
    """Those that the pages have texts in, by their two letters."""
    return sorted(path.stem for path in (STATIC / "texts").glob("*.json"))


def application(*pages: PanelPages, language: str | None = None) -> Starlette:
    """All pages of a panel as one application, with the files that they share.

    ``language`` is that of a page whose reader has not chosen one; None takes the browser's.
    """

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        async with AsyncExitStack() as stack:
            for part in pages:
                await stack.enter_async_context(part.alive())
            yield

    async def offered(_: Request) -> Response:
        served = [route.path for route in own if isinstance(route, Route)]
        offers = {"language": language, "languages": languages(), "pages": served}
        return JSONResponse(offers)

    own = [route for part in pages for route in part.routes]
    common = Route("/languages", offered), Mount("/static", StaticFiles(directory=STATIC))
    routes = [*own, *common]
    return Starlette(routes=routes, lifespan=lifespan)


class ServedPanel:
    """A panel that is being served, at ``address``."""

    def __init__(self, address: str, ended: threading.Event) -> None:
        self.address, self._ended = address, ended

    def alive(self) -> bool:
        """Whether its server runs."""
        return not self._ended.is_set()


@contextmanager
def serve(
    *pages: PanelPages, port: int = 0, language: str | None = None, home: str = "/"
) -> Iterator[ServedPanel]:
    """Serve pages on this machine alone, as long as the context lasts.

    Parameters
    ----------
    port : 0 takes a free one
    language : see `application`
    home : the page that the printed address leads to

    Raises
    ------
    ConfigError : no texts in that language; the port is in use, or may not be taken
    RunError : this machine has no loopback
    """
    if language is not None and language not in languages():
        raise ConfigError(f"--lang: is {language!r}; allowed: {', '.join(languages())}")
    with _listener(port) as listener:
        served = application(*pages, language=language)
        guard = Guard(served, Access(int(listener.getsockname()[1])), home)
        config = uvicorn.Config(
            guard,
            log_config=None,
            access_log=False,
            ws="websockets-sansio",
            ws_max_size=MAX_MESSAGE,
            ws_per_message_deflate=False,
            timeout_graceful_shutdown=1,
            server_header=False,
        )
        logging.getLogger("uvicorn.error").addFilter(_in_one_line)
        server = uvicorn.Server(config)
        ended = threading.Event()

        def run() -> None:
            try:
                server.run(sockets=[listener])
            finally:
                ended.set()

        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        try:
            yield ServedPanel(guard.access.address, ended)
        finally:
            server.should_exit = True
            thread.join(END_S)  # a request that computes does not keep the command


def _in_one_line(record: logging.LogRecord) -> bool:
    """A page's message that is no UTF-8 is not worth a traceback; a request cut off, no word."""
    error = record.exc_info[1] if record.exc_info else None
    if isinstance(error, UnicodeDecodeError):
        record.exc_info = None
    return not isinstance(error, asyncio.CancelledError)


def _listener(port: int) -> socket.socket:
    require_loopback()
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
        listener.listen()
    except OSError as error:
        listener.close()
        why = "is in use" if error.errno == errno.EADDRINUSE else f"{error.strerror}"
        raise ConfigError(f"--port: {port} {why}; allowed: another, or 0 for a free one") from None
    return listener

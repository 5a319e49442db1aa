"""Rerun's web viewer on this machine alone: no request goes to any other, no other user gets it.

The viewer's own page loads a font, looks for a newer version and reports its use. This server
serves the same page with a guard before all of its code: a request to another host is answered at
once with an empty response, and a content security policy keeps the browser from sending any.

Rerun's own ports ask nobody for anything, so none is open: the page reads its recording from this
server, behind its token. A live run's is read while the viewer's node writes it.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator, Iterator
from contextlib import closing, contextmanager, suppress
from functools import cache
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import (
    FileResponse,
    PlainTextResponse,
    RedirectResponse,
    Response,
    StreamingResponse,
)
from starlette.routing import Route

from cam_rig.errors import CamRigError
from cam_rig.files import temporary_folder
from cam_rig.live.sockets import LOOPBACK
from cam_rig.viewer.page import (
    SHOWN_PATH,
    PageTime,
    newest_recording,
    page_script,
    part_after,
    write_delay,
)
from cam_rig.viewer.process import free_port, listening
from cam_rig.viewer.web_server import LOCAL_HOST, serve_application

#: A viewer that keeps nothing from one visit to the next.
HOME = "/?hide_welcome_screen&persist=0&notebook=0&renderer=webgl"
#: Rerun's code asks without cookies, and this server answers nobody without.
GUARD = """<script>
const ask = window.fetch;
window.fetch = (what, how) => {
  const asked = new Request(new Request(what, how), { credentials: "same-origin" });
  const here = new URL(asked.url).host === location.host;
  return here ? ask(asked) : Promise.resolve(new Response(null, { status: 204 }));
};
</script>"""
#: The panel shows the page in a frame of its own.
POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' blob: data:; "
    f"frame-ancestors http://{LOCAL_HOST}:*"
)
#: Wall time (s) between two looks at whether a live run has more, and bytes sent at once.
LOOK_S, CHUNK = 0.1, 1 << 16
#: How long Rerun's server may take to answer, s.
TIMEOUT_S = 20.0
OUTSIDE = re.compile(rb'<link[^>]*"https://[^>]*>')
#: What Rerun's page names of its own: a script, a module, an icon.
NAMED = re.compile(rb'(?:src|href)="([\w.-]+)"|fetch\("\./([\w.-]+)"\)')


class Pages(NamedTuple):
    """The address for a browser, the folder a live run is written into, and what pages show."""

    address: str
    folder: Path
    page: PageTime


@contextmanager
def serve_file(path: Path, begin: float = 0.0) -> Iterator[str]:
    """The address at which a browser shows a recording, from a rig time (s) on."""
    with _serving(RerunPages(path, None, begin)) as address:
        yield address


@contextmanager
def serve() -> Iterator[Pages]:
    """Serve what a live run writes to a browser, as long as the context lasts."""
    with temporary_folder() as folder:
        pages = RerunPages(None, folder)
        with _serving(pages) as address:
            yield Pages(address, folder, pages.page)


@contextmanager
def _serving(pages: RerunPages) -> Iterator[str]:
    with serve_application(pages.application, HOME, POLICY) as served:
        try:
            yield served.address
        finally:
            pages.ended = True


class RerunPages:
    """The viewer, and a recording: of a ``path``, or the newest in a live run's ``folder``."""

    def __init__(self, path: Path | None, folder: Path | None, begin: float = 0.0) -> None:
        self.path, self.folder, self.page, self.ended = path, folder, PageTime(), False
        self.files = dict(viewer_files())
        script = (GUARD + page_script(begin)).encode()
        page = OUTSIDE.sub(b"", self.files["/"].body).replace(b"<head>", b"<head>" + script, 1)
        self.files["/"] = ViewerFile(self.files["/"].kind, page)
        routes = [Route("/", self._index), Route(SHOWN_PATH, self._shown)]
        self.application = Starlette(routes=[*routes, Route("/{name}", self._file)])

    def recording(self) -> Path | None:
        """What is to be shown; None before a live run has begun."""
        return self.path if self.folder is None else newest_recording(self.folder)

    async def _index(self, request: Request) -> Response:
        return self._own("/") if request.url.query else RedirectResponse(HOME, 303)

    async def _shown(self, request: Request) -> Response:
        self.page.take(request.url.query)
        if self.folder is not None:
            write_delay(self.folder, self.page.behind())
        recording = self.recording()
        return PlainTextResponse("" if recording is None else quote(recording.name))

    async def _file(self, request: Request) -> Response:
        name, recording = request.path_params["name"], self.recording()
        if recording is None or name != recording.name or not recording.is_file():
            return self._own(f"/{name}")
        kind = "application/octet-stream"
        if self.folder is None:
            return FileResponse(recording, media_type=kind)
        return StreamingResponse(self._follow(recording), media_type=kind)

    def _own(self, path: str) -> Response:
        file = self.files.get(path)
        if file is None:
            return PlainTextResponse("there is no such file\n", 404)
        return Response(file.body, media_type=file.kind)

    async def _follow(self, first: Path) -> AsyncIterator[bytes]:
        """What is written, until another run begins or the server ends."""
        part: Path | None = first
        while part is not None:
            # Of a part that has been removed meanwhile the page goes on to the next.
            with suppress(FileNotFoundError), part.open("rb") as stream:
                whole = False
                while not whole:
                    whole, over = part_after(part) is not None, self.recording() != first
                    while chunk := stream.read(CHUNK):
                        yield chunk
                    if not whole and (over or self.ended):
                        return
                    if not whole:
                        await asyncio.sleep(LOOK_S)
            part = part_after(part)


class ViewerFile(NamedTuple):
    """A file of Rerun's own web viewer with its MIME type."""

    kind: str
    body: bytes


@cache
def viewer_files() -> dict[str, ViewerFile]:
    """The page at ``/`` and what it asks for by their paths, from Rerun's server, which ends."""
    port, assets = free_port(), free_port()
    arguments = ("--serve-web", "--port", str(port), "--web-viewer-port", str(assets))
    with listening(*arguments, ports=(port, assets)):
        page = _viewer_file(assets, "/")
        if page is None:
            raise CamRigError("the viewer has no page of its own; allowed: rerun-sdk as required")
        names = {(one or other).decode() for one, other in NAMED.findall(page.body)}
        found = {f"/{name}": _viewer_file(assets, f"/{name}") for name in sorted(names)}
    return {"/": page} | {path: file for path, file in found.items() if file is not None}


def _viewer_file(port: int, path: str) -> ViewerFile | None:
    try:
        with closing(HTTPConnection(LOOPBACK, port, timeout=TIMEOUT_S)) as viewer:
            viewer.request("GET", path)
            answer = viewer.getresponse()
            found = ViewerFile(answer.headers.get_content_type(), answer.read())
    except (OSError, HTTPException) as error:
        raise CamRigError(f"the viewer does not answer ({type(error).__name__})") from None
    return found if answer.status == 200 else None

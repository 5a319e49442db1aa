"""Server of Rerun's web viewer, for the local user only.

The original page of the viewer loads a font, checks for a newer version and reports its use. This
server serves the same page with a guard before its code. The guard answers a request to another
host with an empty response, and a content security policy prevents the browser from sending one.

Rerun's ports have no access control, so they are not open while a page is served. The page reads
its recording from this server, which requires a token. The recording of a live run is read while
the viewer's node writes it.
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
from cam_rig.viewer.process import find_free_port, listening
from cam_rig.viewer.web_server import LOCAL_HOST, serve_application

#: Path and options of Rerun's web viewer. With these options it stores no data between visits.
HOME = "/?hide_welcome_screen&persist=0&notebook=0&renderer=webgl"
#: Script that adds the cookie to requests of Rerun's code and blocks requests to other hosts.
GUARD = """<script>
const ask = window.fetch;
window.fetch = (what, how) => {
  const asked = new Request(new Request(what, how), { credentials: "same-origin" });
  const here = new URL(asked.url).host === location.host;
  return here ? ask(asked) : Promise.resolve(new Response(null, { status: 204 }));
};
</script>"""
#: Content security policy. It allows cam-rig's control panel to display the page in a frame.
POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' blob: data:; "
    f"frame-ancestors http://{LOCAL_HOST}:*"
)
#: Polling period (s, wall clock) for new data of a live recording.
LOOK_S = 0.1
#: Number of bytes of a recording that are sent at once.
CHUNK = 1 << 16
#: Longest wall-clock time (s) for a response of Rerun's server.
TIMEOUT_S = 20.0
#: Pattern of links to other hosts in Rerun's page. The links are removed.
OUTSIDE = re.compile(rb'<link[^>]*"https://[^>]*>')
#: Pattern of the references to files that Rerun's page loads from its server: a script, a module,
#: an icon.
NAMED = re.compile(rb'(?:src|href)="([\w.-]+)"|fetch\("\./([\w.-]+)"\)')


class Pages(NamedTuple):
    """Served page of a live run: address, folder of the recording, displayed rig time."""

    address: str
    folder: Path
    page: PageTime


@contextmanager
def serve_file(path: Path, begin: float = 0.0) -> Iterator[str]:
    """Serve a recording file, and yield the address for a browser.

    `begin` is the initial rig time (s).
    """
    with _serving(RerunPages(path, None, begin)) as address:
        yield address


@contextmanager
def serve() -> Iterator[Pages]:
    """Serve the recording of a live run to a browser until the context ends.

    The result contains the address for the browser, and the folder into which the recording must be
    written.
    """
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
    """Web application that serves Rerun's viewer and a recording.

    The recording is the file ``path``, or the newest in the ``folder`` of a live run.
    """

    def __init__(self, path: Path | None, folder: Path | None, begin: float = 0.0) -> None:
        self.path, self.folder, self.page, self.ended = path, folder, PageTime(), False
        self.files = dict(viewer_files())
        script = (GUARD + page_script(begin)).encode()
        page = OUTSIDE.sub(b"", self.files["/"].body).replace(b"<head>", b"<head>" + script, 1)
        self.files["/"] = ViewerFile(self.files["/"].kind, page)
        routes = [Route("/", self._index), Route(SHOWN_PATH, self._report_time)]
        self.application = Starlette(routes=[*routes, Route("/{name}", self._file)])

    def recording(self) -> Path | None:
        """Return the path of the recording to display, None before a live run has started."""
        return self.path if self.folder is None else newest_recording(self.folder)

    async def _index(self, request: Request) -> Response:
        return self._static("/") if request.url.query else RedirectResponse(HOME, 303)

    async def _report_time(self, request: Request) -> Response:
        self.page.take(request.url.query)
        if self.folder is not None:
            write_delay(self.folder, self.page.behind())
        recording = self.recording()
        return PlainTextResponse("" if recording is None else quote(recording.name))

    async def _file(self, request: Request) -> Response:
        name, recording = request.path_params["name"], self.recording()
        if recording is None or name != recording.name or not recording.is_file():
            return self._static(f"/{name}")
        kind = "application/octet-stream"
        if self.folder is None:
            return FileResponse(recording, media_type=kind)
        return StreamingResponse(self._follow(recording), media_type=kind)

    def _static(self, path: str) -> Response:
        file = self.files.get(path)
        if file is None:
            return PlainTextResponse("no such file\n", 404)
        return Response(file.body, media_type=file.kind)

    async def _follow(self, first: Path) -> AsyncIterator[bytes]:
        """Yield the bytes of a live recording while it is written.

        ``first`` is the first file of the recording. The iteration ends when another run starts or
        the server ends.
        """
        part: Path | None = first
        while part is not None:
            # If a part has been removed meanwhile, the page continues with the next part.
            with suppress(FileNotFoundError), part.open("rb") as stream:
                complete = False
                while not complete:
                    complete, is_over = part_after(part) is not None, self.recording() != first
                    while chunk := stream.read(CHUNK):
                        yield chunk
                    if not complete and (is_over or self.ended):
                        return
                    if not complete:
                        await asyncio.sleep(LOOK_S)
            part = part_after(part)


class ViewerFile(NamedTuple):
    """File of Rerun's web viewer with its MIME type."""

    kind: str
    body: bytes


@cache
def viewer_files() -> dict[str, ViewerFile]:
    """Return the viewer's page (path ``/``) and the files that it loads, by path.

    They are read from Rerun's server, which is then stopped.

    Raises
    ------
    CamRigError
        If Rerun's server has no page or does not answer.
    """
    port, assets = find_free_port(), find_free_port()
    arguments = ("--serve-web", "--port", str(port), "--web-viewer-port", str(assets))
    with listening(*arguments, ports=(port, assets)):
        page = _viewer_file(assets, "/")
        if page is None:
            raise CamRigError(
                "this rerun-sdk serves no page; install the version that cam_rig needs"
            )
        names = {(first or second).decode() for first, second in NAMED.findall(page.body)}
        files = {f"/{name}": _viewer_file(assets, f"/{name}") for name in sorted(names)}
    return {"/": page} | {path: file for path, file in files.items() if file is not None}


def _viewer_file(port: int, path: str) -> ViewerFile | None:
    try:
        with closing(HTTPConnection(LOOPBACK, port, timeout=TIMEOUT_S)) as viewer:
            viewer.request("GET", path)
            response = viewer.getresponse()
            file = ViewerFile(response.headers.get_content_type(), response.read())
    except (OSError, HTTPException) as error:
        raise CamRigError(f"the viewer does not answer ({type(error).__name__})") from None
    return file if response.status == 200 else None

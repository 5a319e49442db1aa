"""Rerun's web viewer on this machine alone: no request goes to any other, no other user gets it.

The viewer's own page loads a font, looks for a newer version and reports its use. This server
serves the same page with a guard before all of its code: a request to another host is answered at
once with an empty response, and a content security policy keeps the browser from sending any.

Rerun's own ports ask nobody for anything, so none is open: the page reads its recording from this
server, behind its token. A live run's is read while the viewer's node writes it.
"""

from __future__ import annotations

import re
import select
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import BinaryIO, NamedTuple
from urllib.parse import parse_qs, quote, unquote, urlsplit

from cam_rig.files import temporary_folder
from cam_rig.viewer.access import HEADERS, Access
from cam_rig.viewer.live_folder import newest_recording, part_after, write_delay
from cam_rig.viewer.page import SHOWN_PATH, PageTime, page_script
from cam_rig.viewer.process import HOST
from cam_rig.viewer.viewer_files import ViewerFile, viewer_files

#: A viewer that keeps nothing from one visit to the next.
QUERY = "?hide_welcome_screen&persist=0&notebook=0&renderer=webgl"

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
    f"frame-ancestors http://{HOST}:* http://localhost:*"
)

#: What may be asked for: a path of plain characters.
PATH = re.compile(r"/[!-~]*")

#: Wall time (s) between two looks at whether a live run has more.
LOOK_S = 0.1

OUTSIDE = re.compile(rb'<link[^>]*"https://[^>]*>')


class Pages(NamedTuple):
    """The address for a browser, the folder that a live run is written into.

    And what the pages show.
    """

    address: str
    folder: Path
    page: PageTime


@contextmanager
def serve_file(path: Path, begin: float = 0.0) -> Iterator[str]:
    """The address at which a browser shows a recording, as long as the context lasts.

    ``begin`` is the rig time (s) that it shows first.
    """
    with _serving(path, None, begin) as server:
        yield server.access.address


@contextmanager
def serve() -> Iterator[Pages]:
    """Serve what a live run writes to a browser, as long as the context lasts."""
    with temporary_folder() as folder, _serving(None, folder) as server:
        yield Pages(server.access.address, folder, server.page)


@contextmanager
def _serving(path: Path | None, folder: Path | None, begin: float = 0.0) -> Iterator[_Server]:
    server = _Server(viewer_files(), path, folder, begin)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield server
    finally:
        server.ended.set()
        server.shutdown()
        server.server_close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(
        self, files: dict[str, ViewerFile], path: Path | None, folder: Path | None, begin: float
    ) -> None:
        super().__init__((HOST, 0), _Handler)
        self.path, self.folder, self.page = path, folder, PageTime()
        self.access, self.ended = Access(self.server_address[1]), threading.Event()
        script = (GUARD + page_script(begin)).encode()
        page = OUTSIDE.sub(b"", files["/"].body).replace(b"<head>", b"<head>" + script, 1)
        self.files = files | {"/": ViewerFile(files["/"].kind, page)}

    def recording(self) -> Path | None:
        """What is to be shown; None before a live run has begun."""
        return self.path if self.folder is None else newest_recording(self.folder)


class _Handler(BaseHTTPRequestHandler):
    server: _Server

    def do_GET(self) -> None:
        """A recording, or the viewer; without a question, the way to what is shown."""
        if not PATH.fullmatch(self.path):
            return self.send_error(400, "allowed: a path that begins with /")
        asked = urlsplit(self.path)
        token = parse_qs(asked.query).get("token", [None])[0]
        headers = {name.lower(): value for name, value in self.headers.items()}
        if words := self.server.access.why_not(headers, token):
            return self.send_error(403, words)
        recording, name = self.server.recording(), unquote(asked.path[1:])
        if token is not None or (asked.path == "/" and not asked.query):
            self.send_response(302)
            self.send_header("Location", f"/{QUERY}")
            if token is not None:
                self.send_header("Set-Cookie", self.server.access.cookie)
            self.end_headers()
        elif asked.path == SHOWN_PATH:
            self._shown(asked.query, recording)
        elif recording is not None and name == recording.name:
            self._recording(recording)
        elif asked.path in self.server.files:
            self._body(self.server.files[asked.path])
        else:
            self.send_error(404)

    def _shown(self, query: str, recording: Path | None) -> None:
        """Take what a page shows; it is told what to show."""
        self.server.page.take(query)
        if self.server.folder is not None:
            write_delay(self.server.folder, self.server.page.behind())
        name = "" if recording is None else quote(recording.name)
        self._body(ViewerFile("text/plain", name.encode()))

    def _recording(self, path: Path) -> None:
        with suppress(ConnectionError):  # a page may be closed while it loads
            if self.server.folder is not None:
                self._head("application/octet-stream")
                return self._follow(path)
            try:
                stream = path.open("rb")
            except OSError:
                return self.send_error(404)
            with stream:
                self._head("application/octet-stream", path.stat().st_size)
                shutil.copyfileobj(stream, self.wfile)

    def _follow(self, first: Path) -> None:
        """Send what is written, until another run begins, the page is closed or the server ends."""
        part: Path | None = first
        while part is not None:
            # Of a part that has been removed meanwhile the page goes on to the next.
            with suppress(FileNotFoundError), part.open("rb") as stream:
                if not self._send_part(first, part, stream):
                    return
            part = part_after(part)

    def _send_part(self, first: Path, part: Path, stream: BinaryIO) -> bool:
        """Send a part as it is written; whether it is whole, for there is another."""
        while not self.server.ended.is_set():
            whole, over = part_after(part) is not None, self.server.recording() != first
            shutil.copyfileobj(stream, self.wfile)
            if whole or over or select.select([self.connection], [], [], LOOK_S)[0]:
                return whole
        return False

    def _body(self, file: ViewerFile) -> None:
        with suppress(ConnectionError):  # a page may be closed while it loads
            self._head(file.kind, len(file.body))
            self.wfile.write(file.body)

    def _head(self, kind: str, size: int | None = None) -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        if size is not None:
            self.send_header("Content-Length", str(size))
        self.end_headers()

    def end_headers(self) -> None:
        """With what every answer is sent."""
        for name, value in (HEADERS | {"Content-Security-Policy": POLICY}).items():
            self.send_header(name, value)
        super().end_headers()

    def log_message(self, *_words: object) -> None:
        """Say nothing: a terminal shows the run, not the browser's questions."""

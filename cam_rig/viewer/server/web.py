"""Rerun's web viewer on this machine alone: no request goes to any other.

The viewer's own page loads a font, looks for a newer version and reports its use. This server
serves the same page with a guard before all of its code: a request to another host is answered at
once with an empty response, and a content security policy keeps the browser from sending any. A
request under another host name than this machine's is refused, and its path is never looked up as
a name.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote, urlsplit

from cam_rig.viewer.server.page_time import PageTime
from cam_rig.viewer.server.process import HOST, free_port, listening, stream_address
from cam_rig.viewer.server.scripts import BEHIND_PATH, SHOWN_PATH, page_script

#: A viewer that keeps nothing from one visit to the next.
QUERY = "?hide_welcome_screen&persist=0&notebook=0&renderer=webgl&url="
GUARD = """<script>
const ask = window.fetch;
window.fetch = (what, how) => {
  const url = new URL(what instanceof Request ? what.url : what, location.href);
  const here = url.hostname === location.hostname;
  return here ? ask(what, how) : Promise.resolve(new Response(null, { status: 204 }));
};
</script>"""
POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' blob: data:; "
    f"connect-src 'self' blob: data: http://{HOST}:*"
)
#: What may be asked for: a path of plain characters.
PATH = re.compile(r"/[!-~]*")
#: How long the viewer's own server may take to answer, s.
TIMEOUT_S = 20.0
OUTSIDE = re.compile(rb'<link[^>]*"https://[^>]*>')


class Pages(NamedTuple):
    """The address for a browser, the one to which a live run is sent, the viewer's process.

    And what the pages show.
    """

    address: str
    stream: str
    viewer: subprocess.Popen[bytes]
    page: PageTime


@contextmanager
def serve_file(path: Path, begin: float = 0.0) -> Iterator[str]:
    """The address at which a browser shows a recording, as long as the context lasts.

    ``begin`` is the rig time (s) that it shows first.
    """
    with serve(path, begin) as pages:
        yield pages.address


@contextmanager
def serve(path: Path | None = None, begin: float = 0.0) -> Iterator[Pages]:
    """Serve a recording to a browser, or what a live run sends, as long as the context lasts.

    ``begin`` is the rig time (s) that a page shows first.
    """
    port, assets = free_port(), free_port()
    arguments = ("--serve-web", "--port", str(port), "--web-viewer-port", str(assets))
    with listening(*arguments, ports=(port, assets)) as viewer:
        server = _Server(assets, port, path, begin)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield Pages(f"{server.origin}/", stream_address(port), viewer, server.page)
        finally:
            server.shutdown()
            server.server_close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, assets: int, port: int, path: Path | None, begin: float) -> None:
        super().__init__((HOST, 0), _Handler)
        self.assets, self.path, self.page = assets, path, PageTime()
        self.script = (GUARD + page_script(begin)).encode()
        # Another name that a page made the browser resolve to this machine gets nothing.
        self.hosts = tuple(f"{name}:{self.server_address[1]}" for name in (HOST, "localhost"))
        self.origin = f"http://{self.hosts[0]}"
        self.data = stream_address(port) if path is None else f"{self.origin}/{quote(path.name)}"


class _Handler(BaseHTTPRequestHandler):
    server: _Server

    def do_GET(self) -> None:
        """The recording, or the viewer; without a question, the way to what is shown."""
        if self.headers.get("Host") not in self.server.hosts:
            return self.send_error(403, f"allowed hosts: {', '.join(self.server.hosts)}")
        if not PATH.fullmatch(self.path):
            return self.send_error(400, "allowed: a path that begins with /")
        asked, recording = urlsplit(self.path), self.server.path
        if asked.path == "/" and not asked.query:
            self.send_response(302)
            self.send_header("Location", f"/{QUERY}{quote(self.server.data, safe='')}")
            self.end_headers()
        elif asked.path == SHOWN_PATH:
            self.server.page.take(asked.query)
            self.send_response(204)
            self.end_headers()
        elif asked.path == BEHIND_PATH:
            late = self.server.page.behind()
            body = b"" if late is None else f"{late:.3f}".encode()
            self._head("text/plain", len(body))
            self.wfile.write(body)
        elif recording is not None and asked.path == f"/{quote(recording.name)}":
            self._recording(recording)
        else:
            self._viewer(asked.path)

    def _recording(self, path: Path) -> None:
        try:
            stream = path.open("rb")
        except OSError:
            return self.send_error(404)
        with stream, suppress(ConnectionError):  # a page may be closed while it loads
            self._head("application/octet-stream", path.stat().st_size)
            shutil.copyfileobj(stream, self.wfile)

    def _viewer(self, path: str) -> None:
        """A part of Rerun's own viewer."""
        try:
            with closing(HTTPConnection(HOST, self.server.assets, timeout=TIMEOUT_S)) as viewer:
                viewer.request("GET", path)
                answer = viewer.getresponse()
                kind, body = answer.headers.get_content_type(), answer.read()
        except (OSError, HTTPException) as error:
            return self.send_error(502, f"the viewer does not answer ({type(error).__name__})")
        if answer.status != 200:
            return self.send_error(answer.status)
        if kind == "text/html":
            inserted = b"<head>" + self.server.script
            body = OUTSIDE.sub(b"", body).replace(b"<head>", inserted, 1)
        with suppress(ConnectionError):  # a page may be closed while it loads
            self._head(kind, len(body))
            self.wfile.write(body)

    def _head(self, kind: str, size: int) -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(size))
        self.send_header("Content-Security-Policy", POLICY)
        self.end_headers()

    def log_message(self, *_words: object) -> None:
        """Say nothing: a terminal shows the run, not the browser's questions."""

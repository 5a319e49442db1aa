"""The files of Rerun's own web viewer, taken from its server, which is not needed after that."""

from __future__ import annotations

import re
from contextlib import closing
from http.client import HTTPConnection, HTTPException
from typing import NamedTuple

from cam_rig.errors import CamRigError
from cam_rig.viewer.process import HOST, free_port, listening

#: How long Rerun's server may take to answer, s.
TIMEOUT_S = 20.0

#: What its page names of its own: a script, a module, an icon.
NAMED = re.compile(rb'(?:src|href)="([\w.-]+)"|fetch\("\./([\w.-]+)"\)')


class ViewerFile(NamedTuple):
    """A file with its MIME type."""

    kind: str
    body: bytes


def viewer_files() -> dict[str, ViewerFile]:
    """The page at ``/`` and what it asks for, by their paths."""
    port, assets = free_port(), free_port()
    arguments = ("--serve-web", "--port", str(port), "--web-viewer-port", str(assets))
    with listening(*arguments, ports=(port, assets)):
        page = _file(assets, "/")
        if page is None:
            raise CamRigError("the viewer has no page of its own; allowed: rerun-sdk as required")
        names = {(one or other).decode() for one, other in NAMED.findall(page.body)}
        found = {f"/{name}": _file(assets, f"/{name}") for name in sorted(names)}
    return {"/": page} | {path: file for path, file in found.items() if file is not None}


def _file(port: int, path: str) -> ViewerFile | None:
    """A file of Rerun's server; None where it has none."""
    try:
        with closing(HTTPConnection(HOST, port, timeout=TIMEOUT_S)) as viewer:
            viewer.request("GET", path)
            answer = viewer.getresponse()
            found = ViewerFile(answer.headers.get_content_type(), answer.read())
    except (OSError, HTTPException) as error:
        raise CamRigError(f"the viewer does not answer ({type(error).__name__})") from None
    return found if answer.status == 200 else None

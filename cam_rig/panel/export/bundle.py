"""One HTML file with the scripts, the styles and the data of a page, for opening without a server.

A browser does not load modules from file addresses. Each module is therefore a ``data:`` address in
an import map, under its path below the folder of static files, and its relative imports are
replaced by these paths. The data are JSON, compressed by gzip, in base64.
"""

from __future__ import annotations

import base64
import gzip
import json
import posixpath
import re
from typing import Any

from cam_rig.panel.server import STATIC, style_variables

#: Import statement of a module, in one line, with its relative path.
IMPORT = re.compile(r'^(import (?:.* from )?)"(\.[^"]+)";$', re.MULTILINE)
#: Link to a style sheet of a page.
STYLE_LINK = re.compile(r'<link rel="stylesheet" href="/static/([^"]+)">\n')
#: Script element of a page's first module.
SCRIPT = re.compile(r'<script type="module" src="/static/([^"]+)"></script>')
#: Content-Security-Policy: scripts and styles of this file only, and no requests.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' data:; style-src 'unsafe-inline'; "
    "img-src data:; base-uri 'none'; form-action 'none'"
)
#: Import of the variables of the style sheets from the server.
LOOKS_IMPORT = '@import url("/looks.css");\n'


def bundle_page(page: str, data: dict[str, Any], replaced: dict[str, str]) -> str:
    """Return the HTML file of a page that needs no server.

    Parameters
    ----------
    page : str
        Path of the page's HTML file below the folder of static files.
    data : dict
        JSON data. The page's modules read them from the element ``data``.
    replaced : dict
        Paths of modules that are replaced by other modules, such as that of the connection.
    """
    html = (STATIC / page).read_text("utf-8")
    entry = SCRIPT.search(html)
    assert entry is not None, f"{page}: no module"
    sources = collect_modules(entry[1], replaced)
    addresses = {name: _data_address(source) for name, source in sources.items()}
    packed = gzip.compress(json.dumps(data).encode(), mtime=0)
    head = (
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        f'<script type="importmap">{json.dumps({"imports": addresses})}</script>\n'
        f'<script type="text/plain" id="data">{base64.b64encode(packed).decode()}</script>\n'
        f'<script type="module">import "{entry[1]}";</script>'
    )
    html = STYLE_LINK.sub(lambda link: f"<style>\n{_style(link[1])}</style>\n", html)
    return SCRIPT.sub(lambda _: head, html)


def collect_modules(entry: str, replaced: dict[str, str]) -> dict[str, str]:
    """Return the sources of a module and of all modules that it imports, by their paths.

    The imports in the sources are paths below the folder of static files. A module in `replaced`
    has the source of its replacement.
    """
    sources, open_paths = dict[str, str](), [entry]
    while open_paths:
        path = open_paths.pop()
        if path in sources:
            continue
        file = replaced.get(path, path)

        def rewrite(statement: re.Match[str], folder: str = posixpath.dirname(file)) -> str:
            target = posixpath.normpath(posixpath.join(folder, statement[2]))
            open_paths.append(target)
            return f'{statement[1]}"{target}";'

        sources[path] = IMPORT.sub(rewrite, (STATIC / file).read_text("utf-8"))
    return sources


def _data_address(source: str) -> str:
    return f"data:text/javascript;base64,{base64.b64encode(source.encode()).decode()}"


def _style(path: str) -> str:
    text = (STATIC / path).read_text("utf-8")
    return text.replace(LOOKS_IMPORT, style_variables())

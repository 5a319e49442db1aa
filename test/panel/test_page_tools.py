"""Type check and accessibility check of the web pages by the tools in tools/pages.

The types are those in the comments of the scripts and in messages.d.ts.
"""

import itertools
import json
import re
from pathlib import Path

import pytest

from cam_rig.panel.bench.live_state import NotedReading
from cam_rig.panel.lab.labs import LABS
from cam_rig.panel.lab.pages import LabPages
from cam_rig.panel.server import serve

from ..processes import ended
from ..viewer.asking import Visitor
from .conftest import BENCH, BOARD, BrowserPage, in_browser, received, sheet_of, with_moved_ordinate

ROOT = Path(__file__).parents[2]
TOOLS = ROOT / "tools/pages"
SCRIPTS = sorted((ROOT / "cam_rig/panel/static").rglob("*.js"))
TSC = TOOLS / "node_modules/.bin/tsc"


def tsc(*arguments):
    """Run the TypeScript compiler and return the finished process."""
    return ended(TSC, *arguments, cwd=TOOLS)


@pytest.mark.skipif(not TSC.exists(), reason="no TypeScript: make check-pages")
def test_the_scripts_satisfy_their_types():
    """The TypeScript compiler checks every script of the pages and finds no error."""
    result = tsc("--listFiles")
    assert result.returncode == 0, result.stdout
    checked = {Path(line).resolve() for line in result.stdout.splitlines()}
    assert [path.name for path in SCRIPTS if path.resolve() not in checked] == []


def test_no_script_disables_the_type_check():
    """No script contains a comment that excludes a file or line from the type check."""
    suppression = re.compile(r"@ts-(nocheck|ignore|expect-error)")
    assert [path.name for path in SCRIPTS if suppression.search(path.read_text("utf-8"))] == []


# -- the server sends the messages that messages.d.ts declares


def wrong_types(folder, messages):
    """Return the output of the TypeScript compiler for messages.

    `messages` is a dict from a name to (declared type, message).
    """
    text = "".join(
        f"const {name}: {kind} = {json.dumps(message)};\n"
        for name, (kind, message) in messages.items()
    )
    (folder / "sent.ts").write_text(text, encoding="utf-8")
    options = "--ignoreConfig --noEmit --strict --target es2022 --lib es2023,dom"
    return tsc(*options.split(), "--types", "", folder / "sent.ts", TOOLS / "messages.d.ts").stdout


@pytest.mark.skipif(not TSC.exists(), reason="no TypeScript: make check-pages")
def test_every_sent_message_has_its_declared_type(served, tmp_path):
    """Each message that the server sends has the type declared in messages.d.ts.

    No field is missing, undeclared or of another type.
    """
    sent = {
        "board": ("Board", json.loads(served.get("/board"))),
        "cam": ("CamPicture", json.loads(served.get("/bench/cam/poly345"))),
    }
    with served.page(BOARD) as socket:
        undercut = with_moved_ordinate(served.board, 0.5)
        socket.send(json.dumps({"number": 1, "ordinates": undercut, "rpm": 300.0}))
        socket.send(json.dumps({"number": 2, "ordinates": [], "rpm": 300.0}))
        for kind, message in received(socket, "changed", "fast", "refused", "full").items():
            sent[kind] = ("FullResults" if kind == "full" else kind.capitalize(), message)
    live = served.bench.live
    live.readings.append(NotedReading("a", "one_mass", 300.0, 80.0, "LZF", "in contact", 0, 1, 2))
    live.on_node_message({"state": {"time_ns": 1, "cam": "poly345", "angle": 0.5, "rpm": 300.0}})
    with served.page(BENCH) as socket:
        socket.send(json.dumps({"number": 1, "do": "clear"}))
        sent |= {
            kind: ({"live": "Live", "answer": "SentAnswer"}[kind], message)
            for kind, message in received(socket, "live", "answer").items()
        }
    for i, rpm in enumerate((300.0, 600.0)):
        sent[f"expected_{i}"] = ("Expected", served.send("/bench/expected", {"rpm": rpm})[1])
    for lab in LABS:
        for seed in (None, "alpha"):
            pages = LabPages(sheet_of(lab=lab, seed=seed), tmp_path)
            book, setup = pages.notebook, vars(pages.notebook.sheet.setups[0])
            book.record(setup | {"rpm": book.sheet.knob[0] + 1.0})
            if book.sheet.answer:
                book.answer(setup | {"answer": "1,5"})
            with serve(pages) as panel:
                data = json.loads(Visitor(panel.address).get("/lab/sheet"))
            sent[f"{lab}_{seed}".lower()] = ("LabSheet", data)
    assert wrong_types(tmp_path, sent) == ""
    control = sent["board"][1] | {"rpm": "300", "unknown": 1}
    del control["start"]
    output = wrong_types(tmp_path, {"control": ("Board", control)})
    assert "'string' is not assignable to type 'number'" in output


# -- accessibility: axe-core finds no violation

AXE = TOOLS / "node_modules/axe-core/axe.min.js"
#: Path of each page, and the element id that is filled last.
FILLED = {"/": "level", "/bench": "graph", "/lab": "contact"}
#: Script that makes hidden elements and details visible, so that they are checked too.
SHOW_HIDDEN = """document.querySelectorAll('[hidden]').forEach((one) => { one.hidden = false; });
document.querySelectorAll('details').forEach((one) => { one.open = true; })"""
VIOLATIONS = """() => axe.run().then(({ violations }) => violations.flatMap(({ id, nodes }) =>
  nodes.map(({ html, failureSummary }) => `${id}: ${html.slice(0, 120)} ${failureSummary}`)))"""
CASES = [
    pytest.param(*case, marks=() if case == ("/bench", "es", "dark") else pytest.mark.long)
    for case in itertools.product(FILLED, ("en", "es"), ("light", "dark"))
]


@pytest.mark.slow
@pytest.mark.skipif(not AXE.exists(), reason="no axe-core: make check-pages")
@pytest.mark.parametrize(("path", "language", "scheme"), CASES)
def test_axe_finds_no_violation(chromium, served, path, language, scheme):
    """axe-core finds no violation of accessibility on a filled page.

    Hidden elements are included, in both languages and colour schemes. As a control, an image
    without a text must be detected.
    """
    looks = {"color_scheme": scheme, "viewport": {"width": 1280, "height": 800}}
    with in_browser(chromium, BrowserPage, bypass_csp=True, **looks) as shown:
        chosen = f"sessionStorage.setItem('language', '{language}')"
        shown.page.context.add_init_script(chosen)
        shown.open(served.address, path)
        shown.until(lambda: shown.text(FILLED[path]) not in ("", "–", "None"))
        shown.page.evaluate(SHOW_HIDDEN)
        shown.page.evaluate(AXE.read_text(encoding="utf-8"))
        assert shown.page.evaluate(VIOLATIONS) == []
        assert shown.page.evaluate("document.documentElement.lang") == language
        shown.page.evaluate("document.querySelector('main').append(new Image())")
        (control,) = shown.page.evaluate(VIOLATIONS)
        assert control.startswith("image-alt: ")

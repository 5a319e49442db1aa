"""cam-rig report: one whole page with every figure and table, or a line and nothing written."""

import json
import re
from concurrent.futures import Future
from contextlib import nullcontext

import pytest
from typer.testing import CliRunner

from cam_rig.cli.main import app
from cam_rig.schema.load import config_root


def call(*arguments):
    return CliRunner().invoke(app, ["report", *(str(a) for a in arguments)])


def sentences(page):
    """Every sentence of a page, a cell of a table being one or more."""
    parts = re.findall(r"<(p|li|td|th|caption|figcaption|h\d)\b[^>]*>(.*?)</\1>", page, re.DOTALL)
    for _, text in parts:
        plain = " ".join(re.sub("<[^>]*>", " ", text).split())
        yield from re.split(r"(?<=[.!?”])\s+(?=[A-Z“])", plain)


def too_long(page):
    """The sentences of more than 30 words."""
    return [sentence for sentence in sentences(page) if len(sentence.split()) > 30]


def opening(page):
    """How many sentences stand before the first section's end."""
    (summary,) = re.findall(r'<section id="summary">(.*?)</section>', page, re.DOTALL)
    return sum(1 for _ in sentences(summary.split("</h2>")[1]))


def test_a_long_sentence_is_found():
    """One of 31 words, in any part of a page."""
    words = "Word" + 30 * " word"
    page = f"<p>Short. {words}. Short.</p><td class='x'>{words}</td><li>{words[5:]}</li>"
    assert too_long(page) == [f"{words}.", words]


@pytest.fixture
def in_this_process(monkeypatch):
    """What the command would do in processes of its own."""

    class Here:
        def submit(self, function, *given):
            done = Future()
            done.set_result(function(*given))
            return done

    monkeypatch.setattr("cam_rig.cli.common.workers.workers", lambda _count: nullcontext(Here()))


@pytest.mark.slow
@pytest.mark.usefixtures("in_this_process", "one_study")
def test_the_page(sweep, tmp_path):
    """Every section with its figures inside, tables 1 to 3, origins; JSON as well.

    It opens with five sentences, none anywhere is over 30 words, and tables do not break in print.
    """
    out, data = tmp_path / "out" / "report.html", tmp_path / "out" / "report.json"
    result = call("--out", out, "--scene", sweep, "--json", data)
    assert result.exit_code == 0, result.stderr
    page = out.read_text(encoding="utf-8")
    pictures = re.findall(r'<img src="(.{40})', page)
    assert len(pictures) == 17
    assert all(p.startswith("data:image/svg+xml;base64,") for p in pictures)
    for words in ("Table 1.", "Table 2.", "Table 3.", "Given, assumed, identified"):
        assert words in page
    for number in (1, 2, "3.1 to 3.12", 4, 11, 12, 16):
        assert re.search(rf"Figs?\. {number}\b", page)
    for outward in ("<script", "http://", "https://", "<link"):
        assert outward not in page
    assert too_long(page) == []
    assert opening(page) == 5
    for word in ("ringing", "swing", "cells left", "of its variance"):
        assert word not in page
    assert set(json.loads(data.read_text())) == {
        *("jump", "as-cut", "timing", "vibration", "contact", "noise", "orders", "factorial")
    }
    assert sorted(p.name for p in out.parent.iterdir()) == ["report.html", "report.json"]


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--out", "{tmp}/a.pdf"], 2, "unknown kind of page; allowed: .html, .md"),
        (["--out", "{tmp}"], 2, "unknown kind of page"),
        (["--out", "/dev/null/a.html"], 1, "cannot be written, /dev/null is no writable folder"),
        (["--out", "{tmp}/a.html", "--bag", "{golden}"], 1, "is a recording of the scene 'quick'"),
        (["--out", "{tmp}/a.html", "--bag", "{tmp}/none"], 1, "no such bag"),
        (["--out", "{tmp}/a.html", "--rig", "tm21"], 2, "has no roller_share"),
        (["--out", "{tmp}/a.html", "--scene", "no_such"], 2, "no such file"),
        (["--out", "{tmp}/a.html", "--factorial", "no_such"], 2, "no such file"),
    ],
)
def test_refusals(tmp_path, arguments, code, words):
    """Wrong places, bags and names are told before anything runs, and nothing is written."""
    golden = str(config_root().parent / "bags" / "golden")
    texts = (a.replace("{tmp}", str(tmp_path)).replace("{golden}", golden) for a in arguments)
    result = call(*texts)
    assert result.exit_code == code
    assert words in result.stderr
    assert list(tmp_path.iterdir()) == []

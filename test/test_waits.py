"""No test waits for ever: for a process, a thread, a queue or an event."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).parent
RUN = {"call", "check_call", "check_output", "run"}
#: Methods of processes, threads, futures, queues and events that wait for ever if given nothing.
ENDLESS = {"communicate", "get", "join", "result", "wait"}


def endless(text: str) -> Iterator[str]:
    """The calls of a module that wait, without a limit."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            name, given = node.func.attr, {keyword.arg for keyword in node.keywords}
            waits = name in ENDLESS and not node.args
            waits |= name in RUN and ast.unparse(node.func.value) == "subprocess"
            if (waits or name == "communicate") and not given & {"timeout", None}:
                yield f"line {node.lineno}: {ast.unparse(node)}"


@pytest.mark.parametrize("text", ["subprocess.run(['a'])", "a.wait()", "b().communicate('words')"])
def test_what_waits_for_ever_is_found(text: str) -> None:
    """Else the test below would hold of anything."""
    assert list(endless(text))
    assert not list(endless(f"{text[:-1]}, timeout=1)".replace("(, ", "(")))


def test_every_wait_of_a_test_has_a_limit() -> None:
    """In every module of the tests."""
    modules = {path: list(endless(path.read_text())) for path in HERE.rglob("*.py")}
    assert len(modules) > 100
    assert not {path: found for path, found in modules.items() if found}

"""What the tests lean on: stored references, domains of their own, a limit to every wait."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cam_rig.testing.running_rig import hold_domain

from .references import References


def test_a_reference_is_of_its_numbers_alone(tmp_path):
    path, values = tmp_path / "references" / "a.json", [np.pi, 1e-300]
    assert References("write", path, "t")(lambda: values, [3.0, [1e8, 1e-3]]).tolist() == values
    assert References("stored", path, "t")(pytest.fail, [3.0, [1e8, 1e-3]]).tolist() == values
    with pytest.raises(AssertionError, match="is of other numbers; run `make references`"):
        References("stored", path, "t")(pytest.fail, [3.0, [1e8, 1.0001e-3]])
    with pytest.raises(AssertionError, match="has no u:0"):
        References("stored", path, "u")(pytest.fail, [3.0])
    found = References("compute", path, "t")(lambda: values, [3.0, [1e8, 1e-3]])
    assert found.tolist() == values
    with pytest.raises(AssertionError, match="run `make references`"):
        References("compute", path, "t")(lambda: [3.14159265, 0.0], [3.0, [1e8, 1e-3]])
    assert list(json.loads(path.read_text(encoding="utf-8"))) == ["t:0"]


def test_no_two_hold_one_domain():
    with hold_domain() as one, hold_domain() as two:
        assert one != two
        assert {one, two} <= set(range(40, 101))


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
    assert list(endless(text))
    assert not list(endless(f"{text[:-1]}, timeout=1)".replace("(, ", "(")))


def test_every_wait_of_a_test_has_a_limit() -> None:
    modules = {path: list(endless(path.read_text())) for path in HERE.rglob("*.py")}
    assert len(modules) > 100
    assert not {path: found for path, found in modules.items() if found}

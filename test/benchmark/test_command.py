"""python -m benchmark.speed: what cannot be written is refused before anything is measured."""

import pytest
import typer
from typer.testing import CliRunner

from benchmark.speed import report as bench

app = typer.Typer()
app.command()(bench.bench)


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--plot", "{tmp}/a.xyz"], 2, "unknown kind of picture; allowed: .png"),
        (["--plot", "{tmp}/a.png/"], 1, "is a folder; allowed: a file"),
        (["--json", "{tmp}/file/x.json"], 1, "is no writable folder"),
    ],
)
def test_a_place_is_refused_before_the_study(tmp_path, monkeypatch, arguments, code, words):
    """A study takes minutes: one line comes first, with the code of a wrong argument."""
    monkeypatch.setattr(bench, "measure", lambda *_: pytest.fail("the study ran"))
    (tmp_path / "file").write_text("", encoding="utf-8")
    (tmp_path / "a.png").mkdir()
    result = CliRunner().invoke(app, [a.format(tmp=tmp_path) for a in arguments])
    assert result.exit_code == code
    assert result.stderr.count("\n") == 1
    assert words in result.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"a.png", "file"}

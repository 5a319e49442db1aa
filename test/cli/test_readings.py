"""cam-rig readings: what is refused before anything runs, and a short search."""

from typer.testing import CliRunner

from cam_rig.cli.main import app


def call(*words):
    return CliRunner().invoke(app, ["readings", *map(str, words)])


def test_an_unknown_reading_is_refused_with_those_there_are():
    """The likeliest name, and all of them."""
    result = call("--search", "wieght")
    assert result.exit_code == 2
    assert "did you mean 'weight'?" in result.stderr
    assert "five_speeds" in result.stderr


def test_a_search_says_what_it_found_and_misses(tmp_path):
    """One number over one generation: a table of numbers, one of misses, and both as CSV."""
    out = tmp_path / "found.csv"
    result = call("--search", "printed_stem", "--nearby", "--generations", 1, "--csv", out)
    assert result.exit_code == 0, result.stderr
    assert "best of 128 trials" in result.output
    lines = out.read_text(encoding="utf-8")
    assert all(cam in lines for cam in ("bezier15", "bezier_segments"))


def test_what_only_a_search_obeys_is_refused_without_one():
    """Rather than passed over."""
    result = call("--with-times")
    assert result.exit_code == 2
    assert "needed: --search NAME" in result.stderr

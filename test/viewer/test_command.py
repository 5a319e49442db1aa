"""Opening the viewer fails with words, and the command line says them."""

import re
import sys

import pytest
import typer
from typer.testing import CliRunner

from cam_rig.errors import CamRigError
from cam_rig.viewer import process as viewer
from cam_rig.viewer.command import view
from cam_rig.viewer.recording import save_recording
from cam_rig.viewer.run_recorder import RunRecorder

app = typer.Typer()
app.command()(view)


@pytest.fixture
def no_display(monkeypatch):
    """A Linux machine without a screen."""
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)


def test_the_viewer_gets_the_file_listens_to_nobody_else_and_reports_no_usage(
    monkeypatch, tmp_path
):
    """Bound to loopback, quiet as where CI is set; its exit code is told, with the way out."""
    said = tmp_path / "said"
    monkeypatch.delenv("CI", raising=False)
    words = (
        f"import os, sys; open({str(said)!r}, 'w').write(f'{{sys.argv}} {{os.environ[\"CI\"]}}')"
    )
    monkeypatch.setattr(viewer, "COMMAND", words)
    viewer.show(tmp_path / "a.rrd")
    assert said.read_text().endswith(
        f"'--bind', '127.0.0.1', '--hide-welcome-screen', '--new', '{tmp_path / 'a.rrd'}'] 1"
    )
    monkeypatch.setattr(viewer, "COMMAND", "import sys; sys.exit(3)")
    with pytest.raises(CamRigError, match=r"ended with code 3.*--save"):
        viewer.show(tmp_path / "a.rrd")


@pytest.mark.usefixtures("no_display")
def test_without_a_screen_the_command_says_so(bag):
    """Exit code 1, one line, before any work is done."""
    result = CliRunner().invoke(app, [str(bag.path)])
    assert result.exit_code == 1
    assert "no display to open the viewer on" in result.stderr
    assert "--save FILE.rrd" in result.stderr


@pytest.mark.usefixtures("no_display")
def test_saving_needs_no_screen_and_tells_path_and_size(bag, tmp_path):
    """The folder is made; a second time the file is in the way, but for --force."""
    path = tmp_path / "out" / "a.rrd"
    command = [str(bag.path), "--save", str(path)]
    first, second = (CliRunner().invoke(app, command) for _ in range(2))
    assert first.exit_code == 0
    assert re.fullmatch(rf"{re.escape(str(path))}: \d+\.\d MB", first.stderr.strip())
    assert second.exit_code == 1
    assert "exists already" in second.stderr
    assert CliRunner().invoke(app, [*command, "--force"]).exit_code == 0


def test_what_cannot_be_is_refused(bag, tmp_path):
    """The message names the speeds there are, or the options that do not go together."""
    save = ["--save", "{tmp}/a.rrd"]
    for options, code, words in (
        ([*save, "--web"], 2, "--save and --web"),
        (["--force"], 2, "--force: overwrites the file of --save"),
        (["--save", "{tmp}"], 1, "is a folder; name a file in it, such as"),
        *(
            (
                [*save, "--layout", "compare", "--rpm", rpm],
                2,
                f"{rpm} rpm: the scene has no such speed; allowed: 300, 700",
            )
            for rpm in ("500", "nan", "inf", "-300")
        ),
    ):
        command = [str(bag.path), *(option.format(tmp=tmp_path) for option in options)]
        result = CliRunner().invoke(app, command)
        assert result.exit_code == code
        assert words in result.stderr
        assert list(tmp_path.iterdir()) == []


def test_nothing_is_left_of_a_file_that_was_interrupted(bag, tmp_path, monkeypatch):
    """In the middle of the drawing, where there is a part of it."""

    def interrupted(*_):
        assert [path.name for path in tmp_path.iterdir()] == ["a.rrd.drawn.part"]
        raise KeyboardInterrupt

    monkeypatch.setattr(RunRecorder, "tick", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save_recording(bag.path, tmp_path / "a.rrd")
    assert list(tmp_path.iterdir()) == []

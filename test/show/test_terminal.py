"""Tests that control characters in texts from files are printed as escapes."""

import io
import random

import pytest
from rich.console import Console

from cam_rig.errors import CONTROLS, CamRigError, printable
from cam_rig.schema.load import config_root
from cam_rig.show import terminal
from cam_rig.show.tables import DataTable, Header

from ..cli.conftest import call

#: Text with control characters: red, clear screen, bell, return, reversed text direction.
BAD = "Be\x1b[31mnch\x9b2J\x07\r\u202e"


@pytest.fixture
def screen(monkeypatch):
    """Stream that receives what cam_rig prints to the terminal."""
    stream = io.StringIO()
    monkeypatch.setattr(terminal, "console", Console(file=stream, highlight=False, width=100))
    return stream


def test_lines_and_tables_are_printed_with_escapes(screen):
    """Printed lines and tables contain escapes instead of control characters.

    The control characters are in caption, headings, units, cells and notes of a table.
    """
    terminal.say(f"a\tline {BAD}")
    columns = tuple(Header(f"{BAD}{name}", BAD) for name in "ab")
    terminal.show(DataTable(BAD, columns, ((BAD, "x"), ("y", BAD)), (BAD,)))
    text = screen.getvalue()
    assert not CONTROLS.search(text)
    assert text.count(r"\x1b") >= 8 and r"a" in text


@pytest.mark.parametrize("seed", range(20))
def test_printable_text_has_no_control_and_keeps_the_rest(seed):
    """`printable` escapes all control characters of random texts, and no others."""
    chance = random.Random(seed)
    text = "".join(chr(chance.choice((chance.randrange(256), 0x2028, 0xE9))) for _ in range(200))
    found = printable(text)
    assert not CONTROLS.search(found)
    kept = CONTROLS.sub("", text)
    assert printable(kept) == kept


def test_errors_have_escapes():
    """The text of a CamRigError contains escapes instead of control characters."""
    assert str(CamRigError(BAD)) == r"Be\x1b[31mnch\x9b2J\x07" + r"\r" + r"\u202e"


def test_a_scene_with_such_a_title_is_printed_with_escapes(tmp_path, screen):
    """`simulate` prints escapes for the control characters in the title of a scene."""
    text = (config_root() / "scenes" / "quick.yaml").read_text(encoding="utf-8")
    lines = [r'title: "Be\e[31mnch\x07"' if "title:" in one else one for one in text.split("\n")]
    folder = tmp_path / "scenes"
    for name in ("cams", "rigs", "published"):
        (tmp_path / name).symlink_to(config_root() / name)
    folder.mkdir()
    (folder / "quick.yaml").write_text("\n".join(lines), encoding="utf-8")
    result = call("simulate", folder / "quick.yaml")
    printed = screen.getvalue() + result.output + result.stderr
    assert result.exit_code == 0 and r"Be\x1b[31mnch\x07" in printed
    assert not CONTROLS.search(printed)

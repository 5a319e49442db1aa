"""Error messages of config files that are wrong at one position."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from cam_rig.errors import ConfigError
from cam_rig.schema import load_cam, load_published, load_rig, load_scene

#: Kinds of files: a shipped file, and the function that loads it.
KINDS = {
    "cam": ("cams/poly345.yaml", load_cam),
    "table": ("cams/measured.yaml", load_cam),
    "rig": ("rigs/tm21.yaml", load_rig),
    "scene": ("scenes/tm21_sweep.yaml", load_scene),
    "published": ("published/tm21_noise.yaml", load_published),
}


def catch_error(function: Callable[..., object], *args: object, **kwargs: object) -> str:
    """Return the message of the ConfigError of a call, which must be one line."""
    with pytest.raises(ConfigError) as caught:
        function(*args, **kwargs)
    assert "\n" not in str(caught.value) and caught.value.exit_code == 2
    return str(caught.value)


@pytest.fixture
def load_text(tmp_path: Path) -> Callable[[str, str | bytes], str]:
    """Function that loads a text as a config file of a kind, and returns its error."""

    def load(kind: str, text: str | bytes) -> str:
        path = tmp_path / "continuity.yaml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        message = catch_error(KINDS[kind][1], path)
        assert message.startswith(f"{path}: ")
        return message.removeprefix(f"{path}: ")

    return load


@pytest.fixture
def load_edited(
    config_dir: Path, load_text: Callable[[str, str], str]
) -> Callable[[str, str, str], str]:
    """Function that edits the shipped file of a kind, loads it, and returns its error.

    It replaces a pattern by a text. The groups of the pattern precede the new text.
    """

    def edit(kind: str, old: str, new: str) -> str:
        text = (config_dir / KINDS[kind][0]).read_text(encoding="utf-8")
        edited, count = re.subn(old, lambda match: "".join(match.groups()) + new, text, count=1)
        assert count == 1, f"the shipped {kind} file does not contain {old!r}"
        return load_text(kind, edited)

    return edit

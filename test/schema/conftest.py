"""A config file made wrong in one place, and the error it gives."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from cam_rig.errors import ConfigError
from cam_rig.schema import load_cam, load_published, load_rig, load_scene

KINDS = {
    "cam": ("cams/poly345.yaml", load_cam),
    "table": ("cams/measured.yaml", load_cam),
    "rig": ("rigs/tm21.yaml", load_rig),
    "scene": ("scenes/tm21_sweep.yaml", load_scene),
    "published": ("published/tm21_noise.yaml", load_published),
}


def refusal(function: Callable[..., object], *given: object, **named: object) -> str:
    """The one line with which something is refused."""
    with pytest.raises(ConfigError) as caught:
        function(*given, **named)
    assert "\n" not in str(caught.value) and caught.value.exit_code == 2
    return str(caught.value)


@pytest.fixture
def error_of(tmp_path: Path) -> Callable[[str, str | bytes], str]:
    """Load a text as a file of a kind; the one line that it is refused with."""

    def load(kind: str, text: str | bytes) -> str:
        path = tmp_path / "continuity.yaml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        message = refusal(KINDS[kind][1], path)
        assert message.startswith(f"{path}: ")
        return message.removeprefix(f"{path}: ")

    return load


@pytest.fixture
def refuse(config_dir: Path, error_of: Callable[[str, str], str]) -> Callable[[str, str, str], str]:
    """Replace one piece of the shipped file of a kind; the line that it is refused with."""

    def spoil(kind: str, old: str, new: str) -> str:
        text = (config_dir / KINDS[kind][0]).read_text(encoding="utf-8")
        wrong, count = re.subn(old, lambda match: "".join(match.groups()) + new, text, count=1)
        assert count == 1, f"the shipped {kind} file has no {old!r}"
        return error_of(kind, wrong)

    return spoil

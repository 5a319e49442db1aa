"""A machine without a loopback is told at once, by each command that would wait for one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from cam_rig.live.loopback import require_loopback

ALONE = ["unshare", "--map-root-user", "--net"]
GOLDEN = Path(__file__).parents[2] / "bags" / "golden"


def test_this_machine_has_one() -> None:
    """The other tests need it."""
    require_loopback()


@pytest.mark.variants(2)
@pytest.mark.skipif(
    subprocess.run([*ALONE, "true"], capture_output=True, check=False, timeout=60).returncode != 0,
    reason="no network namespace can be made here",
)
@pytest.mark.parametrize("command", ["run quick --bag bag", "panel", "view {golden} --web"])
def test_without_one_a_command_says_so(command: str, tmp_path: Path) -> None:
    """In a network namespace whose loopback is down; with the remedy, and nothing is left."""
    words = command.format(golden=GOLDEN).split()
    done = subprocess.run(
        [*ALONE, Path(sys.executable).with_name("cam-rig"), *words],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        timeout=100,
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("cam-rig: the loopback interface, 127.0.0.1: is")
    assert done.stderr.rstrip().endswith("so: ip link set lo up")
    assert done.stdout == ""
    assert list(tmp_path.iterdir()) == []

"""The pages' JavaScript keeps the types that its comments and tools/pages/messages.d.ts tell of."""

import re
import subprocess
from pathlib import Path

import pytest

from .conftest import WAIT_S

ROOT = Path(__file__).parents[2]
TOOLS = ROOT / "tools/pages"
SCRIPTS = sorted((ROOT / "cam_rig/panel/static").rglob("*.js"))
TSC = TOOLS / "node_modules/.bin/tsc"


@pytest.mark.skipif(not TSC.exists(), reason="no TypeScript: make check-pages")
def test_the_pages_are_of_their_types():
    """By tsc, every check of it; a script that it does not see would pass unseen."""
    words = [TSC, "--listFiles"]
    checked = subprocess.run(
        words, cwd=TOOLS, capture_output=True, text=True, check=False, timeout=WAIT_S
    )
    assert checked.returncode == 0, checked.stdout
    seen = {Path(line).resolve() for line in checked.stdout.splitlines()}
    assert [path.name for path in SCRIPTS if path.resolve() not in seen] == []


def test_no_script_is_kept_from_the_check():
    """Neither a file nor a line says that it is not to be looked at."""
    excused = re.compile(r"@ts-(nocheck|ignore|expect-error)")
    assert [path.name for path in SCRIPTS if excused.search(path.read_text("utf-8"))] == []

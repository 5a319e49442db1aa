"""Pictures of lessons and tutorials, each written by a command of its page.

    .venv/bin/python -m tools.docs.course_pictures

``make pictures`` draws them too. A page can show ``NAME.png`` if one of its commands writes
``out/NAME.png``. Both languages show the same files.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

from PIL import Image

from cam_rig.errors import CamRigError
from cam_rig.files import atomic_write, temporary_folder
from cam_rig.show.command import user_errors
from cam_rig.show.terminal import console

COURSE = Path("docs/course")
TUTORIALS = [Path("docs/first_hour.md"), Path("docs/own_cam.md")]
SHOWN = re.compile(r"!\[[^\]]+\]\((?:\.\./)?(\w+)\.png\)")
FILE = re.compile(r'^```\w+ title="([^"]+)"\n(.*?)^```', re.M | re.S)
#: Command of a lesson, and the picture that it writes.
DRAWN = re.compile(r"^\$ (cam-rig .*--(?:plot|out) out/(\w+)\.png.*)$", re.M)
#: Command of a page that writes cam, rig and scene for later commands.
NEW = re.compile(r"^\$ (cam-rig new .*)$", re.M)
#: Number of colours of a picture. A plot has few colours, and the file is then a fifth as large.
COLOURS = 32
#: Width of a picture (px).
WIDTH = 1000


def lessons() -> list[Path]:
    """Return the pages of the lessons in English."""
    return sorted(COURSE.glob("[1-9]*.md"))


def pictures(page: Path) -> dict[str, str]:
    """Return the commands that write the pictures of a page, by picture name."""
    text = page.read_text(encoding="utf-8")
    made = {name: command for command, name in DRAWN.findall(text)}
    return {name: made[name] for name in SHOWN.findall(text)}


def draw(page: Path) -> None:
    """Run the commands of a page that write its pictures, in a temporary folder."""
    text = page.read_text(encoding="utf-8")
    with temporary_folder() as folder:
        for name, content in FILE.findall(text):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(content, encoding="utf-8")
        for command in [*NEW.findall(text), *pictures(page).values()]:
            call = [sys.executable, "-m", "cam_rig.cli.main", *shlex.split(command)[1:]]
            done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
            if done.returncode:
                raise CamRigError(f"{page.name}: {command}: {done.stderr.strip()}")
        for name in pictures(page):
            target = page.parent / f"{name}.png"
            with (
                atomic_write(target) as part,
                Image.open(folder / "out" / f"{name}.png") as picture,
            ):
                size = (WIDTH, round(picture.height * WIDTH / picture.width))
                small = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)
                small.quantize(COLOURS, dither=Image.Dither.NONE).save(part, optimize=True)
            console.print(f"{target}: {target.stat().st_size / 1e3:.0f} kB", soft_wrap=True)


def draw_all() -> None:
    """Draw the pictures of all lessons and tutorials."""
    for page in [*lessons(), *TUTORIALS]:
        draw(page)


if __name__ == "__main__":
    with user_errors():
        draw_all()

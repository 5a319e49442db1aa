"""Pictures of the lessons, each made by a command of its lesson.

    .venv/bin/python -m tools.docs.course_pictures

``make pictures`` makes them too. A lesson shows ``NAME.png`` if one of its commands writes
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
from cam_rig.files import temporary_folder, writing
from cam_rig.show.command import user_errors
from cam_rig.show.terminal import console

COURSE = Path("docs/course")
SHOWN = re.compile(r"!\[[^\]]+\]\((?:\.\./)?(\w+)\.png\)")
FILE = re.compile(r'^```\w+ title="([^"]+)"\n(.*?)^```', re.M | re.S)
#: Command of a lesson, and the picture that it writes.
DRAWN = re.compile(r"^\$ (cam-rig .*--(?:plot|out) out/(\w+)\.png.*)$", re.M)
#: Number of colours of a picture. A plot has few colours, and is then a fifth of the size.
COLOURS = 32
#: Width of a picture, px.
WIDTH = 1000


def lessons() -> list[Path]:
    """Return the pages of the lessons in English."""
    return sorted(COURSE.glob("[1-9]*.md"))


def pictures(lesson: Path) -> dict[str, str]:
    """Return the commands of a lesson whose pictures it shows, by the picture's name."""
    text = lesson.read_text(encoding="utf-8")
    made = {name: command for command, name in DRAWN.findall(text)}
    return {name: made[name] for name in SHOWN.findall(text)}


def draw(lesson: Path) -> None:
    """Run the commands of a lesson that make its pictures, in a separate folder."""
    with temporary_folder() as folder:
        for name, content in FILE.findall(lesson.read_text(encoding="utf-8")):
            (folder / name).write_text(content, encoding="utf-8")
        for name, command in pictures(lesson).items():
            call = [sys.executable, "-m", "cam_rig.cli.main", *shlex.split(command)[1:]]
            done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
            if done.returncode:
                raise CamRigError(f"{lesson.name}: {command}: {done.stderr.strip()}")
            target = COURSE / f"{name}.png"
            with writing(target) as part, Image.open(folder / "out" / f"{name}.png") as picture:
                size = (WIDTH, round(picture.height * WIDTH / picture.width))
                small = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)
                small.quantize(COLOURS, dither=Image.Dither.NONE).save(part, optimize=True)
            console.print(f"{target}: {target.stat().st_size / 1e3:.0f} kB", soft_wrap=True)


def draw_all() -> None:
    """Draw the pictures of every lesson."""
    for lesson in lessons():
        draw(lesson)


if __name__ == "__main__":
    with user_errors():
        draw_all()

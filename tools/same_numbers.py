"""Do the numbers stay what they were? For a change that must alter none: keep them, then compare.

Run it from the project's root, before the change and after every step (two minutes each):

    .venv/bin/python tools/same_numbers.py keep       # into out/same_numbers.json
    .venv/bin/python tools/same_numbers.py compare    # exit code 1 when a number differs
    .venv/bin/python tools/same_numbers.py compare --only jump --only bag

Compared are all JSON outputs, value by value with no tolerance, and the bag of `cam-rig run quick`,
byte by byte a message. The order of messages of different topics is not: it depends on scheduling.
Sentences in the JSON may be reworded; they are printed, and change no exit code.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mcap.reader import make_reader

KEPT = Path("out/same_numbers.json")
CAM_RIG = (sys.executable, "-m", "cam_rig.cli.main")

COMMANDS = {
    "laws": ("laws",),
    "jump": ("jump",),
    "jump steady": ("jump", "poly345", "bezier15", "--steady"),
    "jump ramp": ("jump", "poly345", "bezier15", "--ramp", "350"),
    "vibration": ("vibration",),
    "noise": ("noise",),
    "simulate": ("simulate",),
    "simulate quick": ("simulate", "quick"),
    "analyze": ("analyze", "bags/golden"),
    "profile": ("profile", "--all"),
}

#: Keys whose name has changed since the numbers were kept, old: new.
RENAMED: dict[str, str] = {}
#: Keys, where there were none or sentences when the numbers were kept.
ADDED: set[str] = set()
#: Why a value under one of them does not count.
ADDITION = " (added)"


def outputs(name: str) -> Any:
    """What a command writes as JSON. Its exit code may be 1: a check of a cam failed."""
    done = subprocess.run(
        [*CAM_RIG, *COMMANDS[name], "--json", "-"], capture_output=True, text=True, check=False
    )
    if not done.stdout.strip():
        sys.exit(
            f"cam-rig {' '.join(COMMANDS[name])}: no JSON, code {done.returncode}\n{done.stderr}"
        )
    return json.loads(done.stdout)


def bag() -> dict[str, list[str]]:
    """Each topic's messages and each attachment of a run, as digests."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "quick"
        subprocess.run([*CAM_RIG, "run", "quick", "--bag", path], capture_output=True, check=True)
        read: dict[str, list[str]] = {}
        for file in path.glob("*.mcap"):
            with file.open("rb") as stream:
                reader = make_reader(stream)
                for _, channel, message in reader.iter_messages():
                    times = f"{message.log_time} {message.publish_time} "
                    read.setdefault(channel.topic, []).append(digest(times.encode(), message.data))
                for attached in reader.iter_attachments():
                    read[f"attached {attached.name}"] = [digest(attached.data)]
    # Several nodes publish on it, in the order in which they come to it.
    read["/diagnostics"].sort()
    return read


def digest(*parts: bytes) -> str:
    """SHA-256 of bytes."""
    return hashlib.sha256(b"".join(parts)).hexdigest()


def leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every number, truth value and text of a JSON value, with where it stands."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from leaves(inner, f"{path}.{RENAMED.get(key, key)}")
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from leaves(inner, f"{path}[{index}]")
    else:
        yield path, value


def is_sentence(value: Any) -> bool:
    """Say whether a value is a text of several words, so one that may be reworded."""
    return isinstance(value, str) and bool(re.search(r"\w \w", value))


def reason(path: str, old: Any, new: Any) -> str:
    """Why a difference does not count; empty where it does."""
    if is_sentence(old) or is_sentence(new):
        return " (reworded)"
    keys = set(re.findall(r"[^.\[\]]+", path))
    return ADDITION if old == "nothing" and keys & ADDED else ""


def differences(name: str, kept: Any, now: Any) -> int:
    """Print what differs, and count it; a reworded sentence is printed and not counted."""
    before, after = dict(leaves(kept)), dict(leaves(now))
    count = 0
    for path in before | after:
        old, new = before.get(path, "nothing"), after.get(path, "nothing")
        if repr(old) != repr(new):  # as text, so that NaN is what it was
            why = reason(path, old, new)
            count += not why
            if why != ADDITION:
                print(f"{name}{path}{why}: {old!r} -> {new!r}")
    return count


def main() -> None:
    """Keep the numbers, or compare them with those kept."""
    words = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    words.add_argument("what", choices=["keep", "compare"])
    words.add_argument("--only", action="append", choices=[*COMMANDS, "bag"])
    asked = words.parse_args()
    names = asked.only or [*COMMANDS, "bag"]
    read = {name: bag() if name == "bag" else outputs(name) for name in names}
    if asked.what == "keep":
        KEPT.parent.mkdir(exist_ok=True)
        KEPT.write_text(json.dumps(read), encoding="utf-8")
        print(f"{sum(1 for _ in leaves(read))} values kept in {KEPT}")
        return
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    count = sum(differences(name, kept[name], json.loads(json.dumps(read[name]))) for name in names)
    print(f"{sum(1 for _ in leaves(read))} values, {count} differ")
    sys.exit(count > 0)


if __name__ == "__main__":
    main()

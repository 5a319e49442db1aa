"""Comparison of all numbers before and after a change that must not alter any.

Run it from the project's root, before the change and after every step (two minutes each):

    .venv/bin/python tools/same_numbers.py keep       # into out/same_numbers.json
    .venv/bin/python tools/same_numbers.py compare    # exit code 1 if a number differs
    .venv/bin/python tools/same_numbers.py compare --only jump --only bag

It compares all JSON outputs, value by value without a tolerance, and the bag of `cam-rig run
quick`, byte by byte for each message. The order of messages of different topics is not compared: it
depends on scheduling. Sentences in the JSON may be reworded. They are printed, and do not change
the exit code.
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
    "law": ("law", "poly345", "cycloidal", "bezier15"),
    "contact": ("contact", "flat", "oscillating_point"),
    "orders": ("orders", "tm21_sweep", "--cam", "tm21", "--rpm", "200:400:50"),
    "bounce": ("bounce", "tm21", "--restitution", "0.7", "--rpm", "400:460:20"),
    "design": ("design", "poly345", "--maximise", "jump_speed", "--pieces", "4"),
    "compare": ("compare", "bags/golden", "quick"),
    "campaign": ("campaign", "tolerance_poly345", "--points", "8", "--out", "{folder}/points"),
    "fit cam": ("fit", "cam", "config/cams/measured.csv"),
    "fit rig": ("fit", "rig", "bags/golden", "bezier15"),
}

#: Keys that were renamed after the numbers were stored: old and new name.
RENAMED: dict[str, str] = {}
#: Keys that were added, or had sentences as values, when the numbers were stored.
ADDED: set[str] = set()
#: Reason for ignoring a difference under one of these keys.
ADDITION = " (added)"


def outputs(name: str) -> Any:
    """Return the JSON of a command, also if its exit code is 1 (a check failed)."""
    with tempfile.TemporaryDirectory() as folder:
        arguments = [word.format(folder=folder) for word in COMMANDS[name]]
        done = subprocess.run(
            [*CAM_RIG, *arguments, "--json", "-"], capture_output=True, text=True, check=False
        )
    if not done.stdout.strip():
        sys.exit(
            f"cam-rig {' '.join(COMMANDS[name])}: no JSON, code {done.returncode}\n{done.stderr}"
        )
    return json.loads(done.stdout)


def bag() -> dict[str, list[str]]:
    """Return digests of the messages of each topic and of each attachment of a run."""
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
    # Several nodes publish on this topic, and the order depends on scheduling.
    read["/diagnostics"].sort()
    return read


def digest(*parts: bytes) -> str:
    """Return the SHA-256 of bytes."""
    return hashlib.sha256(b"".join(parts)).hexdigest()


def leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every number, truth value and text of a JSON value, with its path."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from leaves(inner, f"{path}.{RENAMED.get(key, key)}")
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from leaves(inner, f"{path}[{index}]")
    else:
        yield path, value


def is_sentence(value: Any) -> bool:
    """Return True if a value is a text of several words, which may be reworded."""
    return isinstance(value, str) and bool(re.search(r"\w \w", value))


def reason(path: str, old: Any, new: Any) -> str:
    """Return the reason for ignoring a difference, or an empty text."""
    if is_sentence(old) or is_sentence(new):
        return " (reworded)"
    keys = set(re.findall(r"[^.\[\]]+", path))
    return ADDITION if old == "nothing" and keys & ADDED else ""


def differences(name: str, reference: Any, present: Any) -> int:
    """Print differences, and return their number without reworded sentences."""
    before, after = dict(leaves(reference)), dict(leaves(present))
    count = 0
    for path in before | after:
        old, new = before.get(path, "nothing"), after.get(path, "nothing")
        if repr(old) != repr(new):  # as text, so that NaN equals NaN
            why = reason(path, old, new)
            count += not why
            if why != ADDITION:
                print(f"{name}{path}{why}: {old!r} -> {new!r}")
    return count


def main() -> None:
    """Store the numbers, or compare them with the stored numbers."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["keep", "compare"])
    parser.add_argument("--only", action="append", choices=[*COMMANDS, "bag"])
    arguments = parser.parse_args()
    names = arguments.only or [*COMMANDS, "bag"]
    read = {name: bag() if name == "bag" else outputs(name) for name in names}
    if arguments.what == "keep":
        KEPT.parent.mkdir(exist_ok=True)
        KEPT.write_text(json.dumps(read), encoding="utf-8")
        print(f"{sum(1 for _ in leaves(read))} values kept in {KEPT}")
        return
    reference = json.loads(KEPT.read_text(encoding="utf-8"))
    count = sum(
        differences(name, reference[name], json.loads(json.dumps(read[name]))) for name in names
    )
    print(f"{sum(1 for _ in leaves(read))} values, {count} differ")
    sys.exit(count > 0)


if __name__ == "__main__":
    main()

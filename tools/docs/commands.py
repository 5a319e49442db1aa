"""Write docs/commands.md: every command of cam-rig, as described by ``--help``.

    .venv/bin/python tools/docs/commands.py

``make docs`` runs it first, and a test compares the page with the commands.
"""

from __future__ import annotations

import inspect
import re
from collections import Counter
from collections.abc import Container, Iterable
from enum import Enum
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from cam_rig.cli.main import COMMANDS, command

PAGE = Path(__file__).parents[2] / "docs" / "commands.md"
#: Placeholder for the value of an option, by type.
KINDS = {str: "TEXT", int: "N", float: "NUMBER", Path: "PATH"}
#: Largest number of examples of a command. The longest examples of its help are selected.
MOST_EXAMPLES = 2
#: Number of words from which on an option of several commands is described only in "Shared".
MIN_SHARED_WORDS = 4
#: Phrase that is removed, because the head of the page explains it for all files.
SAID = re.compile(r"(?<=\w) file(s?), or (?:a )?names? in config/\w+")
EXIT_CODES = re.compile(r"\s+Exit codes:.*?\)\.", re.S)
CALLED = re.compile(r"In Python: (cam_rig\.\w+)\([^)]*\)")
HEAD = """# Commands

This page lists every command with every option. `tools/docs/commands.py` makes it from `--help`.
With `--version` in place of a command, `cam-rig` prints the versions of the package, of Rerun, and
of rclpy with its ROS distribution.

A scene, a cam, a rig or a study is a file, or the name of a shipped file in `config`: `quick` is
`config/scenes/quick.yaml`. If a command has cams as arguments, one scene can replace them: it means
its cams on its rig, and `--rig` selects another rig. A name after `--rig` is searched for next to
the scene first. Tables and messages for people are written to stderr, JSON and CSV to stdout.

| exit code | meaning |
|---:|---|
| 0 | done |
| 1 | a run failed, a bag cannot be read or made, a cam fails a check |
| 2 | a file or an argument is wrong, and the command has not run |
| 128 + n | ended by signal n: 130 after Ctrl-C, 143 after `kill`, 129 if the terminal was closed |

An error is one line with the file or option, its value, and the allowed values. A bag is never
overwritten.

Brackets contain the default of an option, or state that it is required. [Shared](#shared) describes
the options that a command lists as *shared*. A Python function has the names of the options as
arguments. `--help` has more examples.
"""


def page() -> str:
    """Return the whole page as Markdown."""
    every = verbs()
    shared = _shared(every.values())
    parts = [HEAD, "## Shared", "\n".join(shared)]
    parts += [section(name, verb, shared) for name, verb in every.items()]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def verbs() -> dict[str, Any]:
    """Return each command by its words.

    The subcommands of a group, such as ``fit cam``, are separate.
    """
    by_name: dict[str, Any] = {}
    for name in COMMANDS:
        below = getattr(command(name), "commands", {"": command(name)})
        by_name |= {f"{name} {word}".rstrip(): verb for word, verb in below.items()}
    return by_name


def _shared(verbs: Iterable[Any]) -> list[str]:
    """Return the options that several commands describe with equal words.

    For each option, the description is the most frequent.
    """
    items = Counter(_item(option) for verb in verbs for option in _visible_options(verb))
    long = [
        item
        for item, n in items.most_common()
        if n > 1 and len(item.split(": ", 1)[1].split()) >= MIN_SHARED_WORDS
    ]
    first: dict[str, str] = {}
    for item in long:
        first.setdefault(item.split("`")[1].partition(" ")[0], item)
    return list(first.values())


def section(name: str, verb: Any, shared: Container[str]) -> str:
    """Return the section of a command: usage, description, options, examples."""
    usage = " ".join(
        [f"cam-rig {name}", *(_usage(p) for p in verb.params if p.param_type_name == "argument")]
    )
    description, _, examples = inspect.cleandoc(verb.help).partition("Examples\n--------\n")
    items = {option: _item(option) for option in _visible_options(verb)}
    description = EXIT_CODES.sub("", CALLED.sub(r"In Python: `\1`", description.strip()))
    parts = [f"## {name}", f"    {usage} [OPTIONS]", description]
    parts += ["\n".join(item for item in items.values() if item not in shared)]
    same = [_names(option)[0].partition(" ")[0] for option in items if items[option] in shared]
    if same:
        parts.append("Shared: " + ", ".join(f"`{name}`" for name in same))
    lines = [line.strip() for line in examples.splitlines() if line.strip()]
    lines = [line for line in lines if line in sorted(lines, key=len)[-MOST_EXAMPLES:]]
    if lines:
        parts.append("\n".join(["```sh", *lines, "```"]))
    return "\n\n".join(part for part in parts if part)


def _visible_options(verb: Any) -> list[Any]:
    return [option for option in verb.params if not getattr(option, "hidden", False)]


def _item(parameter: Any) -> str:
    """Return an argument or option with its default and description as a list item."""
    names = ", ".join(f"`{name}`" for name in _names(parameter))
    default = _default(parameter)
    return f"- {names}{default and f' ({default})'}: {_help_text(parameter)}"


def _names(parameter: Any) -> list[str]:
    if parameter.param_type_name == "argument":
        return [parameter.name.upper()]
    value = "" if parameter.is_flag else f" {parameter.metavar or _kind(parameter)}"
    return [name + value for name in [*parameter.opts, *parameter.secondary_opts]]


def _kind(parameter: Any) -> str:
    annotation = parameter.type_descriptor.annotation
    if get_origin(annotation) is Literal:
        return " or ".join(get_args(annotation))
    annotation, *_ = get_args(annotation) or [annotation]  # type of the items of a list
    if issubclass(annotation, Enum):
        return " or ".join(str(choice.value) for choice in annotation)
    return KINDS[annotation]


def _usage(parameter: Any) -> str:
    name = parameter.name.upper() + ("..." if parameter.nargs == -1 else "")
    return name if parameter.required else f"[{name}]"


def _default(parameter: Any) -> str:
    value = parameter.default
    if parameter.required or value in (None, False, (), ""):
        return "required" if parameter.required else ""
    values = value if isinstance(value, list | tuple) else [value]
    return "`" + " ".join(str(getattr(value, "value", value)) for value in values) + "`"


def _help_text(parameter: Any) -> str:
    return SAID.sub(r"\1", re.sub(r"\s+", " ", parameter.help or ""))


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")

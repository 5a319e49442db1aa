"""Write docs/commands.md: every command of cam-rig, as ``--help`` describes it.

    .venv/bin/python tools/docs/commands.py

``make docs`` runs it first, and a test compares the page with the commands.
"""

from __future__ import annotations

import inspect
import re
from collections import Counter
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from cam_rig.cli.main import COMMANDS, command

PAGE = Path(__file__).parents[2] / "docs" / "commands.md"
#: What stands for the value of an option.
KINDS = {str: "TEXT", int: "N", float: "NUMBER", Path: "PATH"}
#: So many commands have an option with the same words, and it is described once.
SHARED = 3
HEAD = """# Commands

After this page you can call every command with every option. It is made from `--help` by
`tools/docs/commands.py`. With `--version` instead of a command, `cam-rig` prints the versions of
the package, of Rerun, and of rclpy with its ROS distribution.

A file is given by path, or by name where it is a shipped one: `quick` is
`config/scenes/quick.yaml`, `poly345` is `config/cams/poly345.yaml`. Tables and messages for people
go to stderr; JSON and CSV go to stdout.

A scene is an argument. Where cams are arguments, one scene stands for its cams on its rig, and
`--rig` puts them on another. A name after `--rig` is looked up beside the scene first.

| exit code | meaning |
|---:|---|
| 0 | done |
| 1 | a run failed, a bag cannot be read or made, a cam fails a check |
| 2 | a file or an argument is wrong; nothing has run |
| 128 + n | signal n came: 130 after Ctrl-C, 143 after `kill`, 129 where the terminal was closed |

An error is one line: the file or option, its value, what is allowed. A bag is never overwritten.

Behind an argument or option stands what is taken without it, or that it is required. Those under
*Shared* mean the same in every command that names them after its list.
"""


def page() -> str:
    """The whole page as Markdown."""
    verbs = dict(_verbs({name: command(name) for name in COMMANDS}))
    times = Counter(_item(one) for verb in verbs.values() for one in verb.params)
    shared = {item for item, count in times.items() if count >= SHARED}
    links = ", ".join(f"[`{name}`](#{name.replace(' ', '-')})" for name in verbs)
    parts = [HEAD, links, "## Shared", "\n".join(item for item in times if item in shared)]
    parts += [section(name, verb, shared) for name, verb in verbs.items()]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def _verbs(commands: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Each command by its words; those of a group, such as ``fit cam``, one by one."""
    for name, verb in commands.items():
        if hasattr(verb, "commands"):
            yield from ((f"{name} {word}", one) for word, one in _verbs(verb.commands))
        else:
            yield name, verb


def section(name: str, verb: Any, shared: set[str]) -> str:
    """One command: usage, what it does, its arguments and options, examples."""
    usage = " ".join(
        [f"cam-rig {name}", *(_usage(p) for p in verb.params if p.param_type_name == "argument")]
    )
    words, _, examples = inspect.cleandoc(verb.help).partition("Examples\n--------\n")
    items = {one: _item(one) for one in verb.params}
    parts = [f"## {name}", f"    {usage} [OPTIONS]", words.strip()]
    parts += ["\n".join(item for item in items.values() if item not in shared)]
    if same := [_names(one)[0].partition(" ")[0] for one, item in items.items() if item in shared]:
        parts.append(", ".join(f"`{one}`" for one in same) + ": [shared](#shared).")
    lines = [line.strip() for line in examples.splitlines() if line.strip()]
    if lines:
        parts.append("\n".join(["```sh", *lines, "```"]))
    return "\n\n".join(part for part in parts if part)


def _item(parameter: Any) -> str:
    """An argument or option with its default and its meaning, as an item of a list."""
    names = ", ".join(f"`{name}`" for name in _names(parameter))
    default = _default(parameter)
    return f"- {names}{default and f' ({default})'}: {_words(parameter.help or '')}"


def _names(parameter: Any) -> list[str]:
    if parameter.param_type_name == "argument":
        return [parameter.name.upper()]
    value = "" if parameter.is_flag else f" {parameter.metavar or _kind(parameter)}"
    return [name + value for name in [*parameter.opts, *parameter.secondary_opts]]


def _kind(parameter: Any) -> str:
    annotation = parameter.type_descriptor.annotation
    if get_origin(annotation) is Literal:
        return " or ".join(get_args(annotation))
    annotation, *_ = get_args(annotation) or [annotation]  # what a list is of
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
    return "`" + " ".join(str(getattr(one, "value", one)) for one in values) + "`"


def _words(words: str) -> str:
    return re.sub(r"\s+", " ", words)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")

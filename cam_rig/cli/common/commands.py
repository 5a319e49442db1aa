"""The group of all commands: a wrong option, and what cannot be written, end them in one line."""

from __future__ import annotations

import errno
import os
import sys
from contextlib import suppress
from typing import Any

import typer
from typer.core import TyperGroup

from cam_rig.errors import ConfigError, OutputError

#: What pydantic, which typer asks, says of a text that is no number.
KINDS = {"int_parsing": "a whole number", "float_parsing": "a number"}


class Commands(TyperGroup):
    """As typer's, but for a value it refuses: the project's one line instead of a box."""

    def main(self, *arguments: Any, **options: Any) -> Any:
        """Run the command line, to the last byte of its output."""
        try:
            try:
                return super().main(*arguments, **options)
            finally:
                sys.stdout.flush()
        except OSError as error:
            sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  # for the rest
            what = error.filename or "stdout or a temporary file"
            why = f"{what}: cannot be read or written ({error.strerror or error})"
            if error.errno != errno.EPIPE:  # else a reader has seen enough
                with suppress(OSError):  # stderr itself
                    print(f"cam-rig: {why}; make room, or name another place", file=sys.stderr)
            sys.exit(OutputError.exit_code)

    def invoke(self, ctx: Any) -> Any:
        """Run the command that the arguments name."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            if type(error) is not typer.BadParameter:  # what is missing: typer shows the usage
                raise
            print(f"cam-rig: {one_line(error)}", file=sys.stderr)
            raise typer.Exit(ConfigError.exit_code) from None


def one_line(error: typer.BadParameter) -> str:
    """What is wrong with which option; its value where typer tells it."""
    from pydantic import ValidationError

    problem, param = error.__cause__, error.param
    if param is None or not isinstance(problem, ValidationError):
        return " ".join(error.format_message().split())
    first = problem.errors()[0]
    words = KINDS.get(first["type"], first["msg"].removeprefix("Input should be "))
    name = next((one for one in param.opts if one.startswith("--")), param.opts[0])
    return f"{name}: is {first['input']!r}; allowed: {words}"

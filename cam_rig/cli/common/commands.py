"""All commands: a wrong option, and what cannot be written, end them in one line."""

from __future__ import annotations

import errno
import os
import sys
import tempfile
from collections import Counter
from contextlib import suppress
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

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
            what = error.filename or _unnamed()
            sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  # for the rest
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


def _unnamed() -> str:
    """What could not be written, if the error has no name: stdout, if it takes no end of line."""
    try:
        print(flush=True)
    except OSError:
        return "stdout"
    return f"a temporary file in {tempfile.gettempdir()}"


class Command(TyperCommand):
    """As typer's, but that it refuses an option that stands twice where the last would be taken."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Values of the options and arguments; ``--help`` comes first."""
        stand = Counter(self.make_parser(ctx).parse_args(list(args))[2])
        twice = [one for one, count in stand.items() if count > 1 and not one.multiple]
        if twice and not any(one.is_eager for one in stand):
            name = max(twice[0].opts, key=len)
            print(
                f"cam-rig: {name}: stands {stand[twice[0]]} times; allowed: once", file=sys.stderr
            )
            raise typer.Exit(ConfigError.exit_code)
        return super().parse_args(ctx, args)


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

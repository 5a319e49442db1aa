"""The command ``cam-rig``."""

from __future__ import annotations

import errno
import os
import re
import sys
import tempfile
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from cam_rig.errors import ConfigError, OutputError, printable
from cam_rig.extras import libraries_named
from cam_rig.interrupts import handle_signals
from cam_rig.show.command import StrictCommand

#: Each command's module; the function, or the group of functions, has the command's name.
COMMANDS = {
    "run": "cam_rig.cli.run",
    "simulate": "cam_rig.studies.simulate.command",
    "analyze": "cam_rig.studies.simulate.bag_command",
    "compare": "cam_rig.studies.compare.command",
    "export": "cam_rig.studies.simulate.bag_command",
    "view": "cam_rig.viewer.command",
    "panel": "cam_rig.panel.command",
    "recover": "cam_rig.bag.command",
    "replay": "cam_rig.cli.run",
    "urdf": "cam_rig.messages.command",
    "laws": "cam_rig.studies.laws.command",
    "law": "cam_rig.studies.laws.command",
    "new": "cam_rig.studies.fit_cam.command",
    "profile": "cam_rig.studies.profile.command",
    "design": "cam_rig.studies.design.command",
    "contact": "cam_rig.studies.contact.command",
    "jump": "cam_rig.studies.jump.command",
    "bounce": "cam_rig.studies.bounce.command",
    "vibration": "cam_rig.studies.vibration.command",
    "campaign": "cam_rig.studies.campaign.command",
    "noise": "cam_rig.studies.noise.command",
    "orders": "cam_rig.studies.orders.command",
    "report": "cam_rig.report.command",
    "listen": "cam_rig.studies.simulate.command",
    "fit": "cam_rig.cli.fit",
}
# All commands: a wrong option, and what cannot be written, end them in one line.

#: What pydantic, which typer asks, says of a text that is no number.
KINDS = {"int_parsing": "a whole number", "float_parsing": "a number"}


class Commands(TyperGroup):
    """As typer's, but that only the command that is called is imported.

    A value that it refuses is the project's one line instead of a box.
    """

    def list_commands(self, _ctx: Any) -> list[str]:
        """Names, in the order in which the help lists them."""
        return list(COMMANDS)

    def get_command(self, _ctx: Any, name: str) -> TyperCommand | None:
        """A command's name and line, for the help."""
        return TyperCommand(name, help=summary(name)) if name in COMMANDS else None

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """The command that the first argument names, imported."""
        name, found, rest = super().resolve_command(ctx, args)
        return name, found and command(found.name), rest

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
            why = printable(f"{what}: cannot be read or written ({error.strerror or error})")
            if error.errno != errno.EPIPE:  # else a reader has seen enough
                with suppress(OSError):  # stderr itself
                    print(
                        f"cam-rig: {why}; make room, or name another place",
                        file=sys.stderr,
                    )
            sys.exit(OutputError.exit_code)

    def invoke(self, ctx: Any) -> Any:
        """Run the command that the arguments name."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            if type(error) is not typer.BadParameter:  # what is missing: typer shows the usage
                raise
            print(f"cam-rig: {printable(one_line(error))}", file=sys.stderr)
            raise typer.Exit(ConfigError.exit_code) from None


def _unnamed() -> str:
    """What could not be written, if the error has no name: stdout, if it takes no end of line."""
    try:
        print(flush=True)
    except OSError:
        return "stdout"
    return f"a temporary file in {tempfile.gettempdir()}"


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


MISSING = "not installed"


def print_versions(wanted: bool) -> None:
    """Print one line each and end, where the option is given."""
    if wanted:
        typer.echo("\n".join(f"{name} {found}" for name, found in versions().items()))
        raise typer.Exit


def versions() -> dict[str, str]:
    """Versions by name: the package, the viewer, and rclpy with its ROS distribution."""
    rclpy = _installed("rclpy")
    return {
        "cam_rig": _installed("cam_rig"),
        "rerun": _installed("rerun-sdk"),
        "rclpy": rclpy if rclpy == MISSING else f"{rclpy} (ROS 2 {_distribution()})",
    }


def _installed(name: str) -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(name)
    except PackageNotFoundError:
        return MISSING


def _distribution() -> str:
    """The ROS distribution: of the wheels, of the sourced installation, or of the folder."""
    from importlib.metadata import distributions

    wheels = (re.fullmatch(r"ros-([a-z]+)-rclpy", d.name) for d in distributions() if d.name)
    if found := next((match for match in wheels if match), None):
        return found[1]
    if sourced := os.environ.get("ROS_DISTRO"):
        return sourced
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return next((Path(p).name for p in prefixes if "ros" in Path(p).parts), "of unknown name")


app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            is_eager=True,
            callback=print_versions,
            help="Print the versions of cam_rig, rerun and rclpy with its ROS distribution.",
        ),
    ] = False,
) -> None:
    """A virtual cam test rig: turn a cam, move its follower, listen, record, compare."""


@cache
def command(name: str) -> Any:
    """A command, or a group of some, as click knows it."""
    with libraries_named():
        found = getattr(import_module(COMMANDS[name]), _function(name))
    if isinstance(found, typer.Typer):
        return typer.main.get_group(found)
    alone = typer.Typer(
        add_completion=False, pretty_exceptions_enable=False, rich_markup_mode="markdown"
    )
    alone.command(name, cls=StrictCommand)(found)
    return typer.main.get_command(alone)


def summary(name: str) -> str:
    """The first sentence of a command's docstring, read without importing its module."""
    path = Path(__file__).parents[2].joinpath(*COMMANDS[name].split(".")).with_suffix(".py")
    text, function = path.read_text(encoding="utf-8"), _function(name)
    begin = max(text.find(f"\ndef {function}("), text.find(f"\n{function} = "))
    return " ".join(text[begin:].split('"""')[1].split("\n\n")[0].split())


def _function(name: str) -> str:
    return name.replace("-", "_")


def main() -> None:
    """Run the command that the arguments name."""
    app()


if __name__ == "__main__":
    handle_signals()
    main()

"""List of the commands of ``cam-rig``, whose modules are imported on demand."""

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

from cam_rig.errors import ConfigError, OutputError, did_you_mean, printable
from cam_rig.extras import friendly_import_errors
from cam_rig.interrupts import handle_signals
from cam_rig.show.command import StrictCommand

#: Panels of the help, in its order, each with the module of each command. The function or command
#: group in the module has the name of the command.
PANELS = {
    "Cam": {
        "laws": "cam_rig.studies.laws.command",
        "law": "cam_rig.studies.laws.command",
        "profile": "cam_rig.studies.profile.command",
        "contact": "cam_rig.studies.contact.command",
        "design": "cam_rig.studies.design.command",
        "electronic": "cam_rig.studies.electronic.command",
    },
    "Follower": {
        "jump": "cam_rig.studies.jump.command",
        "vibration": "cam_rig.studies.vibration.command",
        "orders": "cam_rig.studies.orders.command",
        "bounce": "cam_rig.studies.bounce.command",
        "simulate": "cam_rig.studies.simulate.command",
        "listen": "cam_rig.studies.simulate.command",
    },
    "Your machine": {
        "new": "cam_rig.studies.fit_cam.command",
        "fit": "cam_rig.cli.fit",
        "compare": "cam_rig.studies.compare.command",
    },
    "Run and record": {
        "run": "cam_rig.cli.run",
        "view": "cam_rig.viewer.command",
        "analyze": "cam_rig.studies.simulate.bag_command",
        "export": "cam_rig.studies.simulate.bag_command",
        "replay": "cam_rig.cli.run",
        "recover": "cam_rig.bag.command",
        "urdf": "cam_rig.messages.command",
    },
    "Studies": {
        "campaign": "cam_rig.studies.campaign.command",
        "noise": "cam_rig.studies.noise.command",
        "report": "cam_rig.report.command",
    },
    "Teach": {
        "panel": "cam_rig.panel.command",
        "lab": "cam_rig.panel.lab.command",
        "mark": "cam_rig.panel.lab.command",
    },
}
#: Panel of the help of each command.
PANEL_OF = {name: panel for panel, commands in PANELS.items() for name in commands}
#: Module of each command.
COMMANDS = {name: module for commands in PANELS.values() for name, module in commands.items()}
# Handling of errors for all commands: a wrong option or a failed output is reported in one line.

#: Type of a pydantic error -> allowed value in the message. Typer validates options by pydantic.
PARSE_ERRORS = {"int_parsing": "a whole number", "float_parsing": "a number"}


class Commands(TyperGroup):
    """Group of commands that imports only the command that is called.

    A rejected value is reported in one line, in the format of the project, instead of a box.
    """

    def list_commands(self, _ctx: Any) -> list[str]:
        """Return the names of the commands in the order of the help."""
        return list(COMMANDS)

    def get_command(self, _ctx: Any, name: str) -> TyperCommand | None:
        """Return a command for the help: its name and summary, without importing it.

        Returns None if there is no such command.
        """
        if name not in COMMANDS:
            return None
        return TyperCommand(name, help=summary(name), rich_help_panel=PANEL_OF[name])

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Import the command that the first argument names.

        Returns its name, the command, and the other arguments.
        """
        if args[0] not in COMMANDS:
            hint = did_you_mean(args[0], COMMANDS) or "; cam-rig --help lists the commands"
            raise typer.BadParameter(f"{args[0]!r} is not a command{hint}")
        name, resolved, others = super().resolve_command(ctx, args)
        return name, resolved and command(resolved.name), others

    def main(self, *arguments: Any, **options: Any) -> Any:
        """Run the command line, and flush stdout.

        An OSError is reported in one line, and the exit code is that of `OutputError`. A closed
        pipe is not reported.
        """
        try:
            try:
                return super().main(*arguments, **options)
            finally:
                sys.stdout.flush()
        except OSError as error:
            name = error.filename or _failed_output()
            sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  # open until exit
            text = printable(f"{name}: cannot be read or written ({error.strerror or error})")
            if error.errno != errno.EPIPE:  # a reader that closed its pipe needs no message
                with suppress(OSError):  # of stderr
                    print(f"cam-rig: {text}; free space, or name another path", file=sys.stderr)
            sys.exit(OutputError.exit_code)

    def invoke(self, ctx: Any) -> Any:
        """Run the command that the arguments name."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            if type(error) is not typer.BadParameter:  # a missing argument: typer prints the usage
                raise
            print(f"cam-rig: {printable(one_line(error))}", file=sys.stderr)
            raise typer.Exit(ConfigError.exit_code) from None


def _failed_output() -> str:
    """Return the probable output of a write error that does not name a file.

    It is stdout if a line break cannot be written to it, else a temporary file.
    """
    try:
        print(flush=True)
    except OSError:
        return "stdout"
    return f"a temporary file in {tempfile.gettempdir()}"


def one_line(error: typer.BadParameter) -> str:
    """Return the error of an option as one line: option, value, and what is allowed."""
    from pydantic import ValidationError

    cause, param = error.__cause__, error.param
    if param is None:
        return error.message
    if not isinstance(cause, ValidationError):
        return " ".join(error.format_message().split())
    first = cause.errors()[0]
    allowed = PARSE_ERRORS.get(first["type"], first["msg"].removeprefix("Input should be "))
    name = next((option for option in param.opts if option.startswith("--")), param.opts[0])
    return f"{name}: is {first['input']!r}; allowed: {allowed}"


#: Text for the version of a package that is not installed.
NOT_INSTALLED = "not installed"


def print_versions(requested: bool) -> None:
    """Print the versions, one per line, and exit, if the option --version is present."""
    if requested:
        typer.echo("\n".join(f"{name} {version}" for name, version in versions().items()))
        raise typer.Exit


def versions() -> dict[str, str]:
    """Return the versions of the package, the viewer, and rclpy with its ROS distribution."""
    rclpy = _installed_version("rclpy")
    return {
        "cam_rig": _installed_version("cam_rig"),
        "rerun": _installed_version("rerun-sdk"),
        "rclpy": rclpy if rclpy == NOT_INSTALLED else f"{rclpy} (ROS 2 {_ros_distribution()})",
    }


def _installed_version(name: str) -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(name)
    except PackageNotFoundError:
        return NOT_INSTALLED


def _ros_distribution() -> str:
    """Return the ROS distribution of the wheels, the sourced installation, or the prefix path."""
    from importlib.metadata import distributions

    wheels = (re.fullmatch(r"ros-([a-z]+)-rclpy", d.name) for d in distributions() if d.name)
    if wheel := next((match for match in wheels if match), None):
        return wheel[1]
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
    """Turn a cam, move its follower, listen, record and compare: a virtual cam test rig."""


@cache
def command(name: str) -> Any:
    """Import a command or a command group, and return it as a click object."""
    with friendly_import_errors():
        function = getattr(import_module(COMMANDS[name]), _function_name(name))
    if isinstance(function, typer.Typer):
        return typer.main.get_group(function)
    single = typer.Typer(
        add_completion=False, pretty_exceptions_enable=False, rich_markup_mode="markdown"
    )
    single.command(name, cls=StrictCommand)(function)
    return typer.main.get_command(single)


def summary(name: str) -> str:
    """Return the first sentence of a command's docstring, without importing its module."""
    path = Path(__file__).parents[2].joinpath(*COMMANDS[name].split(".")).with_suffix(".py")
    text, function = path.read_text(encoding="utf-8"), _function_name(name)
    start = max(text.find(f"\ndef {function}("), text.find(f"\n{function} = "))
    return " ".join(text[start:].split('"""')[1].split("\n\n")[0].split())


def _function_name(name: str) -> str:
    return name.replace("-", "_")


def main() -> None:
    """Run the command that the arguments name."""
    app()


if __name__ == "__main__":
    handle_signals()
    main()

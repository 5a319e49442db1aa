"""The command ``cam-rig``."""

from __future__ import annotations

import errno
import os
import re
import sys
import tempfile
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, distributions, version
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from benchmark.speed.report import bench
from cam_rig.bag.command import analyze, export, recover
from cam_rig.campaign.command import campaign
from cam_rig.cli.laws import law, laws
from cam_rig.cli.run import replay, run
from cam_rig.design.command import design
from cam_rig.errors import ConfigError, OutputError
from cam_rig.interrupts import handle_signals
from cam_rig.measured.cam_fit.command import new
from cam_rig.measured.command import fit
from cam_rig.measured.real_run.command import compare
from cam_rig.messages.command import urdf
from cam_rig.panel.command import panel
from cam_rig.paper.as_cut.command import as_cut
from cam_rig.paper.contact.command import contact
from cam_rig.paper.factorial.command import factorial
from cam_rig.paper.jump.command import jump
from cam_rig.paper.noise.command import calibrate, identify, noise
from cam_rig.paper.orders.command import orders
from cam_rig.paper.readings.command import readings
from cam_rig.paper.timing.command import timing
from cam_rig.paper.vibration.command import vibration
from cam_rig.profile.command import profile
from cam_rig.report.command import report
from cam_rig.show.command import Command
from cam_rig.simulation.command import listen, simulate
from cam_rig.viewer.command import view

# All commands: a wrong option, and what cannot be written, end them in one line.

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


# What `cam-rig --version` prints: what is installed, read without importing it.

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
    try:
        return version(name)
    except PackageNotFoundError:
        return MISSING


def _distribution() -> str:
    """The ROS distribution: of the wheels, of the sourced installation, or of the folder."""
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
    rich_markup_mode="markdown",
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


for verb in (
    run,
    simulate,
    analyze,
    compare,
    export,
    view,
    panel,
    recover,
    replay,
    urdf,
    laws,
    law,
    new,
    profile,
    as_cut,
    timing,
    design,
    contact,
    jump,
    readings,
    vibration,
    factorial,
    campaign,
    noise,
    orders,
    report,
    listen,
    calibrate,
    identify,
    bench,
):
    app.command(cls=Command)(verb)

app.add_typer(fit, name="fit")


def main() -> None:
    """Run the command that the arguments name."""
    app()


if __name__ == "__main__":
    handle_signals()
    main()

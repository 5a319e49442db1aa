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
from importlib.metadata import PackageNotFoundError, distributions, version
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from cam_rig.errors import ConfigError, OutputError
from cam_rig.extras import libraries_named
from cam_rig.interrupts import handle_signals
from cam_rig.show.command import Command

#: Each command: its function, or its group of functions, and its line in the help.
COMMANDS = {
    "run": ("cam_rig.cli.run:run", "Run a scene through the node graph and record it."),
    "simulate": (
        "cam_rig.simulation.command:simulate",
        "Run a scene without ROS, on the same core: a row each speed, and its noise compared.",
    ),
    "analyze": (
        "cam_rig.bag.command:analyze",
        "Read a recorded sweep back: a row each speed, and its noise beside the "
        "published regressions.",
    ),
    "compare": (
        "cam_rig.measured.real_run.command:compare",
        "Drive a scene's model with the cam angle of a real run, and show where the two part.",
    ),
    "export": (
        "cam_rig.bag.command:export",
        "Write every sample of a run with the cam that turned under it.",
    ),
    "view": (
        "cam_rig.viewer.command:view",
        "Show a recorded run: the cam turning, its follower, lift, contact force and sound.",
    ),
    "panel": (
        "cam_rig.panel.command:panel",
        "Turn the rig by hand in a browser, and draw the laws of its cams.",
    ),
    "recover": (
        "cam_rig.bag.command:recover",
        "Copy everything readable of a damaged or unfinished bag into a new, valid one.",
    ),
    "replay": (
        "cam_rig.cli.run:replay",
        "Feed recorded cam states and laws to live nodes, and compare their messages with the bag.",
    ),
    "urdf": (
        "cam_rig.messages.command:urdf",
        "Print the rig of a scene as URDF: base, guide, motor, microphone, cam and follower.",
    ),
    "laws": (
        "cam_rig.cli.laws:laws",
        "List the laws with their peaks per unit rise and unit span, and how smoothly they join.",
    ),
    "law": (
        "cam_rig.cli.laws:law",
        "Plot lift, velocity, acceleration and jerk over the cam angle; list peaks and joints.",
    ),
    "new": (
        "cam_rig.measured.cam_fit.command:new",
        "Write cam, rig and scene files from a table of lifts; they run as they are.",
    ),
    "profile": (
        "cam_rig.profile.command:profile",
        "Check a cam's contour: undercut, curvature, pressure angle, reach. Draw it, or "
        "measure one.",
    ),
    "as-cut": (
        "cam_rig.paper.as_cut.command:as_cut",
        "Drive a roller on the contour of a point, as fig. 12 of the paper draws it.",
    ),
    "timing": (
        "cam_rig.paper.timing.command:timing",
        "List the cam angles of 1, 50 and 99 % of the lift; of one cam, what each ordinate moves.",
    ),
    "design": (
        "cam_rig.law_design.command:design",
        "Design the law that is best by a goal, and bound what any law of its class could reach.",
    ),
    "contact": (
        "cam_rig.paper.contact.command:contact",
        "Find Hertz pressure and sliding speed over the turn, and the bounds on the base radius.",
    ),
    "jump": (
        "cam_rig.paper.jump.command:jump",
        "Find the jump speed of cams to 0.01 rpm, beside the paper's Table 2.",
    ),
    "readings": (
        "cam_rig.paper.readings.command:readings",
        "Read Table 2 of the paper in several ways: which rig shows its speeds, and its times.",
    ),
    "vibration": (
        "cam_rig.paper.vibration.command:vibration",
        "Measure residual vibration in the low dwell, peak acceleration, and twist of the shaft.",
    ),
    "factorial": (
        "cam_rig.paper.factorial.command:factorial",
        "Give laws of every continuity the same angles, then the same acceleration; "
        "analyse variance.",
    ),
    "campaign": (
        "cam_rig.campaigns.command:campaign",
        "Measure thousands of rigs that differ in some numbers, and keep a row of each.",
    ),
    "noise": (
        "cam_rig.paper.noise.command:noise",
        "Calibrate on one cam, predict another, identify the third, with confidence intervals.",
    ),
    "orders": (
        "cam_rig.paper.orders.command:orders",
        "Find the spectrum of force and sound by orders of the cam: exact, without leakage.",
    ),
    "report": (
        "cam_rig.report.command:report",
        "Write everything about a scene's cams as one self-contained page.",
    ),
    "listen": (
        "cam_rig.simulation.command:listen",
        "Write what the microphone hears: 48 kHz, 16 bit, sound pressure in proportion.",
    ),
    "calibrate": (
        "cam_rig.paper.noise.command:calibrate",
        "Fit gain and cut-off of the rig's radiation to the published noise of one cam.",
    ),
    "identify": (
        "cam_rig.paper.noise.command:identify",
        "Search lift, event and nose angle of a tangent-arc cam that fit its published noise.",
    ),
    "fit": (
        "cam_rig.measured.command:fit",
        "Find the numbers of a cam, or of a rig, from what was measured.",
    ),
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
        return TyperCommand(name, help=COMMANDS[name][1]) if name in COMMANDS else None

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


@cache
def command(name: str) -> Any:
    """A command, or a group of some, as click knows it.

    Raises
    ------
    MissingLibraryError : it needs a library that is not installed
    """
    module, function = COMMANDS[name][0].split(":")
    with libraries_named():
        found = getattr(import_module(module), function)
    if isinstance(found, typer.Typer):
        return typer.main.get_group(found)
    alone = typer.Typer(
        add_completion=False, pretty_exceptions_enable=False, rich_markup_mode="markdown"
    )
    alone.command(name, cls=Command)(found)
    return typer.main.get_command(alone)


def main() -> None:
    """Run the command that the arguments name."""
    app()


if __name__ == "__main__":
    handle_signals()
    main()

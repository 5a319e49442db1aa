"""The command ``cam-rig``."""

from __future__ import annotations

import sys

import typer

from cam_rig.cli.analyze import analyze
from cam_rig.cli.bench import bench
from cam_rig.cli.calibrate import calibrate
from cam_rig.cli.identify import identify
from cam_rig.cli.run import run
from cam_rig.cli.simulate import simulate
from cam_rig.cli.view import view

app = typer.Typer(
    help="A virtual cam test rig: turn a cam, move its follower, listen, record, compare.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)
for verb in (run, simulate, analyze, view, calibrate, identify, bench):
    app.command()(verb)


def main() -> None:
    """Entry point of the executable."""
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()

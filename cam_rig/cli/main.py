"""The command ``cam-rig``."""

from __future__ import annotations

import sys

import typer

from cam_rig.cli.analyze import analyze
from cam_rig.cli.bench import bench
from cam_rig.cli.calibrate import calibrate
from cam_rig.cli.factorial import factorial
from cam_rig.cli.identify import identify
from cam_rig.cli.jump import jump
from cam_rig.cli.law import law
from cam_rig.cli.laws import laws
from cam_rig.cli.listen import listen
from cam_rig.cli.noise import noise
from cam_rig.cli.pictures import pictures
from cam_rig.cli.profile import profile
from cam_rig.cli.recover import recover
from cam_rig.cli.replay import replay
from cam_rig.cli.report import report
from cam_rig.cli.run import run
from cam_rig.cli.simulate import simulate
from cam_rig.cli.vibration import vibration
from cam_rig.cli.view import view

app = typer.Typer(
    help="A virtual cam test rig: turn a cam, move its follower, listen, record, compare.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)
for verb in (
    run,
    simulate,
    analyze,
    view,
    recover,
    replay,
    pictures,
    laws,
    law,
    profile,
    jump,
    vibration,
    factorial,
    noise,
    report,
    listen,
    calibrate,
    identify,
    bench,
):
    app.command()(verb)


def main() -> None:
    """Entry point of the executable."""
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()

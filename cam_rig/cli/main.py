"""The command ``cam-rig``."""

from __future__ import annotations

from typing import Annotated

import typer

from cam_rig.cli.cams.fit import fit
from cam_rig.cli.cams.law import law
from cam_rig.cli.cams.laws import laws
from cam_rig.cli.cams.new import new
from cam_rig.cli.cams.profile import profile
from cam_rig.cli.common.commands import Command, Commands
from cam_rig.cli.common.version import print_versions
from cam_rig.cli.runs.analyze import analyze
from cam_rig.cli.runs.compare import compare
from cam_rig.cli.runs.export import export
from cam_rig.cli.runs.listen import listen
from cam_rig.cli.runs.panel import panel
from cam_rig.cli.runs.recover import recover
from cam_rig.cli.runs.replay import replay
from cam_rig.cli.runs.run import run
from cam_rig.cli.runs.simulate import simulate
from cam_rig.cli.runs.urdf import urdf
from cam_rig.cli.runs.view import view
from cam_rig.cli.studies.as_cut import as_cut
from cam_rig.cli.studies.bench import bench
from cam_rig.cli.studies.calibrate import calibrate
from cam_rig.cli.studies.campaign import campaign
from cam_rig.cli.studies.contact import contact
from cam_rig.cli.studies.design import design
from cam_rig.cli.studies.factorial import factorial
from cam_rig.cli.studies.identify import identify
from cam_rig.cli.studies.jump import jump
from cam_rig.cli.studies.noise import noise
from cam_rig.cli.studies.orders import orders
from cam_rig.cli.studies.readings import readings
from cam_rig.cli.studies.report import report
from cam_rig.cli.studies.timing import timing
from cam_rig.cli.studies.vibration import vibration
from cam_rig.interrupts import handle_signals

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

"""A command as a person calls it, in this process."""

from typer.testing import CliRunner

from cam_rig.cli.main import app


def call(*arguments):
    """What `cam-rig` answers to these arguments."""
    return CliRunner().invoke(app, [str(one) for one in arguments])

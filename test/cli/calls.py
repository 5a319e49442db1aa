"""A command as a person calls it, in this process."""

from typer.testing import CliRunner

from cam_rig.cli.main import app
from cam_rig.schema.load import config_root

GOLDEN = config_root().parent / "bags" / "golden"


def call(*arguments):
    """What `cam-rig` answers to these arguments."""
    return CliRunner().invoke(app, [str(one) for one in arguments])

"""A command as a person calls it, in this process."""

import json

from typer.testing import CliRunner

from cam_rig.cli.main import app
from cam_rig.schema.load import config_root

GOLDEN = config_root().parent / "bags" / "golden"


def call(*arguments):
    """What `cam-rig` answers to these arguments."""
    return CliRunner().invoke(app, [str(one) for one in arguments])


def done(*arguments):
    """The answer of a command that succeeds."""
    result = call(*arguments)
    assert result.exit_code == 0, result.stderr
    return result


def data_of(*arguments):
    """What such a command gives as JSON."""
    return json.loads(done(*arguments, "--json", "-").stdout)

"""Fixtures: the rig of the paper's jump speeds, and runs of the paper's scripts."""

import pytest

from cam_rig.dynamics import TwoMassParameters
from cam_rig.schema import load_rig

from ...figure_faults import no_faulty_figure

__all__ = ["no_faulty_figure"]


@pytest.fixture(scope="session")
def table2(config_dir):
    """Rig that was identified from the jump speeds of the paper's Table 2."""
    return load_rig(config_dir / "rigs" / "paper_table2.yaml")


@pytest.fixture(scope="session")
def two_mass(table2):
    """Two-mass parameters of the rig of Table 2."""
    return TwoMassParameters.from_rig(table2)


@pytest.fixture
def printed_by(tmp_path, capsys):
    """Function that runs a script, checks its figure file, and returns its output."""

    def run(script):
        script.main(["--out", str(tmp_path)])
        name = script.__name__.rpartition(".")[2]
        assert (tmp_path / f"{name}.png").is_file()
        return capsys.readouterr().out

    return run

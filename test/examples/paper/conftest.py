"""Fixtures: the rig of the paper's jump speeds, and runs of the example scripts.

The paper is the article on Bézier cams that docs/glossary.md lists under Sources.
"""

import pytest

from cam_rig.dynamics import TwoMassParameters
from cam_rig.schema import load_rig

from ...figure_faults import no_faulty_figure

__all__ = ["no_faulty_figure"]


@pytest.fixture(scope="session")
def table2(config_dir):
    """Rig identified from the jump speeds in Table 2 of the paper.

    The paper is listed in docs/glossary.md.
    """
    return load_rig(config_dir / "rigs" / "paper_table2.yaml")


@pytest.fixture(scope="session")
def two_mass(table2):
    """Parameters of the two masses of the rig identified from the paper's Table 2."""
    return TwoMassParameters.from_rig(table2)


@pytest.fixture
def printed_by(tmp_path, capsys):
    """Function that runs an example script and returns its output.

    The script must write its figure file.
    """

    def run(script):
        script.main(["--out", str(tmp_path)])
        name = script.__name__.rpartition(".")[2]
        assert (tmp_path / f"{name}.png").is_file()
        return capsys.readouterr().out

    return run

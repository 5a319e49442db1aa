"""The paper's five laws and the rig of its jump speeds; what commands show is free of faults."""

import pytest

from cam_rig.schema import load_rig
from cam_rig.simulation.asked import asked_cams

from ..cli.conftest import no_broken_heading, no_faulty_figure

__all__ = ["no_broken_heading", "no_faulty_figure"]

FIVE = ("bezier15", "poly345", "poly4567", "cycloidal", "bezier_segments")


@pytest.fixture(scope="session")
def table2(config_dir):
    """The rig that was identified from the jump speeds."""
    return load_rig(config_dir / "rigs" / "paper_table2.yaml")


@pytest.fixture(scope="session")
def cam_set():
    """The five laws of Table 2 on it."""
    return asked_cams(list(FIVE), "paper_table2")

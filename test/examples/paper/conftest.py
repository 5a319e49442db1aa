"""The rig of the paper's jump speeds."""

import pytest

from cam_rig.schema import load_rig


@pytest.fixture(scope="session")
def table2(config_dir):
    """The rig that was identified from the jump speeds of Table 2."""
    return load_rig(config_dir / "rigs" / "paper_table2.yaml")

"""Fixtures of the studies: laws, a table of lifts, and cams of the paper."""

import numpy as np
import pytest

from cam_rig.simulation.inputs import resolve_cams

from ..cli.conftest import no_broken_heading, no_faulty_figure

__all__ = ["no_broken_heading", "no_faulty_figure"]

FIVE = ("bezier15", "poly345", "poly4567", "cycloidal", "bezier_segments")


@pytest.fixture(scope="session")
def law(laws):
    """Law of the cam `poly345` (3-4-5 polynomial), for studies that need any cam."""
    return laws["poly345"]


@pytest.fixture
def lift_table(tmp_path):
    """Path of a file with 360 measured lifts, semicolons and decimal commas.

    The lift is 10 mm, the zero 3.2 mm, the noise 2 µm, and the reading at 100° an outlier of 0.4
    mm.
    """
    angles = np.arange(0, 360)
    u = np.clip((angles - 60.0) / 100.0, 0.0, 1.0), np.clip((angles - 220.0) / 100.0, 0.0, 1.0)
    up, down = (10 * x**3 - 15 * x**4 + 6 * x**5 for x in u)
    lifts = 3.2 + 10.0 * (up - down) + np.random.default_rng(1).normal(scale=0.002, size=360)
    lifts[100] += 0.4
    rows = [f"{a};{s:.4f}".replace(".", ",") for a, s in zip(angles, lifts, strict=True)]
    path = tmp_path / "lifts.csv"
    path.write_text("\ufeffWinkel (Grad);Hub (mm)\r\n" + "\r\n".join(rows), encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def cam_set():
    """The five cams of Table 2 of the paper, on the rig that was identified from it."""
    return resolve_cams(list(FIVE), "paper_table2")

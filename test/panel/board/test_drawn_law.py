"""A law as a linear function of its ordinates: it is the core's own, for any ordinates."""

from __future__ import annotations

import numpy as np
import pytest

from cam_rig.errors import ConfigError
from cam_rig.laws import build_law
from cam_rig.laws.continuity import joints
from cam_rig.panel.board.drawable import with_own_ordinates
from cam_rig.panel.board.drawn_law import ORDERS, DrawnLaw, table_angles
from cam_rig.schema import CamConfig, load_cam

from ...conftest import CAM_NAMES, CONFIG

#: Laws in s and its derivatives agree within this part of their largest value.
SAME = 1e-12
OWN = ["bezier15", "designed"]


def moved(drawn: DrawnLaw, by: float = 0.05) -> np.ndarray:
    """Every ordinate that may be moved somewhere else."""
    ordinates = drawn.ordinates.copy()
    free = [handle.index for handle in drawn.handles]
    ordinates[free] += by * np.random.default_rng(3).standard_normal(len(free))
    return ordinates


def from_table(drawn: DrawnLaw, ordinates: np.ndarray) -> np.ndarray:
    """``(4, n)`` as a page multiplies it."""
    table = drawn.table
    columns = table.first[:, None].astype(int) + np.arange(table.table.shape[2])
    return table.constant + np.einsum("okw,kw->ok", table.table, ordinates[columns])


@pytest.fixture(scope="module", params=CAM_NAMES)
def drawn(request: pytest.FixtureRequest) -> DrawnLaw:
    return DrawnLaw.of(load_cam(CONFIG / "cams" / f"{request.param}.yaml"))


def test_the_start_is_the_cams_law(drawn: DrawnLaw) -> None:
    """With its own ordinates the drawn law is the one that the core builds."""
    law = build_law(drawn.start.cam)
    found = drawn.law(drawn.ordinates, law.name)
    assert np.array_equal(found.breaks, law.breaks)
    assert np.abs(found.ordinates - law.ordinates).max() <= SAME * law.lift


def test_the_table_gives_the_law_at_any_ordinates(drawn: DrawnLaw) -> None:
    """s to s''' by the table are the core's; one ordinate off by 1e-6 shows."""
    ordinates = moved(drawn)
    law = drawn.law(ordinates, "moved")
    wanted = np.stack([law(table_angles(), order) for order in range(ORDERS)])
    largest = np.abs(wanted).max(axis=1, keepdims=True)
    assert (np.abs(from_table(drawn, ordinates) - wanted) / largest).max() <= SAME
    ordinates[drawn.handles[0].index] += 1e-6
    off = (np.abs(from_table(drawn, ordinates) - wanted) / largest).max(axis=1)
    assert (off > 1e3 * SAME).all()


def test_moved_ordinates_leave_dwells_and_joints_as_smooth_as_they_were(drawn: DrawnLaw) -> None:
    """What a page may move cannot tear the law, nor make its velocity jump."""
    before = {joint.angle: joint.continuity for joint in joints(drawn.start.law)}
    after = {j.angle: j.continuity for j in joints(drawn.law(moved(drawn), "moved"))}
    assert after.keys() == before.keys()
    assert all(after[angle] >= min(before[angle], 3) for angle in before)


def test_a_handle_is_where_its_ordinate_pulls(drawn: DrawnLaw) -> None:
    """Moving an ordinate moves the lift at its handle, the same way."""
    step = np.round(np.array([h.angle for h in drawn.handles]) / table_angles()[1]).astype(int)
    for handle, k in zip(drawn.handles, step % table_angles().size, strict=True):
        more = drawn.ordinates.copy()
        more[handle.index] += 1.0
        gained = from_table(drawn, more)[0] - from_table(drawn, drawn.ordinates)[0]
        assert gained[k] >= 0.5 * gained.max() > 0.0


@pytest.mark.parametrize("name", OWN)
def test_a_law_of_ordinates_has_its_own(name: str) -> None:
    """A Bézier or B-spline law is drawn as it is in its file, not another near it."""
    config = load_cam(CONFIG / "cams" / f"{name}.yaml")
    drawn = DrawnLaw.of(config)
    assert drawn.start.cam is config
    assert drawn.start.law_class is None
    assert drawn.start.distance == 0.0


def test_a_law_whose_ordinates_are_all_fixed_is_drawn_as_the_nearest() -> None:
    """Four ordinates at rest at each end of eight leave none to be moved."""
    config = load_cam(CONFIG / "cams" / "b_spline.yaml")
    own = with_own_ordinates(config)
    assert own is not None
    assert DrawnLaw(own).handles == []
    assert DrawnLaw.of(config).start.law_class is not None


@pytest.mark.parametrize(("name", "most"), [("poly4567", 1e-5), ("poly345", 1e-3), ("tm21", 2e-2)])
def test_any_other_law_is_drawn_as_the_nearest_of_a_class(name: str, most: float) -> None:
    """How far it is from the file's law is what the page says, in lifts here."""
    config = load_cam(CONFIG / "cams" / f"{name}.yaml")
    start = DrawnLaw.of(config).start
    law, angles = build_law(config), np.linspace(0.0, 2.0 * np.pi, 1000)
    distance = np.abs(start.law(angles) - law(angles)).max()
    assert start.distance == pytest.approx(distance, rel=0.05)
    assert 0.0 < start.distance < most * law.lift


def test_a_cam_that_rests_all_around_is_refused() -> None:
    """There is nothing to draw."""
    data = load_cam(CONFIG / "cams" / "poly345.yaml").model_dump(exclude_none=True)
    span = {"assumed": 360.0, "unit": "deg", "source": "all"}
    data |= {"segments": [{"law": "dwell", "span": span}]}
    with pytest.raises(ConfigError, match="rests all around"):
        DrawnLaw.of(CamConfig.model_validate(data))

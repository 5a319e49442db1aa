"""For tests of packages that use the rig: a pytest fixture that starts one and leaves nothing.

pytest finds it by itself where cam_rig is installed; ``pytest_plugins = ["cam_rig.testing"]`` does
no harm. Nothing heavy is imported before a rig is started.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from cam_rig.extras import libraries_named

if TYPE_CHECKING:
    from cam_rig.testing.running_rig import RunningRig

__all__ = ["start_rig"]


@pytest.fixture
def start_rig(tmp_path: Path) -> Iterator[Callable[..., RunningRig]]:
    """Start a rig: ``start_rig(scene="quick", bag=None, **drive)``; see `RunningRig`.

    Each rig has a ROS domain of its own and records into ``tmp_path``. All end with the test, which
    fails where a node ended before its time; what the nodes logged stands in the test's report.

    Examples
    --------
    >>> def test_the_sweep_is_heard(start_rig):
    ...     rig = start_rig("quick")
    ...     rig.wait_until_done()
    ...     assert rig.read_bag().complete
    """
    numbers = count(1)
    with ExitStack() as rigs:

        def start(
            scene: str | Path = "quick", bag: str | Path | None = None, **drive: Any
        ) -> RunningRig:
            with libraries_named():
                from cam_rig.testing.running_rig import RunningRig
            place = Path(bag or tmp_path / f"bag_{next(numbers)}")
            return rigs.enter_context(RunningRig(scene, place, **drive))

        yield start
